"""KITTI: pairs 10 m apart by the rule of the literature, and listed loop pairs.

The rule and the list of 555 pairs are those of FCGF (Choy et al., ICCV 2019), which DGR, PointDSC,
SC2-PCR and others use. The loop lists are those of the LiDAR registration benchmark of G3Reg.
"""
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...io.datasets import Drive
from ...io.datasets import DriveScan
from ..metrics.registration_recall import EASY
from ..metrics.registration_recall import LOOPS
from .pairs import Pair
from .protocol import outdoor
from .protocol import Protocol

Array = NDArray[np.float64]

DISTANCE_M, AHEAD = 10.0, 100
KNOWN_BAD = (8, 15, 58)
"""The pair that all who use the list leave out: sequence, scans."""
COLUMNS = 20
"""Of a list: sequence and scan of the source, of the target, and T_target_source."""

Finder = Callable[[int, int], DriveScan | None]
"""Sequence and scan to the frame; None where it is not there."""


def ten_metre_pairs(positions: Array) -> list[tuple[int, int]]:
    """Return (source, target) by the rule: from each scan on, the last before 10 m are passed.

    Parameters
    ----------
    positions : (N, 3) float64
        Of the camera, as in the poses of KITTI: the rule was run on those.
    """
    pairs = []
    at = 0
    while at < len(positions):
        away = np.linalg.norm(positions[at:at + AHEAD] - positions[at], axis=1) > DISTANCE_M
        if not away.any():
            at += 1
            continue
        # the first beyond it, less one
        last = at + int(np.argmax(away)) - 1
        pairs.append((at, last))
        at = last + 1
    return pairs


def read_pair_list(path: Path) -> list[tuple[int, int, int, int, Array]]:
    """Return (sequence, source, sequence of the target, target, T_target_source) of a list.

    Raises
    ------
    InputError
        It cannot be read, or a row has not 20 numbers.
    """
    try:
        rows = np.loadtxt(path, skiprows=1, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: expected a header and rows of numbers: {error}') from error
    if rows.shape[1] != COLUMNS:
        raise InputError(f'{path}: {rows.shape[1]} columns, expected {COLUMNS}')
    return [(int(row[0]), int(row[1]), int(row[2]), int(row[3]), row[4:].reshape(4, 4))
            for row in rows]


def kitti_10m(drives: Sequence[Drive], positions: Sequence[Array]) -> Protocol:
    """Return the rule's pairs of drives with poses.

    Parameters
    ----------
    drives : sequence of Drive
    positions : sequence of (N, 3) float64
        Where the rule is to be applied: the camera's, or the sensor's where that is all there is.
    """
    pairs = []
    for drive, where in zip(drives, positions, strict=True):
        assert drive.T_world_sensor is not None
        T = drive.T_world_sensor
        pairs += [Pair(drive.scans[i], drive.scans[j], se3.inverse(T[j]) @ T[i],
                       name=f'{drive.name} {i} {j}', group=drive.name)
                  for i, j in ten_metre_pairs(where[:len(drive.scans)])
                  if (drive.name.rpartition('/')[2], i, j) != (f'{KNOWN_BAD[0]:02d}',
                                                              *KNOWN_BAD[1:])]
    return outdoor('kitti_10m', pairs)


def kitti_10m_list(path: Path, find: Finder) -> Protocol:
    """Return the pairs of a list of the 10 m kind, without the one that is known to be bad."""
    listed = [row for row in read_pair_list(path) if (row[0], row[1], row[3]) != KNOWN_BAD]
    pairs, missing = _listed(listed, find, lambda sequence: f'{sequence:02d}')
    return outdoor('kitti_10m', pairs, missing)


def kitti_loops(paths: Sequence[Path], find: Finder) -> Protocol:
    """Return the pairs of lists of loops, each list a band of distance."""
    pairs: list[Pair] = []
    missing = 0
    for path in paths:
        band = path.stem.removeprefix('kitti_loops_').replace('_', '-') + ' m'
        found, gone = _listed(read_pair_list(path), find, lambda _, band=band: band)    # type: ignore[misc]
        pairs += found
        missing += gone
    return replace(outdoor('kitti_loops', pairs, missing), thresholds=(LOOPS, EASY))


def _listed(rows: Sequence[tuple[int, int, int, int, Array]], find: Finder,
           group: Callable[[int], str]) -> tuple[list[Pair], int]:
    pairs = []
    for sequence, i, other, j, T in rows:
        source, target = find(sequence, i), find(other, j)
        if source is not None and target is not None:
            pairs.append(Pair(source, target, T, name=f'{sequence:02d} {i} {other:02d} {j}',
                              group=group(sequence)))
    return pairs, len(rows) - len(pairs)
