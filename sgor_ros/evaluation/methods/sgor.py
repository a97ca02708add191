"""SGOR itself, in any configuration."""
from functools import partial

from ...core.config import SgorConfig
from ...core.execution.stopwatch import Stopwatch
from ...core.execution.threads import cores
from ...core.solver.solution import solve
from .problem import Matches
from .problem import Method
from .problem import Solution


def sgor(config: SgorConfig) -> Method:
    """Return SGOR as a method of the tables; like the others it answers, trusted or not."""
    return partial(_sgor, config)


def _sgor(config: SgorConfig, matches: Matches) -> Solution:
    with cores(config.threads):
        found = solve(matches.correspondences, matches.ground_normals, None, config, Stopwatch())
    return Solution(found.T_target_source)
