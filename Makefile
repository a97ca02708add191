# make demo, make test: both set everything up first. What a target does is in scripts/.
VENV := .venv
PY := $(VENV)/bin/python

.PHONY: demo test setup lint site clean

setup: $(VENV)/.ready

$(VENV)/.ready: setup.py setup.cfg package.xml scripts/setup.sh
	bash scripts/setup.sh $(VENV)
	touch $@

demo: setup
	$(PY) -m sgor_ros.commands.demo --out out/demo

lint: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy

site: setup
	$(PY) -m sphinx -q -W --keep-going docs out/site

test: lint
	$(PY) -m pytest

clean:
	rm -rf $(VENV) build install log out sgor_ros.egg-info .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
