"""The methods that are compared: SGOR, others of the literature, and odometries.

Each takes `Matches`, the same for all, or `Scans`, and returns an `Estimate`; what is installed is
found by `rivals_on_matches` and `rivals_on_scans`. Thresholds of methods on matches are those of
the papers (spectral matching: PointDSC's script) as multiples of the inlier threshold.
"""
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
import sys
from typing import Any
import warnings

from ...core.common.settings import InputError
from ..pairs.pair import Matches as Matches
from .method import Estimate as Estimate
from .method import Method as Method

ON_MATCHES = (('SC2-PCR', '', 'sc2_pcr.sc2_pcr'), ('MAC', 'igraph', 'mac.mac'),
              ('SM', '', 'spectral_matching.spectral_matching'),
              ('RANSAC', 'open3d', 'open3d_methods.ransac'),
              ('FGR', 'open3d', 'open3d_methods.fast_global'),
              ("KISS-Matcher's solver", 'kiss_matcher', 'kiss_matcher_methods.solver'))
"""Name in tables, the package that it needs, module and function."""

ON_SCANS = (('kiss-matcher-0.3', 'KISS-Matcher', 'kiss_matcher', 'kiss_matcher_methods.on_scans',
             0.3, True),
            ('kiss-matcher-0.5', 'KISS-Matcher', 'kiss_matcher', 'kiss_matcher_methods.on_scans',
             0.5, True),
            ('ransac', 'Open3D RANSAC', 'open3d', 'open3d_methods.ransac_on_scans', 0.5, False),
            ('fgr', 'Open3D FGR', 'open3d', 'open3d_methods.fast_global_on_scans', 0.5, False))
"""Name of the option, name in tables, package, function, voxel size [m], whether it refuses."""


def rivals_on_matches(say: Callable[[str], None]) -> dict[str, Method]:
    """Return the other methods on matches that are installed, by name; say what is left out."""
    found = {}
    for name, package, function in ON_MATCHES:
        if not package or find_spec(package) is not None:
            found[name] = Method(name, _function(function))
        else:
            say(f'{name} is left out: pip install {package}')
    return found


def rivals_on_scans(say: Callable[[str], None]) -> dict[str, Method]:
    """Return the other methods on raw scans that are installed, by option; they see no labels."""
    found = {}
    absent = set()
    for option, name, package, function, voxel_m, refuses in ON_SCANS:
        if find_spec(package) is not None:
            found[option] = Method(f'{name}, voxel {voxel_m:g}',
                                   partial(_function(function), voxel_m=voxel_m), 'scans',
                                   refuses=refuses)
        else:
            absent.add(package)
    for package in sorted(absent):
        say(f'{package} is not installed, so left out; to have it: pip install {package}')
    return found


def imported(name: str) -> Method:
    """Return a method from a file of the user's, ``MODULE:FUNCTION``.

    The function takes matches; in its place may be a `Method`, of raw scans too.

    Raises
    ------
    InputError
        There is none of that name.
    """
    module, _, function = name.partition(':')
    sys.path.insert(0, '')
    try:
        found = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f'--method {name}: expected MODULE:FUNCTION: {error}') from error
    return found if isinstance(found, Method) else Method(name, found)


def _function(path: str) -> Any:
    """Import a function only now: its module imports its package."""
    module, _, name = path.partition('.')
    return getattr(import_module(f'.{module}', __name__), name)


def __getattr__(name: str) -> Any:
    if name == 'Solution':
        warnings.warn('sgor_ros.evaluation.methods.Solution is now Estimate', DeprecationWarning,
                      stacklevel=2)
        return Estimate
    raise AttributeError(f'module {__name__} has no attribute {name}')
