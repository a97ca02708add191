"""The node over many rounds of one drive, as fast as it goes: SGOR_SOAK=10000 for a long one."""
import os
from pathlib import Path

import numpy as np
import ros_helpers as ros
from ros_helpers import street

from sgor_ros.commands.demo import forth_and_back
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.domain import Domain
from sgor_ros.ros.playback.node_process import NodeProcess

SCANS = int(os.environ.get('SGOR_SOAK', '200'))
ROUND = 40
SAMPLES = 20
# of the way: there is no map, so the odometry of a long drive drifts
DRIFT = 0.001


def state(node):
    """Return memory (MB), threads and open files of the node."""
    process = Path(f'/proc/{node.process.pid}')
    threads = next(int(line.split()[1]) for line in (process / 'status').read_text().splitlines()
                   if line.startswith('Threads'))
    return node.memory_mb(), threads, len(list((process / 'fd').iterdir()))


def test_rounds_without_growth_or_loss(tmp_path):
    drive = {stamp: scan for stamp, *scan in street(ROUND)}
    origin = np.linalg.inv(drive[ros.START_NS][2])
    samples, seconds, errors_m, way_m = [], [], [], [0.0]
    last = drive[ros.START_NS][2]
    domain = Domain()
    with NodeProcess(domain, tmp_path / 'log') as node, ros.Partner(domain) as partner:
        partner.wait_for_node(node.alive)
        for index, (original, stamp) in enumerate(forth_and_back(list(drive), SCANS), 1):
            points, labels, pose = drive[original]
            values = partner.outcome(ros.cloud(points, labels, stamp), 60.0)[2]
            assert int(values['received']) == index
            seconds.append(float(values['seconds']))
            way_m.append(way_m[-1] + np.linalg.norm(pose[:3, 3] - last[:3, 3]))
            last = pose
            if values['state'] != 'failed':
                partner.spin_until(lambda: partner.odometry)
                message, = partner.odometry
                assert stamp_ns_of(message.header) == stamp
                errors_m.append(ros.difference(matrix_of(message.pose.pose), origin @ pose)[0])
                assert errors_m[-1] < 0.5 + DRIFT * way_m[-1]
            partner.forget()
            if index % (SCANS // SAMPLES) == 0:
                samples.append(state(node))
                p95_ms = 1e3 * np.percentile(seconds[-SCANS // SAMPLES:], 95)
                print('scan {}: {:.1f} MB, {} threads, {} files, p95 {:.0f} ms'.format(
                    index, *samples[-1], p95_ms), flush=True)
        assert node.stop() == 0
    domain.close()
    print(f'{SCANS} scans, {way_m[-1]:.0f} m, worst {max(errors_m):.2f} m off; {values}')
    assert int(values['processed']) == len(errors_m)
    assert int(values['processed']) + int(values['failed']) == SCANS
    assert int(values['failed']) <= SCANS // 100
    settled = samples[SAMPLES // 4]
    for memory_mb, *others in samples[SAMPLES // 4:]:
        assert others == list(settled[1:])
        # it takes some hundred scans until the allocator has what it needs
        assert memory_mb < (1.05 * settled[0] + 5 if SCANS >= 2000 else 400)
