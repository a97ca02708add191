"""The scans that later ones can be registered to: few, spread out, of all tracks."""
from dataclasses import dataclass
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.config import prepares_alike
from ..core.config import SgorConfig
from ..core.prepared_scan import PreparedScan
from ..core.preprocessing import preprocess
from .covariance import PoseCovariance

NEWEST = 3
"""So many of the newest are always kept."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A scan with its pose, ready to be registered to.

    Attributes
    ----------
    id : int
        Its own among all keyframes of a tracker; stamps may come twice, or go back.
    prepared : PreparedScan
    stamp_ns : int
    track_id : int
        The track in whose frame the pose is.
    T_odom_sensor : (4, 4) float64
    covariance : PoseCovariance or None
    first_overlap : float or None
        Share of agreeing keypoints of the first scan that was registered to it.
    """

    id: int
    prepared: PreparedScan
    stamp_ns: int
    track_id: int
    T_odom_sensor: NDArray[np.float64]
    covariance: PoseCovariance | None
    first_overlap: float | None = None

    def ready(self, config: SgorConfig) -> 'Keyframe':
        """Return it prepared with these settings: they may have changed since."""
        if prepares_alike(self.prepared.config, config):
            return self
        scan = self.prepared.raw('the settings have changed')
        return replace(self, prepared=replace(
            preprocess(scan, config), frame_covariance=self.prepared.frame_covariance))

    def distance(self, other: 'Keyframe') -> float:
        """Return the metres to another; infinite where it is in another frame."""
        if self.track_id != other.track_id:
            return float('inf')
        return float(np.linalg.norm(self.T_odom_sensor[:3, 3] - other.T_odom_sensor[:3, 3]))


class Keyframes:
    """Those that are remembered, oldest first; memory is bounded by their number."""

    def __init__(self) -> None:
        self._kept: list[Keyframe] = []
        self._turn = 0

    def __len__(self) -> int:
        return len(self._kept)

    def add(self, keyframe: Keyframe, limit: int) -> None:
        """Remember one more; beyond the limit forget the one that leaves the smallest gap."""
        self._kept.append(keyframe)
        while len(self._kept) > limit:
            self._kept.remove(min(self._kept[:-NEWEST], key=self._gap))

    def _gap(self, keyframe: Keyframe) -> float:
        """Return the metres between its neighbours in time, by way of it; infinite at an end."""
        place = self._kept.index(keyframe)
        if place == 0:
            return float('inf')
        return (keyframe.distance(self._kept[place - 1])
                + keyframe.distance(self._kept[place + 1]))

    def keep(self, keyframe: Keyframe, limit: int) -> None:
        """Remember a keyframe, if it is not remembered yet."""
        if all(one.id != keyframe.id for one in self._kept):
            self.add(keyframe, limit)

    def renew(self, keyframe: Keyframe) -> None:
        """Put a keyframe in place of the one of its number, where that is remembered."""
        self._kept = [keyframe if one.id == keyframe.id else one for one in self._kept]

    def last(self, track_id: int) -> Keyframe | None:
        """Return the newest of a track."""
        return next((one for one in reversed(self._kept) if one.track_id == track_id), None)

    def in_turns(self, count: int, but: Keyframe, before_track: int | None = None
                 ) -> list[Keyframe]:
        """Return the next few to try, so that in the end each has had its turn.

        Parameters
        ----------
        count : int
        but : Keyframe
            The reference, which has been tried already.
        before_track : int, optional
            Only those of tracks with a lower number.
        """
        # the newest first: they are most likely near
        others = [one for one in reversed(self._kept) if one.id != but.id
                  and (before_track is None or one.track_id < before_track)]
        if not others:
            return []
        start = self._turn % len(others)
        chosen = (others[start:] + others[:start])[:count]
        self._turn += len(chosen)
        return chosen
