"""Clouds of other libraries as arrays: structured arrays of ROS, Open3D, tensors, (N, 4)."""
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..common.checks import as_numbers
from ..common.checks import as_points
from ..common.settings import InputError

# in this order: the usual name, Autoware's, two of other nodes, CARLA's ros-bridge and CARLA's own
LABEL_FIELDS = ('label', 'class_id', 'semantic_id', 'semantic_label', 'ObjTag', 'object_tag')


def points_and_labels(cloud: Any) -> tuple[NDArray[Any], ArrayLike | None]:
    """Return (N, 3) points of a cloud, and its labels where it has a field of them.

    Parameters
    ----------
    cloud : array, structured array, tensor or Open3D cloud
        (N, 3), or (N, 4) whose last column is left out (intensity); fields x, y, z and perhaps
        one of `LABEL_FIELDS`, as `sensor_msgs_py.point_cloud2.read_points` returns them.

    Raises
    ------
    InputError
        It is none of these.
    """
    array = _array(cloud)
    if array.dtype.names is not None:
        return _of_fields(array)
    # (4, 4) is a transformation in the wrong place
    if array.ndim == 2 and array.shape[1] == 4 and len(array) != 4:
        array = array[:, :3]
    return as_points(array, 'points', None), None


def _array(cloud: Any) -> NDArray[Any]:
    """Return what holds the coordinates, as numpy has it."""
    if hasattr(cloud, 'point') and 'positions' in cloud.point:    # open3d.t
        cloud = cloud.point['positions']
    elif hasattr(cloud, 'points'):
        cloud = cloud.points
    for way in ('detach', 'cpu', 'numpy'):    # of a tensor, which may lie on a graphics card
        if not isinstance(cloud, np.ndarray) and callable(getattr(cloud, way, None)):
            cloud = getattr(cloud, way)()
    if isinstance(cloud, np.ndarray) and cloud.dtype.names is not None:
        return cloud
    return as_numbers(cloud, 'points')


def _of_fields(array: NDArray[Any]) -> tuple[NDArray[Any], ArrayLike | None]:
    assert array.dtype.names is not None
    there = array.dtype.names
    if missing := [axis for axis in 'xyz' if axis not in there]:
        raise InputError(f'points: no field {missing[0]}; there are {", ".join(there)}')
    flat = array.reshape(-1)    # an organized cloud has rows and columns
    columns = [as_numbers(flat[axis], f'points: field {axis}') for axis in 'xyz']
    labels = next((flat[name] for name in LABEL_FIELDS if name in there), None)
    return as_points(np.column_stack(columns), 'points', None), labels
