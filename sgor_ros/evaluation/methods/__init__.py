"""Methods on the same matches: each takes `Matches` and returns a `Solution`.

`problem` has both; each method of the paper's tables has a file. All thresholds are those of the
papers (spectral: PointDSC's script of that baseline) as multiples of the inlier threshold.
"""
from collections.abc import Callable
from importlib.util import find_spec

from .mac import mac
from .packages import fast_global
from .packages import kiss_matcher_solver
from .packages import ransac
from .problem import Matches as Matches
from .problem import Method as Method
from .problem import Solution as Solution
from .sc2_pcr import sc2_pcr
from .sgor import sgor as sgor
from .spectral import spectral_matching

RIVALS: dict[str, tuple[Method, str]] = {
    'SC2-PCR': (sc2_pcr, ''), 'MAC': (mac, 'igraph'), 'SM': (spectral_matching, ''),
    'RANSAC': (ransac, 'open3d'), 'FGR': (fast_global, 'open3d'),
    "KISS-Matcher's solver": (kiss_matcher_solver, 'kiss_matcher')}
"""Each with the package that it needs."""


def rivals(say: Callable[[str], None]) -> dict[str, Method]:
    """Return the rivals that are installed, by name, and say what is left out."""
    for name, (_, package) in RIVALS.items():
        if not _installed(package):
            say(f'{name} is left out: pip install {package}')
    return {name: method for name, (method, package) in RIVALS.items() if _installed(package)}


def _installed(package: str) -> bool:
    return not package or find_spec(package) is not None
