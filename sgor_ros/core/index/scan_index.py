"""The index of one scan, to judge poses of another: where its keypoints are, how far it saw."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.products import times_transposed
from ..features.features import Features
from ..scan.scan import ORIGIN
from .birds_eye_view import birds_eye_view
from .birds_eye_view import BirdsEyeView
from .columns import Columns
from .columns import in_columns


@dataclass(frozen=True, eq=False)
class ScanIndex:
    """What one scan can say about points of another.

    Attributes
    ----------
    points, normals : (V, 3) float64
        Keypoints, metres, and their unit normals.
    labels : (V,) uint8
        Their regional labels.
    max_distance : float
        Maximum correspondence distance: the farthest partner of a point that counts, metres.
    columns : Columns
        The keypoints in columns, with
    column_normals, column_labels : (V, 3) float64, (V,) uint8
        Normals and labels in their order.
    ranges : (360, 180) float32
        Shortest range measured in each direction or next to it, metres; infinite where nothing
        was.
    origin : (3,) float64
        Place of the sensor, metres.
    axes : (3, 3) float64
        Two axes of the ground plane and the direction up, as rows.
    level : bool
        Whether a ground plane says what is up; without, it is the sensor's z axis.
    birds_eye_view : BirdsEyeView
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    labels: NDArray[np.uint8]
    max_distance: float
    columns: Columns
    column_normals: NDArray[np.float64]
    column_labels: NDArray[np.uint8]
    ranges: NDArray[np.float32]
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    level: bool
    birds_eye_view: BirdsEyeView


def scan_index(ranges: NDArray[np.float32], features: Features, normals: NDArray[np.float64],
               up: NDArray[np.float64] | None, max_distance: float,
               origin: NDArray[np.float64] = ORIGIN) -> ScanIndex:
    """Index one scan.

    Parameters
    ----------
    ranges : (360, 180) float32
        The `range_image` of the scan.
    features : Features
        Its keypoints.
    normals : (V, 3) float64
        Their unit normals.
    up : (3,) float64 or None
        Unit normal of the ground; None without a ground plane.
    max_distance : float
        Maximum correspondence distance, metres.
    origin : (3,) float64
        Place of the sensor, metres.
    """
    columns = in_columns(features.points, max_distance)
    axes = np.eye(3) if up is None else np.vstack((np.linalg.svd(up[None])[2][1:], up))
    return ScanIndex(
        features.points, normals, features.regional, max_distance, columns,
        normals[columns.order], features.regional[columns.order], ranges, origin, axes,
        up is not None,
        birds_eye_view(times_transposed(features.points, axes), times_transposed(normals, axes),
                       features.regional, max_distance))
