"""SGOR: global registration of labelled LiDAR scans, and the odometry built on it.

Two scans: `register`, `preprocess`, `register_correspondences`, `warm_up`; with the types
`SemanticScan`, `PreparedScan`, `SgorConfig`, `Registration`, `Status`, `Placement`, `InputError`.
For keyframes that are kept: `compact`, `CompactScan`.
Scan after scan: `Tracker`, `TrackerConfig`, `TrackedScan`, `State`.
With loops and a map: `Mapper`, `MapperConfig`, `MappedScan`, `Loop`, `Trajectory`.
Maps that stay: `Map`, `Located`, `Place`, `Merged`.
Data sets: `open_drive`, `open_drives`, `Drive`.

The five calls:

    prepared = preprocess(SemanticScan(points, labels))       # what depends on one scan alone
    result = register(source, target)                         # scans, prepared ones, or arrays
    if result.success: moved = result.transform(points)       # T_target_source, else result.reason
    tracked = Tracker().track(scan, stamp_ns)                 # scan after scan: T_odom_sensor
    for scan in open_drive(path): scan.read(), scan.stamp_ns  # folders and bags

Importing it loads and changes nothing; compiled code is loaded with the first of these names.
"""
from importlib import import_module
from types import ModuleType
from typing import Any
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .api import *  # noqa: F403
    from .io.datasets import Drive as Drive
    from .io.datasets import open_drive as open_drive
    from .io.datasets import open_drives as open_drives
    __version__: str

DATASETS = ('Drive', 'open_drive', 'open_drives')
"""What reads files, which the rest of the interface does not."""


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


def __dir__() -> list[str]:
    """Return the interface, of which help and completion ask, and the modules that are loaded."""
    own = (name for name, value in globals().items()
           if name.startswith('__') or isinstance(value, ModuleType))
    return sorted({*own, *__getattr__('__all__'), '__version__'})
