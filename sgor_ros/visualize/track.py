"""A drive, scan by scan: the map that grows, the track, and each scan on its reference."""
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
import rerun as rr
import rerun.blueprint as rrb

from ..core.common import se3
from ..core.config import SgorConfig
from ..core.scan.labels import label_convention
from ..core.scan.scan import SemanticScan
from ..core.verdict.result import Registration
from ..tracker import State
from ..tracker import TrackedScan
from .clouds import few
from .clouds import Map
from .clouds import median_distance
from .clouds import palette
from .clouds import Shown
from .clouds import shown
from .clouds import UNIT_SHARE
from .clouds import VOXEL_SHARE
from .recording import BLUE
from .recording import GREEN
from .recording import GREY
from .recording import lifted
from .recording import ORANGE
from .recording import POINT_SIZE
from .recording import Recording
from .recording import RED
from .recording import view

Array = NDArray[np.float64]

POSES_A_PIECE = 100
"""The track is drawn in pieces: each new pose sends one of them again, and not all."""

REMEMBERED = 60
"""Keyframes whose clouds are kept, to be shown under the scans that are registered to them."""

STATE_COLOURS = {State.DEGENERATE: ORANGE, State.NEW_TRACK: BLUE}

ABOUT = """
**Left: the map.** Points by class (by height without labels), once a voxel, of what does not move.
The line is the track, its dots are keyframes, orange rings lie on the ground that was found.

**Top right: one registration.** Below, the keyframe; above it, lifted, the scan that was
registered to it. Each line is a match of two keypoints: **green** ones agree with the answer and
stand upright, **red** ones were rejected. Where the scan has no pose, its refused candidate is
shown.

**Plots.** Confidence, and the threshold below which an answer is refused; matches and inliers;
time. Move along the timeline to see any scan.
"""


@dataclass(eq=False)
class _Track:
    """What is kept of a track."""

    T_world_odom: Array
    map: Map
    pieces: int = 0
    poses: list[Array] = field(default_factory=list)


def _blueprint(unit_m: float) -> rrb.Blueprint:
    plots = [rrb.TimeSeriesView(origin=f'/plots/{name}', name=title) for name, title in (
        ('confidence', 'confidence'), ('matches', 'matches'), ('time', 'time [ms]'))]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin='/world', name='map and track'),
            rrb.Vertical(
                view('/pair', 'this scan on its keyframe', unit_m),
                rrb.Horizontal(rrb.TextDocumentView(origin='/state', name='this scan'),
                               rrb.TextDocumentView(origin='/about', name='what you see')),
                rrb.Horizontal(*plots), row_shares=[4, 2, 2]),
            column_shares=[3, 2]),
        rrb.TimePanel(timeline='scan', state='collapsed', play_state='following'),
        collapse_panels=True)


class TrackView(Recording):
    """Shows a drive; what is kept in memory is bounded, however long it is.

    Parameters
    ----------
    target : str or Path
        As of `Recording`.
    config : SgorConfig
    """

    def __init__(self, target: str | Path, config: SgorConfig) -> None:
        super().__init__(target)
        self._convention = label_convention(config.label_convention)
        self._min_confidence = config.min_confidence
        self._scans = 0
        self._unit_m = 0.0
        self._voxel_m = 0.0
        self._tracks: dict[int, _Track] = {}
        self._keyframes: dict[int, Shown] = {}
        self._below: Shown | None = None
        self._T_world_sensor = np.eye(4)
        self._static()

    def show(self, scan: SemanticScan, tracked: TrackedScan) -> None:
        """Show a scan and what became of it; nothing once the view is broken."""
        if self.broken:
            return
        self.stream.set_time('scan', sequence=self._scans)
        self.stream.set_time('stamp', timestamp=np.datetime64(tracked.stamp_ns, 'ns'))
        self._scans += 1
        if not self._unit_m:
            distance = median_distance(scan)
            self._unit_m, self._voxel_m = UNIT_SHARE * distance, VOXEL_SHARE * distance
            self.stream.send_blueprint(_blueprint(self._unit_m))
        cloud = shown(scan, self._convention, self._voxel_m)
        self._pair(few(cloud), tracked)
        self._scalars(tracked)
        self._state(tracked)
        if tracked.T_odom_sensor is not None:
            self._pose(cloud, tracked, tracked.T_odom_sensor)
        if self.live:
            self.send()

    def _static(self) -> None:
        log = self.stream.log
        colours = palette()
        log('/', rr.AnnotationContext([
            rr.AnnotationInfo(id=i, label=name, color=tuple(colours[i].tolist()))
            for i, name in self._convention.names.items()]), static=True)
        for path in ('/world', '/pair'):
            log(path, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log('/about', rr.TextDocument(ABOUT, media_type='text/markdown'), static=True)
        for path, name, colour in (
                ('confidence/confidence', 'confidence', GREEN),
                ('confidence/threshold', 'min_confidence', RED), ('matches/all', 'matches', GREY),
                ('matches/inliers', 'inliers', GREEN), ('time/scan', 'a scan', BLUE)):
            log(f'/plots/{path}', rr.SeriesLines(names=name, colors=[colour]), static=True)

    def _pose(self, cloud: Shown, tracked: TrackedScan, T_odom_sensor: Array) -> None:
        track = self._tracks.get(tracked.track_id)
        root = f'/world/track_{tracked.track_id}'
        if track is None:
            # where a new track lies in the old one nobody knows; it goes on where that one ended
            track = self._tracks[tracked.track_id] = _Track(self._T_world_sensor,
                                                            Map(self._voxel_m))
            self.place(root, track.T_world_odom)
        self._T_world_sensor = track.T_world_odom @ T_odom_sensor
        self.place('/world/sensor', self._T_world_sensor)
        self.stream.log('/world/sensor', rr.TransformAxes3D(self._unit_m / 6))
        track.poses.append(T_odom_sensor)
        piece = np.array(track.poses)[:, :3, 3]
        self.stream.log(f'{root}/trajectory/{track.pieces:05d}', rr.LineStrips3D(
            [piece], colors=[STATE_COLOURS.get(tracked.state, GREEN)], radii=[-2.0]))
        if len(track.poses) == POSES_A_PIECE:
            track.pieces, track.poses = track.pieces + 1, track.poses[-1:]
        if tracked.keyframe:
            self._keyframe(cloud, track, root, tracked.stamp_ns, T_odom_sensor)

    def _keyframe(self, cloud: Shown, track: _Track, root: str, stamp_ns: int,
                  T_odom_sensor: Array) -> None:
        self._keyframes[stamp_ns] = few(cloud)
        while len(self._keyframes) > REMEMBERED:
            self._keyframes.pop(next(iter(self._keyframes)))
        still = ~np.isin(cloud.classes, list(self._convention.movable))
        part, new, forgotten = track.map.add(cloud[still], T_odom_sensor)
        self._cloud(f'{root}/map/{part:05d}', new)
        for old in forgotten:
            self.stream.log(f'{root}/map/{old:05d}', rr.Clear(recursive=False))
        self.stream.log(f'{root}/keyframes/{part:05d}', rr.Points3D(
            [T_odom_sensor[:3, 3]], colors=[ORANGE], radii=[-5.0]))

    def _pair(self, cloud: Shown, tracked: TrackedScan) -> None:
        found = tracked.registration
        if found is None:
            return
        T = _shown_step(found, tracked)
        keyframe = self._keyframes.get(tracked.reference_stamp_ns or 0)
        if keyframe is not None and keyframe is not self._below:
            self._below = keyframe
            self._cloud('/pair/keyframe', keyframe)
        self._cloud('/pair/scan', Shown(lifted(cloud.points, T, self._unit_m), cloud.classes))
        self.matches('/pair/matches', found, lifted(found.source_points, T, self._unit_m),
                     found.target_points)
        self.ground('/world/sensor/ground', found.source_ground, self._unit_m, ORANGE)
        self.ground('/pair/ground', found.target_ground, self._unit_m, ORANGE)

    def _cloud(self, path: str, cloud: Shown) -> None:
        """Draw a cloud; with classes, so that pointing at one tells its name."""
        self.stream.log(path, rr.Points3D(
            cloud.points.astype(np.float32), radii=[POINT_SIZE],
            colors=None if cloud.labelled else cloud.colours(),
            class_ids=cloud.classes if cloud.labelled else None))

    def _scalars(self, tracked: TrackedScan) -> None:
        log, found = self.stream.log, tracked.registration
        log('/plots/confidence/threshold', rr.Scalars([self._min_confidence]))
        log('/plots/time/scan', rr.Scalars([1e3 * sum(tracked.timings.values())]))
        if found is not None:
            log('/plots/confidence/confidence', rr.Scalars([found.confidence]))
            log('/plots/matches/all', rr.Scalars([len(found.inliers)]))
            log('/plots/matches/inliers', rr.Scalars([int(found.inliers.sum())]))

    def _state(self, tracked: TrackedScan) -> None:
        lines = [f'**{tracked.state}**, track {tracked.track_id}'
                 + (', keyframe' if tracked.keyframe else '')]
        if tracked.registration is not None:
            found = tracked.registration
            lines.append(f'confidence {found.confidence:.3f}, {int(found.inliers.sum())} inliers '
                         f'of {len(found.inliers)} matches')
        if tracked.T_reference_sensor is not None:
            T = tracked.T_reference_sensor
            lines.append(f'{np.linalg.norm(T[:3, 3]):.2f} m and '
                         f'{np.degrees(se3.angle(T[:3, :3])):.1f} deg from its keyframe')
        lines += filter(None, (tracked.reason, *tracked.warnings))
        self.stream.log('/state', rr.TextDocument('\n\n'.join(lines), media_type='text/markdown'))


def _shown_step(found: Registration, tracked: TrackedScan) -> Array | None:
    """Return where to lay the scan: the pose that stands, or else the refused candidate."""
    return (found.T_target_source if tracked.T_reference_sensor is None
            else tracked.T_reference_sensor)
