"""The picture of a map that stays: cloud, nodes, edges by kind, and where a scan was found."""
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...io.colours import ESTIMATE
from ...io.colours import INLIER
from ...io.colours import LIMIT
from ...io.colours import SERIES
from ...io.colours import TARGET
from ...io.plots import new_figure
from ...io.plots import save
from ...mapping import Located
from ...mapping import Map
from ...mapping.edge import Kind

MOST_POINTS = 200_000
"""Of the cloud: more of them only make it slower."""


def plot_map(path: Path, title: str, known: Map, cloud: NDArray[np.float32],
             found: Located | None = None) -> None:
    """Draw a map from above.

    Parameters
    ----------
    path : Path
        Picture to write.
    title : str
    known : Map
    cloud : (P, 3) array
        Its points, metres.
    found : Located, optional
        Drawn with its heading; where it is ambiguous, each place.
    """
    figure = new_figure(9, 8, 'compressed')
    axes = figure.subplots()
    axes.set_title(title, loc='left', weight='bold')
    axes.scatter(*cloud[::len(cloud) // MOST_POINTS + 1, :2].T, s=0.3, c=LIMIT, linewidths=0)
    for kind, colour in ((Kind.ODOMETRY, ESTIMATE), (Kind.LOOP, INLIER)):
        ends = [known.poses((edge.target, edge.source))[:, :2, 3] for edge in known.edges
                if edge.kind is kind]
        for i, line in enumerate(ends):
            axes.plot(*line.T, '-', color=colour, lw=1.2, label=kind.value if i == 0 else None)
    for i, session in enumerate(known.sessions):
        nodes = known.poses(node.id for node in known.nodes.values()
                            if node.session == session)[:, :2, 3]
        _, marker, _ = SERIES[i % len(SERIES)]
        axes.plot(*nodes.T, marker, color=ESTIMATE, ms=3, label=f'drive {session}')
    if found is not None and found.T_map_sensor is not None:
        places = (found.T_map_sensor, *(place.T_map_sensor for place in found.alternatives))
        for i, T in enumerate(places):
            axes.quiver(*T[:2, 3], *T[:2, 0], color=TARGET, zorder=3,
                        label='found' if i == 0 and found.success else
                        'perhaps' if i == 0 else None)
    axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal')
    axes.legend(loc='upper right', frameon=False)
    save(figure, path)
