# make demo, make test: both set everything up first. What a target does is in scripts/.
VENV := .venv
PY := $(VENV)/bin/python

.PHONY: demo test test-fast mutants setup lint site clean

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

# two files at a time, the tests of one in their order
test: lint
	$(PY) -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# for who changes a line: no real data, no processes, one or two places of each verdict
test-fast: setup
	$(VENV)/bin/ruff check .
	$(PY) -m pytest -q -m 'not slow'

# changes each line that decides on a verdict and tells what no test noticed; half an hour.
# Works in mutants/ and changes nothing else; goes on where it was stopped. One function, one
# file: make mutants ONLY='sgor_ros.core.verdict.decision*'
mutants: setup
	$(PY) -m mutmut run $(ONLY)
	$(PY) -m mutmut results

clean:
	rm -rf $(VENV) mutants build install log out sgor_ros.egg-info .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
