"""`sgor_demo`: the built-in world, played to `sgor_node` over DDS and compared with the truth."""
import argparse
from collections.abc import Iterator
from pathlib import Path
import sys
from typing import Any
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..core.settings import InputError
from ..evaluation.track import track_errors
from ..evaluation.track import TrackErrors
from ..evaluation.track_plots import plot_errors
from ..evaluation.track_plots import plot_track
from ..io.bags import BagReader
from .world_bag import WorldMap
from .world_bag import write_world_bag

if TYPE_CHECKING:
    from ..ros.player import Heard

Array = NDArray[np.float64]

# beyond this, something is wrong with the node or with this machine
WORST_DRIFT_PERCENT, LEAST_SHARE = 3.0, 0.5


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; return 0 where all went well, 1 where not, 2 on unusable input."""
    options = _parse(arguments)
    try:
        return _run(options)
    except InputError as error:
        print(f'error: {error}', file=sys.stderr)
        return 2


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='sgor_demo', description='Write a labelled bag of the built-in street world, play '
        'it to sgor_node over DDS in real time, and compare what the node publishes with the '
        'ground truth.', formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument('--out', type=Path, default=Path('out/demo'),
                        help='folder for the bag, the pictures and the log; an older bag there '
                        'is replaced')
    parser.add_argument('--scans', type=int, default=120, help='length of the drive')
    parser.add_argument('--rate', type=float, default=10.0, help='scans a second')
    parser.add_argument('--seed', type=int, default=0, help='chooses the place and the noise')
    options = parser.parse_args(arguments)
    if options.scans < 2:
        parser.error(f'--scans {options.scans}: at least 2')
    if not 0.1 <= options.rate <= 100:
        parser.error(f'--rate {options.rate}: 0.1 to 100')
    return options


def _run(options: argparse.Namespace) -> int:
    try:
        # late, so that --help and the message below work without ROS
        from ..ros.player import isolate
        from ..ros.player import NodeProcess
        from ..ros.player import Player
    except ImportError as error:
        raise InputError(f'no ROS 2 here ({error}): source /opt/ros/jazzy/setup.bash, or '
                         "pip install 'sgor_ros[ros]'") from error
    out: Path = options.out
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'--out {out}: {error.strerror}') from error
    bag = out / 'bag'
    isolate()
    _say('starting sgor_node; the first start on a machine compiles, for a minute or two')
    with NodeProcess(out / 'node.log') as node:
        truth, world = write_world_bag(bag, options.scans, options.seed)
        with Player() as player, BagReader(bag) as reader:
            if not player.wait_for_node(node.alive):
                return _fail(f'sgor_node did not get ready; see {node.log}')
            _say(f'sgor_node is ready; playing {len(truth)} scans at {options.rate:g} Hz')
            memory = [node.memory_mb()]
            clouds = tqdm(_clouds(reader), 'playing', len(truth), unit='scan', disable=None)
            heard = player.play(clouds, 1 / options.rate, node.alive)
        memory.append(node.memory_mb())
        alive = node.alive()
        code = node.stop()
    if not alive or code:
        return _fail(f'sgor_node ended with code {code}; see {node.log}')
    return _compare(heard, truth, world, memory, options)


def _compare(heard: 'Heard', truth: dict[int, Array], world: WorldMap, memory_mb: list[float],
             options: argparse.Namespace) -> int:
    """Print the table, write the pictures and judge."""
    out: Path = options.out
    answered = [i for i, stamp in enumerate(heard.sent) if stamp in heard.poses]
    few = f'{len(answered)} odometry messages for {len(heard.sent)} scans; see {out}/node.log'
    if len(answered) < 2:
        return _fail(few)
    stamps = [heard.sent[i] for i in answered]
    errors = track_errors(np.array([heard.poses[stamp] for stamp in stamps]),
                          np.array([truth[stamp] for stamp in stamps]))
    seconds = np.array([heard.seconds.get(stamp, np.nan) for stamp in stamps])
    latency = np.array([heard.latency_s[stamp] for stamp in stamps])
    _say(report(len(heard.sent), heard.counts, seconds, latency, errors, memory_mb))
    plot_track(out / 'trajectory.png', errors, np.array(list(truth.values())), world)
    plot_errors(out / 'errors.png', errors, np.array(answered), seconds, 1 / options.rate)
    _say(f'pictures: {out}/trajectory.png, {out}/errors.png; bag: {out}/bag')
    if len(answered) < LEAST_SHARE * len(heard.sent):
        return _fail(few)
    if errors.drift.stretches and not errors.drift.translation_percent < WORST_DRIFT_PERCENT:
        return _fail(f'the drift is above {WORST_DRIFT_PERCENT} %')
    return 0


def report(sent: int, counts: dict[str, int], seconds: Array, latency: Array,
           errors: TrackErrors, memory_mb: list[float]) -> str:
    """Return the table of the demo."""
    drift = errors.drift
    rows = [
        ('scans sent', str(sent)),
        ('  processed', str(counts.get('processed', 0))),
        ('  replaced by a newer one', str(counts.get('replaced', 0))),
        ('  failed', str(counts.get('failed', 0))),
        ('time per scan', _spread(1e3 * seconds, '{:.0f} ms')),
        ('cloud sent to odometry heard', _spread(1e3 * latency, '{:.0f} ms')),
        ('RE of consecutive pairs', _spread(errors.rotation_deg, '{:.3f} deg')),
        ('TE of consecutive pairs', _spread(100 * errors.translation_m, '{:.2f} cm')),
        ('drift', f'{drift.translation_percent:.2f} %, {drift.rotation_deg_per_m:.4f} deg/m'
         if drift.stretches else 'the drive is too short'),
        (f'end of the track, after {errors.length_m:.0f} m',
         f'{errors.end_translation_m:.2f} m, {errors.end_rotation_deg:.2f} deg off'),
        ('memory of the node', f'{memory_mb[0]:.0f} MB before, {memory_mb[-1]:.0f} MB after'),
    ]
    width = max(len(name) for name, _ in rows)
    rule = '-' * (width + 36)
    lines = [f'{name:<{width}}  {value}' for name, value in rows]
    return '\n'.join([rule, *lines, rule])


def _spread(values: Array, unit: str) -> str:
    values = values[np.isfinite(values)]
    if not len(values):
        return 'unknown'
    median, p95 = (unit.format(np.quantile(values, q)) for q in (0.5, 0.95))
    return f'median {median}, p95 {p95}'


def _clouds(reader: BagReader) -> Iterator[tuple[int, Any]]:
    for cloud in reader.clouds(reader.find_topic('label')):
        stamp_ns, _, message = cloud.read()
        yield stamp_ns, message


def _say(message: str) -> None:
    print(message, flush=True)


def _fail(message: str) -> int:
    print(f'error: {message}', file=sys.stderr)
    return 1


if __name__ == '__main__':
    sys.exit(main())
