"""Compiled kernels stay inside their arrays, which compiled code does not check by itself."""
import os
import subprocess
import sys

import numpy as np
import pytest

from sgor_ros.core.index.birds_eye_view import birds_eye_view

pytestmark = pytest.mark.slow    # processes that compile anew

SCRIPT = """
import numpy as np

from sgor_ros import preprocess, register, register_correspondences, SemanticScan, SgorConfig
from sgor_ros.core.scan.deskewing import deskewed
from sgor_ros.world import Lidar, simulate

lidar = Lidar(beams=24, columns=400)
rng = np.random.default_rng(0)
scan = SemanticScan(rng.uniform(-60, 60, (5000, 3)), times=rng.uniform(-0.1, 0.1, 5000))
deskewed(scan, rng.normal(size=6))
(_, p, p_labels, _), (_, q, q_labels, _) = list(simulate(12, 0, lidar=lidar))[::11]
for config in (SgorConfig(), SgorConfig.paper(), SgorConfig.kitti_protocol(), SgorConfig.indoor()):
    config = config.replace(threads=1)
    for labels in ((p_labels, q_labels), (None, None)):
        source, target = (preprocess(SemanticScan(*scan), config)
                          for scan in zip((p, q), labels))
        print(register(source, target, config).success)
    # walls on the edges between cells, points in one place, on a line, hardly any
    for edge in (0.5, config.voxel_size, config.max_correspondence_distance, 5.0):
        walls = np.round(rng.uniform(-20, 20, (2000, 3)) / edge) * edge
        for points in (walls, walls[:1].repeat(50, 0), walls * (1, 0, 0), walls[:5], walls[:1]):
            prepared = preprocess(SemanticScan(points), config.replace(min_range=0.0))
            register(prepared, prepared)
    for count in (3, 63, 64, 65, 500):
        source = rng.uniform(-30, 30, (count, 3))
        wrong = rng.uniform(-30, 30, (count, 3))
        target = np.where(rng.random((count, 1)) < 0.5, source + 1, wrong)
        register_correspondences(source, target, config=config)
print('done')
"""


@pytest.mark.parametrize('edge', [0.5, 0.6, 1.2, 0.1])
def test_the_birds_eye_view_has_room_for_points_on_its_edges(edge):
    """A wall at a whole number of cells: it once wrote beyond the map."""
    rng = np.random.default_rng(0)
    placed = rng.uniform(-12, 12, (500, 3))
    placed[:100, 0], placed[100:200, 1], placed[200:300, 0] = 12.0, 12.0, -12.0
    found = birds_eye_view(placed, np.tile([1.0, 0, 0], (500, 1)), np.ones(500, np.uint8), edge)
    columns = np.floor((placed[:, :2] - found.low) / found.edge).astype(int)
    assert columns.min() >= 1
    assert columns.max() + 1 < len(found.cells)
    assert np.all(found.cells[columns[:, 0], columns[:, 1]] != 0)


def test_kernels_stay_inside_their_arrays(tmp_path):
    """Compiled anew with checks of every index, on streets and on what lies on edges."""
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT], capture_output=True, text=True, timeout=900,
        env={**os.environ, 'NUMBA_BOUNDSCHECK': '1', 'NUMBA_CACHE_DIR': str(tmp_path)})
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.splitlines()[-1] == 'done'
