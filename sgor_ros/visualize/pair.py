"""Two scans: as they came, with their matches, and as the answer lays them on each other."""
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
from .clouds import few
from .clouds import median_distance
from .clouds import shown
from .clouds import UNIT_SHARE
from .clouds import VOXEL_SHARE
from .recording import BLUE
from .recording import lifted
from .recording import ORANGE
from .recording import POINT_SIZE
from .recording import Recording
from .recording import view

Array = NDArray[np.float64]

ABOUT = """
**Target** blue, **source** orange. Lines are matches of two keypoints: **green** ones agree with
the answer, **red** ones were rejected.

*as they came*: both scans around one sensor. *matches*: the source where the answer puts it, but
lifted, so that green lines stand upright. *aligned*: on each other; rings lie on the ground of
each. Where there are several answers, frames show where else the source could be.
"""

VIEWS = ('as_they_came', 'matches', 'aligned')


def _blueprint(unit_m: float) -> rrb.Blueprint:
    before, between, after = (view(f'/{name}', name.replace('_', ' '), unit_m) for name in VIEWS)
    texts = (rrb.TextDocumentView(origin='/result', name='result'),
             rrb.TextDocumentView(origin='/about', name='what you see'))
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(before, between),
                       rrb.Vertical(after, rrb.Horizontal(*texts), row_shares=[3, 1])),
        collapse_panels=True)


class PairView(Recording):
    """Shows a registration.

    Parameters
    ----------
    target : str or Path
        As of `Recording`.
    config : SgorConfig
    """

    def __init__(self, target: str | Path, config: SgorConfig) -> None:
        super().__init__(target)
        self._convention = label_convention(config.label_convention)

    def show(self, source: SemanticScan, target: SemanticScan, result: Registration,
             text: str) -> None:
        """Show both scans, the result of registering them, and what is said of it."""
        log = self.stream.log
        distance = median_distance(target)
        unit = UNIT_SHARE * distance
        self.stream.send_blueprint(_blueprint(unit))
        clouds = [few(shown(scan, self._convention, VOXEL_SHARE * distance)).points
                  for scan in (source, target)]
        T = result.T_target_source
        laid = np.eye(4) if T is None else T
        moved = {'as_they_came': clouds[0], 'matches': lifted(clouds[0], T, unit),
                 'aligned': se3.transform(laid, clouds[0])}
        for name in VIEWS:
            log(f'/{name}', rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            for side, points, colour in (('target', clouds[1], BLUE),
                                         ('source', moved[name], ORANGE)):
                log(f'/{name}/{side}', rr.Points3D(points.astype(np.float32), colors=[colour],
                                                   radii=[POINT_SIZE]))
        self.matches('/as_they_came/lines', result, result.source_points, result.target_points)
        self.matches('/matches/lines', result, lifted(result.source_points, T, unit),
                     result.target_points)
        self.place('/aligned/source_sensor', laid)
        log('/aligned/source_sensor', rr.TransformAxes3D(unit / 6))
        self.ground('/aligned/source_sensor/ground', result.source_ground, unit, ORANGE)
        self.ground('/aligned/target_ground', result.target_ground, unit, BLUE)
        for i, other in enumerate(result.alternatives):
            self.place(f'/aligned/or_else/{i}', other.T_target_source)
            log(f'/aligned/or_else/{i}', rr.TransformAxes3D(unit / 3))
        log('/result', rr.TextDocument(text), static=True)
        log('/about', rr.TextDocument(ABOUT, media_type='text/markdown'), static=True)
