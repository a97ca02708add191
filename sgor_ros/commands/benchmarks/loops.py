"""`sgor_benchmark loops`: the mapper on drives that come back."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

import numpy as np

from ...core.common.settings import InputError
from ...evaluation.loops import LoopRun
from ...evaluation.loops import OtherRun
from ...evaluation.loops import run_loops
from ...evaluation.loops import run_other
from ...evaluation.methods.loop_closing import loop_closers
from ...evaluation.metrics.trajectory import require_evo
from ...evaluation.protocols.returns import there_and_back
from ...evaluation.report.loop_plots import plot_loops
from ...evaluation.report.loop_table import loop_records
from ...evaluation.report.loop_table import loop_table
from ...evaluation.report.loop_table import OTHERS_RULE
from ...evaluation.report.loop_table import others_table
from ...evaluation.report.loop_table import RULE
from ...io.datasets import Drive
from ...mapping.map_cloud import map_cloud
from ..scene_pairs import return_drive
from ..scene_pairs import scene_kinds
from . import inputs
from .numbers import positive

STREET = 'street'
HELP = 'loop closure: how many are found, how many are wrong, and what they are worth'


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--back', type=float, metavar='DEG', help='let every other scan of a '
                         'drive come back from its end, with the sensor turned by so much')
    command.add_argument('--no-labels', action='store_true', help='map without labels')
    command.add_argument('--random-labels', type=float, default=0.0, metavar='SHARE',
                         help='of the points in the built-in world')
    command.add_argument('--beams', type=positive, default=64, help='in the world')
    command.add_argument('--seeds', type=positive, default=1, help='places of each kind there')
    command.add_argument('--way', type=float, default=400.0, metavar='M', help='there, before it '
                         'turns round and comes back')
    command.add_argument('--kinds', nargs='+', metavar='KIND', default=[STREET],
                         help='of places there; default: the street, which is no other kind')
    command.add_argument('--others', action='store_true',
                         help='also map-closures and KISS-SLAM, where they are installed')


def measure(arguments: Namespace, folder: Path) -> None:
    """Map each drive and judge its loops."""
    require_evo()
    config = inputs.default_config(arguments)
    drives = [drive for drive in inputs.data_drives(arguments)
              if drive.T_world_sensor is not None and len(drive) > 1]
    if arguments.back is not None:
        drives = [there_and_back(drive, np.radians(arguments.back)) for drive in drives]
    makers = loop_closers(inputs.say) if arguments.others else {}
    runs: list[LoopRun] = []
    others: list[OtherRun] = []

    def run(drive: Drive) -> None:
        runs.append(run_loops(drive.without_labels() if arguments.no_labels else drive, config))
        others.extend(run_other(name, make, drive, runs[-1].mapper)
                      for name, make in makers.items())

    for drive in drives:
        run(drive)
    if inputs.wants_world(arguments):
        from ...world import Lidar
        lidar = Lidar(beams=arguments.beams, label_noise=arguments.random_labels)
        scene_kinds([kind for kind in arguments.kinds if kind != STREET])
        for kind in arguments.kinds:
            for seed in range(arguments.seed, arguments.seed + arguments.seeds):
                inputs.say(f'{kind}, seed {seed}: scanning')
                run(return_drive(kind, arguments.way, seed, lidar))
    if not runs:
        raise InputError(f'{arguments.data}: no drive with two scans and poses.txt')
    parts = [loop_table(runs), RULE]
    if others:
        parts += [others_table(runs, others), OTHERS_RULE]
    inputs.finish(arguments, folder, '\n\n'.join(parts), loop_records(runs))
    first = runs[0].mapper
    stamp_of, (stamps_ns, after) = first.node_stamps_ns(), first.trajectory()
    at = {stamp: i for i, stamp in enumerate(stamps_ns.tolist())}
    plot_loops(folder / 'plot.png', runs[0].drive, first.trajectory(loops=False).T_map_sensor,
               after, [(at[stamp_of[loop.target]], at[stamp_of[loop.source]])
                       for loop in first.graph.loops],
               map_cloud(first.keyframes, first.graph)[0])
