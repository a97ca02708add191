"""The reliability diagram: how far confidence can be believed."""
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
import numpy as np

from ...io.colours import BLUE
from ...io.colours import DIFFERENT
from ...io.colours import GREY
from ...io.colours import RIGHT
from ...io.colours import WRONG
from ..metrics.reliability import BINS
from ..metrics.reliability import reliability_diagram
from ..metrics.row import Row
from .plots import DPI


def plot_reliability_diagram(path: Path, rows: Sequence[Row], methods: Sequence[str],
                             default: float) -> None:
    """Draw the share that is right against the confidence, and how many there are of each.

    Parameters
    ----------
    path : Path
        Where to.
    rows : sequence of Row
    methods : sequence of str
        Which of them, a column each.
    default : float
        The threshold below which answers are refused.
    """
    figure = Figure(figsize=(6.5 * len(methods), 7.5), layout='constrained')
    grid = figure.subplots(2, len(methods), sharex=True, squeeze=False, height_ratios=(2, 1))
    for (top, bottom), name in zip(grid.T, methods, strict=True):
        own = [row for row in rows if row.method == name]
        bins = reliability_diagram(own)
        top.plot((0, 100), (0, 100), ':', color=GREY, label='calibrated')
        top.plot([100 * each.mean for each in bins],
                 [100 * each.right / each.answers for each in bins], 'o-', color=BLUE,
                 label='answers, refused ones too')
        top.set(ylabel='share that is right [%]', ylim=(-3, 103))
        top.set_title(name, loc='left', weight='bold')
        _histogram = {
            'right': ([row for row in own if row.right and row.within], RIGHT),
            'wrong answer': ([row for row in own if row.right and not row.within], WRONG),
            'different places': ([row for row in own if not row.right], DIFFERENT)}
        shown = {kind: ([100 * row.confidence for row in part if not np.isnan(row.confidence)],
                        colour) for kind, (part, colour) in _histogram.items()}
        bottom.hist([values for values, _ in shown.values()], 100 * np.array(BINS), stacked=True,
                    color=[colour for _, colour in shown.values()],
                    label=[f'{kind} ({len(values)})' for kind, (values, _) in shown.items()])
        bottom.set(xlabel='confidence [%]', ylabel='answers', xlim=(0, 100))
        for axes in (top, bottom):
            axes.axvline(100 * default, color='black', ls='--', lw=1,
                         label=f'min_confidence = {default:g}')
            axes.grid(alpha=0.25)
            axes.legend(fontsize=9)
    figure.savefig(path, dpi=DPI)
