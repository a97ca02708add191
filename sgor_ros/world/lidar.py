"""A spinning LiDAR that sees a scene by ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .disturbances import early_returns
from .disturbances import ghosts
from .motion import poses_during
from .rays import cast
from .rays import Rays
from .scene import Scene

Array = npt.NDArray[np.float64]
Points = npt.NDArray[np.float32]
Labels = npt.NDArray[np.uint32]

_TURN = 2 * np.pi


@dataclass(frozen=True)
class Lidar:
    """Spinning LiDAR; the defaults resemble a 64-beam car sensor.

    Sensors that are sold are in `sgor_ros.world.sensors`.

    Attributes
    ----------
    beams : int
        Rays in a column, equally spaced in elevation.
    columns : int
        Columns in a turn.
    fov_up, fov_down : float
        Elevation of the highest and the lowest beam, rad.
    max_range : float
        Farther returns are lost, m.
    range_noise : float
        Standard deviation of the range, m.
    drop_out : float
        Share of the returns that are lost at random.
    label_noise : float
        Share of the points that get a random other class of the scene.
    min_range : float
        Nearer returns are lost, m.
    fov_horizontal : float
        Sector around the x axis that is swept, rad; columns keep their spacing.
    elevations : tuple of float, optional
        Elevation of each beam from the top, rad, where they are not equally spaced.
    early_returns : float
        Share of the rays that return early: rain, dust, snow. They have label 0.
    ghosts : float
        Share of the rays that are mirrored by the surface that they meet: what they meet next
        appears behind it. Those that meet nothing next are lost.

    Raises
    ------
    ValueError
        If elevations are not as many as beams, or a share is not within 0 and 1.
    """

    beams: int = 64
    columns: int = 1800
    fov_up: float = float(np.deg2rad(2.0))
    fov_down: float = float(np.deg2rad(-24.8))
    max_range: float = 100.0
    range_noise: float = 0.02
    drop_out: float = 0.05
    label_noise: float = 0.0
    min_range: float = 0.0
    fov_horizontal: float = _TURN
    elevations: tuple[float, ...] | None = None
    early_returns: float = 0.0
    ghosts: float = 0.0

    def __post_init__(self) -> None:
        if self.elevations is not None and len(self.elevations) != self.beams:
            raise ValueError(f'{len(self.elevations)} elevations of {self.beams} beams')
        for name in ('drop_out', 'label_noise', 'early_returns', 'ghosts'):
            share = getattr(self, name)
            if not 0.0 <= share <= 1.0:
                raise ValueError(f'{name} {share!r}: not within 0 and 1')
        if not 0.0 < self.fov_horizontal <= _TURN:
            raise ValueError(f'fov_horizontal {self.fov_horizontal!r}: not within 0 and 2 pi')

    def scan(
        self, scene: Scene, T_world_sensor: Array, rng: np.random.Generator,
        companions: Scene | None = None,
    ) -> tuple[Points, Labels]:
        """Take one scan from a standing sensor.

        Parameters
        ----------
        scene : Scene
            What to look at.
        T_world_sensor : (4, 4) array
            Pose of the sensor in the world, translation in m.
        rng : numpy.random.Generator
            Source of noise.
        companions : Scene, optional
            What moves with the sensor, in the sensor frame: see `sgor_ros.world.traffic`.

        Returns
        -------
        points : (N, 3) array of float32
            Returns in the sensor frame (x ahead, y left, z up), m, beam by beam from the top.
        labels : (N,) array of uint32
            Raw SemanticKITTI label of each point.
        """
        directions, _ = self._pattern(rng)
        rays = Rays(T_world_sensor[:3, 3], directions @ T_world_sensor[:3, :3].T)
        points, labels, _ = self._measure(scene, rays, directions, rng, companions)
        return points, labels

    def sweep(
        self, scene: Scene, T_world_sensor: Array, rng: np.random.Generator,
        twist: npt.ArrayLike, period: float = 0.1, companions: Scene | None = None,
    ) -> tuple[Points, Labels, Array]:
        """Take one scan from a sensor that moves meanwhile, each ray from where it is then.

        Parameters
        ----------
        scene, rng, companions
            As in `scan`.
        T_world_sensor : (4, 4) array
            Pose of the sensor in the world at the start of the sweep, translation in m.
        twist : (6,) array_like
            Velocity (m/s), then angular velocity (rad/s), in the sensor frame, constant.
        period : float
            How long the sweep takes, s.

        Returns
        -------
        points : (N, 3) array of float32
            Returns, m, each in the frame that the sensor had when it fired: a bent scan.
        labels : (N,) array of uint32
            Raw SemanticKITTI label of each point.
        times : (N,) array of float64
            When each was fired, s since the start; `motion.unbend` takes the bend out.
        """
        directions, shares = self._pattern(rng)
        times = period * shares
        R, t = poses_during(T_world_sensor, twist, times)
        rays = Rays(t, np.einsum('nij,nj->ni', R, directions))
        points, labels, seen = self._measure(scene, rays, directions, rng, companions)
        return points, labels, times[seen]

    def _measure(
        self, scene: Scene, rays: Rays, directions: Array, rng: np.random.Generator,
        companions: Scene | None,
    ) -> tuple[Points, Labels, npt.NDArray[np.int64]]:
        """Points and labels where rays return, and which; directions are in the sensor frame."""
        reach, labels, normals = cast(scene, rays)
        surface = reach
        if self.ghosts:
            reach, labels = ghosts(scene, rays, reach, labels, normals, self.ghosts, rng)
        if companions is not None:
            near, theirs, _ = cast(companions, Rays(np.zeros(3), directions))
            before = near < surface
            reach, labels = np.where(before, near, reach), np.where(before, theirs, labels)
        if self.early_returns:
            reach, labels = early_returns(reach, labels, self.early_returns,
                                          (self.min_range, self.max_range), rng)
        # Misses are infinitely far.
        returned = (reach >= self.min_range) & (reach < self.max_range)
        seen = np.flatnonzero(returned & (rng.random(len(directions)) >= self.drop_out))
        reach = reach[seen] + self.range_noise * rng.standard_normal(len(seen))
        points = (reach[:, None] * directions[seen]).astype(np.float32)
        return points, self._mislabel(labels[seen], scene.label_of_geometry, rng), seen

    def _pattern(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw the rays of a turn: unit vectors (R, 3), and the share of it that has passed (R,).

        A full turn starts ahead, a sector on its left.
        """
        elevation = (np.linspace(self.fov_up, self.fov_down, self.beams)
                     if self.elevations is None else np.array(self.elevations))
        full = self.fov_horizontal >= _TURN
        count = round(self.columns * self.fov_horizontal / _TURN)
        column = np.arange(count)
        # Clockwise, as a car's sensor spins.
        azimuth = (0.0 if full else self.fov_horizontal / 2) - (
            self.fov_horizontal * (column + rng.random()) / count)
        shape = (self.beams, count)
        return (spherical(azimuth, elevation[:, None]),
                np.broadcast_to(column / count, shape).ravel())

    def _mislabel(
        self, labels: Labels, classes: Labels, rng: np.random.Generator,
    ) -> Labels:
        """Swap the label of a random share of points for that of another class."""
        known = np.unique(classes)
        wrong = rng.random(len(labels)) < self.label_noise
        shift = rng.integers(1, max(2, len(known)), len(labels))
        other = known[(np.searchsorted(known, labels) + shift) % len(known)]
        return np.where(wrong, other, labels)


def spherical(azimuth: Array, elevation: Array) -> Array:
    """Return unit vectors (R, 3) of angles that broadcast against each other, rad."""
    azimuth, elevation = np.broadcast_arrays(azimuth, elevation)
    return np.stack([
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ], axis=-1).reshape(-1, 3)
