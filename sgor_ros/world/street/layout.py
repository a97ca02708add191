"""Where the streets run and how high the ground is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from ..waves import draw_waves
from ..waves import wave_sum

Array = npt.NDArray[np.float64]

KERB_HEIGHT = 0.12  # m
_STEP = 0.25  # m, spacing of axis points
_FAR = 12.0  # m from a street's axis, where all is terrain
_FILLET = 1.2  # m, rounds the kerb where streets meet
_MARGIN = 55.0  # m, land around the loop
_SIDE_LENGTH = 75.0  # m


@dataclass(frozen=True)
class Street:
    """One street, given by its axis.

    Attributes
    ----------
    axis : (M, 2) array
        Points of the centre line, equally spaced, m.
    half_width : float
        From the centre line to the kerb, m.
    closed : bool
        Whether the last point is followed by the first.
    """

    axis: Array
    half_width: float
    closed: bool

    @property
    def length(self) -> float:
        """Length of the centre line, m."""
        return _STEP * len(self.axis)

    @cached_property
    def tree(self) -> cKDTree:
        """Search tree over the centre line."""
        return cKDTree(self.axis)

    @cached_property
    def heading(self) -> Array:
        """Direction of travel at each axis point, (M,), rad."""
        if self.closed:
            ahead = np.roll(self.axis, -1, axis=0) - np.roll(self.axis, 1, axis=0)
        else:
            ahead = np.gradient(self.axis, axis=0)
        return np.arctan2(ahead[:, 1], ahead[:, 0])

    def at(self, along: float, left: float) -> tuple[Array, float]:
        """Point beside the axis.

        Parameters
        ----------
        along : float
            Distance from the start of the street, m.
        left : float
            Distance to the left of the axis, m; negative to the right.

        Returns
        -------
        (2,) array, float
            The point, m, and the street's heading there, rad.
        """
        index = min(int(along / _STEP), len(self.axis) - 1)
        heading = float(self.heading[index])
        normal = np.array([-np.sin(heading), np.cos(heading)])
        return self.axis[index] + left * normal, heading


@dataclass(frozen=True)
class Layout:
    """Streets and relief of a place; the first street is the loop.

    Attributes
    ----------
    streets : tuple of Street
        The loop, counter-clockwise, then the streets that leave it.
    sidewalk : float
        Width of the sidewalks, m.
    road_waves, terrain_waves : (K, 4) array
        Undulation as rows of wave vector (rad/m, two), phase (rad), amplitude (m).
    slope : (2,) array
        Mean slope of the land, m/m.
    """

    streets: tuple[Street, ...]
    sidewalk: float
    road_waves: Array
    terrain_waves: Array
    slope: Array

    @property
    def loop(self) -> Street:
        """The closed street."""
        return self.streets[0]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of the land, (2,) each, m."""
        axis = self.loop.axis
        return axis.min(axis=0) - _MARGIN, axis.max(axis=0) + _MARGIN

    def kerb_distance(self, xy: Array) -> Array:
        """Distance outside the nearest kerb, negative on a road.

        Parameters
        ----------
        xy : (N, 2) array
            Points, m.

        Returns
        -------
        (N,) array
            Distance, m; 12 far from all streets, where it is not measured.
        """
        total = np.full(len(xy), -np.inf)
        for street in self.streets:
            distance, _ = street.tree.query(xy, distance_upper_bound=_FAR)
            total = np.logaddexp(total, (street.half_width - distance) / _FILLET)
        return np.minimum(-_FILLET * total, _FAR)

    def road_height(self, xy: Array) -> Array:
        """Height of the land at road level, (N,), m, at points (N, 2)."""
        return np.asarray(xy @ self.slope + wave_sum(self.road_waves, xy))

    def ground_height(self, xy: Array, kerb: Array | None = None) -> Array:
        """Height of road, sidewalk or terrain.

        Parameters
        ----------
        xy : (N, 2) array
            Points, m.
        kerb : (N,) array, optional
            Their `kerb_distance`, when it is known already.

        Returns
        -------
        (N,) array
            Height, m.
        """
        kerb = self.kerb_distance(xy) if kerb is None else kerb
        step = KERB_HEIGHT * np.clip(kerb / _STEP, 0.0, 1.0)
        wild = np.clip((kerb - self.sidewalk) / 3.0, 0.0, 1.0)
        return np.asarray(self.road_height(xy) + step + wild * wave_sum(self.terrain_waves, xy))


def make_layout(rng: np.random.Generator) -> Layout:
    """Draw a loop road with side streets on sloped, wavy land."""
    loop = Street(_loop_axis(rng), rng.uniform(4.4, 5.0), closed=True)
    count = int(rng.integers(3, 6))
    starts = (np.arange(count) + rng.uniform(0.2, 0.8, count)) / count * loop.length
    sides = [_side_street(rng, loop, start) for start in starts]
    return Layout(
        streets=(loop, *sides),
        sidewalk=rng.uniform(1.8, 2.6),
        road_waves=np.vstack([draw_waves(rng, 4, (60.0, 160.0), 0.5),
                              draw_waves(rng, 8, (5.0, 18.0), 0.008)]),
        terrain_waves=draw_waves(rng, 8, (3.0, 14.0), 0.05),
        slope=rng.uniform(-0.025, 0.025, 2),
    )


def _loop_axis(rng: np.random.Generator) -> Array:
    """Centre line of a rounded polygon with bowed edges."""
    count = int(rng.integers(4, 7))
    angle = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
    angle += rng.uniform(0.0, 2 * np.pi)
    size = rng.uniform((52.0, 40.0), (76.0, 56.0)) * rng.uniform(0.88, 1.12, (count, 1))
    corners = size * np.column_stack([np.cos(angle), np.sin(angle)])
    part = np.linspace(0.0, 1.0, 200, endpoint=False)[:, None]
    edges = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([end[1] - start[1], start[0] - end[0]])
        bow = rng.uniform(-0.08, 0.08) * np.sin(np.pi * part) ** 2
        edges.append(start + part * (end - start) + bow * normal)
    rough = resample_closed(np.vstack(edges), _STEP)
    smooth = gaussian_filter1d(rough, 6.0 / _STEP, axis=0, mode='wrap')
    return resample_closed(smooth - smooth.mean(axis=0), _STEP)


def _side_street(rng: np.random.Generator, loop: Street, along: float) -> Street:
    start, heading = loop.at(along, 0.0)
    distance = np.arange(0.0, _SIDE_LENGTH, _STEP)
    # The loop runs counter-clockwise, so outside is on the right.
    course = heading - np.pi / 2 + rng.uniform(-0.25, 0.25) + rng.uniform(-1, 1) * distance / 90.0
    steps = _STEP * np.column_stack([np.cos(course), np.sin(course)])
    return Street(start + np.cumsum(steps, axis=0), rng.uniform(3.2, 4.2), closed=False)


def resample_closed(points: Array, step: float) -> Array:
    """Points of a closed line at an equal spacing close to `step`, (M, 2), m."""
    ring = np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    wanted = np.linspace(0.0, along[-1], round(along[-1] / step), endpoint=False)
    return np.column_stack([np.interp(wanted, along, ring[:, k]) for k in range(2)])
