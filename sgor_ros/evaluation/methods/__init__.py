"""Methods on the same matches: each takes `Matches` and returns a `Solution`.

`problem` has both; each method of the paper's tables has a file. All thresholds are those of the
papers (spectral: PointDSC's script of that baseline) as multiples of the inlier threshold.
"""
from collections.abc import Callable
from importlib.util import find_spec

from ...core.config import SgorConfig
from .mac import mac
from .packages import fast_global
from .packages import kiss_matcher_solver
from .packages import ransac
from .problem import Matches as Matches
from .problem import Method as Method
from .problem import Solution as Solution
from .sc2_pcr import sc2_pcr
from .sgor import sgor
from .spectral import spectral_matching

NEEDS: dict[Method, str] = {mac: 'igraph', ransac: 'open3d', fast_global: 'open3d',
                            kiss_matcher_solver: 'kiss_matcher'}
"""Packages that are not of ours."""


def table_methods(config: SgorConfig, say: Callable[[str], None]) -> dict[str, Method]:
    """Return the methods of the tables that are installed, by name; say what is left out."""
    found: dict[str, Method] = {
        'SGOR': sgor(config), 'SC2-PCR': sc2_pcr, 'MAC': mac, 'SM': spectral_matching,
        'RANSAC': ransac, 'FGR': fast_global, "KISS-Matcher's solver": kiss_matcher_solver}
    for name, method in list(found.items()):
        if method in NEEDS and find_spec(NEEDS[method]) is None:
            say(f'{name} is left out: pip install {NEEDS[method]}')
            del found[name]
    return found
