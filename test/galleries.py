"""Scenes made by hand, point by point, for tests of what is decided on them."""
import numpy as np
from scipy.spatial.transform import Rotation

from sgor_ros.core.features.features import Features
from sgor_ros.core.index.range_image import range_image
from sgor_ros.core.index.scan_index import scan_index
from sgor_ros.core.scan.directions import by_direction

MAX_DISTANCE = 0.6
UP = np.array([0.0, 0.0, 1.0])
NOTHING = np.empty((0, 4, 4))


def moved(x=0.0, y=0.0, z=0.0, yaw_deg=0.0, roll_deg=0.0):
    """Return a (4, 4) pose."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('zx', [yaw_deg, roll_deg], degrees=True).as_matrix()
    T[:3, 3] = x, y, z
    return T


def gallery(pitch=8.0, offset=0.0, ends=(-40.0, 40.0)):
    """Return what is seen between two walls at y = 4 and -4 with a pillar each `pitch` metres.

    Points and unit normals towards the sensor, (V, 3) each.
    """
    points, normals = [], []
    for y in (-4.0, 4.0):
        wall = np.stack(np.meshgrid(np.arange(*ends, 0.5), [y], np.arange(-1.5, 3, 0.5)), -1)
        points.append(wall.reshape(-1, 3))
        normals.append(np.tile([0.0, -np.sign(y), 0.0], (len(points[-1]), 1)))
    if pitch:
        for x in np.arange(ends[0] + (offset - ends[0]) % pitch, ends[1], pitch):
            for dx, facing in ((-0.6, -1.0), (0.6, 1.0)):
                side = np.stack(np.meshgrid([x + dx], [-3.4, -2.9, -2.4],
                                            np.arange(-1.5, 3, 0.5)), -1).reshape(-1, 3)
                points.append(side)
                normals.append(np.tile([facing, 0.0, 0.0], (len(side), 1)))
    return np.concatenate(points), np.concatenate(normals)


def seen(points):
    """Return the range image of all (N, 3) float32 points."""
    return range_image(by_direction(points), np.ones(len(points), np.bool_))


def dense(points, normals):
    """Return what a sensor sees of surfaces of which there is a point every half metre."""
    steps = np.arange(-0.25, 0.3, 0.1)
    return np.concatenate([points + (i * normals[:, [1, 0, 2]] + [0, 0, j])
                           for i in steps for j in steps])


def index_of(points, normals, up=UP, max_distance=MAX_DISTANCE, label=0):
    """Return the index of a scan that saw surfaces; all of them with one regional label."""
    labels = np.full(len(points), label, np.uint8)
    features = Features(points, labels, labels, np.zeros((len(points), 3), np.float32))
    return scan_index(seen(dense(points, normals).astype(np.float32)), features, normals,
                      up, max_distance)
