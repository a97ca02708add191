"""Methods: each answers a pair of raw scans, or matches that all methods share.

A new one: a file beside these with a function that takes `ScanPair` or `Matches` and returns an
`Answer`, and a line in `ON_SCANS` or `ON_MATCHES`. All thresholds are those of the papers
(spectral: PointDSC's script of that baseline) as multiples of the inlier threshold.
"""
from collections.abc import Callable
from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any
import warnings

from .interface import Answer as Answer
from .interface import Matches as Matches
from .interface import Method as Method
from .interface import ScanPair as ScanPair
from .kiss_matcher import kiss_matcher
from .kiss_matcher import kiss_matcher_on_matches
from .mac import mac
from .open3d import fast_global
from .open3d import fast_global_on_matches
from .open3d import ransac
from .open3d import ransac_on_matches
from .sc2_pcr import sc2_pcr
from .sgor import sgor as sgor
from .sgor import sgor_on_matches as sgor_on_matches
from .sgor import sgor_solver as sgor_solver
from .spectral import spectral_matching

ON_SCANS: dict[str, Method] = {
    **{f'kiss-matcher-{voxel_m}': Method(
        f'KISS-Matcher, voxel {voxel_m}', partial(kiss_matcher, voxel_m=voxel_m),
        package='kiss_matcher') for voxel_m in (0.3, 0.5)},
    'ransac': Method('Open3D RANSAC, voxel 0.5', partial(ransac, voxel_m=0.5), refuses=False,
                     package='open3d'),
    'fgr': Method('Open3D FGR, voxel 0.5', partial(fast_global, voxel_m=0.5), refuses=False,
                  package='open3d')}
"""Other methods on raw scans, which see no labels, by the names to ask for them."""

ON_MATCHES: dict[str, Method] = {method.name: method for method in (
    Method('SC2-PCR', on_matches=sc2_pcr),
    Method('MAC', on_matches=mac, package='igraph'),
    Method('SM', on_matches=spectral_matching),
    Method('RANSAC', on_matches=ransac_on_matches, package='open3d'),
    Method('FGR', on_matches=fast_global_on_matches, package='open3d'),
    Method("KISS-Matcher's solver", on_matches=kiss_matcher_on_matches, package='kiss_matcher'))}
"""Other methods on given matches."""


def available(methods: Mapping[str, Method], say: Callable[[str], None]) -> dict[str, Method]:
    """Return the methods whose packages are installed, and say which are not."""
    missing = [package for package in dict.fromkeys(m.package for m in methods.values())
               if package and not installed(package, say)]
    return {name: method for name, method in methods.items() if method.package not in missing}


def installed(package: str, say: Callable[[str], None]) -> bool:
    """Tell whether a package is there, and say so if it is not."""
    if find_spec(package) is not None:
        return True
    say(f'{package} is not installed, so left out; to have it: pip install {package}')
    return False


def __getattr__(name: str) -> Any:
    if name == 'Solution':
        warnings.warn('sgor_ros.evaluation.methods.Solution is Answer now', DeprecationWarning,
                      stacklevel=2)
        return Answer
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
