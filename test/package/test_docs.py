"""What the docs tell a reader to copy works, and what they point at is there."""
from html.parser import HTMLParser
from pathlib import Path
import re
import subprocess
import sys
from urllib.parse import unquote
from urllib.parse import urlsplit

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from test_layers import CORE

from sgor_ros import api
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros.core.execution.compiling import TAKES
from sgor_ros.ros.parameters import NodeConfig
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
FILES = [path.relative_to(ROOT).as_posix()
         for folder in ('sgor_ros', 'test', 'scripts', 'examples')
         for path in (ROOT / folder).rglob('*.py')]


def code_of(page):
    """Return the only Python block of a page."""
    block, = re.findall(r'```python\n(.*?)```', (ROOT / page).read_text(), re.DOTALL)
    return block


def registered(kind, seed):
    place, rng = scenes.make(kind, seed), np.random.default_rng(seed)
    target, source = (SemanticScan(*Lidar().scan(place, T, rng))
                      for T in scenes.random_pair(place, rng, 4.0, 8.0))
    return register(source, target)


def anchors_of(page):
    """Return what a page can be linked to by, as GitHub makes it from headings."""
    text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
            for heading in re.findall(r'^#+ (.*)', text, re.MULTILINE)}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link, anchor in re.findall(r'\]\((?!http)([^)#]*)#?([^)]*)', page.read_text()):
        target = page.parent / link if link else page
        assert target.exists(), link
        assert not anchor or anchor in anchors_of(target), f'{link}#{anchor}'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_defaults_are_not_written_down_again(page):
    names = '|'.join(item.name for config in (SgorConfig, TrackerConfig, NodeConfig)
                     for item in config.settings())
    again = re.findall(rf'`({names})`,? \(\d[^)]*\)', page.read_text())
    assert not again, 'parameters.md has the default of each, out of the code'


def named_files(text):
    """Return the Python files that a text names, by the end of their paths."""
    return re.findall(r'`([\w/]+\.py)`', text)


def paths_of(name):
    return [path for path in FILES if path == name or path.endswith(f'/{name}')]


@pytest.mark.parametrize('page', [page for page in PAGES if page.name != 'lab_log.md'],
                         ids=lambda page: page.name)
def test_files_that_a_page_names_are_there(page):
    text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
    if page.name == 'finding.md':    # its last column is of before
        text = re.sub(r'\|[^|]*\|$', '', text, flags=re.MULTILINE)
    for name in named_files(text):
        # a reader's own
        assert paths_of(name) or name == 'mine.py', name


def test_words_of_the_glossary_live_where_it_says():
    text = (ROOT / 'docs/glossary.md').read_text().partition('## Old words')[0]
    rows = [row for row in re.findall(r'^\|.*\|$', text, re.MULTILINE) if '.py`' in row]
    assert len(rows) > 35
    for row in rows:
        for place in row.split('|')[3].split(';'):
            path, = paths_of('sgor_ros/' + named_files(place)[0])
            source = (ROOT / path).read_text()
            for name in re.findall(r'`(\w+)`', place):
                assert re.search(rf'\b{name}\b', source), f'{path}: {name}'


def test_the_picture_of_core_has_the_order_of_its_rooms():
    picture = re.search(r'## The rooms of core.*?```text\n(.*?)```',
                        (ROOT / 'docs/design.md').read_text(), re.DOTALL).group(1)
    lines = [line[:32].split() for line in picture.splitlines() if line[0] != ' ']
    assert [room for line in reversed(lines) for room in line] == list(CORE)


class Links(HTMLParser):
    """What a page of the site points at, and what in it can be pointed at."""

    def __init__(self, text):
        super().__init__()
        self.out, self.anchors = set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.anchors |= {attributes[name] for name in ('id', 'name') if attributes.get(name)}
        self.out |= {attributes[name] for name in ('href', 'src') if attributes.get(name)}


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """Build the site; any warning is an error."""
    out = tmp_path_factory.mktemp('site')
    done = subprocess.run(
        [sys.executable, '-m', 'sphinx', '-q', '-W', '--keep-going', '-d', str(out / 'trees'),
         str(ROOT / 'docs'), str(out / 'html')], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path: Links(path.read_text()) for path in (out / 'html').rglob('*.html')}


def test_links_of_the_site_lead_somewhere(site):
    followed = 0
    for page, links in site.items():
        for link in links.out:
            if urlsplit(link).scheme:
                continue
            path, anchor = unquote(urlsplit(link).path), unquote(urlsplit(link).fragment)
            target = (page.parent / path).resolve() if path else page
            assert target.exists(), f'{page.name}: {link}'
            if anchor and target in site:
                assert anchor in site[target].anchors, f'{page.name}: {link}'
            followed += 1
    assert followed > 500


def test_the_site_has_all_settings_and_all_of_the_interface(site):
    page = {path.stem: links.anchors for path, links in site.items()}
    for config in (SgorConfig, TrackerConfig, NodeConfig):
        for item in config.settings():
            assert f'confval-{item.name}' in page['parameters'], item.name
    public = set(api.__all__)
    assert {f'sgor_ros.{name}' for name in public} <= page['api']


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


def test_the_first_page_of_the_site(street):
    scope = {f'{side}_{what}': street[i][j] for i, side in ((0, 'target'), (3, 'source'))
             for j, what in enumerate(('points', 'labels'))}
    exec(code_of('docs/index.md'), scope)
    metres, degrees = errors(scope['result'].T_target_source,
                             relative(street[0][2], street[3][2]))
    assert metres < 0.1
    assert degrees < 0.3


def test_types_of_the_api_are_links(site):
    links, = (links for path, links in site.items() if path.name == 'api.html')
    assert {'#sgor_ros.SemanticScan', '#sgor_ros.SgorConfig', '#sgor_ros.PreparedScan',
            '#sgor_ros.Status', '#sgor_ros.Placement'} <= links.out


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


def test_compiling_takes_the_same_on_every_page():
    """Whoever waits for it has read one of them."""
    pages = {path.name: path.read_text() for path in PAGES}
    for name in ('README.md', 'start.md', 'api.md'):
        assert TAKES in pages[name]
    for name, text in pages.items():
        assert not re.search(r'compil\w+[^.|]{0,60}\b\d+ (seconds|minutes|min|s)\b', text), name
