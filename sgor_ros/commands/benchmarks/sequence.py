"""`sgor_benchmark sequence`: odometries on drives."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation.methods import odometries
from ...evaluation.metrics.trajectory import require_evo
from ...evaluation.report import plots
from ...evaluation.report import tables
from ...evaluation.report.consistency_table import consistency_table
from ...evaluation.report.consistency_table import RULE
from ...evaluation.sequences import run_drive
from ...io.datasets import Drive
from ..scene_pairs import scene_drive
from ..scene_pairs import scene_kinds
from . import inputs
from .numbers import count

HELP = 'odometry: drift, time a scan, and whether its covariance holds'


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--scans', type=count, default=120, help='of each drive, and of the '
                         'street of the built-in world; 0: none')
    command.add_argument('--per-kind', type=count, default=40, metavar='COUNT', help='scans of a '
                         'drive through each other kind of place in the built-in world; 0: none')
    command.add_argument('--no-labels', action='store_true', help='also track without labels')
    inputs.add_kinds(command)
    command.add_argument('--speed', type=float, default=6.0, metavar='M/S', help='in the world')


def measure(arguments: Namespace, folder: Path) -> None:
    """Compare odometries on drives, and the covariance that the tracker claims with the truth."""
    require_evo()
    config = inputs.default_config(arguments)
    drives = [drive for drive in inputs.data_drives(arguments) if drive.T_world_sensor is not None
              and drive.heights_known and len(drive.scans) > 1]
    drives = [Drive(drive.name, drive.scans[:arguments.scans], drive.T_world_sensor)
              for drive in drives if arguments.scans > 1]
    if inputs.wants_world(arguments) and arguments.scans > 1:
        drives.append(inputs.world_drive(arguments.seed, arguments.scans, arguments.speed))
    kinds = (scene_kinds(arguments.kinds or ())
             if inputs.wants_world(arguments) and arguments.per_kind > 1 else {})
    if not drives and not kinds:
        raise InputError(f'{arguments.data or "world"}: no drive with two scans and poses.txt, '
                         'good in z')
    makers = odometries.odometries(config, inputs.say, unlabelled=arguments.no_labels)
    tracks = [track for drive in drives for track in run_drive(drive, makers, config)]
    makers = odometries.trackers(config, unlabelled=arguments.no_labels)
    for number, kind in enumerate(kinds, 1):
        inputs.say(f'{kind}, {number} of {len(kinds)} kinds: scanning')
        drive = scene_drive(kind, arguments.per_kind, arguments.seed)
        tracks += run_drive(drive, makers, config)
    text = '\n\n'.join((tables.sequence_table(tracks), consistency_table(tracks), RULE))
    inputs.finish(arguments, folder, text, tables.scan_records(tracks))
    plots.plot_sequences(folder / 'plot.png', tracks)
