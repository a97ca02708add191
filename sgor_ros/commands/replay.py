"""`sgor_replay`: the tracker over a bag, without ROS; the same poses as the node's."""
from argparse import Namespace
from contextlib import ExitStack
from contextlib import nullcontext
from dataclasses import asdict
import json
import math
from pathlib import Path
import sys
from typing import Any

import numpy as np
from tqdm import tqdm

from .. import visualize
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.scan.labels import label_convention
from ..core.warmup import warm_up
from ..evaluation.report.track_plots import plot_track
from ..io.bags import BagReader
from ..io.bags import BagWriter
from ..io.bags import is_bag
from ..io.datasets import open_drive
from ..io.datasets.clouds import DriveReader
from ..io.environment import describe_environment
from ..io.stream_config import StreamConfig
from ..io.trajectories import write_kitti
from ..io.trajectories import write_tum
from ..io.writing import free_folder
from ..io.writing import new_folder
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .frame import FAILED
from .frame import OK
from .frame import Parser
from .frame import run
from .options import add_params_file
from .options import add_preset
from .options import add_settings
from .options import add_visualize
from .options import configured
from .options import PRESETS
from .options import read_parameters
from .replay_steps import Row
from .replay_steps import Steps
from .replay_steps import Warnings


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(replay, _parser().parse_args(argv))


def replay(arguments: Namespace) -> int:
    """Track the clouds of a bag and write the results; 1 where no scan could be registered."""
    parameters = read_parameters(arguments, SgorConfig, TrackerConfig, StreamConfig)
    stream = configured(StreamConfig(), arguments, parameters)
    drive = (None if is_bag(arguments.bag_path)
             else open_drive(arguments.bag_path, arguments.sequence))
    start = PRESETS[arguments.preset]()
    if drive is not None:
        start = start.replace(label_convention=drive.label_convention)
    tracker = Tracker(configured(start, arguments, parameters),
                      configured(TrackerConfig(), arguments, parameters))
    if arguments.visualize is not None:
        visualize.check(arguments.visualize)
    label_convention(tracker.config.label_convention)
    warnings = Warnings()
    rows: list[Row] = []
    broken: InputError | None = None
    with ExitStack() as stack:
        bag: BagReader | DriveReader = (
            stack.enter_context(BagReader(arguments.bag_path)) if drive is None
            else stack.enter_context(DriveReader(drive)))
        topic = arguments.topic or bag.find_topic(stream.label_field)
        clouds, expected = bag.clouds(topic), bag.cloud_topics()[topic]
        output: Path = arguments.output or free_folder(_usual_output(arguments))
        place = stack.enter_context(new_folder(output))
        place.mkdir()
        with BagWriter(place / 'bag') if arguments.bag else nullcontext() as writer:
            warm_up(tracker.config)
            look = (None if arguments.visualize is None else stack.enter_context(
                visualize.track_view(arguments.visualize, tracker.config)))
            steps = Steps(tracker, stream, writer, warnings, look)
            try:
                for cloud in tqdm(clouds, total=expected, unit='scan', disable=None):
                    rows.append(steps.take(cloud))
            except InputError as error:
                broken = error    # what came before is worth keeping
        if broken and not rows:
            raise broken
        if len(rows) < expected:
            warnings.add(f'{topic}: the bag tells of {expected} clouds, only {len(rows)} came')
        if all(row.T_odom_sensor is None for row in rows):
            raise InputError(f'{topic}: none of {len(rows)} clouds could be used: '
                             f'{rows[0].reason}')
        summary = _summary(rows, warnings.texts, arguments.bag_path, topic, tracker, stream)
        _write(place, rows, summary, f'{arguments.bag_path.name} {topic}')
    _print(summary, output)
    if broken:
        raise InputError(f'after {len(rows)} scans: {broken}')
    if len(rows) > 1 and all(row.T_odom_sensor is None or row.restarted for row in rows):
        print('error: no scan could be registered to another', file=sys.stderr)
        return FAILED
    return OK


def _parser() -> Parser:
    command = Parser(
        'sgor_replay', 'BAG [options]', 'Track the labelled clouds of a bag (ROS 2 mcap or '
        'sqlite3, ROS 1), or the scans of a folder (SemanticKITTI and others, see docs/data.md), '
        'and write trajectory.tum, trajectory_kitti.txt, summary.json and trajectory.png into a '
        'new folder.',
        ('sgor_replay bags/drive', 'sgor_replay sequences/08 --visualize',
         'sgor_replay drive.bag --topic /points --output out/first --bag'),
        'done; scans that failed are told and counted',
        'no scan could be registered to another; the results are written')
    command.add_argument('bag_path', type=Path, metavar='BAG', help='or folder of scans')
    command.add_argument('--topic', help='of the clouds; found where there is but one')
    command.add_argument('--sequence', metavar='NAME', help='of the drives of a folder; found '
                         'where there is but one')
    command.add_argument('--output', type=Path, metavar='FOLDER',
                         help='for the results, must not exist; default: out/NAME_replay with the '
                         'name of the bag, and _2, _3, ... behind it where that exists')
    command.add_argument('--bag', action='store_true',
                         help='also write a bag with /pose, /odometry and /correspondences')
    add_visualize(command)
    add_params_file(command)
    add_preset(command)
    add_settings(command, 'clouds and frames', StreamConfig)
    add_settings(command, 'tracker', TrackerConfig)
    add_settings(command, 'registration (defaults are those of the preset outdoor)', SgorConfig)
    return command


def _usual_output(arguments: Namespace) -> Path:
    """Return a folder that is not the bag's own, where a bag lies in out/ too."""
    bag: Path = arguments.bag_path
    name = arguments.sequence or (bag.resolve().name if bag.is_dir() else bag.stem)
    return Path('out') / f'{name.replace("/", "_")}_replay'


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
