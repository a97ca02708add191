"""Draw docs/images/trust.png: what the clouds say of an answer and of another placement.

Three places of the built-in world, by the code that registers. Usage, from the checkout:
.venv/bin/python scripts/trust_picture.py [FILE]
"""
from dataclasses import dataclass
from pathlib import Path
import sys
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from sgor_ros import PreparedScan
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import Status
from sgor_ros.core.common import se3
from sgor_ros.core.degeneracy.directions import perturbed_poses
from sgor_ros.core.hypotheses.map_correlation import correlate_maps
from sgor_ros.core.icp.point_to_plane import icp
from sgor_ros.core.scan.voxels import thin
from sgor_ros.core.scoring.pose_scoring import AGREES
from sgor_ros.core.scoring.pose_scoring import pose_score
from sgor_ros.core.scoring.pose_scoring import score_keypoints
from sgor_ros.core.scoring.pose_scoring import VIOLATES
from sgor_ros.io.colours import DIFFERENT
from sgor_ros.io.colours import SOURCE
from sgor_ros.io.colours import TARGET
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

Array = NDArray[np.float64]

PICTURE = Path(__file__).parents[1] / 'docs/images/trust.png'
SLICE_M = (0.4, 2.4)
"""Heights over the ground that are drawn: neither floor nor ceiling."""
SLID_M = 8.0
ROUNDS = 10
"""Of ICP, as many as rivals get that nothing has ruled out."""
ASKED = 1000
"""Keypoints of each scan."""
ASPECT = 0.62


@dataclass(frozen=True, eq=False)
class Example:
    """A pair, what `register` says, its answer, another placement, and what to look at [m]."""

    status: Status
    source: PreparedScan
    target: PreparedScan
    T_world_target: Array
    answer: Array
    other: Array
    middle: tuple[float, float]


def main() -> None:
    """Draw all three."""
    figure = Figure(figsize=(12, 6.4), layout='constrained')
    grid = figure.subplots(2, 3)
    columns = (
        (tunnel(), 40.0, 'Tunnel', f'slid by {SLID_M:.0f} m: not ruled out'),
        (facade(), 48.0, 'Facade in bays', 'one bay further: not ruled out'),
        (courtyard(), 32.0, 'Courtyard', 'turned by half: ruled out'))
    for (top, bottom), (example, width, title, change) in zip(grid.T, columns, strict=True):
        draw(top, example, example.answer, width)
        draw(bottom, example, example.other, width)
        top.set_title(f'{title}: {example.status.name.lower()}', weight='bold', fontsize=13,
                      pad=10)
        bottom.set_title(change, fontsize=12)
    slide_arrow(grid[0, 0], columns[0][0])
    grid[0, 0].set_ylabel('the answer', fontsize=12)
    grid[1, 0].set_ylabel('another placement', fontsize=12)
    for colour, marker, label in ((TARGET, 's', 'target scan'), (SOURCE, 's', 'source scan'),
                                  ('white', 'o', 'where the two sensors stood'),
                                  (DIFFERENT, 'o', 'hangs where the other sensor saw through')):
        grid[0, 0].plot([], [], marker, color=colour, label=label, ms=8,
                        mec='black' if colour == 'white' else colour)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc='outside lower center', ncols=4,
                  frameon=False, fontsize=11)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else PICTURE, dpi=110, bbox_inches='tight')


def pair_of(kind: str, seed: int) -> tuple[PreparedScan, PreparedScan, Array]:
    """Scan a place from two poses: source, target, T_world_target."""
    place, rng = scenes.make(kind, seed), np.random.default_rng(seed)
    least, greatest = scenes.KINDS[kind].distances
    T_world_target, T_world_source = scenes.random_pair(
        place, rng, 0.8 * least + 0.2 * greatest, 0.5 * (least + greatest))
    target, source = (preprocess(SemanticScan(*Lidar().scan(place, T, rng)))
                      for T in (T_world_target, T_world_source))
    return source, target, T_world_target


def tunnel() -> Example:
    """Return a bare tunnel, and the source slid along it."""
    source, target, T_world_target = pair_of('tunnel', 3)
    found = register(source, target)
    slide = SLID_M * found.alternatives[0].degenerate[:1]
    slid = icp(source.index, target.index, perturbed_poses(found.T_target_source, slide), ROUNDS,
               ROUNDS)
    return Example(found.status, source, target, T_world_target, found.T_target_source, slid[0],
                   _middle(T_world_target, found.T_target_source, slid[0]))


def facade() -> Example:
    """Return a facade with the same car before each bay, and its best alternative."""
    source, target, T_world_target = pair_of('facade_cars_regular', 2)
    found = register(source, target)
    other = found.alternatives[0].T_target_source
    return Example(found.status, source, target, T_world_target, found.T_target_source, other,
                   _middle(T_world_target, found.T_target_source, other))


def courtyard() -> Example:
    """Return a courtyard of one design on all sides, and the rival with most agreement."""
    source, target, T_world_target = pair_of('courtyard', 1)
    found = register(source, target)
    rivals = icp(source.index, target.index, correlate_maps(
        source.index, target.index, found.T_target_source, 30.0), ROUNDS, ROUNDS)
    turned = [se3.angle(T[:3, :3] @ found.T_target_source[:3, :3].T) > 0.1 for T in rivals]
    said = score_keypoints(source.index, target.index, rivals, ASKED)
    best = int(np.argmax((said == AGREES).sum(axis=1) * turned))
    return Example(found.status, source, target, T_world_target, found.T_target_source,
                   rivals[best], (0.0, 0.0))


def _middle(T_world_target: Array, *placements: Array) -> tuple[float, float]:
    """Return the middle of all sensors."""
    sensors = np.array([T_world_target, *(T_world_target @ T for T in placements)])[:, :2, 3]
    x, y = (sensors.min(axis=0) + sensors.max(axis=0)) / 2
    return float(x), float(y)


def draw(axes: Any, example: Example, T: Array, width: float) -> None:
    """Draw both scans from above under a placement, and what contradicts it."""
    source, target = example.source, example.target
    W = example.T_world_target
    for scan, pose, colour in ((target, W, TARGET), (source, W @ T, SOURCE)):
        heights = scan.ground.heights(scan.scan.points)
        shown = scan.scan.points[(heights > SLICE_M[0]) & (heights < SLICE_M[1])]
        placed = se3.transform(pose, shown.astype(np.float64))
        axes.scatter(*placed[:, :2].T, s=1.6, color=colour, alpha=0.55, linewidths=0,
                     rasterized=True)
    outcomes = score_keypoints(source.index, target.index, T[None], ASKED)[0]
    asked = [se3.transform(pose, scan.index.points[thin(len(scan.index.points), ASKED)])
             for scan, pose in ((source, W @ T), (target, W))]
    against = np.vstack(asked)[outcomes == VIOLATES]
    axes.plot(*against[:, :2].T, 'o', color=DIFFERENT, ms=3.2, mew=0)
    for pose, colour in ((W, TARGET), (W @ T, SOURCE)):
        axes.plot(*pose[:2, 3], 'o', ms=9, mfc='white', mec=colour, mew=2.5, zorder=5)
    found = pose_score(outcomes)
    axes.set_xlabel(f'{found.overlap:.0%} agree, {found.violations:.1%} contradict', fontsize=11)
    half = width / 2 * np.array((-1, 1))
    x, y = example.middle
    axes.set(xlim=x + half, ylim=y + ASPECT * half, aspect='equal', xticks=[], yticks=[])


def slide_arrow(axes: Any, example: Example) -> None:
    """Draw the direction in which the source slides."""
    sensor = (example.T_world_target @ example.answer)[:2, 3]
    way = (example.T_world_target @ example.other)[:2, 3] - sensor
    axes.annotate('', sensor + way, sensor - way, zorder=4,
                  arrowprops={'arrowstyle': '<->', 'color': 'black', 'lw': 2})


if __name__ == '__main__':
    main()
