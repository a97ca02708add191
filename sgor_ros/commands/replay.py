"""`sgor_replay`: the pipeline of the node over a bag or a folder, without ROS."""
from argparse import Namespace
from contextlib import ExitStack
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
import sys
from typing import TYPE_CHECKING

import numpy as np

from .. import visualize
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.scan.labels import label_convention
from ..core.warmup import warm_up
from ..evaluation.metrics.trajectory import require_evo
from ..io.bags import BagReader
from ..io.bags import BagWriter
from ..io.bags import is_bag
from ..io.datasets import open_drive
from ..io.datasets.bags import BagSequence
from ..io.label_field import AUTO
from ..io.label_field import NONE
from ..io.sequence import ScanSequence
from ..io.stream_config import StreamConfig
from ..io.terminal import progress
from ..io.writing import free_folder
from ..io.writing import new_folder
from ..mapping import Mapper
from ..mapping import MapperConfig
from ..pipeline import extrinsic
from ..pipeline.outcome import Row
from ..pipeline.pipeline import Pipeline
from ..pipeline.sinks import BagSink
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .command_line import FAILED
from .command_line import OK
from .command_line import Parser
from .command_line import run
from .options import add_labels
from .options import add_params_file
from .options import add_preset
from .options import add_settings
from .options import add_visualize
from .options import configured
from .options import PRESETS
from .options import read_parameters
from .replay_map import write_map
from .replay_results import print_results
from .replay_results import summary_of
from .replay_results import Warnings
from .replay_results import write_results
from .replay_truth import compared
from .replay_truth import GivenTruth
from .replay_truth import read_truth
from .replay_truth import true_poses
from .replay_truth import Truth
from .replay_truth import WITHOUT_EVO

if TYPE_CHECKING:
    from ..visualize.track import TrackView


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(replay, _parser().parse_args(argv))


def replay(arguments: Namespace) -> int:
    """Track the scans of a bag or folder and write the results; 1 where none was registered."""
    parameters = read_parameters(arguments, SgorConfig, TrackerConfig, MapperConfig, StreamConfig)
    stream = configured(StreamConfig(), arguments, parameters)
    mount = extrinsic.configured(stream)
    if stream.base_frame and mount is None:
        raise InputError(f'base_frame = {stream.base_frame!r}: the replay has no tf2 to look it '
                         'up, so it needs T_base_sensor')
    if arguments.visualize is not None:
        visualize.check(arguments.visualize)
    given = None
    if arguments.truth is not None:
        require_evo()
        given = read_truth(arguments.truth, arguments.bag_path)    # told before the work
    with ExitStack() as stack:
        sequence = open_sequence(arguments, stream, stack)
        start = PRESETS[arguments.preset]()
        if sequence.label_convention is not None:
            start = start.replace(label_convention=sequence.label_convention)
        settings = (configured(start, arguments, parameters),
                    configured(TrackerConfig(), arguments, parameters))
        mapper = (Mapper(*settings, configured(MapperConfig(), arguments, parameters))
                  if arguments.loops else None)
        tracker = Tracker(*settings) if mapper is None else mapper.tracker
        label_convention(tracker.config.label_convention)
        output: Path = arguments.output or free_folder(_usual_output(arguments))
        place = stack.enter_context(new_folder(output))
        place.mkdir()
        warnings = Warnings()
        for text in sequence.warnings:
            warnings.add(text)
        with BagWriter(place / 'bag') if arguments.bag else nullcontext() as writer:
            warm_up(tracker.config)
            view = (None if arguments.visualize is None else stack.enter_context(
                visualize.track_view(arguments.visualize, tracker.config)))
            pipeline = Pipeline(mapper or tracker, stream, BagSink(writer) if writer else None,
                                mount)
            rows, broken = run_sequence(sequence, pipeline, view, warnings)
        T_base_sensor = np.eye(4) if mount is None else mount(0, '')
        assert not isinstance(T_base_sensor, str), 'it is fixed'
        truth = _truth(given, sequence, rows, warnings)
        summary = summary_of(rows, warnings.texts, arguments.bag_path, sequence.name, tracker,
                             stream)
        summary['truth'], shown = compared(rows, truth, T_base_sensor)
        title = f'{arguments.bag_path.name} {sequence.name}'
        if mapper is not None:
            mapper.finish()
            summary['map'] = write_map(place, mapper, rows, T_base_sensor, truth, title)
        write_results(place, rows, summary, title, shown)
    print_results(summary, output)
    if broken:
        raise InputError(f'after {len(rows)} scans: {broken}')
    if len(rows) > 1 and all(row.T_odom_child is None or row.restarted for row in rows):
        print('error: no scan could be registered to another', file=sys.stderr)
        return FAILED
    return OK


def open_sequence(arguments: Namespace, stream: StreamConfig, stack: ExitStack) -> ScanSequence:
    """Open the bag or the folder."""
    if is_bag(arguments.bag_path):
        bag = stack.enter_context(BagReader(arguments.bag_path))
        if arguments.labels is not None:
            raise InputError(f'--labels {arguments.labels}: the clouds of a bag have theirs in a '
                             'field, see --label-field')
        topic = arguments.topic or bag.find_topic(stream.label_field)
        return BagSequence(bag, topic, stream.label_field, stream.time_field)
    drive = open_drive(arguments.bag_path, arguments.sequence, arguments.labels)
    if stream.label_field not in (AUTO, NONE):
        raise InputError(f'label_field = {stream.label_field!r}: only the clouds of a bag have '
                         f'fields; for a folder it is {AUTO} or {NONE}')
    return drive if stream.label_field == AUTO else drive.without_labels()


def _truth(given: GivenTruth | None, sequence: ScanSequence, rows: list[Row],
           warnings: Warnings) -> Truth:
    """Return the true poses; those that do not fit cost no results."""
    try:
        truth = true_poses(given, sequence, rows)
    except InputError as error:
        warnings.add(str(error))
        return [None] * len(rows)
    if find_spec('evo') is None and any(T is not None for T in truth):
        warnings.note(WITHOUT_EVO)
    return truth


def run_sequence(sequence: ScanSequence, pipeline: Pipeline, view: 'TrackView | None',
                 warnings: Warnings) -> tuple[list[Row], InputError | None]:
    """Return a row for each scan, and what a bag broke off with, if there were scans before."""
    rows: list[Row] = []
    broken: InputError | None = None
    try:
        with progress(sequence.name, sequence.expected, 'scan') as told:
            for scan in told.over(sequence):
                warnings.note(scan.note)
                outcome = pipeline.process(scan)
                if view and outcome.scan is not None and outcome.tracked is not None:
                    view.show(outcome.scan, outcome.tracked)
                warnings.add_those_of(outcome)
                rows.append(outcome.row())
    except InputError as error:
        broken = error    # what came before is worth keeping
    if broken and not rows:
        raise broken
    if sequence.expected is not None and len(rows) < sequence.expected:
        warnings.add(f'{sequence.name}: the bag tells of {sequence.expected} clouds, only '
                     f'{len(rows)} came')
    if all(row.T_odom_child is None for row in rows):
        raise InputError(f'{sequence.name}: none of {len(rows)} clouds could be used: '
                         f'{rows[0].reason}')
    return rows, broken


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
    command.add_argument('-t', '--topic', help='of the clouds; found where there is but one')
    command.add_argument('--sequence', metavar='NAME', help='of the drives of a folder; found '
                         'where there is but one')
    command.add_argument('-o', '--output', type=Path, metavar='FOLDER',
                         help='for the results, must not exist; default: out/NAME_replay with the '
                         'name of the bag, and _2, _3, ... behind it where that exists')
    command.add_argument('--truth', metavar='FILE', help='true poses of the sensor to compare '
                         'with: TUM (by time) or KITTI (a line for each scan), or a topic of the '
                         'bag (odometry, stamped poses or transforms); default: those that come '
                         'with the data')
    add_labels(command)
    command.add_argument('--bag', action='store_true',
                         help='also write a bag with /pose, /odometry and /correspondences')
    command.add_argument('--loops', action='store_true', help='close loops: also write corrected '
                         'trajectories, graph.g2o with the stamps of its nodes, map.ply, map.pcd '
                         'and loops.png')
    add_visualize(command)
    add_params_file(command)
    add_preset(command)
    add_settings(command, 'clouds and frames', StreamConfig)
    add_settings(command, 'tracker', TrackerConfig)
    add_settings(command, 'loops', MapperConfig)
    add_settings(command, 'registration', SgorConfig)
    return command


def _usual_output(arguments: Namespace) -> Path:
    """Return a folder that is not the bag's own, where a bag lies in out/ too."""
    bag: Path = arguments.bag_path
    name = arguments.sequence or (bag.resolve().name if bag.is_dir() else bag.stem)
    return Path('out') / f'{name.replace("/", "_")}_replay'


if __name__ == '__main__':
    sys.exit(main())
