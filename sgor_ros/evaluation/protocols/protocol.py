"""What a protocol asks: pairs with their truth, thresholds, and a front end."""
from collections.abc import Sequence
from dataclasses import dataclass

from ...core.config import SgorConfig
from ..metrics.registration_recall import EASY
from ..metrics.registration_recall import HARD
from ..metrics.registration_recall import MEDIUM
from ..metrics.row import Threshold
from .pairs import Pair

INLIER_M = 0.6


@dataclass(frozen=True, eq=False)
class Protocol:
    """How a table comes about.

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
    """

    name: str
    pairs: Sequence[Pair]
    thresholds: tuple[Threshold, ...]
    inlier_m: float
    front_end: SgorConfig
    missing: int = 0


def outdoor(name: str, pairs: Sequence[Pair], missing: int = 0) -> Protocol:
    """Return a protocol with the thresholds, the inlier distance and the front end of KITTI's."""
    return Protocol(name, pairs, (EASY, MEDIUM, HARD), INLIER_M, SgorConfig.kitti_protocol(),
                    missing)
