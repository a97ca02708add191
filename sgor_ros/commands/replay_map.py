"""What `sgor_replay --loops` writes beside the results of odometry: graph, map, trajectories."""
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..evaluation.metrics.trajectory import ape
from ..evaluation.metrics.trajectory import rmse
from ..evaluation.report.loop_plots import plot_loops
from ..io.g2o import write_g2o
from ..io.g2o import write_stamps
from ..io.map_files import write_map_pcd
from ..io.map_files import write_map_ply
from ..io.trajectories import write_kitti
from ..io.trajectories import write_tum
from ..mapping import Mapper
from ..mapping.map_cloud import map_cloud
from ..pipeline.outcome import Row

Array = NDArray[np.float64]


def write_map(folder: Path, mapper: Mapper, rows: list[Row], T_base_sensor: Array,
              T_world_sensor: Sequence[Array | None], title: str) -> dict[str, Any]:
    """Write all of it into a folder, and return what the summary says of it.

    Parameters
    ----------
    folder : Path
    mapper : Mapper
    rows : list of Row
        Of all scans, in their order.
    T_base_sensor : (4, 4) array
        The trajectories are those of the base.
    T_world_sensor : sequence of (4, 4) array or None
        True poses of the scans, where they are known.
    title : str
        Of the picture.
    """
    after, before = mapper.trajectory(), mapper.trajectory(loops=False)
    stamps_ns = after.stamps_ns.tolist()
    parts = list(dict.fromkeys(after.part.tolist()))
    for number, part in enumerate(parts, 1):
        ending = f'_{number}' * (number > 1)
        poses = {stamp: T_base_sensor @ T @ se3.inverse(T_base_sensor) for stamp, T, of in
                 zip(stamps_ns, after.T_map_sensor, after.part, strict=True) if of == part}
        write_tum(folder / f'corrected{ending}.tum', list(poses), list(poses.values()))
        write_kitti(folder / f'corrected_kitti{ending}.txt',
                    [poses.get(row.stamp_ns) for row in rows])
    nodes = mapper.graph.nodes
    write_g2o(folder / 'graph.g2o', dict(zip(nodes, mapper.graph.poses(nodes), strict=True)),
              mapper.graph.edges)
    write_stamps(folder / 'graph_stamps.txt', mapper.node_stamps_ns())
    points, labels = map_cloud(mapper.keyframes, mapper.graph)
    write_map_ply(folder / 'map.ply', points, labels)
    write_map_pcd(folder / 'map.pcd', points, labels)
    at, stamp_of = {stamp: i for i, stamp in enumerate(stamps_ns)}, mapper.node_stamps_ns()
    plot_loops(folder / 'loops.png', title, before.T_map_sensor, after.T_map_sensor,
               [(at[stamp_of[loop.target]], at[stamp_of[loop.source]])
                for loop in mapper.graph.loops], points)
    summary: dict[str, Any] = {
        'loops': [[stamp_of[loop.target], stamp_of[loop.source]] for loop in mapper.graph.loops],
        'contradicted_loops': mapper.consistency.contradicted,
        'waiting_loops': len(mapper.consistency.waiting), 'candidates_put_off':
        mapper.candidates.put_off, 'nodes': len(nodes), 'keyframes': len(mapper.keyframes),
        'keyframe_megabytes': round(mapper.keyframes.nbytes / 1e6, 3), 'parts': len(parts)}
    if not mapper.graph.missing and mapper.graph.loops:
        chi_squared, freedom = mapper.graph.chi_squared()
        summary['chi_squared_per_degree_of_freedom'] = round(chi_squared / max(freedom, 1), 3)
    if any(T is not None for T in T_world_sensor) and find_spec('evo') is not None:
        truth = {row.stamp_ns: T for row, T in zip(rows, T_world_sensor, strict=True)
                 if T is not None}
        known = [i for i, stamp in enumerate(stamps_ns) if after.part[i] == parts[0]
                 and stamp in truth]
        true = np.array([se3.inverse(truth[stamps_ns[known[0]]]) @ truth[stamps_ns[i]]
                         for i in known])
        for name, trajectory in (('before', before), ('after', after)):
            _, metres = ape(trajectory.T_map_sensor[known], true)
            summary[f'ape_{name}_m'] = round(rmse(metres), 4)
    return summary
