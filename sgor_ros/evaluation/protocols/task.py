"""What a protocol asks: pairs of scans with the truth, thresholds, and a front end."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...io.datasets import Frame
from ..methods import Matches


@dataclass(frozen=True, eq=False)
class Task:
    """One pair to register. It can be sent to another process.

    Attributes
    ----------
    name : str
        Its own within the protocol.
    group : str
        What it is counted under: a band of distance, a scene.
    source, target : Frame or None
    T_target_source : (4, 4) float64
        The truth.
    matches : Matches or None
        Where they come from a file, in place of scans.
    """

    name: str
    group: str
    source: Frame | None
    target: Frame | None
    T_target_source: NDArray[np.float64]
    matches: Matches | None = None


@dataclass(frozen=True)
class Threshold:
    """Within both an answer is right: degrees and metres."""

    name: str
    rotation_deg: float
    translation_m: float


EASY = Threshold('easy', 5.0, 0.6)
MEDIUM = Threshold('medium', 5.0, 0.3)
HARD = Threshold('hard', 2.0, 0.1)
LOOPS = Threshold('5 deg, 2 m', 5.0, 2.0)
INDOOR = Threshold('15 deg, 30 cm', 15.0, 0.3)


@dataclass(frozen=True, eq=False)
class Protocol:
    """How a table comes about.

    Attributes
    ----------
    name : str
    tasks : sequence of Task
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
    tasks: Sequence[Task]
    thresholds: tuple[Threshold, ...]
    inlier_m: float
    front_end: SgorConfig
    missing: int = 0
