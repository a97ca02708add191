"""The tables of a protocol, beside the published rows."""
from collections.abc import Sequence
import re

import numpy as np

from ..metrics.registration import Threshold
from ..protocols.protocol import Protocol
from ..rows import Row
from .cells import by_method
from .cells import markdown
from .cells import mean
from .cells import percent
from .published import KITTI_LEVELS
from .published import KITTI_LOOPS
from .published import ROWS

RULES = ('RR: share of all pairs within {re:g} deg and {te:g} cm. RE and TE: means over those '
         'pairs. IP, IR (inlier recall) and F1: of each pair at {inlier:g} m, then means over '
         'all pairs; where nothing was found they are 0. Time: from the matches on, for methods '
         'on raw scans from the scans on.')
PRINTED = 'printed'
"""Marks rows that were not measured here."""


def whole(rows: Sequence[Row], protocol: Protocol) -> str:
    """Return all tables of a protocol, and by what rules they are averaged."""
    first = protocol.thresholds[0]
    count = len({r.pair for r in rows})
    absent = (f', {protocol.missing} more in the list whose scans are not here'
              if protocol.missing else '')
    text = [f'{count} pair{"s" if count > 1 else ""}{absent}. '
            + RULES.format(re=first.rotation_deg, te=100 * first.translation_m,
                           inlier=protocol.inlier_m),
            markdown(*main_rows(rows, protocol, first))]
    if len(protocol.thresholds) > 1:
        text.append(markdown(*level_rows(rows, protocol)))
    groups = sorted({r.group for r in rows}, key=_natural)
    if len(groups) > 1:
        text.append(markdown(*group_rows(rows, protocol, groups, first)))
    return '\n\n'.join(text)


def main_rows(rows: Sequence[Row], protocol: Protocol, first: Threshold
              ) -> tuple[list[str], list[list[str]]]:
    """Return header and rows: what was measured, then what is printed elsewhere."""
    header = ['method', 'pairs', 'RR %', 'RE deg', 'TE cm', 'IP %', 'IR %', 'F1 %',
              'ms median', 'ms p95']
    lines = []
    for method, own in by_method(rows).items():
        right = [r for r in own if r.within(first)]
        ms = 1e3 * np.array([r.seconds for r in own])
        lines.append([method, str(len(own)), percent([r.within(first) for r in own]),
                     mean([r.rotation_error_deg for r in right], 2),
                     mean([100 * r.translation_error_m for r in right], 2),
                     *(mean([100 * getattr(r, name) for r in own], 2)
                       for name in ('precision', 'recall', 'f1')),
                     f'{np.median(ms):.0f}', f'{np.percentile(ms, 95):.0f}'])
    for p in ROWS.get(protocol.name, ()):
        lines.append([f'{p.method}, {PRINTED}', '', *(
            '' if value is None else f'{value:.2f}' for value in p[1:]), '', ''])
    return header, lines


def level_rows(rows: Sequence[Row], protocol: Protocol
               ) -> tuple[list[str], list[list[str]]]:
    """Return RR at each threshold."""
    header = ['RR %', *(f'{t.name} ({t.rotation_deg:g} deg, {100 * t.translation_m:g} cm)'
                        for t in protocol.thresholds)]
    lines = [[method, *(percent([r.within(t) for r in own]) for t in protocol.thresholds)]
            for method, own in by_method(rows).items()]
    if protocol.name == 'kitti_10m':
        lines += [[f'{method}, {PRINTED}', *(f'{value:.2f}' for value in values)]
                 for method, values in KITTI_LEVELS.items()]
    return header, lines


def group_rows(rows: Sequence[Row], protocol: Protocol, groups: Sequence[str],
               first: Threshold) -> tuple[list[str], list[list[str]]]:
    """Return RR of each group: bands, scenes, sequences."""
    count = {group: len({r.pair for r in rows if r.group == group}) for group in groups}
    header = ['RR %', *(f'{group} ({count[group]})' for group in groups)]
    lines = [[method, *(percent([r.within(first) for r in own if r.group == group])
                       for group in groups)] for method, own in by_method(rows).items()]
    if protocol.name == 'kitti_loops' and len(groups) == 3:
        lines += [[f'{method}, {PRINTED}', *(f'{value:.1f}' for value in values)]
                 for method, values in KITTI_LOOPS.items()]
    return header, lines


def variant_rows(rows: Sequence[Row], first: Threshold
                 ) -> tuple[list[str], list[list[str]]]:
    """Return RR of each variant of a study."""
    variants = list(dict.fromkeys(r.variant for r in rows))
    header = ['RR %', *(variant or 'unchanged' for variant in variants)]
    return header, [[method, *(percent([r.within(first) for r in own if r.variant == variant])
                               for variant in variants)]
                    for method, own in by_method(rows).items()]


def _natural(name: str) -> list[tuple[int, str]]:
    """Return what sorts 10-20 m behind 2-5 m."""
    return [(int(part), '') if part.isdigit() else (-1, part) for part in re.split(r'(\d+)', name)]
