"""`sgor_register`: two scans from files, the transformation between them."""
from argparse import Namespace
from dataclasses import replace
import math
from pathlib import Path
import sys
import time

import numpy as np

from .. import visualize
from ..core.common import se3
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.preprocessing import preprocess
from ..core.registration import register
from ..core.scan.scan import SemanticScan
from ..core.verdict.result import Registration
from ..core.warmup import warm_up
from ..io.plots import PICTURES
from ..io.plots import plot_registration
from ..io.scans import read_scan
from ..io.writing import check_file
from ..io.writing import STDOUT
from .command_line import FAILED
from .command_line import OK
from .command_line import Parser
from .command_line import run
from .options import add_params_file
from .options import add_preset
from .options import add_settings
from .options import add_visualize
from .options import configured
from .options import PRESETS
from .options import read_parameters
from .result_output import tell


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(register_files, _parser().parse_args(argv))


def register_files(arguments: Namespace) -> int:
    """Register and tell; 1 where the scans could not be registered."""
    _check_outputs(arguments)
    config = configured(PRESETS[arguments.preset](), arguments,
                        read_parameters(arguments, SgorConfig))
    if arguments.visualize is not None:
        visualize.check(arguments.visualize)
    convention = arguments.target_label_convention or config.label_convention
    source = read_scan(arguments.source, arguments.source_labels)
    target = read_scan(arguments.target, arguments.target_labels)
    warm_up(config)
    begin = time.perf_counter()
    prepared = (preprocess(source, config),
                preprocess(target, config.replace(label_convention=convention)))
    preprocessing = time.perf_counter() - begin
    result = register(*prepared, config)
    result = replace(result, timings={
        **result.timings, 'preprocessing': preprocessing + result.timings['preprocessing']})
    for warning in result.warnings:
        print(f'warning: {warning}', file=sys.stderr)
    tell(_text(result), {'source': str(arguments.source), 'target': str(arguments.target),
                         **result.to_dict()}, arguments.json)
    if arguments.plot:
        _plot(arguments, source, target, result)
    if arguments.visualize is not None:
        with visualize.pair_view(arguments.visualize, config) as look:
            look.show(source, target, result, _text(result))
    return OK if result.success else FAILED


def _parser() -> Parser:
    command = Parser(
        'sgor_register', 'SOURCE TARGET [options]', 'Register two scans without an initial guess '
        'and print T_target_source, which maps points of the source into the target.',
        ('sgor_register a.bin b.bin --source-labels a.label --target-labels b.label',
         'sgor_register a.ply b.ply --json result.json --plot pair.png'),
        'registered', 'not registered; the reason is told')
    command.add_argument('source', type=Path, help='.bin, .pcd, .ply or .npz')
    command.add_argument('target', type=Path, help='likewise')
    for side in ('source', 'target'):
        command.add_argument(f'--{side}-labels', type=Path, metavar='FILE',
                             help=f'labels of the {side}: uint32 or uint8 a point')
    command.add_argument('--target-label-convention', metavar='STR',
                         help='where the labels of the target mean something else')
    add_preset(command)
    command.add_argument('-j', '--json', type=Path, metavar='FILE', help='write the result to; an '
                         'older file is replaced; -: to standard output, and all else to stderr')
    command.add_argument('-p', '--plot', type=Path, metavar='FILE', help='draw the result to '
                         f'({", ".join(PICTURES)}), likewise')
    add_visualize(command)
    add_params_file(command)
    add_settings(command, 'settings', SgorConfig)
    return command


def _check_outputs(arguments: Namespace) -> None:
    """Refuse what could not be written after the work, or would replace what is read."""
    inputs = [path.resolve() for path in (arguments.source, arguments.target,
                                          arguments.source_labels, arguments.target_labels)
              if path is not None]
    for option, path, endings in (('--json', arguments.json, ()),
                                  ('--plot', arguments.plot, PICTURES)):
        if path is None or (option == '--json' and path == STDOUT):
            continue
        check_file(path, option, endings)
        if path.resolve() in inputs:
            raise InputError(f'{option} {path}: would replace an input')
    if arguments.json and arguments.plot and arguments.json.resolve() == arguments.plot.resolve():
        raise InputError(f'--plot {arguments.plot}: the same file as --json')


def _text(result: Registration) -> str:
    lines = []
    if result.success and result.T_target_source is not None:
        T = result.T_target_source
        lines += ['T_target_source', *(' '.join(f'{v:14.9f}' for v in row) for row in T), '',
                  f'registered: moved {np.linalg.norm(T[:3, 3]):.3f} m, '
                  f'turned {math.degrees(se3.angle(T[:3, :3])):.3f} deg']
    else:
        lines.append(f'not registered: {result.reason}')
    lines.append(f'confidence {result.confidence:.3f}, {int(result.inliers.sum())} inliers of '
                 f'{len(result.inliers)} correspondences')
    if result.success and result.covariance is not None:
        sigma = np.sqrt(np.diag(result.covariance))
        lines.append('standard deviation x y z ' + ' '.join(f'{100 * s:.1f}' for s in sigma[:3])
                     + ' cm, rotation ' + ' '.join(f'{math.degrees(s):.3f}' for s in sigma[3:])
                     + ' deg')
    lines.append(f'took {1e3 * sum(result.timings.values()):.0f} ms, '
                 f'{1e3 * result.timings["preprocessing"]:.0f} of them to preprocess both scans')
    return '\n'.join(lines)


def _plot(arguments: Namespace, source: SemanticScan, target: SemanticScan,
          result: Registration) -> None:
    title = (f'{_short(arguments.source)} to {_short(arguments.target)}: '
             f'{"registered" if result.success else "not registered"}, '
             f'confidence {result.confidence:.2f}')
    plot_registration(arguments.plot, title, source, target, result)


def _short(path: Path) -> str:
    return str(Path(*path.parts[-3:]))    # as the user named it, not where that lies


if __name__ == '__main__':
    sys.exit(main())
