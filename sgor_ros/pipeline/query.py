"""A scan to be found in a map, and the answer in the frames that are published."""
from dataclasses import dataclass
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.scan.scan import SemanticScan
from ..mapping import Located
from ..mapping import Map
from ..mapping import Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Query:
    """A scan with what is known of it.

    Attributes
    ----------
    scan : SemanticScan
    stamp_ns : int
    child_frame : str
        Whose pose is wanted: base or sensor.
    T_map_mapper : (4, 4) float64
        Where the frame of the mapper lies in the map that is published.
    T_base_sensor : (4, 4) float64
        The identity where the pose of the sensor is wanted.
    """

    scan: SemanticScan
    stamp_ns: int
    child_frame: str
    T_map_mapper: Array
    T_base_sensor: Array

    def locate(self, known: Map) -> Located:
        """Return where it is in a map of the mapper; poses are of the child in the map."""
        found = known.locate(self.scan)
        others = tuple(self._placed(place) for place in found.alternatives)
        if found.T_map_sensor is None or found.keyframe is None:
            return found
        here = self._placed(Place(found.T_map_sensor, found.covariance, found.confidence,
                                  found.keyframe))
        return replace(found, T_map_sensor=here.T_map_sensor, covariance=here.covariance,
                       alternatives=others)

    def _placed(self, place: Place) -> Place:
        """Return a place with the pose of the child and its covariance, in the map."""
        T_sensor_base = se3.inverse(self.T_base_sensor)
        T_map_sensor = self.T_map_mapper @ place.T_map_sensor
        J = se3.carried(T_map_sensor[:3, :3] @ T_sensor_base[:3, 3]) @ se3.turned(
            self.T_map_mapper[:3, :3])
        return replace(
            place, T_map_sensor=T_map_sensor @ T_sensor_base,
            covariance=None if place.covariance is None else J @ place.covariance @ J.T)
