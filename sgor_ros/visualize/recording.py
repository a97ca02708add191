"""Where it goes, a file or a viewer, and what all views draw alike."""
import logging
from pathlib import Path
import threading
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
import rerun as rr
import rerun.blueprint as rrb

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.scan.ground import Ground
from ..core.verdict.result import Registration
from . import viewer_program

Array = NDArray[np.float64]

GREEN, RED, BLUE, ORANGE = (42, 200, 110), (225, 70, 80), (90, 150, 235), (240, 160, 50)
GREY = (150, 150, 150)

# what the eye still tells apart
SHOWN_INLIERS = 150
SHOWN_REJECTED = 100

RINGS = (0.5, 1.0)
"""Radii of the rings that show the ground, in units of the view."""

POINT_SIZE = -1.5
"""Negative: pixels, and not metres."""

PATIENCE_S = 10.0
"""For a viewer to take what was sent: one that was closed never does, and rerun waits for ever."""

LOGGER = logging.getLogger('sgor_ros')


class Recording:
    """A stream of rerun; use it in a ``with``.

    A viewer that ends, or a disk that is full, ends the view and not the work: it is logged once.

    Parameters
    ----------
    target : str or Path
        An ``.rrd`` to write; empty: a viewer is opened.

    Attributes
    ----------
    broken : bool
        Whether nothing more can be shown.
    live : bool
        Whether it goes to a viewer.

    Raises
    ------
    InputError
        The viewer does not start.
    """

    def __init__(self, target: str | Path) -> None:
        self.stream = rr.RecordingStream('sgor_ros')
        self.broken = False
        self.live = not target
        if target:
            self.stream.save(target)
            return
        try:
            rr.spawn(memory_limit='2GB', executable_path=viewer_program(), recording=self.stream)
        except RuntimeError as error:
            raise InputError(f'--visualize: the viewer does not start: {error}') from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.send()
        if self.broken:
            # rerun waits for ever for a viewer that takes nothing
            threading.Thread(target=self.stream.disconnect, daemon=True).start()
        else:
            self.stream.disconnect()

    def send(self) -> None:
        """Send what was logged; to be called often enough that no queue of rerun gets full."""
        if self.broken:
            return
        try:
            self.stream.flush(timeout_sec=PATIENCE_S)
        except RuntimeError as error:
            self.broken = True
            LOGGER.warning('--visualize: nothing more is shown: %s', error)

    def place(self, path: str, T: Array) -> None:
        """Put a frame into the one above it: (4, 4)."""
        self.stream.log(path, rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))

    def matches(self, path: str, result: Registration, source: Array, target: Array) -> None:
        """Draw matches as lines from (K, 3) to (K, 3): green inliers, some of the rejected."""
        ends = np.stack((source, target), axis=1).astype(np.float32)
        for name, part, most, colour in (
                ('rejected', ends[~result.inliers], SHOWN_REJECTED, RED),
                ('inliers', ends[result.inliers], SHOWN_INLIERS, GREEN)):
            shown = part[::max(1, -(-len(part) // most))]
            self.stream.log(f'{path}/{name}', rr.LineStrips3D(
                shown, colors=[colour], radii=[-1.0 if name == 'inliers' else -0.5]))

    def ground(self, path: str, ground: Ground | None, unit_m: float,
               colour: tuple[int, int, int]) -> None:
        """Draw rings on a ground plane below the sensor; nothing where there is no plane."""
        self.stream.log(path, rr.Clear(recursive=False) if ground is None else rr.LineStrips3D(
            rings(ground, unit_m), colors=[colour], radii=[-1.0]))


def view(path: str, name: str, unit_m: float) -> rrb.Spatial3DView:
    """Return a view of what is below a path, seen from behind and above the origin."""
    return rrb.Spatial3DView(
        origin=path, name=name, eye_controls=rrb.EyeControls3D(
            position=(-2.2 * unit_m, -1.2 * unit_m, 1.8 * unit_m),
            look_target=(0.0, 0.0, 0.3 * unit_m), eye_up=(0.0, 0.0, 1.0)))


def rings(ground: Ground, unit_m: float) -> list[Array]:
    """Return circles on the plane around the point below the sensor, (65, 3) each."""
    across = np.cross(ground.normal, [1.0, 0.0, 0.0])
    if np.linalg.norm(across) < 0.1:
        across = np.cross(ground.normal, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    along = np.cross(across, ground.normal)
    angles = np.linspace(0, 2 * np.pi, 65)[:, None]
    circle = np.cos(angles) * along + np.sin(angles) * across
    return [np.asarray(radius * unit_m * circle - ground.offset * ground.normal)
            for radius in RINGS]


def lifted(points: Array, T_target_source: Array | None, height_m: float) -> Array:
    """Return (N, 3) points of the source where they belong over the target, but higher."""
    moved = points if T_target_source is None else se3.transform(T_target_source, points)
    return moved + [0.0, 0.0, height_m]
