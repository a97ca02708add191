"""The tables of a protocol, in Markdown and LaTeX, beside the published rows."""
from collections.abc import Sequence
import re

import numpy as np

from ..metrics.row import Row
from ..metrics.row import Threshold
from ..protocols.protocol import Protocol
from .published import KITTI_LEVELS
from .published import KITTI_LOOPS
from .published import ROWS
from .tables import markdown

RULES = ('RR: share of all pairs within {re:g} deg and {te:g} cm. RE and TE: means over those '
         'pairs. IP, IR (inlier recall) and F1: of each pair at {inlier:g} m, then means over '
         'all pairs; where nothing was found they are 0. Time: from the matches on, for methods '
         'on raw scans from the scans on.')
PRINTED = 'printed'
"""Marks rows that were not measured here."""


def whole(measured: Sequence[Row], protocol: Protocol) -> str:
    """Return all tables of a protocol, and by what rules they are averaged."""
    first = protocol.thresholds[0]
    count = len({r.pair for r in measured})
    absent = (f', {protocol.missing} more in the list whose scans are not here'
              if protocol.missing else '')
    text = [f'{count} pair{"s" if count > 1 else ""}{absent}. '
            + RULES.format(re=first.rotation_deg, te=100 * first.translation_m,
                           inlier=protocol.inlier_m),
            markdown(*main_rows(measured, protocol, first))]
    if len(protocol.thresholds) > 1:
        text.append(markdown(*level_rows(measured, protocol)))
    groups = sorted({r.group for r in measured}, key=_natural)
    if len(groups) > 1:
        text.append(markdown(*group_rows(measured, protocol, groups, first)))
    return '\n\n'.join(text)


def main_rows(measured: Sequence[Row], protocol: Protocol, first: Threshold
              ) -> tuple[list[str], list[list[str]]]:
    """Return header and rows: what was measured, then what is printed elsewhere."""
    header = ['method', 'pairs', 'RR %', 'RE deg', 'TE cm', 'IP %', 'IR %', 'F1 %',
              'ms median', 'ms p95']
    rows = []
    for method, own in by_method(measured).items():
        right = [r for r in own if r.below(first)]
        ms = 1e3 * np.array([r.seconds for r in own])
        rows.append([method, str(len(own)), percent([r.below(first) for r in own]),
                     mean([r.rotation_error_deg for r in right], 2),
                     mean([100 * r.translation_error_m for r in right], 2),
                     *(mean([100 * getattr(r, name) for r in own], 2)
                       for name in ('precision', 'recall', 'f1')),
                     f'{np.median(ms):.0f}', f'{np.percentile(ms, 95):.0f}'])
    for p in ROWS.get(protocol.name, ()):
        rows.append([f'{p.method}, {PRINTED}', '', *(
            '' if value is None else f'{value:.2f}' for value in p[1:]), '', ''])
    return header, rows


def level_rows(measured: Sequence[Row], protocol: Protocol
               ) -> tuple[list[str], list[list[str]]]:
    """Return RR at each threshold."""
    header = ['RR %', *(f'{t.name} ({t.rotation_deg:g} deg, {100 * t.translation_m:g} cm)'
                        for t in protocol.thresholds)]
    rows = [[method, *(percent([r.below(t) for r in own]) for t in protocol.thresholds)]
            for method, own in by_method(measured).items()]
    if protocol.name == 'kitti_10m':
        rows += [[f'{method}, {PRINTED}', *(f'{value:.2f}' for value in values)]
                 for method, values in KITTI_LEVELS.items()]
    return header, rows


def group_rows(measured: Sequence[Row], protocol: Protocol, groups: Sequence[str],
               first: Threshold) -> tuple[list[str], list[list[str]]]:
    """Return RR of each group: bands, scenes, sequences."""
    count = {group: len({r.pair for r in measured if r.group == group}) for group in groups}
    header = ['RR %', *(f'{group} ({count[group]})' for group in groups)]
    rows = [[method, *(percent([r.below(first) for r in own if r.group == group])
                       for group in groups)] for method, own in by_method(measured).items()]
    if protocol.name == 'kitti_loops' and len(groups) == 3:
        rows += [[f'{method}, {PRINTED}', *(f'{value:.1f}' for value in values)]
                 for method, values in KITTI_LOOPS.items()]
    return header, rows


def variant_rows(measured: Sequence[Row], first: Threshold
                 ) -> tuple[list[str], list[list[str]]]:
    """Return RR of each variant of a study."""
    variants = list(dict.fromkeys(r.variant for r in measured))
    header = ['RR %', *(variant or 'unchanged' for variant in variants)]
    return header, [[method, *(percent([r.below(first) for r in own if r.variant == variant])
                               for variant in variants)]
                    for method, own in by_method(measured).items()]


def latex(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table for a paper (booktabs)."""
    lines = [r'\begin{tabular}{l' + 'c' * (len(header) - 1) + '}', r'\toprule',
             ' & '.join(map(_escaped, header)) + r' \\', r'\midrule',
             *(' & '.join(_escaped(cell) or '--' for cell in row) + r' \\' for row in rows),
             r'\bottomrule', r'\end{tabular}']
    return '\n'.join(lines)


def by_method(measured: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each method, in the order of the first."""
    found: dict[str, list[Row]] = {}
    for each in measured:
        found.setdefault(each.method, []).append(each)
    return found


def percent(right: Sequence[bool]) -> str:
    """Return a share with two digits, as the literature prints it."""
    return f'{100 * sum(right) / len(right):.2f}' if right else ''


def mean(values: Sequence[float], digits: int) -> str:
    """Return the mean of those that are numbers; empty without any."""
    known = [v for v in values if not np.isnan(v)]
    return f'{np.mean(known):.{digits}f}' if known else ''


def _natural(name: str) -> list[tuple[int, str]]:
    """Return what sorts 10-20 m behind 2-5 m."""
    return [(int(part), '') if part.isdigit() else (-1, part) for part in re.split(r'(\d+)', name)]


def _escaped(cell: str) -> str:
    return cell.replace('%', r'\%').replace('_', r'\_')
