"""PointCloud2 to `SemanticScan` and back, for messages of rclpy and of rosbags alike."""
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..core.common.checks import as_labels
from ..core.common.checks import as_points
from ..core.common.settings import InputError
from ..core.scan.scan import SemanticScan
from .header_stamp import stamp_ns_of
from .label_field import field_names
from .time_field import seconds_since

# the datatypes of sensor_msgs/msg/PointField
FORMATS = {1: 'i1', 2: 'u1', 3: 'i2', 4: 'u2', 5: 'i4', 6: 'u4', 7: 'f4', 8: 'f8'}
UINT32, FLOAT32 = 6, 7
FLOATS = ('f4', 'f8')

# how far from a whole number a label may be that came as a float
LABEL_ROUNDING = 1e-3
# ids have 32 bits
LARGEST_LABEL = 2.0**32


def decode(message: Any, label_field: str, time_field: str = '', *, guessed: bool = False
           ) -> SemanticScan:
    """Read the points and labels of a cloud.

    Parameters
    ----------
    message : sensor_msgs/msg/PointCloud2
        Of rclpy or of rosbags: only the names of its fields matter.
    label_field : str
        Field with the class ids, of any integer or float type; empty for a scan without labels
        (see `label_field_of`).
    time_field : str
        Field with the time of each point; empty for none (see `time_field_of`).
    guessed : bool
        Whether nobody has named that field: what are no times is left alone then.

    Raises
    ------
    InputError
        A field is missing or unusable, the data is shorter than the cloud, no point is finite.
    """
    for name, what in ((label_field, 'class ids'), (time_field, 'times')):
        if name in ('x', 'y', 'z'):
            raise InputError(f'field {name}: it holds coordinates, not {what}')
    names = tuple(dict.fromkeys(('x', 'y', 'z', *filter(None, (label_field, time_field)))))
    records = _records(message, names)
    points = np.empty((len(records), 3), np.float32)
    for axis, name in enumerate('xyz'):
        points[:, axis] = records[name]
    labels = whole_numbers(records[label_field], points,
                           f'field {label_field}') if label_field else None
    return SemanticScan(points, labels, times=(
        _times(message, records[time_field], time_field, guessed) if time_field else None))


def _times(message: Any, values: NDArray[Any], name: str, guessed: bool
           ) -> NDArray[np.float64] | None:
    try:
        return seconds_since(stamp_ns_of(message.header), values, name)
    except InputError:
        if guessed:
            return None
        raise


def _records(message: Any, names: tuple[str, ...]) -> NDArray[Any]:
    """View the bytes of the cloud as (N,) records of the fields `names`; organised or not."""
    width, height, point_step = message.width, message.height, message.point_step
    if width * height == 0:
        raise InputError(f'width x height = {width} x {height}: the cloud is empty')
    formats, offsets = zip(*(_format(message, name) for name in names), strict=True)
    for name, code, offset in zip(names, formats, offsets, strict=True):
        if offset + np.dtype(code).itemsize > point_step:
            raise InputError(f'field {name}: offset {offset} and type {code[1:]} reach beyond '
                             f'point_step = {point_step}')
    # some drivers leave row_step at 0 where there is but one row
    row_step = message.row_step if height > 1 else width * point_step
    if row_step < width * point_step:
        raise InputError(f'row_step = {row_step}: less than {width} points of {point_step} bytes')
    needed = (height - 1) * row_step + width * point_step
    data = memoryview(message.data)
    if data.nbytes < needed:
        raise InputError(f'data: {data.nbytes} bytes, but {width} x {height} points of '
                         f'{point_step} bytes need {needed}')
    record = np.dtype({'names': names, 'formats': formats, 'offsets': offsets,
                       'itemsize': point_step})
    return np.ndarray((height, width), record, data, strides=(row_step, point_step)).reshape(-1)


def _format(message: Any, name: str) -> tuple[str, int]:
    """Return the numpy format and the offset of a field."""
    found = [f for f in message.fields if f.name == name]
    if len(found) != 1:
        raise InputError(f'field {name}: the cloud has {len(found) or "none"}; its fields are '
                         f'{", ".join(field_names(message)) or "none at all"}')
    field = found[0]
    code = FORMATS.get(field.datatype)
    if code is None or (name in ('x', 'y', 'z') and code not in FLOATS):
        raise InputError(f'field {name}: unsupported datatype {field.datatype}'
                         f'{f" ({code})" if code else ""}')
    if field.count != 1:
        raise InputError(f'field {name}: count = {field.count}, expected 1')
    return ('>' if message.is_bigendian else '<') + code, field.offset


def whole_numbers(labels: NDArray[Any], points: NDArray[Any], name: str) -> NDArray[np.int64]:
    """Return (N,) labels as integers; floats must be whole where the point is finite.

    Raises
    ------
    InputError
        Naming `name`, the label and the point.
    """
    if labels.dtype.kind != 'f':
        return labels.astype(np.int64)
    labels = np.where(np.isfinite(points).all(axis=1), labels, 0)
    with np.errstate(invalid='ignore'):    # infinity less infinity
        whole = (np.abs(labels - np.rint(labels)) < LABEL_ROUNDING) & (abs(labels) < LARGEST_LABEL)
    bad = np.flatnonzero(~whole)
    if bad.size:
        raise InputError(f'{name}: {labels[bad[0]]} at point {bad[0]} is not a whole '
                         'number, so not a class id')
    return np.rint(labels).astype(np.int64)


@dataclass(frozen=True, eq=False)
class CloudBytes:
    """What a PointCloud2 of one row is built from.

    Attributes
    ----------
    fields : tuple of (str, int, int)
        Name, offset in bytes and PointField datatype of each field; the count is 1.
    point_step : int
        Bytes a point.
    width : int
        Number of points.
    data : (width * point_step,) uint8
        Little-endian.
    """

    fields: tuple[tuple[str, int, int], ...]
    point_step: int
    width: int
    data: NDArray[np.uint8]


def encode(points: ArrayLike, labels: ArrayLike | None = None) -> CloudBytes:
    """Pack (N, 3) points as float32 x y z and (N,) labels, where there are any, as uint32.

    Raises
    ------
    InputError
        Shapes or types that do not fit.
    """
    xyz = as_points(points, 'points', np.float32)
    fields = [('x', 0, FLOAT32), ('y', 4, FLOAT32), ('z', 8, FLOAT32)]
    columns = [xyz.astype('<f4').view('<u4')]
    if labels is not None:
        fields.append(('label', 12, UINT32))
        columns.append(as_labels(labels, len(xyz), 'labels').astype('<u4')[:, None])
    packed = np.ascontiguousarray(np.hstack(columns))
    return CloudBytes(tuple(fields), 4 * len(fields), len(xyz), packed.view(np.uint8).reshape(-1))
