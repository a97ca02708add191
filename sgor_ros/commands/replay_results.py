"""What `sgor_replay` writes and says of a drive: trajectories, summary, picture, warnings."""
from collections import Counter
from dataclasses import asdict
import json
import math
from pathlib import Path
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..evaluation.report.track_plots import plot_track
from ..io.environment import describe_environment
from ..io.stream_config import StreamConfig
from ..io.trajectories import write_kitti
from ..io.trajectories import write_tum
from ..pipeline.outcome import Outcome
from ..pipeline.outcome import Row
from ..tracker import Tracker
from .replay_truth import in_words

# then the terminal has seen enough; summary.json has them all
PRINTED_WARNINGS = 20


class Warnings:
    """Tells each text once, above the progress bar."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._noted: set[str] = set()

    def note(self, text: str) -> None:
        """Tell `text`, if it is new: it is no warning."""
        if text and text not in self._noted:
            self._noted.add(text)
            print(text, file=sys.stderr)

    def add(self, text: str) -> None:
        """Tell `text`, if it is new."""
        if text in self.texts:
            return
        self.texts.append(text)
        if len(self.texts) <= PRINTED_WARNINGS:
            print(f'warning: {text}', file=sys.stderr)
        elif len(self.texts) == PRINTED_WARNINGS + 1:
            print('warning: more of them are in summary.json', file=sys.stderr)

    def add_those_of(self, outcome: Outcome) -> None:
        """Tell what is wrong with a scan."""
        scan = f'scan at {outcome.stamp_ns * 1e-9:.3f} s'
        if outcome.tracked is None:
            self.add(f'{scan} left out: {outcome.reason}')
            return
        for text in outcome.tracked.warnings:
            self.add(text)
        if outcome.T_odom_child is None:
            self.add(f'{scan} has no pose: {outcome.reason}')


def summary_of(rows: list[Row], warnings: list[str], path: Path, topic: str, tracker: Tracker,
               stream: StreamConfig) -> dict[str, Any]:
    """Return the content of summary.json."""
    stages = dict.fromkeys(stage for row in rows for stage in row.timings)
    return {
        'bag': str(path), 'topic': topic, 'scans': len(rows),
        'successes': sum(row.T_odom_child is not None for row in rows),
        'failures': [{'scan': i, 'stamp_ns': row.stamp_ns, 'reason': row.reason}
                     for i, row in enumerate(rows) if row.T_odom_child is None],
        # the first scan of all is one of them
        'tracks': [{'id': track, 'scans': count} for track, count in Counter(
            row.track_id for row in rows if row.T_odom_child is not None).items()],
        'restarts': [i for i, row in enumerate(rows) if row.restarted],
        'timings_ms': {
            'total': _statistics([row.seconds for row in rows]),
            **{stage: _statistics([row.timings[stage] for row in rows if stage in row.timings])
               for stage in stages}},
        'warnings': warnings,
        'parameters': {**asdict(stream), **asdict(tracker.tracker_config),
                       **asdict(tracker.config)},
        'environment': describe_environment()}


def _statistics(seconds: list[float]) -> dict[str, float]:
    taken = np.array([s for s in seconds if math.isfinite(s)]) * 1e3
    return {'median': round(float(np.median(taken)), 3),
            'p95': round(float(np.percentile(taken, 95)), 3)}


def write_results(output: Path, rows: list[Row], summary: dict[str, Any], title: str,
                  truth: dict[int, NDArray[np.float64]]) -> None:
    """Write trajectories, summary and picture into a folder.

    Each track has a frame of its own, and so files of its own; `truth` has true poses by track.
    """
    stamps_ns = [row.stamp_ns for row in rows]
    for number, track in enumerate(summary['tracks'], 1):
        ending = f'_{number}' * (number > 1)
        poses = [row.T_odom_child if row.track_id == track['id'] else None for row in rows]
        write_tum(output / f'trajectory{ending}.tum', stamps_ns, poses)
        write_kitti(output / f'trajectory_kitti{ending}.txt', poses)
    (output / 'summary.json').write_text(json.dumps(summary, indent=2) + '\n')
    plot_track(output / 'trajectory.png', title, [stamp * 1e-9 for stamp in stamps_ns],
               [row.T_odom_child for row in rows], [row.seconds for row in rows],
               [row.confidence for row in rows], [row.track_id for row in rows], truth)


def print_results(summary: dict[str, Any], output: Path) -> None:
    """Print how it went, and what was written."""
    total = summary['timings_ms']['total']
    if 'map' in summary:
        told = summary['map']
        error = (f'; APE {told["ape_before_m"]:.2f} m before, {told["ape_after_m"]:.2f} m after'
                 if 'ape_after_m' in told else '')
        print(f'{len(told["loops"])} loops closed among {told["nodes"]} nodes{error}')
    for line in in_words(summary['truth']):
        print(line)
    if (tracks := len(summary['tracks'])) > 1:
        print(f'{tracks} tracks, each in a frame of its own: trajectory.tum is the first, '
              f'trajectory_2.tum the second'
              + (f', up to trajectory_{tracks}.tum' if tracks > 2 else ''))
    print(f'{summary["successes"]} of {summary["scans"]} scans have a pose; time per scan: median '
          f'{total["median"]:.0f} ms, p95 {total["p95"]:.0f} ms\n'
          f'wrote {output}: {", ".join(sorted(path.name for path in output.iterdir()))}')
