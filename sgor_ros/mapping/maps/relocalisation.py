"""Where in a map that was there before the sensor is, as long as it is lost."""
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.checks import as_pose
from ...core.prepared_scan import PreparedScan
from ...core.verdict.result import Status
from ..edge import Edge
from ..odometry import Node
from .map import Map
from .result import Located

Array = NDArray[np.float64]


class Relocalisation:
    """Looks for nodes all over a map, near a hint first; knows which places fit the last of them.

    Parameters
    ----------
    known : Map

    Attributes
    ----------
    known : Map
    hint : (4, 4) float64 or None
        Where somebody believes the sensor to be.
    hint_is_new : bool
        Whether nothing has been looked for since it was given.
    """

    def __init__(self, known: Map) -> None:
        self.known = known
        self._node: Node | None = None    # that the next are of
        self._places: tuple[Array, ...] = ()
        self.forget_hint()

    def forget_hint(self) -> None:
        """Drop the hint."""
        self.hint: Array | None = None
        self.hint_is_new = False

    def give_hint(self, T_map_sensor: ArrayLike) -> None:
        """Take a hint, (4, 4), which may be wrong.

        Raises
        ------
        InputError
            It is no pose.
        """
        self.hint, self.hint_is_new = as_pose(T_map_sensor, 'T_map_sensor'), True

    def nearest_to_hint(self, nodes: list[int], T_map_sensor: Array) -> list[int]:
        """Return nodes with poses (N, 4, 4), nearest to the hint first; none without a hint."""
        if self.hint is None:
            return []
        distance = np.linalg.norm((T_map_sensor - self.hint)[:, :3, 3], axis=1)
        return [nodes[row] for row in np.argsort(distance)]

    def look_for(self, node: Node, prepared: PreparedScan) -> tuple[list[Edge], Located]:
        """Look for a node all over the map.

        Returns
        -------
        edges : list of Edge
            From keyframes of the map to the node; where several places fit, one for each.
        found : Located
        """
        self.hint_is_new = False
        found = self.known.locate(prepared, self.hint)
        if self.hint is not None and not found.success:
            found = self.known.locate(prepared)    # the hint may be wrong, and took its turns
        places = {found.keyframe, *(place.keyframe for place in found.alternatives)}
        self._node, self._places = node, ()
        if found.status is Status.AMBIGUOUS and found.T_map_sensor is not None:
            self._places = (found.T_map_sensor,
                            *(place.T_map_sensor for place in found.alternatives))
        return [replace(edge, source=node.id) for edge in found.edges
                if found.success or edge.target in places], found

    def hypotheses(self, track_id: int, T_odom_sensor: Array) -> tuple[Array, ...]:
        """Return T_map_sensor, (4, 4), of a scan at each of the places that fit the last node."""
        if self._node is None or self._node.track_id != track_id:
            return ()
        step = se3.inverse(self._node.T_odom_sensor) @ T_odom_sensor
        return tuple(T @ step for T in self._places)
