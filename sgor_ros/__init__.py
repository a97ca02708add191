"""SGOR: global registration of labelled LiDAR scans, and the odometry built on it."""
from importlib import import_module
from typing import Any
from typing import TYPE_CHECKING

from .cache import choose_cache_folder

if TYPE_CHECKING:
    from .api import *  # noqa: F403
    __version__: str

choose_cache_folder()


def __getattr__(name: str) -> Any:
    """Load the interface when something of it is asked for.

    Every module of this package runs this file first, and compiled code takes a second to load:
    the node must know what to do about a signal before that.
    """
    if name == '__version__':
        metadata = import_module('importlib.metadata')
        try:
            return metadata.version(__name__)
        except metadata.PackageNotFoundError:    # a checkout that nobody installed
            return '0+unknown'
    if name == '__all__' or not name.startswith('_'):
        api = import_module('.api', __name__)
        if name in ('__all__', *api.__all__):
            return getattr(api, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
