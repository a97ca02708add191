"""What a protocol is: pairs with the truth, thresholds, and a front end."""
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from ...core.config import SgorConfig
from ..metrics.registration import EASY
from ..metrics.registration import HARD
from ..metrics.registration import MEDIUM
from ..metrics.registration import Threshold
from ..pairs.pair import Pair

INLIER_M = 0.6
KITTI = (EASY, MEDIUM, HARD)


@dataclass(frozen=True, eq=False)
class Protocol:
    """What is run.

    Attributes
    ----------
    name : str
    pairs : sequence of Pair
    thresholds : tuple of Threshold
        The first is that of RR, RE and TE; RE and TE are means over what it counts as right.
    inlier_m : float
        A match is right below this distance.
    front_end : SgorConfig
        Makes the matches that all methods share.
    missing : int
        Pairs of the list whose scans are not there.
    turn_seed : int or None
        Sources are turned by random rotations that follow from it, so that no method profits from
        a guess; None: as they are.
    """

    name: str
    pairs: Sequence[Pair]
    thresholds: tuple[Threshold, ...]
    inlier_m: float
    front_end: SgorConfig
    missing: int = 0
    turn_seed: int | None = None

    @classmethod
    def turned(cls, pairs: Sequence[Pair], seed: int) -> Self:
        """Return outdoor pairs as raw scans, the sources turned."""
        return cls('turned', pairs, (EASY,), INLIER_M, SgorConfig(), turn_seed=seed)
