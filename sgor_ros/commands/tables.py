"""`sgor_tables`: the tables and studies of the paper, on your data or in the built-in world."""
from argparse import Namespace
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
import sys
from typing import Any

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.warmup import warm_up
from ..evaluation.front_end import Features
from ..evaluation.methods import available
from ..evaluation.methods import Method
from ..evaluation.methods import ON_MATCHES
from ..evaluation.methods import ON_SCANS
from ..evaluation.methods import sgor
from ..evaluation.methods import sgor_solver
from ..evaluation.methods.interface import OnMatches
from ..evaluation.protocols import pairs as pairing
from ..evaluation.protocols import studies
from ..evaluation.protocols.ablation import PAPER_ROWS
from ..evaluation.protocols.drives import posed
from ..evaluation.protocols.drives import strided
from ..evaluation.protocols.indoor import depth_frames
from ..evaluation.protocols.indoor import threedmatch
from ..evaluation.protocols.kitti import kitti_10m
from ..evaluation.protocols.kitti import kitti_10m_list
from ..evaluation.protocols.kitti import kitti_loops
from ..evaluation.protocols.match_files import given_matches
from ..evaluation.protocols.protocol import Protocol
from ..evaluation.protocols.truth import refined
from ..evaluation.report import page
from ..evaluation.runner import run
from ..io.datasets import Drive
from ..io.datasets import DriveScan
from ..io.datasets import open_drives
from ..io.terminal import show
from ..io.writing import STDOUT
from . import command_line
from .benchmarks import inputs

SPEED_M_S = 8.0
ABLATION = 'ablation'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return command_line.run(_tables, _parser().parse_args(arguments))


def _parser() -> command_line.Parser:
    parser = command_line.Parser(
        'sgor_tables', 'PROTOCOL [options]',
        'Run a protocol of the literature with every method on the same matches, and print its '
        'table beside the published rows. Stopped, it goes on where it was when it is started '
        'again with the same --output.',
        ('sgor_tables strides', 'sgor_tables kitti-10m --data sequences --output out/kitti'))
    add = parser.add_argument

    def rare(*names: str, **details: Any) -> None:
        parser.leave_out(add(*names, **details))

    add('protocol', choices=list(PROTOCOLS),
        help='kitti-10m: the 555 pairs by their rule or --list; kitti-loops: lists of loops in '
        'bands; 3dmatch: fragments and gt.log, 3DLoMatch likewise; depth: single depth maps; '
        'strides: keyframes so many apart; poses: all pairs of posed scans up to a distance, and '
        'of pairs.json; matches: from files')
    add('--data', type=Path, metavar='FOLDER',
        help='with folders velodyne, labels and poses.txt up to two levels below, or the scenes '
        'of 3DMatch; without it the built-in world')
    add('--list', type=Path, nargs='+', metavar='FILE', default=(),
        help='pairs with their truth: rows of "sequence i sequence j" and a 4x4 matrix')
    rare('--refine-truth', action='store_true',
        help='refine the truth by ICP, kept in OUTPUT/truth.json')
    rare('--strides', type=int, nargs='+', metavar='N', default=(1, 2, 4))
    rare('--max-distance', type=float, metavar='M', default=30.0)
    rare('--sets', default='*', metavar='GLOB', help='names of the sets of matches')
    rare('--inlier', type=float, default=0.6, metavar='M',
        help='of matches from files: 0.1 indoors')
    rare('--scans', type=int, default=120, help='of the built-in world')
    add('--limit', type=int, default=0, metavar='PAIRS', help='evenly spread; 0: all')
    add('--methods', nargs='+', metavar='NAME', help='of the table; default: all that there are')
    rare('--method', action='append', default=[], metavar='MODULE:FUNCTION',
        help='one of your own: takes Matches, returns an Answer')
    add('--raw', action='store_true',
        help='also what registers raw scans: SGOR with all of ours, and KISS-Matcher')
    add('--study', choices=[*studies.STUDIES, ABLATION], default='',
        help='repeat for different numbers of matches, categories or random labels; ablation: '
        'rows 1 to 9 of the paper')
    rare('--values', type=float, nargs='+', help='of the study')
    rare('--front-end', choices=['protocol', 'paper'], default='protocol',
        help="who makes the matches: the relatives' voxels and radii, or SgorConfig.paper()")
    rare('--features', type=Path, metavar='FOLDER',
        help='NAME.npz for each scan with points (V, 3) and descriptors (V, D)')
    rare('--seed', type=int, default=0)
    add('--processes', type=int, default=1)
    rare('--dask', default='', metavar='ADDRESS', help='of a scheduler, to run on its workers')
    add('-o', '--output', type=Path, metavar='FOLDER', help='default: out/PROTOCOL')
    return parser


def _tables(arguments: Namespace) -> int:
    output: Path = arguments.output or Path('out') / arguments.protocol
    if output == STDOUT:
        raise InputError('--output -: a folder is written, which standard output cannot take')
    protocol = PROTOCOLS[arguments.protocol](arguments)
    if not protocol.pairs:
        raise InputError(f'no pair of {protocol.name} in {arguments.data or "the built-in world"}'
                         + (f'; {protocol.missing} in the list, their scans are not there'
                            if protocol.missing else ''))
    protocol = _spread(protocol, arguments.limit)
    if arguments.front_end == 'paper':
        protocol = replace(protocol, front_end=SgorConfig.paper())
    if arguments.refine_truth:
        protocol = replace(protocol, pairs=refined(protocol.pairs, output / 'truth.json'))
    study = '' if arguments.study == ABLATION else arguments.study
    methods = _methods(arguments, protocol)
    inputs.say(f'{protocol.name}: {len(protocol.pairs)} pairs, {len(methods)} methods; {output}')
    warm_up(protocol.front_end)
    features = None if arguments.features is None else Features(arguments.features)
    rows = run(protocol, methods, output, features=features,
               variants=studies.variants(study, arguments.values, arguments.seed),
               processes=arguments.processes, dask=arguments.dask, data=_data(arguments))
    inputs.say(page.keep_earlier(output, rows))
    show(page.write(output, rows, protocol, methods, study, features))
    return command_line.OK


def _data(arguments: Namespace) -> str:
    """Return what the pairs are of; their names alone do not tell."""
    if arguments.data is None:
        return f'built-in world, seed {arguments.seed}, {arguments.scans} scans'
    return str(arguments.data.resolve())


def _methods(arguments: Namespace, protocol: Protocol) -> list[Method]:
    own = protocol.front_end
    if arguments.study == ABLATION:
        configs = {row.method: own.replace(**row.changes) for row in PAPER_ROWS}
        return [sgor_solver(name, config, config) for name, config in configs.items()]
    methods = [sgor_solver('SGOR', own), *available(ON_MATCHES, inputs.say).values()]
    if arguments.raw and all(pair.matches is None for pair in protocol.pairs):
        methods += [sgor('SGOR, all of ours, from scans', _everything(protocol)),
                    *available(ON_SCANS, inputs.say).values()]
    if arguments.methods:
        known = {method.name: method for method in methods}
        wrong = [name for name in arguments.methods if name not in known]
        if wrong:
            raise InputError(f'--methods {wrong[0]}: not one of {", ".join(known)}')
        methods = [known[name] for name in arguments.methods]
    return methods + [Method(name, on_matches=_imported(name)) for name in arguments.method]


def _everything(protocol: Protocol) -> SgorConfig:
    return SgorConfig.indoor() if 'depth' in protocol.name or '3d' in protocol.name \
        else SgorConfig()


def _imported(name: str) -> OnMatches:
    module, _, function = name.partition(':')
    sys.path.insert(0, '')
    try:
        found: OnMatches = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f'--method {name}: expected MODULE:FUNCTION: {error}') from error
    return found


def _drives(arguments: Namespace) -> list[Drive]:
    if arguments.data is not None:
        drives = [d for d in open_drives(arguments.data) if d.T_world_sensor is not None]
        if not drives:
            raise InputError(f'--data {arguments.data}: no drive with poses.txt in it')
        return drives
    return [inputs.world_drive(arguments.seed, arguments.scans, SPEED_M_S)]


def _kitti_10m(arguments: Namespace) -> Protocol:
    if arguments.list:
        return kitti_10m_list(arguments.list[0], _finder(arguments))
    drives = _drives(arguments)
    return kitti_10m(drives, [d.T_world_sensor[:, :3, 3] for d in drives
                              if d.T_world_sensor is not None])


def _poses(arguments: Namespace) -> Protocol:
    listed = (pairing.listed_pairs(arguments.data, arguments.max_distance)
              if arguments.data else [])
    return posed(_drives(arguments), arguments.max_distance, listed)


def _matches(arguments: Namespace) -> Protocol:
    if arguments.data is None:
        raise InputError('matches: name the folder of the sets by --data')
    return given_matches(arguments.data, arguments.sets, arguments.inlier)


def _kitti_loops(arguments: Namespace) -> Protocol:
    if not arguments.list:
        raise InputError('kitti-loops: name the lists by --list')
    return kitti_loops(arguments.list, _finder(arguments))


def _finder(arguments: Namespace) -> Callable[[int, int], DriveScan | None]:
    """Return what finds scan i of a sequence: in a folder of its number."""
    if arguments.data is None:
        raise InputError('--list needs --data: the folder of the sequences')
    drives = {d.name.rpartition('/')[2]: {frame.name.rpartition('/')[2]: frame
                                          for frame in d.scans}
              for d in open_drives(arguments.data)}
    return lambda sequence, scan: drives.get(f'{sequence:02d}', {}).get(f'{scan:06d}')


def _indoor(arguments: Namespace, *, depth: bool) -> Protocol:
    if arguments.data is None:
        raise InputError('3dmatch and depth have no built-in world: name a folder by --data')
    return (depth_frames(arguments.data, arguments.strides[0]) if depth
            else threedmatch(arguments.data))


def _spread(protocol: Protocol, most: int) -> Protocol:
    count = len(protocol.pairs)
    if not 0 < most < count:
        return protocol
    return replace(protocol, pairs=[protocol.pairs[i * count // most] for i in range(most)])


PROTOCOLS: dict[str, Callable[[Namespace], Protocol]] = {
    'kitti-10m': _kitti_10m,
    'kitti-loops': _kitti_loops,
    '3dmatch': partial(_indoor, depth=False),
    'depth': partial(_indoor, depth=True),
    'strides': lambda arguments: strided(_drives(arguments), arguments.strides),
    'poses': _poses,
    'matches': _matches}

if __name__ == '__main__':
    sys.exit(main())
