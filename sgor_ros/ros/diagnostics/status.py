"""What the node says about itself: counts, and the message on /diagnostics."""
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue

from ...io.messages import header
from ...mapping import Mapper
from ...pipeline.outcome import Outcome
from ...tracker import State
from ...tracker import TrackedScan
from ..types import ros_type

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE


@dataclass
class Counts:
    """Scans since the start: received = processed + failed + late + replaced + the one at work.

    Before those, `missed` never came, by their stamps, and `paused` came while the node paused.
    """

    received: int = 0
    processed: int = 0
    replaced: int = 0
    failed: int = 0
    late: int = 0
    missed: int = 0
    paused: int = 0

    def __str__(self) -> str:
        """Return the counts in one line, without the rare ones that never happened."""
        return ', '.join(f'{name} {count}' for name, count in vars(self).items()
                         if count or name not in ('late', 'missed', 'paused'))


def diagnostics(name: str, frame: str, stamp_ns: int, level: bytes, message: str, counts: Counts,
                values: dict[str, str]) -> DiagnosticArray:
    """Return one status, with the counts and `values`, at a stamp."""
    pairs = {**{key: str(count) for key, count in vars(counts).items()}, **values}
    return DiagnosticArray(
        header=header(ros_type, stamp_ns, frame),
        status=[DiagnosticStatus(
            level=level, name=f'{name}: odometry', message=message, hardware_id=frame,
            values=[KeyValue(key=key, value=value) for key, value in pairs.items()])])


def level_of(outcome: Outcome) -> tuple[bytes, str]:
    """Return the level of a scan and why."""
    tracked = outcome.tracked
    if tracked is None:
        return ERROR, f'unusable cloud: {outcome.reason}'
    if tracked.state is State.LATE:
        return WARN, f'dropped, for it came late: {tracked.reason}'
    if not tracked.success:
        level, message = ERROR, f'registration failed: {tracked.reason}'
        if tracked.state is State.LOST:
            message = f'lost, {tracked.failures} scans without a pose: {tracked.reason}'
    elif outcome.reason:
        level, message = WARN, f'nothing is published: {outcome.reason}'
    elif tracked.state is State.DEGENERATE:
        level, message = WARN, 'degenerate: some directions are predicted'
    elif tracked.warnings:
        return WARN, '; '.join(tracked.warnings)
    else:
        return OK, 'first scan of a track' if tracked.restarted else 'registered'
    return level, '; '.join((message, *tracked.warnings))


def details(tracked: TrackedScan | None) -> dict[str, str]:
    """Return what a person wants to see of a scan, as text; nothing of an unusable cloud."""
    if tracked is None:
        return {}
    step = tracked.registration
    shown = {'state': tracked.state.value, 'track': str(tracked.track_id),
             'reason': tracked.reason}
    if step is not None:
        shown['found by'] = 'a confirmed prediction' if tracked.confirmed else 'SGOR'
        shown['confidence'] = f'{step.confidence:.3f}'
        shown['inliers'] = str(int(step.inliers.sum()))
        shown['correspondences'] = str(len(step.inliers))
    return shown


def map_details(mapper: Mapper | None) -> dict[str, str]:
    """Return the same of the map, with what was put off; nothing where no loops are closed."""
    if mapper is None:
        return {}
    return {'map mode': 'localization' if mapper.frozen else 'mapping',
            'loops': str(len(mapper.graph.loops)), 'keyframes': str(len(mapper.keyframes)),
            'loop candidates waiting': str(len(mapper.candidates)),
            'loop candidates put off': str(mapper.candidates.put_off)}
