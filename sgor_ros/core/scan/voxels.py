"""Semantic-geometric space U = R^3 x S on a voxel grid (Sec. III-B)."""
from dataclasses import dataclass
import zlib

import numba
import numpy as np
from numpy.typing import NDArray

from .labels import UNLABELLED


@dataclass(frozen=True)
class VoxelCloud:
    """The occupied voxels of one scan.

    Attributes
    ----------
    points : (V, 3) float64
        Mean of the raw points of each voxel, metres.
    votes : (V, C) int32
        Raw points of each class of `classes` in each voxel.
    classes : (C,) uint8
        Classes present, without `UNLABELLED`.
    labels : (V,) uint8
        The class with most votes in the voxel, `UNLABELLED` where none voted.
    """

    points: NDArray[np.float64]
    votes: NDArray[np.int32]
    classes: NDArray[np.uint8]
    labels: NDArray[np.uint8]

    def __getitem__(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> 'VoxelCloud':
        return VoxelCloud(self.points[keep], self.votes[keep], self.classes, self.labels[keep])


def voxel_grid(points: NDArray[np.float32], labels: NDArray[np.uint8], voxel_size: float,
               shift: float = 0.0) -> VoxelCloud:
    """Thin a labelled scan to one point a voxel; labels by vote of the raw points.

    Parameters
    ----------
    points : (N, 3) float32
        Metres; finite.
    labels : (N,) uint8
        Classes inside.
    voxel_size : float
        Metres.
    shift : float
        Where the grid lies, along all axes, in voxels.

    Returns
    -------
    VoxelCloud
        In the order in which voxels first appear in the scan.
    """
    classes, column = _columns(labels)
    means, votes = _accumulate(points, column[labels], voxel_size, shift, classes.size)
    return VoxelCloud(means, votes, classes, winning_labels(votes, classes))


def shift_of(points: NDArray[np.float32]) -> float:
    """Return where the grid of a scan is to lie: anywhere, but always there for these points.

    Grids that move with the sensor pull its motion towards whole voxels, the same way in each
    step. Where each scan has a grid of its own, that is noise and averages out.
    """
    return zlib.crc32(points[:1000].tobytes()) / 2**32


def one_point_voxels(points: NDArray[np.float64], labels: NDArray[np.uint8]) -> VoxelCloud:
    """Return a cloud in which each of (N, 3) points is a voxel of its own."""
    classes, column = _columns(labels)
    votes = (column[labels][:, None] == np.arange(classes.size)).astype(np.int32)
    return VoxelCloud(points, votes, classes, labels)


def thin(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` of the indices 0 to count - 1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.intp)


def winning_labels(votes: NDArray[np.int32], classes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class with most votes in each row, (V,); ties go to the lower class."""
    if classes.size == 0:
        return np.full(len(votes), UNLABELLED, np.uint8)
    winner = classes[np.argmax(votes, axis=1)]
    winner[votes.max(axis=1, initial=0) == 0] = UNLABELLED
    return winner


def _columns(labels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return the classes present and the column of votes of each class, -1 for none."""
    classes = np.flatnonzero(np.bincount(labels, minlength=256)).astype(np.uint8)
    classes = classes[classes != UNLABELLED]
    column = np.full(256, -1, np.int64)
    column[classes] = np.arange(classes.size)
    return classes, column


@numba.njit(cache=True, nogil=True)
def _accumulate(points, columns, voxel_size, shift, n_classes):
    """Hash each point to its voxel; sum coordinates and votes."""
    n = len(points)
    n_slots = 1
    while n_slots < 2 * n:    # half full at the most: a full table is searched all over
        n_slots *= 2
    slots = np.full(n_slots, -1, np.int32)
    keys = np.empty(n, np.int64)
    voxel = np.empty(n, np.int32)
    count = 0
    inverse = np.float32(1.0 / voxel_size)
    shift = np.float32(shift)
    last_key = np.int64(-1)
    last = 0
    for i in range(n):
        # 21 bits a coordinate: +-1 million voxels
        key = (((np.int64(np.floor(points[i, 0] * inverse + shift)) & 0x1FFFFF) << 42)
               | ((np.int64(np.floor(points[i, 1] * inverse + shift)) & 0x1FFFFF) << 21)
               | (np.int64(np.floor(points[i, 2] * inverse + shift)) & 0x1FFFFF))
        if key != last_key:    # a beam often stays in the same voxel
            slot = ((key * np.int64(-7046029254386353131)) >> 32) & (n_slots - 1)
            while slots[slot] >= 0 and keys[slots[slot]] != key:
                slot = (slot + 1) & (n_slots - 1)
            if slots[slot] < 0:
                slots[slot] = count
                keys[count] = key
                count += 1
            last_key = key
            last = slots[slot]
        voxel[i] = last
    sums = np.zeros((count, 3))
    members = np.zeros(count)
    votes = np.zeros((count, n_classes), np.int32)
    for i in range(n):
        v = voxel[i]
        sums[v, 0] += points[i, 0]
        sums[v, 1] += points[i, 1]
        sums[v, 2] += points[i, 2]
        members[v] += 1.0
        if columns[i] >= 0:
            votes[v, columns[i]] += 1
    for v in range(count):
        scale = 1.0 / members[v]
        sums[v, 0] *= scale
        sums[v, 1] *= scale
        sums[v, 2] *= scale
    return sums, votes
