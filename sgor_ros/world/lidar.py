"""A spinning LiDAR that sees a scene by ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

from .scene import Scene


@dataclass(frozen=True)
class Lidar:
    """Spinning LiDAR; the defaults resemble a 64-beam car sensor.

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
    """

    beams: int = 64
    columns: int = 1800
    fov_up: float = float(np.deg2rad(2.0))
    fov_down: float = float(np.deg2rad(-24.8))
    max_range: float = 100.0
    range_noise: float = 0.02
    drop_out: float = 0.05
    label_noise: float = 0.0

    def scan(
        self, scene: Scene, T_world_sensor: npt.NDArray[np.float64], rng: np.random.Generator,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
        """Take one scan from a standing sensor.

        Parameters
        ----------
        scene : Scene
            What to look at.
        T_world_sensor : (4, 4) array
            Pose of the sensor in the world, translation in m.
        rng : numpy.random.Generator
            Source of noise.

        Returns
        -------
        points : (N, 3) array of float32
            Returns in the sensor frame (x ahead, y left, z up), m, beam by beam from the top.
        labels : (N,) array of uint32
            Raw SemanticKITTI label of each point.
        """
        rays = self._directions(rng)
        reach, labels = _cast(scene, T_world_sensor, rays)
        # Misses are infinitely far.
        seen = np.flatnonzero((reach < self.max_range) & (rng.random(len(rays)) >= self.drop_out))
        reach = reach[seen] + self.range_noise * rng.standard_normal(len(seen))
        points = (reach[:, None] * rays[seen]).astype(np.float32)
        return points, self._mislabel(labels[seen], scene.label_of_geometry, rng)

    def _directions(self, rng: np.random.Generator) -> npt.NDArray[np.float64]:
        """Draw the rays of a turn that starts anywhere: unit vectors (beams * columns, 3)."""
        elevation = np.linspace(self.fov_up, self.fov_down, self.beams)[:, None]
        # Clockwise, as a car's sensor spins.
        azimuth = -2 * np.pi * (np.arange(self.columns) + rng.random()) / self.columns
        return np.stack([
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.broadcast_to(np.sin(elevation), (self.beams, self.columns)),
        ], axis=-1).reshape(-1, 3)

    def _mislabel(
        self, labels: npt.NDArray[np.uint32], classes: npt.NDArray[np.uint32],
        rng: np.random.Generator,
    ) -> npt.NDArray[np.uint32]:
        """Swap the label of a random share of points for that of another class."""
        known = np.unique(classes)
        wrong = rng.random(len(labels)) < self.label_noise
        shift = rng.integers(1, len(known), len(labels))
        other = known[(np.searchsorted(known, labels) + shift) % len(known)]
        return np.where(wrong, other, labels)


def _cast(
    scene: Scene, T_world_sensor: npt.NDArray[np.float64], rays: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.uint32]]:
    """Range (R,), m, and label (R,) where rays (R, 3) meet the scene; a miss is infinite."""
    lines = np.empty((len(rays), 6), np.float32)
    lines[:, :3] = T_world_sensor[:3, 3]
    lines[:, 3:] = rays @ T_world_sensor[:3, :3].T
    hits = scene.raycaster.cast_rays(o3d.core.Tensor.from_numpy(lines))
    geometry = hits['geometry_ids'].numpy()
    # The id of a miss is out of range; its label is never used.
    geometry = np.minimum(geometry, len(scene.label_of_geometry) - 1)
    return hits['t_hit'].numpy().astype(np.float64), scene.label_of_geometry[geometry]
