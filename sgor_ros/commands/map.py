"""`sgor_map`: build a map that stays, find scans in it, merge, export and show it."""
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
import sys
from typing import Any

import numpy as np

from .. import visualize
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.warmup import warm_up
from ..evaluation.report.map_plots import plot_map
from ..io.executors import executor
from ..io.grid_files import write_grid
from ..io.map_files import write_map_pcd
from ..io.map_files import write_map_ply
from ..io.plots import PICTURES
from ..io.scans import read_scan
from ..io.stream_config import StreamConfig
from ..io.writing import check_file
from ..io.writing import new_file
from ..io.writing import STDOUT
from ..mapping import Located
from ..mapping import Map
from ..mapping import Mapper
from ..mapping import MapperConfig
from ..mapping.map_cloud import joined_cloud
from ..mapping.maps.occupancy import occupancy_grid
from ..pipeline import extrinsic
from ..pipeline.pipeline import Pipeline
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
from .replay import open_sequence
from .replay import run_sequence
from .replay_results import Warnings
from .result_output import tell

EXPORTS = ('.ply', '.pcd', '.yaml')


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    arguments = _parser().parse_args(argv)
    act: Callable[[Namespace], int] = arguments.act
    return run(act, arguments)


def build(arguments: Namespace) -> int:
    """Map a drive, in a map of before where there is one; 1 where it was not found in it."""
    known = None if arguments.map is None else _loaded(arguments.map)
    parameters = read_parameters(arguments, SgorConfig, TrackerConfig, MapperConfig, StreamConfig)
    stream = configured(StreamConfig(), arguments, parameters)
    start = known or Map(config=PRESETS[arguments.preset]())
    with ExitStack() as stack:
        sequence = open_sequence(arguments, stream, stack)
        if known is None and sequence.label_convention is not None:
            start = Map(config=start.config.replace(label_convention=sequence.label_convention))
        config = configured(start.config, arguments, parameters)
        mapper = Mapper(config, configured(start.tracker_config, arguments, parameters),
                        configured(start.mapper_config, arguments, parameters), map=known)
        if mapper.graph.missing:
            raise InputError(mapper.graph.missing)
        warm_up(config)
        warnings = Warnings()
        pipeline = Pipeline(mapper, stream, None, extrinsic.configured(stream))
        rows, broken = run_sequence(sequence, pipeline, None, warnings)
        mapper.finish()
    made = mapper.map
    if known is not None and len(made.nodes) == len(known.nodes):
        print('error: the drive was not found in the map', file=sys.stderr)
        return FAILED
    made.save(arguments.output)
    print(f'{_in_words(made)} from {len(rows)} scans, {len(mapper.graph.loops)} loops; wrote '
          f'{arguments.output}')
    if broken:
        raise InputError(f'after {len(rows)} scans: {broken}')
    return OK


def locate(arguments: Namespace) -> int:
    """Find a scan in a map and tell where it was taken; 1 where it is not found."""
    if arguments.json not in (None, STDOUT):
        check_file(arguments.json, '--json')
    known = _loaded(arguments.map)
    found = _found(known, arguments)
    tell(_where(found), _as_dict(found, arguments), arguments.json)
    return OK if found.success else FAILED


def merge(arguments: Namespace) -> int:
    """Make one map of two and write it; 1 where they share nothing."""
    if arguments.processes < 1:
        raise InputError(f'--processes {arguments.processes}: expected 1 or more')
    # workers read the scans by the same paths
    known, other = (_loaded(folder.resolve()) for folder in (arguments.map, arguments.other))
    warm_up(known.config)
    print(f'looking for {len(other.keyframes)} keyframes of {arguments.other} in {arguments.map}',
          file=sys.stderr)
    with executor(arguments.processes, arguments.dask) as workers:
        merged = known.merge(other, workers)
    if merged.map is None:
        print(f'not merged: {merged.reason}')
        return FAILED
    merged.map.save(arguments.output)
    print(f'{_in_words(merged.map)}: {merged.found} keyframes of the second were found in the '
          f'first, {len(merged.loops)} loops; wrote {arguments.output}')
    return OK


def export(arguments: Namespace) -> int:
    """Write the map as a cloud, or as an occupancy grid."""
    output: Path = arguments.output
    check_file(output, 'OUTPUT', EXPORTS)
    known = _loaded(arguments.map)
    if output.suffix.lower() == '.yaml':
        grid = occupancy_grid(known.scans(of_base=True), arguments.resolution)
        write_grid(output, grid)
        height, width = grid.cells.shape
        print(f'{width} x {height} cells of {grid.resolution:g} m; wrote {output} and '
              f'{output.with_suffix(".pgm")}')
        return OK
    points, labels = joined_cloud(known.scans(of_base=True))
    write = write_map_ply if output.suffix.lower() == '.ply' else write_map_pcd
    with new_file(output) as place:
        write(place, points, labels)
    print(f'{len(points)} points; wrote {output}')
    return OK


def show(arguments: Namespace) -> int:
    """Tell what the map holds, and draw it; with a scan, where it was found."""
    if arguments.output:
        check_file(arguments.output, '--output', PICTURES)
    if arguments.visualize is not None:
        visualize.check(arguments.visualize)
    known = _loaded(arguments.map)
    print(_in_words(known))
    for session in known.sessions:
        nodes = [node for node in known.nodes.values() if node.session == session]
        stamps = [node.stamp_ns * 1e-9 for node in nodes]
        print(f'session {session}: {len(nodes)} nodes, {min(stamps):.3f} to {max(stamps):.3f} s')
    found = _found(known, arguments) if arguments.scan else None
    if found is not None:
        print(_where(found))
    if arguments.output:
        points, _ = joined_cloud(known.scans())
        plot_map(arguments.output, f'{arguments.map.resolve().name}: {_in_words(known)}', known,
                 points, found)
        print(f'wrote {arguments.output}')
    if arguments.visualize is not None:
        with visualize.map_view(arguments.visualize) as look:
            look.show(known, found, '\n'.join((_in_words(known), _where(found) if found else '')))
    return OK if found is None or found.success else FAILED


def _loaded(folder: Path) -> Map:
    known = Map.load(folder)
    for warning in known.warnings:
        print(f'warning: {warning}', file=sys.stderr)
    return known


def _found(known: Map, arguments: Namespace) -> Located:
    scan = read_scan(arguments.scan, arguments.labels)
    warm_up(known.config)
    return known.locate(scan)


def _in_words(known: Map) -> str:
    of = f' of {len(known.sessions)} drives' if len(known.sessions) > 1 else ''
    return f'a map{of} with {len(known.nodes)} nodes and {len(known.keyframes)} keyframes'


def _where(found: Located) -> str:
    lines = []
    if found.success and found.T_map_sensor is not None:
        lines += ['T_map_sensor', *(' '.join(f'{v:14.9f}' for v in row)
                                    for row in found.T_map_sensor)]
        lines.append(f'found: by keyframe {found.keyframe}, confidence {found.confidence:.3f}, '
                     f'{found.attempts} registrations')
        if found.covariance is not None:
            sigma = np.sqrt(np.diag(found.covariance)[:3])
            lines.append('standard deviation x y z '
                         + ' '.join(f'{100 * s:.1f}' for s in sigma) + ' cm')
        return '\n'.join(lines)
    lines.append(f'not found, {found.status}: {found.reason}')
    if found.alternatives and found.T_map_sensor is not None:
        for T in (found.T_map_sensor, *(place.T_map_sensor for place in found.alternatives)):
            lines.append('perhaps at ' + ' '.join(f'{v:.2f}' for v in T[:3, 3]) + ' m')
    return '\n'.join(lines)


def _as_dict(found: Located, arguments: Namespace) -> dict[str, Any]:
    T, covariance = found.T_map_sensor, found.covariance
    return {
        'map': str(arguments.map), 'scan': str(arguments.scan), 'success': found.success,
        'status': found.status.value, 'reason': found.reason, 'confidence': found.confidence,
        # one that nothing agrees with is nothing to build on
        'T_map_sensor': T.tolist() if T is not None and (
            found.success or found.alternatives) else None,
        'covariance': None if covariance is None else covariance.tolist(),
        'keyframe': found.keyframe, 'attempts': found.attempts,
        'alternatives': [place.T_map_sensor.tolist() for place in found.alternatives]}


def _parser() -> Parser:
    top = Parser(
        'sgor_map', 'COMMAND [options]', 'Build a map that stays, find scans in it without a '
        'guess, merge maps, export and show them.',
        ('sgor_map build bags/monday --output maps/yard',
         'sgor_map locate maps/yard scan.bin', 'sgor_map show maps/yard --output yard.png'),
        failed='not found, or not merged; the reason is told')
    commands = top.add_subparsers(required=True, dest='command', metavar='COMMAND')

    def command(act: Callable[[Namespace], int], usage: str, example: str) -> Parser:
        described = (act.__doc__ or '').partition(';')[0].rstrip('.')
        name = act.__name__
        made: Parser = commands.add_parser(
            name, help=described[0].lower() + described[1:], prog=f'sgor_map {name}', usage=usage,
            description=f'{described}.', examples=(f'sgor_map {name} {example}',),
            failed='not found, or not merged; the reason is told')
        made.set_defaults(act=act)
        return made

    one = command(build, 'DRIVE --output MAP [options]', 'bags/tuesday --map maps/yard '
                  '--output maps/yard')
    one.add_argument('bag_path', type=Path, metavar='DRIVE', help='bag, or folder of scans')
    _add_output(one)
    one.add_argument('--map', type=Path, metavar='MAP', help='to go on in; its settings are taken')
    one.add_argument('-t', '--topic', help='of the clouds; found where there is but one')
    one.add_argument('--sequence', metavar='NAME', help='of the drives of a folder; found where '
                     'there is but one')
    add_labels(one)
    add_params_file(one)
    add_preset(one)
    for title, settings in (('clouds and frames', StreamConfig), ('tracker', TrackerConfig),
                            ('loops', MapperConfig), ('registration', SgorConfig)):
        add_settings(one, title, settings)
    one = command(locate, 'MAP SCAN [options]', 'maps/yard scan.bin --json found.json')
    _add_map(one)
    one.add_argument('scan', type=Path, metavar='SCAN', help='.bin, .pcd, .ply or .npz')
    _add_labels(one)
    one.add_argument('-j', '--json', type=Path, metavar='FILE', help='write the result to; an '
                     'older file is replaced; - for standard output')
    one = command(merge, 'MAP OTHER --output MAP', 'maps/yard maps/street --output maps/both')
    _add_map(one)
    one.add_argument('other', type=Path, metavar='OTHER', help='of the same place, in part')
    _add_output(one)
    one.add_argument('--processes', type=int, default=1, metavar='INT', help='to locate keyframes '
                     'in')
    one.add_argument('--dask', default='', metavar='ADDRESS', help='of a scheduler, to locate '
                     'them on its workers, which see both maps by the same paths')
    one = command(export, 'MAP OUTPUT [options]', 'maps/yard yard.yaml --resolution 0.05')
    _add_map(one)
    one.add_argument('output', type=Path, metavar='OUTPUT', help='.ply or .pcd for the cloud; '
                     '.yaml for an occupancy grid with its .pgm, as map_server of nav2 reads it')
    one.add_argument('--resolution', type=float, default=0.1, help='edge of a cell, m')
    one = command(show, 'MAP [options]', 'maps/yard --output yard.png --scan scan.bin')
    _add_map(one)
    one.add_argument('-o', '--output', type=Path, metavar='PICTURE',
                     help=f'({", ".join(PICTURES)})')
    one.add_argument('--scan', type=Path, metavar='SCAN', help='to find in it')
    _add_labels(one)
    add_visualize(one)
    return top


def _add_map(to: Parser) -> None:
    to.add_argument('map', type=Path, metavar='MAP', help='folder that `sgor_map build` or '
                    '`Map.save` wrote')


def _add_output(to: Parser) -> None:
    to.add_argument('-o', '--output', type=Path, metavar='MAP', required=True, help='folder of '
                    'the map; a map that is there is replaced once the new one is complete')


def _add_labels(to: Parser) -> None:
    to.add_argument('--labels', type=Path, metavar='FILE', help='of the scan')


if __name__ == '__main__':
    sys.exit(main())
