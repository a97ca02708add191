"""What the docs tell a reader to copy works, and what they point at is there."""
from pathlib import Path
import re

from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]


def code_of(page):
    """Return the only Python block of a page."""
    block, = re.findall(r'```python\n(.*?)```', (ROOT / page).read_text(), re.DOTALL)
    return block


def registered(kind, seed):
    place, rng = scenes.make(kind, seed), np.random.default_rng(seed)
    target, source = (SemanticScan(*Lidar().scan(place, T, rng))
                      for T in scenes.random_pair(place, rng, 4.0, 8.0))
    return register(source, target)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    links = re.findall(r'\]\((?!http)([^)#]+)', page.read_text())
    assert not [link for link in links if not (page.parent / link).exists()]


def test_the_example_of_the_readme(street, capsys):
    (target, target_labels, T_target), (source, source_labels, T_source) = street[0], street[3]
    scope = {'target_points': target, 'target_labels': target_labels,
             'source_points': source, 'source_labels': source_labels}
    exec(code_of('README.md'), scope)
    metres, degrees = errors(scope['result'].T_target_source, relative(T_target, T_source))
    assert metres < 0.1
    assert degrees < 0.3
    scope['source_points'] = np.random.default_rng(0).uniform(-30, 30, source.shape)
    exec(code_of('README.md'), scope)
    assert 'not to be trusted' in capsys.readouterr().out


@pytest.mark.parametrize(('kind', 'seed'), [
    ('courtyard', 1), ('facade', 2), ('facade_cars_regular', 2)])
def test_each_placement_is_an_edge(kind, seed):
    scope = {}
    exec(code_of('docs/trust.md'), scope)
    result = registered(kind, seed)
    edges = scope['edges'](result)
    assert result.success == (kind == 'courtyard')
    assert len(edges) == 1 + len(result.alternatives)
    for _, information in edges:
        assert np.linalg.eigvalsh(information).min() > 0


def test_what_is_refused_is_no_edge(street):
    scope = {}
    exec(code_of('docs/trust.md'), scope)
    noise = np.random.default_rng(0).uniform(-30, 30, (20000, 3))
    assert scope['edges'](register(SemanticScan(noise), SemanticScan(street[0][0]))) == []
