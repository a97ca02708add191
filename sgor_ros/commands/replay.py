"""`sgor_replay`: the tracker over a bag, without ROS; the same poses as the node's."""
from argparse import ArgumentParser
from argparse import Namespace
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
import json
import math
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.scan.labels import label_convention
from ..core.warmup import warm_up
from ..evaluation.track_plots import plot_track
from ..io import messages
from ..io.bags import BagReader
from ..io.bags import BagWriter
from ..io.bags import RecordedCloud
from ..io.environment import describe_environment
from ..io.label_field import choice_in_words
from ..io.label_field import label_field_of
from ..io.pointcloud2 import decode
from ..io.stream_config import StreamConfig
from ..io.trajectories import write_kitti
from ..io.trajectories import write_tum
from ..tracker import TrackedScan
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .options import add_params_file
from .options import add_settings
from .options import configured
from .options import parser
from .options import read_parameters
from .options import run

# then the terminal has seen enough; summary.json has them all
PRINTED_WARNINGS = 20


@dataclass(frozen=True, eq=False)
class Row:
    """What is kept of a scan: little, for a bag may have many."""

    stamp_ns: int
    reason: str
    T_odom_sensor: NDArray[np.float64] | None = None
    restarted: bool = False
    inliers: int | None = None
    confidence: float = math.nan
    seconds: float = math.nan
    timings: dict[str, float] = field(default_factory=dict)


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(replay, _parser().parse_args(argv))


def replay(arguments: Namespace) -> int:
    """Track the clouds of a bag and write the results."""
    parameters = read_parameters(arguments, [
        *SgorConfig.settings(), *TrackerConfig.settings(), *StreamConfig.settings()])
    stream = configured(StreamConfig(), arguments, parameters)
    tracker = Tracker(configured(SgorConfig(), arguments, parameters),
                      configured(TrackerConfig(), arguments, parameters))
    label_convention(tracker.config.label_convention)
    output: Path = arguments.output or Path('out') / arguments.bag_path.stem
    warnings = Warnings()
    rows: list[Row] = []
    broken: InputError | None = None
    with ExitStack() as stack:
        bag = stack.enter_context(BagReader(arguments.bag_path))
        topic = arguments.topic or bag.find_topic(stream.label_field)
        clouds, expected = bag.clouds(topic), bag.cloud_topics()[topic]
        output.mkdir(parents=True, exist_ok=True)
        writer = stack.enter_context(BagWriter(output / 'bag')) if arguments.bag else None
        warm_up(tracker.config)
        try:
            for cloud in tqdm(clouds, total=expected, unit='scan', disable=None):
                rows.append(_step(tracker, cloud, stream, writer, warnings))
        except InputError as error:
            broken = error    # what came before is worth keeping
    if broken and not rows:
        raise broken
    if len(rows) < expected:
        warnings.add(f'{topic}: the bag tells of {expected} clouds, only {len(rows)} came')
    if all(row.T_odom_sensor is None for row in rows):
        raise InputError(f'{topic}: none of {len(rows)} clouds could be used: {rows[0].reason}')
    summary = _summary(rows, warnings.texts, arguments.bag_path, topic, tracker, stream)
    _write(output, rows, summary, f'{arguments.bag_path.name} {topic}')
    _print(summary, output)
    if broken:
        raise InputError(f'after {len(rows)} scans: {broken}')
    return 0


def _parser() -> ArgumentParser:
    command = parser('Track the labelled clouds of a bag (ROS 2 mcap or sqlite3, ROS 1) and write '
                     'trajectory.tum, trajectory_kitti.txt, summary.json and trajectory.png.')
    command.add_argument('bag_path', type=Path, metavar='BAG')
    command.add_argument('--topic', help='of the clouds; found where there is but one')
    command.add_argument('--output', type=Path, metavar='FOLDER',
                         help='for the results; default: out/ and the name of the bag')
    command.add_argument('--bag', action='store_true',
                         help='also write a bag with /pose, /odometry and /correspondences')
    add_params_file(command)
    add_settings(command, 'clouds and frames', StreamConfig.settings())
    add_settings(command, 'tracker', TrackerConfig.settings())
    add_settings(command, 'registration', SgorConfig.settings())
    return command


class Warnings:
    """Tells each text once, above the progress bar."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._noted: set[str] = set()

    def note(self, text: str) -> None:
        """Tell `text`, if it is new: it is no warning."""
        if text and text not in self._noted:
            self._noted.add(text)
            tqdm.write(text, file=sys.stderr)

    def add(self, text: str) -> None:
        """Tell `text`, if it is new."""
        if text in self.texts:
            return
        self.texts.append(text)
        if len(self.texts) <= PRINTED_WARNINGS:
            tqdm.write(f'warning: {text}', file=sys.stderr)
        elif len(self.texts) == PRINTED_WARNINGS + 1:
            tqdm.write('warning: more of them are in summary.json', file=sys.stderr)


def _step(tracker: Tracker, cloud: RecordedCloud, stream: StreamConfig, writer: BagWriter | None,
          warnings: Warnings) -> Row:
    """Track one cloud; a broken one is a row without a pose."""
    stamp_ns = cloud.bag_time_ns
    start = time.perf_counter()
    try:
        stamp_ns, frame_id, message = cloud.read()
        warnings.note(choice_in_words(message, stream.label_field))
        scan = decode(message, label_field_of(message, stream.label_field))
        tracked = tracker.track(scan, stamp_ns)
    except InputError as error:
        warnings.add(f'scan at {stamp_ns * 1e-9:.3f} s left out: {error}')
        return Row(stamp_ns, str(error))
    seconds = time.perf_counter() - start
    for text in tracked.warnings:
        warnings.add(text)
    if not tracked.success:
        warnings.add(f'scan at {stamp_ns * 1e-9:.3f} s has no pose: {tracked.reason}')
    if writer:
        for topic, result in _results(writer, tracked, stream, frame_id):
            writer.write(topic, result, cloud.bag_time_ns)
    step = tracked.registration
    return Row(stamp_ns, tracked.reason, tracked.T_odom_sensor, tracked.restarted,
               None if step is None else int(step.inliers.sum()),
               math.nan if step is None else step.confidence, seconds, tracked.timings)


def _results(writer: BagWriter, tracked: TrackedScan, stream: StreamConfig, frame_id: str
             ) -> Iterator[tuple[str, Any]]:
    """Yield what the node would publish: topic and message."""
    types, odom = writer.types, stream.odom_frame
    if tracked.success:
        yield '/odometry', messages.odometry(types, tracked, odom, stream.sensor_frame or frame_id)
        yield '/pose', messages.pose_stamped(types, tracked, odom)
    yield '/correspondences', messages.correspondence_markers(types, tracked, odom)


def _summary(rows: list[Row], warnings: list[str], bag: Path, topic: str, tracker: Tracker,
             stream: StreamConfig) -> dict[str, Any]:
    stages = dict.fromkeys(stage for row in rows for stage in row.timings)
    return {
        'bag': str(bag), 'topic': topic, 'scans': len(rows),
        'successes': sum(row.T_odom_sensor is not None for row in rows),
        'failures': [{'scan': i, 'stamp_ns': row.stamp_ns, 'reason': row.reason}
                     for i, row in enumerate(rows) if row.T_odom_sensor is None],
        # the first scan of all is one of them
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


def _write(output: Path, rows: list[Row], summary: dict[str, Any], title: str) -> None:
    stamps_ns, poses = [row.stamp_ns for row in rows], [row.T_odom_sensor for row in rows]
    write_tum(output / 'trajectory.tum', stamps_ns, poses)
    write_kitti(output / 'trajectory_kitti.txt', poses)
    (output / 'summary.json').write_text(json.dumps(summary, indent=2) + '\n')
    plot_track(output / 'trajectory.png', title, [stamp * 1e-9 for stamp in stamps_ns], poses,
               [row.seconds for row in rows], [row.confidence for row in rows])


def _print(summary: dict[str, Any], output: Path) -> None:
    total = summary['timings_ms']['total']
    print(f'{summary["successes"]} of {summary["scans"]} scans have a pose; time per scan: median '
          f'{total["median"]:.0f} ms, p95 {total["p95"]:.0f} ms\n'
          f'wrote {output}: {", ".join(sorted(path.name for path in output.iterdir()))}')


if __name__ == '__main__':
    sys.exit(main())
