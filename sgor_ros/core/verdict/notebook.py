"""A result as HTML, for notebooks: a table, and the matches from above as a small SVG."""
from collections.abc import Iterator
from html import escape
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..common.se3 import angle

if TYPE_CHECKING:
    from .result import Registration

SIZE = 320
"""Edge of the picture, pixels."""
MOST_MATCHES = 400
TARGET, SOURCE, OUTLIER = '#1f77b4', '#d62728', '#bbbbbb'


def html_of(result: 'Registration') -> str:
    """Return verdict, pose, covariance and alternatives, and a picture where there is a pose."""
    rows = ''.join(f'<tr><th style="text-align:left">{escape(name)}</th>'
                   f'<td style="text-align:left">{text}</td></tr>' for name, text in _rows(result))
    picture = '' if result.T_target_source is None else _picture(result, result.T_target_source)
    return f'<div style="display:flex;gap:1em"><table>{rows}</table>{picture}</div>'


def _rows(result: 'Registration') -> Iterator[tuple[str, str]]:
    colour = '#2ca02c' if result.success else SOURCE
    yield 'status', (f'<b style="color:{colour}">{escape(result.status.value)}</b> '
                     f'{escape(result.reason)}')
    yield 'confidence', f'{result.confidence:.2f}'
    yield 'correspondences', f'{int(result.inliers.sum())} inliers of {len(result.inliers)}'
    if result.T_target_source is not None:
        yield 'motion' if result.success else 'candidate', _moved(result.T_target_source)
        lines = (' '.join(f'{value:9.4f}' for value in row) for row in result.T_target_source)
        yield 'T_target_source', '<pre>' + '\n'.join(lines) + '</pre>'
    if result.covariance is not None:
        sigma = np.sqrt(np.diag(result.covariance))
        yield 'standard deviation', (
            ' '.join(f'{100 * s:.1f}' for s in sigma[:3]) + ' cm, '
            + ' '.join(f'{math.degrees(s):.3f}' for s in sigma[3:]) + ' deg')
    for direction in result.degenerate:
        yield 'slides along', ' '.join(f'{value:.2f}' for value in direction)
    for other in result.alternatives:
        yield 'or else', _moved(other.T_target_source)
    for warning in result.warnings:
        yield 'warning', escape(warning)


def _moved(T: NDArray[np.float64]) -> str:
    return (f'{np.linalg.norm(T[:3, 3]):.3f} m, {math.degrees(angle(T[:3, :3])):.3f} deg')


def _picture(result: 'Registration', T: NDArray[np.float64]) -> str:
    """Draw matches and sensors from above, in the frame of the target."""
    moved = result.source_points @ T[:3, :3].T + T[:3, 3]
    step = max(1, math.ceil(len(moved) / MOST_MATCHES))
    inliers = result.inliers[::step]
    source, target = moved[::step, :2], result.target_points[::step, :2]
    sensors = {TARGET: np.eye(4), SOURCE: T}
    shown = np.vstack((target, *(pose[None, :2, 3] for pose in sensors.values())))
    low, high = shown.min(axis=0), shown.max(axis=0)
    metres = max(float((high - low).max()), 1.0) * 1.1
    corner = (low + high - metres) / 2

    def at(point: NDArray[np.float64]) -> tuple[float, float]:
        x, y = SIZE * (point[:2] - corner) / metres
        return round(float(x), 1), round(float(SIZE - y), 1)

    parts = []
    for one, other, good in sorted(zip(source, target, inliers, strict=True),
                                   key=lambda match: bool(match[2])):
        x, y = at(other)
        if good:
            from_x, from_y = at(one)
            parts.append(f'<path d="M{from_x} {from_y}L{x} {y}" stroke="{SOURCE}"/>')
        parts.append(f'<circle cx="{x}" cy="{y}" r="1.5" fill="{TARGET if good else OUTLIER}"/>')
    for colour, pose in sensors.items():
        x, y = at(pose[:2, 3])
        ahead_x, ahead_y = at(pose[:2, 3] + 0.06 * metres * pose[:2, 0])
        parts.append(f'<path d="M{x} {y}L{ahead_x} {ahead_y}" stroke="{colour}" '
                     f'stroke-width="2"/><circle cx="{x}" cy="{y}" r="5" fill="{colour}"/>')
    for alternative in result.alternatives:
        x, y = at(alternative.T_target_source[:2, 3])
        parts.append(f'<circle cx="{x}" cy="{y}" r="5" fill="none" stroke="{SOURCE}"/>')
    return (f'<svg width="{SIZE}" height="{SIZE}" viewBox="0 0 {SIZE} {SIZE}" '
            f'style="background:white"><title>from above, {metres:.0f} m wide: sensor of the '
            f'target blue, of the source red, its alternatives hollow; inliers blue</title>'
            f'{"".join(parts)}</svg>')
