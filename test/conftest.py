"""Shared input: real scans where there are any, and a few scans of the built-in street."""
import os
from pathlib import Path

import numpy as np
import pytest

from sgor_ros.io.bags import BagWriter
from sgor_ros.io.messages import point_cloud2
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

PERIOD_NS = 100_000_000


SLOW_ROOMS = {'commands', 'evaluation', 'execution', 'files', 'node', 'package', 'pipeline',
              'world', 'test_bounds.py', 'test_hints.py', 'test_paper.py', 'test_places.py',
              'test_tracker.py'}
"""Processes, DDS, files, drives, tables, whole places: `make test-fast` leaves them out."""
SLOW_FIXTURES = {'data_folder', 'domain'}


def pytest_collection_modifyitems(items):
    """Mark what takes long by the room it is in or by what it asks for; others mark themselves."""
    for item in items:
        rooms = item.path.relative_to(Path(__file__).parent).parts
        if SLOW_ROOMS.intersection(rooms) or SLOW_FIXTURES.intersection(item.fixturenames):
            item.add_marker('slow')


@pytest.fixture(scope='session')
def data_folder():
    """Return the folder of real data: SGOR_DATA, or ../shared/data beside the checkout."""
    default = Path(__file__).resolve().parents[2] / 'shared/data'
    folder = Path(os.environ.get('SGOR_DATA', default))
    if not (folder / 'pairs.json').is_file():
        pytest.skip(f'no real data in {folder}; set SGOR_DATA')
    return folder


@pytest.fixture(scope='session')
def street():
    """Return scans of a street 1.5 m apart: (points, labels, T_world_sensor) of each."""
    lidar = Lidar(beams=64, columns=900)
    return [scan[1:] for scan in simulate(4, seed=0, lidar=lidar, speed=15.0)]


@pytest.fixture(scope='session')
def elsewhere():
    """Return scans of another street, 6 m apart: (points, labels, T_world_sensor) of each."""
    lidar = Lidar(beams=64, columns=900)
    return [scan[1:] for scan in simulate(3, seed=1, lidar=lidar, speed=60.0)]


@pytest.fixture(scope='session')
def street_bag(street, tmp_path_factory):
    """Return an mcap bag of the street on /points."""
    return write_bag(tmp_path_factory.mktemp('street') / 'bag',
                     [(points, labels, i * PERIOD_NS) for i, (points, labels, _)
                      in enumerate(street)])


def write_bag(path, clouds, topic='/points'):
    """Write (points, labels or None, stamp_ns) clouds to a bag; return its path."""
    with BagWriter(path) as bag:
        for points, labels, stamp_ns in clouds:
            bag.write(topic, point_cloud2(bag.types, points, labels, stamp_ns, 'lidar'), stamp_ns)
    return path


def relative(T_a, T_b):
    """Return T_a_b of two poses in one frame."""
    return np.linalg.inv(T_a) @ T_b


def errors(T, truth):
    """Return the errors of a transformation: metres and degrees."""
    delta = np.linalg.inv(truth) @ T
    cosine = np.clip((np.trace(delta[:3, :3]) - 1) / 2, -1, 1)
    return np.linalg.norm(delta[:3, 3]), np.degrees(np.arccos(cosine))


@pytest.fixture(scope='module')
def domain():
    """Yield a ROS domain that no other test on this machine uses."""
    from sgor_ros.ros.playback.domain import Domain  # only where there is ROS
    domain = Domain()
    yield domain
    domain.close()
