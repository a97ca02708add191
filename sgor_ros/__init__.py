"""SGOR: global registration of labelled LiDAR scans, and the odometry built on it."""
from importlib import import_module
from typing import Any
from typing import TYPE_CHECKING

from .cache import choose_cache_folder

if TYPE_CHECKING:
    from .api import *  # noqa: F403
    from .io.datasets import Drive as Drive
    from .io.datasets import open_drive as open_drive
    from .io.datasets import open_drives as open_drives
    __version__: str

DATASETS = ('Drive', 'open_drive', 'open_drives')
"""What reads files, which the rest of the interface does not."""

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
        if name == '__all__':
            return [*api.__all__, *DATASETS]
        if name in api.__all__:
            return getattr(api, name)
        if name in DATASETS:
            return getattr(import_module('.io.datasets', __name__), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
