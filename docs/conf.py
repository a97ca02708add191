"""The site: Markdown pages beside this file, numpydoc docstrings, and settings from the code.

python -m sphinx -W docs out/site
"""
from importlib import import_module
from pathlib import Path
import sys

from docutils import nodes
from numpydoc.xref import DEFAULT_LINKS
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sgor_ros import api
from sgor_ros.core.common.settings import Setting
from sgor_ros.core.common.settings import Settings

project = 'sgor_ros'
copyright = 'sgor_ros maintainers, Apache-2.0'
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'numpydoc']
html_theme = 'furo'
html_title = 'sgor_ros'
html_show_sphinx = False
# deep enough for all links to headings, which are written as GitHub makes their anchors
myst_heading_anchors = 4
# types in them are links, to classes of this package; whether they are is seen without the network
numpydoc_xref_param_type = True
DEFAULT_LINKS.clear()    # those lead to the sites of Python and numpy
numpydoc_xref_ignore = 'all'
numpydoc_xref_aliases = {name: f'sgor_ros.{name}' for name in api.__all__}
# numpydoc sections have the types, with shapes and units, which annotations can't
autodoc_typehints = 'none'
autodoc_member_order = 'bysource'
# attributes are in the docstrings already
numpydoc_show_class_members = False


class SettingsOf(SphinxDirective):
    """All settings of a configuration class, or those that its own body adds: `settings-of`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write an entry for each."""
        module, _, name = self.arguments[0].rpartition('.')
        config: type[Settings] = getattr(import_module(module), name)
        inherited = {item.name for base in config.__bases__ if base is not Settings
                     for item in base.settings()}
        lines = [line for item in config.settings() if item.name not in inherited
                 for line in described(item)]
        return self.parse_text_to_nodes('\n'.join(lines))


def described(item: Setting) -> list[str]:
    """Return the lines of one setting."""
    bounds = [f'{word} {value:.6g}' for word, value in (('from', item.minimum),
                                                        ('to', item.maximum))
              if value is not None]
    default = f"'{item.default}'" if isinstance(item.default, str) else repr(item.default)
    return [f'```{{confval}} {item.name}', f':type: {item.kind.__name__}',
            f':default: `{default}`', '', '; '.join([item.description, ' '.join(bounds)]
                                                    if bounds else [item.description]),
            '```', '']


def setup(app: Sphinx) -> None:
    """Add the directive."""
    app.add_directive('settings-of', SettingsOf)
