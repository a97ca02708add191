"""What a method is, and what it answers."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from typing import Literal
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...core.verdict.result import Registration


class Estimate(NamedTuple):
    """What a method answers.

    Attributes
    ----------
    T_target_source : (4, 4) float64 or None
        None where it found nothing.
    kept : (K,) array of int or None
        Rows of the matches that it holds to be right; None: those that fit T to the threshold.
    accepted : bool
        Whether the method itself trusts it.
    score : float
        By what it judged: confidence, inliers or fitness.
    seconds : float or None
        From two raw scans on; None: as long as the call took.
    seconds_one_new : float
        With one of the scans prepared before; NaN where a method cannot do that.
    registration : Registration or None
        The whole result of SGOR; None for others.
    """

    T_target_source: NDArray[np.float64] | None
    kept: NDArray[np.intp] | None = None
    accepted: bool = True
    score: float = float('nan')
    seconds: float | None = None
    seconds_one_new: float = float('nan')
    registration: Registration | None = None


@dataclass(frozen=True, eq=False)
class Method:
    """A row of the tables. It can be sent to another process if `run` can.

    Attributes
    ----------
    name : str
    run : callable
        Takes `Scans` or `Matches`, returns an `Estimate`.
    takes : str
        Which of them.
    front_end : SgorConfig or None
        Makes its matches; None: those of the protocol, the same for all.
    refuses : bool
        Whether it can refuse an answer, so that pairs of different places mean something to it.
    """

    name: str
    run: Callable[[Any], Estimate]
    takes: Literal['scans', 'matches'] = 'matches'
    front_end: SgorConfig | None = None
    refuses: bool = True
