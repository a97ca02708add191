"""Draw docs/images/scenes.png: places of the built-in world as a LiDAR sees them on a drive.

Usage, from the checkout: .venv/bin/python scripts/scenes_picture.py [FILE]
"""
from pathlib import Path
import sys
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from sgor_ros.core.common import se3
from sgor_ros.io.colours import CLASSES
from sgor_ros.io.colours import ESTIMATE
from sgor_ros.io.colours import GROUND
from sgor_ros.world import scenes
from sgor_ros.world import simulate

PICTURE = Path(__file__).parents[1] / 'docs/images/scenes.png'
KINDS = ('tunnel_lamps_12', 'road_tunnel', 'corridor', 'facade_cars_regular', 'garage_half_full',
         'orchard_jittered', 'highway', 'field', 'parking_jittered', 'courtyard')
SEED = 1
SCANS = 5
DRIVEN = 0.6
"""Of the width of the picture."""


def main() -> None:
    """Draw all of them."""
    figure = Figure(figsize=(14, 6), layout='constrained')
    for axes, kind in zip(figure.subplots(2, 5).flat, KINDS, strict=True):
        draw(axes, kind)
    named = {name: colour for label, (name, colour) in CLASSES.items() if label not in GROUND}
    for name, colour in named.items():
        axes.plot([], [], 's', color=colour, ms=7, label=name)
    axes.plot([], [], '-', color=ESTIMATE, lw=2, label='drive')
    figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=11,
                  frameon=False)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else PICTURE, dpi=100)


def draw(axes: Any, kind: str) -> None:
    """Draw one place from above, and the way of the sensor through it."""
    width = 22.0 if scenes.KINDS[kind].distances[1] < 15 else 80.0
    speed = DRIVEN * width / (SCANS - 1) / 0.1
    drive = list(simulate(SCANS, SEED, speed=speed, place=kind))
    way = np.array([T for *_, T in drive])[:, :2, 3]
    points = np.vstack([se3.transform(T, points.astype(np.float64)) for _, points, _, T in drive])
    labels = np.concatenate([labels for _, _, labels, _ in drive])
    for label, (_, colour) in CLASSES.items():
        shown = points[labels == label]
        axes.scatter(*shown[:, :2].T, s=0.2 if label in GROUND else 0.8, color=colour,
                     linewidths=0, rasterized=True)
    axes.plot(*way.T, '-', color=ESTIMATE, lw=2)
    x, y = (way.min(axis=0) + way.max(axis=0)) / 2
    half = width / 2 * np.array((-1, 1))
    axes.set(xlim=x + half, ylim=y + half, aspect='equal', xticks=[], yticks=[])
    axes.set_title(f'{kind}, {width:.0f} m', loc='left', fontsize=10, weight='bold')


if __name__ == '__main__':
    main()
