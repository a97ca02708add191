"""Pictures of a protocol: recall along a study, errors, matches before and after."""
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path

from matplotlib.lines import Line2D
import numpy as np

from ...core.common import se3
from ...io.plots import new_figure
from ...io.plots import save
from ..methods import Answer
from ..methods import Matches
from ..metrics.row import Row
from ..metrics.row import Threshold
from .protocol_tables import by_method

RIGHT, WRONG, POINTS = '#009e73', '#d55e00', '#888888'
SHOWN = 400
"""Lines of a picture of matches: more are a blot."""
COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#555555', '#000000')
MARKERS = 'osD^vP*X'


def recall_along(path: Path, rows: Sequence[Row], threshold: Threshold, axis: str) -> None:
    """Draw RR of each method along the values of a study."""
    figure = new_figure(8, 4.8)
    axes = figure.add_subplot()
    methods = by_method(rows)
    for place, (method, own) in enumerate(methods.items()):
        # the first are drawn broader: where curves are the same all of them are seen
        over = len(methods) - 1 - place
        names = list(dict.fromkeys(r.variant for r in own))
        recall = [100 * np.mean([r.below(threshold) for r in own if r.variant == name])
                  for name in names]
        axes.plot([float(name) for name in names], recall, '-', marker=MARKERS[place % 8],
                  color=COLOURS[place % 8], lw=1.5 + 2 * over, ms=5 + 3 * over, label=method)
    pairs = len({r.pair for r in rows})
    axes.set(xlabel=axis, ylabel=f'RR %, {pairs} pairs', ylim=(-3, 103))
    axes.legend(loc='center left', bbox_to_anchor=(1.02, 0.5), frameon=False)
    save(figure, path)


def errors(path: Path, rows: Sequence[Row], threshold: Threshold) -> None:
    """Draw for each method how many pairs have at most so large an error."""
    figure = new_figure(10, 4.2)
    left, right = figure.subplots(1, 2, sharey=True)
    for place, (method, own) in enumerate(by_method(rows).items()):
        for axes, values, most in (
                (left, [r.rotation_error_deg for r in own], threshold.rotation_deg),
                (right, [100 * r.translation_error_m for r in own],
                 100 * threshold.translation_m)):
            known = np.sort(np.nan_to_num(values, nan=np.inf))
            share = 100 * np.arange(1, len(known) + 1) / len(known)
            axes.step([0, *known.clip(max=2 * most)], [0, *share], where='post',
                      color=COLOURS[place % 8], lw=1.5, label=method)
            axes.set(xlim=(0, most))
    left.set(xlabel='RE at most [deg]', ylabel=f'% of {len({r.pair for r in rows})} pairs',
             ylim=(0, 103))
    right.set(xlabel='TE at most [cm]')
    right.legend(loc='center left', bbox_to_anchor=(1.02, 0.5), frameon=False)
    save(figure, path)


def matches_before_and_after(path: Path, T_target_source: np.ndarray, matches: Matches,
                             answers: Mapping[str, Answer]) -> None:
    """Draw the matches given and those that each method kept, right ones apart from wrong ones."""
    figure = new_figure(3.4 * (1 + len(answers)), 4.6)
    every = np.arange(len(matches.source))
    true = _fitting(matches, T_target_source)
    kept = {'given': every, **{name: _kept(matches, answer)
                               for name, answer in answers.items()}}
    # the target lies beside the source, as in the papers' pictures
    aside = np.array([0.0, 1.3 * np.ptp(matches.source[:, 1])])
    for axes, (name, rows) in zip(np.atleast_1d(figure.subplots(1, len(kept))), kept.items(),
                                  strict=True):
        shown = rows[::max(len(rows) // SHOWN, 1)]
        p = matches.source[:, :2]
        q = se3.transform(se3.inverse(T_target_source), matches.target)[:, :2] + aside
        for cloud in (p, q):
            axes.plot(*cloud.T, '.', color=POINTS, ms=1.5, mew=0)
        for is_true, colour in ((False, WRONG), (True, RIGHT)):
            some = shown[true[shown] == is_true]
            axes.plot(np.stack((p[some, 0], q[some, 0])), np.stack((p[some, 1], q[some, 1])),
                      '-', color=colour, lw=0.6)
        axes.set_title(f'{name}\n{true[rows].sum()} of {len(rows)} right', fontsize=9)
        axes.set_aspect('equal')
        axes.set_axis_off()
    figure.legend(handles=[
        Line2D([], [], color=POINTS, marker='.', ls='', label='matched points, target above'),
        Line2D([], [], color=RIGHT, label='right match'),
        Line2D([], [], color=WRONG, label='wrong match')], loc='outside lower center', ncols=3,
        frameon=False)
    save(figure, path)


def _fitting(matches: Matches, T: np.ndarray) -> np.ndarray:
    return np.linalg.norm(se3.transform(T, matches.source) - matches.target,
                          axis=1) < matches.inlier_m


def _kept(matches: Matches, answer: Answer) -> np.ndarray:
    if answer.kept is not None:
        return answer.kept
    if answer.T_target_source is None:
        return np.empty(0, np.intp)
    return np.flatnonzero(_fitting(matches, answer.T_target_source))
