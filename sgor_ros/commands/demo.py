"""`sgor_demo`: the built-in world, played to `sgor_node` over DDS and compared with the truth."""
import argparse
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
import sys
from typing import Any
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..evaluation.metrics.trajectory import require_evo
from ..evaluation.metrics.trajectory import track_errors
from ..evaluation.metrics.trajectory import TrackErrors
from ..evaluation.report.track_plots import plot_against_truth
from ..evaluation.report.track_plots import plot_errors
from ..io.bags import BagReader
from ..io.bags import CLOUD_TYPE
from ..io.header_stamp import stamp_ns_of
from ..io.messages import matrix_of
from ..io.terminal import progress
from .command_line import FAILED
from .command_line import OK
from .command_line import Parser
from .command_line import run
from .recorded_drive import Recorded
from .recorded_drive import recorded_drive
from .world_bag import STREET
from .world_bag import WorldMap
from .world_bag import write_world_bag

if TYPE_CHECKING:
    from ..ros.playback.player import Player

Array = NDArray[np.float64]

# beyond this, something is wrong with the node
WORST_DRIFT_PERCENT, LEAST_SHARE = 3.0, 0.5
# a machine that answers fewer is slow, and told so; the others were replaced by newer ones
SWIFT_SHARE = 0.9
# of the time of a scan: what is left for sending and hearing
LOAD = 0.8
# about 300 MB, on the disk and in memory
BAG_SCANS = 150
LAST_ANSWER_S = 60.0


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(play, _parse(arguments))


def play(options: argparse.Namespace) -> int:
    """Run the demo; 1 where the node did badly."""
    try:
        return _run(options)
    except TimeoutError as error:
        return _fail(f'{error}; see {options.out}/node.log')


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = Parser(
        'sgor_demo', '[options]', 'Write a labelled bag of the built-in world, or read a recorded '
        'drive, play it to sgor_node over DDS in real time, and compare what the node publishes '
        'with the ground truth.',
        ('sgor_demo', 'sgor_demo --place courtyard --scans 300',
         'sgor_demo --data sequences/08 --scans 500'),
        'done; a slow machine that leaves scans out is told so',
        'the node ended, was silent, failed often, or drifted by more than '
        f'{WORST_DRIFT_PERCENT:g} %')
    parser.add_argument('-o', '--out', '--output', type=Path, default=Path('out/demo'),
                        help='folder for the bag, the pictures and the log; those of an older '
                        'demo are replaced')
    parser.add_argument('--scans', type=int, default=120,
                        help=f'scans to play; the bag has {BAG_SCANS} at most, more of them are '
                        'that drive forth and back')
    parser.add_argument('--rate', type=float, default=10.0, help='scans a second')
    parser.add_argument('--seed', type=int, default=0, help='chooses the place and the noise')
    parser.add_argument('--place', default=STREET, metavar='KIND', help='or tunnel, corridor, '
                        'facade, garage_half_full, ...: a wrong one lists them all')
    parser.add_argument('--data', type=Path, metavar='FOLDER', help='play this recorded drive '
                        'instead of the built-in world: velodyne/*.bin and poses.txt, the truth')
    parser.add_argument('--no-loops', action='store_true', help='odometry alone; --data has none '
                        'either')
    options = parser.parse_args(arguments)
    # the way back of a recorded drive has the very scans of the way there
    options.loops = not options.no_loops and options.data is None
    if options.scans < 2:
        parser.error(f'--scans {options.scans}: at least 2')
    if not 0.1 <= options.rate <= 100:
        parser.error(f'--rate {options.rate}: 0.1 to 100')
    return options


def _run(options: argparse.Namespace) -> int:
    try:
        # late, so that --help and the message below work without ROS
        from ..ros.playback.domain import Domain
        from ..ros.playback.node_process import NodeProcess
        from ..ros.playback.player import Player
    except ImportError as error:
        raise InputError(f'no ROS 2 here ({error}): source /opt/ros/jazzy/setup.bash, or pip '
                         "install 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces"
                         ) from error
    require_evo()
    out: Path = options.out
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'--out {out}: {error.strerror}') from error
    _say('starting sgor_node; the first start on a machine compiles, for half a minute')
    most = min(options.scans, BAG_SCANS)
    recorded = recorded_drive(options.data, most) if options.data else None
    convention = (recorded or SgorConfig()).label_convention
    with closing(Domain()) as domain, NodeProcess(
            domain, out / 'node.log', '-p', f'label_convention:={convention}',
            '-p', f'loop_closure:={str(options.loops).lower()}') as node:
        # while the node starts
        recorded = recorded or _built_in(options, most)
        drive = recorded.truth
        scans = list(forth_and_back(list(drive), options.scans))
        truth = {stamp_ns: drive[original] for original, stamp_ns in scans}
        with Player(domain) as player:
            player.wait_for_node(node.alive)
            _say(f'sgor_node is ready; playing {len(scans)} scans at {options.rate:g} Hz')
            memory = [node.memory_mb()]
            stream = _restamped(recorded.clouds, list(drive), scans)
            with progress('playing', len(scans), 'scan') as told:
                player.play(told.over(stream), 1 / options.rate, node.alive)
            last = scans[-1][1]
            player.spin_until(lambda: not node.alive() or any(
                stamp_ns_of(told.header) == last for told in player.diagnostics[-3:]),
                LAST_ANSWER_S, 'answer to the last scan')
        memory.append(node.memory_mb())
        alive = node.alive()
        code = node.stop()
    if not alive or code:
        return _fail(f'sgor_node ended with code {code}; see {node.log}')
    return _compare(player, truth, recorded.world, memory, options)


def _built_in(options: argparse.Namespace, scans: int) -> Recorded:
    """Drive through the built-in world and read what the bag has of it."""
    truth, world = write_world_bag(options.out / 'bag', scans, options.seed, options.place)
    with BagReader(options.out / 'bag') as reader:
        clouds = [cloud.read()[2] for cloud in reader.clouds(reader.find_topic('label'))]
    return Recorded(truth, clouds, world, SgorConfig().label_convention)


def forth_and_back(stamps_ns: list[int], count: int) -> Iterator[tuple[int, int]]:
    """Yield (stamp of the scan to play, stamp to give it): neighbours stay neighbours.

    Parameters
    ----------
    stamps_ns : list of int
        Of the recorded scans, at least two, at equal distances.
    count : int
        Number of scans to play.
    """
    turn = len(stamps_ns) - 1
    for i in range(count):
        place = i % (2 * turn)
        original = stamps_ns[min(place, 2 * turn - place)]
        yield original, stamps_ns[0] + i * (stamps_ns[1] - stamps_ns[0])


def _restamped(clouds: list[Any], recorded_ns: list[int], scans: list[tuple[int, int]]
               ) -> Iterator[tuple[int, bytes]]:
    """Yield the new stamp and the serialised cloud of each scan to play."""
    store = get_typestore(Stores.ROS2_JAZZY)
    cloud_of = dict(zip(recorded_ns, clouds, strict=True))
    for original, stamp_ns in scans:
        cloud = cloud_of[original]
        cloud.header.stamp.sec, cloud.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        yield stamp_ns, bytes(store.serialize_cdr(cloud, CLOUD_TYPE))


def _compare(player: 'Player', truth: dict[int, Array], world: WorldMap, memory_mb: list[float],
             options: argparse.Namespace) -> int:
    """Print the table, write the pictures and judge."""
    from ..ros.playback.player import values_of
    out: Path = options.out
    poses = {stamp_ns_of(message.header): matrix_of(message.pose.pose)
             for message in player.odometry}
    told = {stamp_ns_of(message.header): values_of(message) for message in player.diagnostics}
    sent = list(player.sent_s)
    answered = [i for i, stamp in enumerate(sent) if stamp in poses]
    if len(answered) < 2:
        return _fail(f'{len(answered)} odometry messages for {len(sent)} scans; '
                     f'see {out}/node.log')
    stamps = [sent[i] for i in answered]
    errors = track_errors(np.array([poses[stamp] for stamp in stamps]),
                          np.array([truth[stamp] for stamp in stamps]))
    seconds = np.array([float(told[stamp]['seconds']) if stamp in told else np.nan
                        for stamp in stamps])
    latency = np.array([player.heard_s[stamp] - player.sent_s[stamp] for stamp in stamps])
    counts = list(told.values())[-1]
    loops = [loop_of(message) for message in player.loops]
    _say(report(len(sent), counts, seconds, latency, errors, memory_mb,
                None if not options.loops else [
                    np.linalg.norm((se3.inverse(truth[target]) @ truth[source] - T)[:3, 3])
                    for target, source, T in loops]))
    if len(answered) < SWIFT_SHARE * len(sent):
        _say(slowness(len(answered), len(sent), seconds, options.rate))
    plot_against_truth(out / 'trajectory.png', errors, np.array(list(truth.values())), world,
                       [(truth[target], truth[source]) for target, source, _ in loops])
    plot_errors(out / 'errors.png', errors, np.array(answered), seconds, 1 / options.rate)
    _say(f'pictures: {out}/trajectory.png, {out}/errors.png'
         + ('' if options.data else f'; bag: {out}/bag'))
    processed, failed = int(counts['processed']), int(counts['failed'])
    if processed < LEAST_SHARE * (processed + failed):
        return _fail(f'{failed} of {processed + failed} registrations failed; '
                     f'see {out}/node.log')
    if errors.drift.stretches and not errors.drift.translation_percent < WORST_DRIFT_PERCENT:
        return _fail(f'the drift is above {WORST_DRIFT_PERCENT} %')
    return OK


def slowness(answered: int, sent: int, seconds: Array, rate: float) -> str:
    """Return a remark for a machine that does not keep up; what it did is as good as elsewhere."""
    median = float(np.nanmedian(seconds))
    return (f'This machine is too slow, or too busy, for {rate:g} scans a second: a scan takes '
            f'{1e3 * median:.0f} ms.\nThe node took the newest one each time, {answered} of '
            f'{sent}; the errors above are of those.\n--rate {LOAD / median:.2g} would leave '
            'none out.')


def report(sent: int, counts: dict[str, str], seconds: Array, latency: Array,
           errors: TrackErrors, memory_mb: list[float], loop_errors_m: list[float] | None) -> str:
    """Return the table of the demo; `counts` is what the node told of the last scan."""
    drift = errors.drift
    rows = [
        ('scans sent', str(sent)),
        ('  received', counts['received']),
        ('  processed', counts['processed']),
        ('  replaced by a newer one', counts['replaced']),
        ('  failed', counts['failed']),
        ('time per scan', _spread(1e3 * seconds, '{:.0f} ms', (50, 95, 99))),
        ('cloud sent to odometry heard', _spread(1e3 * latency, '{:.0f} ms', (50, 95, 99))),
        ('RE of consecutive pairs', _spread(errors.rotation_deg, '{:.3f} deg')),
        ('TE of consecutive pairs', _spread(100 * errors.translation_m, '{:.2f} cm')),
        ('drift', f'{drift.translation_percent:.2f} %, {drift.rotation_deg_per_m:.4f} deg/m'
         if drift.stretches else 'the drive is too short'),
        (f'end of the track, after {errors.length_m:.0f} m',
         f'{errors.end_translation_m:.2f} m, {errors.end_rotation_deg:.2f} deg off'),
        *([] if loop_errors_m is None else [('loops closed', str(len(loop_errors_m)) + (
            f', off by {_spread(100 * np.array(loop_errors_m), "{:.1f} cm")}'
            if loop_errors_m else ''))]),
        ('memory of the node', f'{memory_mb[0]:.0f} MB before, {memory_mb[-1]:.0f} MB after'),
    ]
    width = max(len(name) for name, _ in rows)
    rule = '-' * (width + 42)
    lines = [f'{name:<{width}}  {value}' for name, value in rows]
    return '\n'.join([rule, *lines, rule])


def loop_of(message: Any) -> tuple[int, int, Array]:
    """Return the stamps of target and source of a `loop_closure`, and T_target_source."""
    target, source = (int(frame.rpartition('@')[2])
                      for frame in (message.header.frame_id, message.child_frame_id))
    return target, source, matrix_of(message.pose.pose)


def _spread(values: Array, unit: str, percentiles: tuple[int, ...] = (50, 95)) -> str:
    values = values[np.isfinite(values)]
    if not len(values):
        return 'unknown'
    return ', '.join(
        f'{"median" if p == 50 else f"p{p}"} {unit.format(np.percentile(values, p))}'
        for p in percentiles)


def _say(message: str) -> None:
    print(message, flush=True)


def _fail(message: str) -> int:
    print(f'error: {message}', file=sys.stderr)
    return FAILED


if __name__ == '__main__':
    sys.exit(main())
