"""What is claimed against what is right, a panel a sensor."""
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from ...io.colours import BLUE
from ...io.colours import GREY
from ..calibration import Sample
from ..metrics.reliability import binned
from .plots import DPI

ROWS = 4
EDGES = (0.0, 0.5, 0.8, 0.9, 0.97, 1.0)
"""Of the bins of the claim: most claims are high."""


def plot_calibration(path: Path, samples: Sequence[Sample], claimed: NDArray[np.float64]) -> None:
    """Draw the reliability diagram of each sensor.

    Parameters
    ----------
    path : Path
        Where to.
    samples : sequence of Sample
    claimed : (N,) float64
        Probability of each, by a model that has not seen its sensor.
    """
    names = np.array([s.sensor for s in samples])
    right = np.array([s.right for s in samples])
    sensors = list(np.unique(names))
    columns = -(-len(sensors) // ROWS)
    figure = Figure(figsize=(3.0 * columns, 2.8 * ROWS), layout='constrained')
    panels = figure.subplots(ROWS, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, sensor in zip(panels, sensors, strict=False):
        own = names == sensor
        bins = binned(claimed[own], right[own], EDGES)
        points = [(100 * each.mean, 100 * each.right / each.answers) for each in bins]
        axes.plot((0, 100), (0, 100), ':', color=GREY)
        axes.plot(*zip(*points, strict=True), 'o-', color=BLUE)
        for each, point in zip(bins, points, strict=True):
            axes.annotate(str(each.answers), point, xytext=(3, -11), textcoords='offset points',
                          fontsize=7)
        axes.set_title(f'{sensor} ({int(own.sum())})', fontsize=9, loc='left')
        axes.grid(alpha=0.25)
    for axes in panels[len(sensors):]:
        axes.set_visible(False)
    figure.supxlabel('claimed by a model that has not seen the sensor [%]')
    figure.supylabel('right [%]')
    figure.savefig(path, dpi=DPI)
