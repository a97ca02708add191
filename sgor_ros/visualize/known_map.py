"""A map that stays: its cloud, keyframes, edges by kind, and where a scan was found."""
import numpy as np
from numpy.typing import NDArray
import rerun as rr
import rerun.blueprint as rrb

from ..core.scan.voxels import thin
from ..mapping import Located
from ..mapping import Map
from ..mapping.edge import Kind
from ..mapping.map_cloud import joined_cloud
from .clouds import MAP_POINTS
from .clouds import Shown
from .recording import BLUE
from .recording import GREEN
from .recording import GREY
from .recording import ORANGE
from .recording import POINT_SIZE
from .recording import Recording
from .recording import RED
from .recording import view

Array = NDArray[np.float64]

UNIT_M = 15.0
"""Of the view: what is to be seen at first."""
AXES_M = 3.0
ABOUT = """
Points by class, by height without labels. **Keyframes** grey, a path for each drive.
**Edges**: odometry blue, loops green. A scan: **orange** where it was found, **red** where it may
be.
"""


class MapView(Recording):
    """Shows a map."""

    def show(self, known: Map, found: Located | None, text: str) -> None:
        """Show a map, where a scan was found in it, and what is said of both."""
        log = self.stream.log
        self.stream.send_blueprint(rrb.Blueprint(rrb.Horizontal(
            view('/map', 'map', UNIT_M), rrb.Vertical(
                rrb.TextDocumentView(origin='/result', name='result'),
                rrb.TextDocumentView(origin='/about', name='what you see')),
            column_shares=[3, 1]), collapse_panels=True))
        log('/map', rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        points, classes = joined_cloud(known.scans())
        cloud = Shown(points.astype(np.float64), classes)[thin(len(points), MAP_POINTS)]
        log('/map/cloud', rr.Points3D(cloud.points.astype(np.float32), colors=cloud.colours(),
                                      radii=[POINT_SIZE]), static=True)
        log('/map/keyframes', rr.Points3D(
            known.positions[1].astype(np.float32), colors=[GREY], radii=[-4.0],
            labels=[str(node) for node in known.positions[0]], show_labels=False), static=True)
        for session in known.sessions:
            nodes = sorted((node for node in known.nodes.values() if node.session == session),
                           key=lambda node: node.stamp_ns)
            path = np.array([node.T_map_sensor[:3, 3] for node in nodes], np.float32)
            log(f'/map/drives/{session}', rr.LineStrips3D([path], colors=[GREY], radii=[-0.5]),
                static=True)
        for kind, colour in ((Kind.ODOMETRY, BLUE), (Kind.LOOP, GREEN)):
            ends = [known.poses((edge.target, edge.source))[:, :3, 3].astype(np.float32)
                    for edge in known.edges if edge.kind is kind]
            log(f'/map/edges/{kind.value}', rr.LineStrips3D(ends, colors=[colour], radii=[-1.0]),
                static=True)
        if found is not None and found.T_map_sensor is not None:
            places = [found.T_map_sensor, *(place.T_map_sensor for place in found.alternatives)]
            name, colour = ('found', ORANGE) if found.success else ('perhaps', RED)
            for i, T in enumerate(places):
                path_of = f'/map/scan/{name}/{i}'
                self.place(path_of, T)
                log(path_of, rr.TransformAxes3D(AXES_M),
                    rr.Points3D([[0.0, 0.0, 0.0]], colors=[colour], radii=[-8.0]))
        log('/result', rr.TextDocument(text), static=True)
        log('/about', rr.TextDocument(ABOUT, media_type='text/markdown'), static=True)
