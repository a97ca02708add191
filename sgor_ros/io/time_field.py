"""When each point of a cloud was taken: drivers have many names and units for it."""
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from .label_field import chosen_field

TIME_FIELDS = ('t', 'time', 'timestamp', 'time_stamp', 'offset_time')
"""In this order: Ouster; Velodyne; Hesai, RoboSense and Livox; others; Livox's own message."""
NUMBERS = (5, 6, 7, 8)
"""Datatypes of sensor_msgs/msg/PointField that have room for times."""
UNITS = (1.0, 1e-3, 1e-6, 1e-9)
SHORTEST_S, LONGEST_S = 0.002, 2.0
"""A sweep takes so long: by that the unit is known, for from one to the next it is as many times.
"""
OF_ONE_CLOCK_S = 1.0
"""Times farther from the stamp are of another clock."""


def time_field_of(message: Any, wanted: str) -> str:
    """Return the field to read times from; empty: from none.

    Parameters
    ----------
    message : sensor_msgs/msg/PointCloud2
    wanted : str
        What the user says: a name; ``'auto'`` for the first of `TIME_FIELDS` that the cloud has;
        ``'none'`` or empty for none.
    """
    return chosen_field(wanted, TIME_FIELDS, [
        field.name for field in message.fields
        if field.datatype in NUMBERS and field.count == 1])


def seconds_since(stamp_ns: int, times: NDArray[Any], name: str) -> NDArray[np.float64] | None:
    """Return (N,) times of points as seconds since the stamp of their cloud.

    They may be since the stamp, since the first point or since 1970, in seconds or thousandths,
    millionths or billionths of them.

    Parameters
    ----------
    stamp_ns : int
        Nanoseconds.
    times : (N,) array
        As the field has them.
    name : str
        Of the field.

    Returns
    -------
    (N,) float64 or None
        None where all points have the same time: that of a sensor that sees all at once, or of a
        driver that does not know.

    Raises
    ------
    InputError
        Naming the field: no sweep takes that long, in no unit.
    """
    finite = np.isfinite(times) if times.dtype.kind == 'f' else np.ones(len(times), np.bool_)
    if not finite.any():
        raise InputError(f'field {name}: no time is finite')
    first, last = times[finite].min(), times[finite].max()
    if first == last:
        return None
    span = float(last) - float(first) if times.dtype.kind == 'f' else float(int(last) - int(first))
    unit = next((unit for unit in UNITS if SHORTEST_S <= span * unit < LONGEST_S), None)
    if unit is None:
        raise InputError(f'field {name}: from {first} to {last}, no sweep takes that long in '
                         's, ms, us or ns; time_field none leaves it alone')
    # large numbers are subtracted before they are rounded
    since_first = np.where(finite, times - first, 0).astype(np.float64) * unit
    begin = float(first) * unit
    if abs(begin) > LONGEST_S:    # since 1970, or since the sensor was switched on
        begin -= stamp_ns * 1e-9
        if unit == 1e-9 and times.dtype.kind != 'f':
            begin = (int(first) - stamp_ns) * 1e-9
        if abs(begin) > OF_ONE_CLOCK_S:
            begin = 0.0
    return since_first + begin
