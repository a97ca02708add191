"""Sensors that are sold, by name.

Figures are meant to be those of the makers' data sheets and manuals:

- VLP-16: Velodyne, VLP-16 User Manual: 16 beams 2 deg apart, 0.2 deg at 10 Hz.
- HDL-32E: Velodyne, HDL-32E User's Manual, table of vertical angles; 0.05 to 100 m, 2 cm.
- HDL-64E: the defaults of `Lidar`, equally spaced beams.
- OS0, OS1, OS2: Ouster, data sheets of revision 6: uniform spacing over 90, 45 and 22.5 deg,
  1024 columns; OS1-64 is that of the first revision, over 33.2 deg.
- Pandar64: Hesai, Pandar64 User Manual, channel distribution: 1/6 deg apart near the horizon,
  up to 6 deg away from it.
- Pandar XT-32: Hesai, PandarXT User Manual: 1 deg apart.
- Avia: Livox, Avia User Manual: 70.4 x 77.2 deg, 240,000 points/s.
- Mid-360: Livox, Mid-360 User Manual: 360 x 59 deg, 200,000 points/s.

Where a sheet gives a range by reflectivity, it is that of a bright target (80 %), for Pandar64 and
Avia of a dark one (10 %). A sheet does not say which share of the returns is lost: it is that of
`Lidar`. Noise is one standard deviation at a middle range.

Looked up: elevations (HDL-32E and OS1-64 in the maker's own sheet, VLP-16, XT-32, Mid-360, OS0,
OS2 and Pandar64 in what others publish of them); ranges of HDL-32E, OS1-64 and Mid-360; noise of
OS1-64 and Mid-360; the 70.4 deg of Avia. Other figures are as commonly quoted, not looked up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .lidar import Lidar
from .livox import Rosette
from .livox import TurningMirror

_PANDAR64 = (
    14.882, 11.032, 8.059, 5.057, 3.04, 2.028, 1.86, 1.688, 1.522, 1.351, 1.184, 1.013, 0.846,
    0.675, 0.508, 0.337, 0.169, 0.0, -0.169, -0.337, -0.508, -0.675, -0.846, -1.013, -1.184,
    -1.351, -1.522, -1.688, -1.86, -2.028, -2.198, -2.365, -2.536, -2.7, -2.873, -3.04, -3.21,
    -3.375, -3.548, -3.712, -3.884, -4.05, -4.221, -4.385, -4.558, -4.72, -4.892, -5.057, -5.229,
    -5.391, -5.565, -5.726, -5.898, -6.061, -7.063, -8.059, -9.06, -9.885, -11.032, -12.006,
    -12.974, -13.93, -18.889, -24.897)
"""Elevations, deg."""


def _spinning(degrees: Sequence[float], columns: int, ranges: tuple[float, float],
              noise: float) -> Lidar:
    """Sensor of beam elevations (deg, from the top), least and greatest range and noise (m)."""
    up, *_, down = elevations = tuple(float(np.deg2rad(angle)) for angle in degrees)
    return Lidar(len(elevations), columns, up, down, ranges[1], noise, min_range=ranges[0],
                 elevations=elevations)


def _even(beams: int, up: float, down: float) -> tuple[float, ...]:
    return tuple(float(angle) for angle in np.linspace(up, down, beams))


_OS1_64 = _spinning(_even(64, 16.6, -16.6), 1024, (0.8, 120.0), 0.015)

SENSORS: dict[str, Lidar] = {
    'VLP-16': _spinning(_even(16, 15.0, -15.0), 1800, (0.5, 100.0), 0.03),
    'HDL-32E': _spinning(_even(32, 10.67, -30.67), 2160, (0.05, 100.0), 0.02),
    'HDL-64E': Lidar(),
    'OS0-128': _spinning(_even(128, 45.0, -45.0), 1024, (0.3, 50.0), 0.02),
    'OS1-64': _OS1_64,
    'OS1-128': _spinning(_even(128, 22.5, -22.5), 1024, (0.3, 120.0), 0.015),
    'OS2-128': _spinning(_even(128, 11.25, -11.25), 1024, (1.0, 210.0), 0.03),
    'Pandar64': _spinning(_PANDAR64, 1800, (0.3, 200.0), 0.02),
    'Pandar XT-32': _spinning(_even(32, 15.0, -16.0), 2000, (0.05, 120.0), 0.01),
    'Avia': Rosette(6, 4000, float(np.deg2rad(38.6)), float(np.deg2rad(-38.6)), 190.0, 0.02,
                    min_range=1.0, fov_horizontal=float(np.deg2rad(70.4))),
    'Mid-360': TurningMirror(4, 5000, float(np.deg2rad(52.0)), float(np.deg2rad(-7.0)), 70.0,
                             0.02, min_range=0.1),
    'OS1-64, 120 deg': replace(_OS1_64, fov_horizontal=float(np.deg2rad(120.0))),
    'OS1-64, 70 deg': replace(_OS1_64, fov_horizontal=float(np.deg2rad(70.0))),
}
"""All sensors by name."""
