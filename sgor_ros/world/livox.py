"""LiDARs whose pattern does not repeat itself: every scan fills other gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .lidar import Lidar
from .lidar import spherical

Array = npt.NDArray[np.float64]

_GOLDEN = (1 + 5 ** 0.5) / 2    # the ratio of two rates that takes longest to come near a repeat
_ROUNDS = 1000.0    # a scan starts anywhere within so many


@dataclass(frozen=True)
class Rosette(Lidar):
    """Narrow LiDAR behind two prisms that turn against each other, like a Livox Avia.

    `beams` are the lines that fire together, one above the other, and `columns` the firings in a
    scan. The field of view is an ellipse within `fov_up`, `fov_down` and `fov_horizontal`. The
    pattern is modelled on the rosette of such a sensor and is not the maker's.

    Attributes
    ----------
    rounds : float
        Turns of the faster prism in a scan.
    line_spread : float
        Elevation between the highest and the lowest line, rad.
    """

    rounds: float = 12.0
    line_spread: float = float(np.deg2rad(4.5))

    def _pattern(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw the rays of a scan and the share of it that has passed at each."""
        share = np.arange(self.columns) / self.columns
        turn = 2 * np.pi * (_ROUNDS * rng.random() + self.rounds * share)
        beam = np.exp(1j * turn) + np.exp(-1j * turn / _GOLDEN)
        line = np.linspace(0.5, -0.5, self.beams)[:, None] * self.line_spread
        high = (self.fov_up - self.fov_down - self.line_spread) / 4
        middle = (self.fov_up + self.fov_down) / 2
        return (spherical(self.fov_horizontal / 4 * beam.real, middle + line + high * beam.imag),
                np.tile(share, self.beams))


@dataclass(frozen=True)
class TurningMirror(Lidar):
    """LiDAR that sees all around through a mirror that turns and nods, like a Livox Mid-360.

    `beams` are the lines that fire together, one above the other, and `columns` the firings in a
    scan. The pattern is modelled on such a sensor and is not the maker's.

    Attributes
    ----------
    rounds : float
        Turns of the mirror in a scan.
    """

    rounds: float = 20.0

    def _pattern(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw the rays of a scan and the share of it that has passed at each."""
        share = np.arange(self.columns) / self.columns
        turn = _ROUNDS * rng.random() + self.rounds * share
        nod = turn * _GOLDEN + np.linspace(0.0, 0.5, self.beams, endpoint=False)[:, None]
        # A triangle wave: all elevations as often.
        height = 2 * np.abs(nod % 1.0 - 0.5)
        elevation = self.fov_down + height * (self.fov_up - self.fov_down)
        return spherical(-2 * np.pi * turn, elevation), np.tile(share, self.beams)
