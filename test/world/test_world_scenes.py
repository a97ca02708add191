"""Places of many kinds: what is there, where a sensor may be, and what repeats."""
import numpy as np
import open3d as o3d
import pytest

from sgor_ros.commands.demo import BAG_SCANS
from sgor_ros.core.scan.labels import label_convention
from sgor_ros.world import Lidar
from sgor_ros.world import scenes
from sgor_ros.world import simulate
from sgor_ros.world.scenes import KINDS
from sgor_ros.world.scenes.plot import clear_of

CLEAN = Lidar(beams=32, columns=720, range_noise=0.0, drop_out=0.0)
EVEN = Lidar(beams=16, columns=360, fov_up=0.3, fov_down=-0.3, range_noise=0.0, drop_out=0.0)
GROUND = {'road', 'parking', 'sidewalk', 'other-ground', 'terrain'}
CAR, OTHER_OBJECT, FENCE, POLE = 10, 99, 51, 80


@pytest.fixture(scope='module', params=KINDS)
def kind(request):
    return request.param


@pytest.fixture(scope='module')
def place(kind):
    return scenes.make(kind, 4)


def scan(place, pose, lidar=CLEAN):
    """Scan with rays that start at the same azimuth each time."""
    return lidar.scan(place, pose, np.random.default_rng(0))


def images(place, pose):
    """Return ranges and labels of all rays, (32, 720) each; 0 where they miss."""
    points, seen = scan(place, pose)
    reach = np.linalg.norm(points, axis=1)
    elevation, azimuth = np.arcsin(points[:, 2] / reach), np.arctan2(points[:, 1], points[:, 0])
    row = np.round((CLEAN.fov_up - elevation) / (CLEAN.fov_up - CLEAN.fov_down) * 31).astype(int)
    column = np.floor(azimuth / (2 * np.pi) * 720).astype(int) % 720
    ranges, labels = np.zeros((32, 720)), np.zeros((32, 720), int)
    ranges[row, column], labels[row, column] = reach, seen
    return ranges, labels


def moved(pose, x, y=0.0):
    pose = pose.copy()
    pose[:2, 3] += x, y
    return pose


def is_rotation(R):
    return np.allclose(R @ R.T, np.eye(3), atol=1e-9) and np.isclose(np.linalg.det(R), 1.0)


def distance_to_surfaces(place, points):
    query = o3d.core.Tensor.from_numpy(np.asarray(points, np.float32))
    return place.raycaster.compute_distance(query).numpy()


def test_points_are_labelled_and_lie_on_what_is_there(kind, place):
    pose = scenes.drive(place, 1, KINDS[kind].step)[0]
    points, labels = scan(place, pose)
    convention = label_convention('semantickitti')
    classes, keep, unknown = convention.decode(labels.astype(np.int64))
    assert unknown == []
    assert keep.all()
    seen = {convention.names[c] for c in np.unique(classes)}
    assert seen & GROUND
    assert len(seen) >= 2
    # what the ground is called lies under the sensor, and nothing else does
    ground = np.isin(classes, list(convention.ground))
    near = np.linalg.norm(points[:, :2], axis=1) < 4.0
    assert (near & ground).sum() > 50
    world = points @ pose[:3, :3].T + pose[:3, 3]
    foot = world[near & ground]
    assert np.median(foot[:, 2] - place.ground_height(foot[:, :2])) == pytest.approx(0.0, abs=0.1)
    assert distance_to_surfaces(place, world).max() < 0.003


def test_same_seed_same_place_and_other_seed_another_one(kind, place):
    pose = scenes.drive(place, 1, KINDS[kind].step)[0]
    points, labels = scan(place, pose)
    again, labels_again = scan(scenes.make(kind, 4), pose)
    np.testing.assert_array_equal(again, points)
    np.testing.assert_array_equal(labels_again, labels)
    for seed in (5, 6, 7):
        other, _ = scan(scenes.make(kind, seed), pose)
        if len(other) != len(points):
            break
        if (np.linalg.norm(other - points, axis=1) > 0.05).mean() > 0.01:
            break
    else:
        pytest.fail('other seeds give the same place')


def test_pairs_are_as_far_apart_as_asked_and_stand_free(kind, place):
    rng = np.random.default_rng(1)
    low, high = KINDS[kind].distances
    distances, yaws, tilts = [], [], []
    for _ in range(40):
        pair = scenes.random_pair(place, rng, low, high)
        distances.append(np.linalg.norm(pair[0][:2, 3] - pair[1][:2, 3]))    # in plan
        for pose in pair:
            assert is_rotation(pose[:3, :3])
            yaws.append(np.arctan2(pose[1, 0], pose[0, 0]))
            tilts.append(np.arccos(pose[2, 2]))
            assert clear_of(place.boxes, pose[None, :2, 3], place.clearance - 1e-9).all()
            foot = place.ground_height(pose[None, :2, 3])[0]
            assert pose[2, 3] - foot == pytest.approx(place.sensor_height)
            # all around there is room: neither in an object nor in a wall
            points, _ = scan(place, pose, EVEN)
            assert np.linalg.norm(points, axis=1).min() > 0.75 * min(place.clearance, 0.6)
    assert low - 0.01 <= min(distances)
    assert max(distances) <= high + 0.01
    assert max(distances) - min(distances) > 0.5 * (high - low)
    # of any yaw, but hardly tilted
    assert all(np.histogram(yaws, 4, (-np.pi, np.pi))[0] > 5)
    assert 0.002 < np.median(tilts) < np.deg2rad(4.0)
    assert max(tilts) < np.deg2rad(9.0)


def test_no_sensor_is_under_or_inside_a_thing(kind, place):
    """Straight down from the sensor is the ground, at the height that it should have."""
    rng = np.random.default_rng(2)
    poses = [pose for _ in range(20)
             for pose in scenes.random_pair(place, rng, *KINDS[kind].distances)]
    poses += list(scenes.drive(place, 20, KINDS[kind].step))
    rays = np.array([[*pose[:3, 3], 0.0, 0.0, -1.0] for pose in poses], np.float32)
    hits = place.raycaster.cast_rays(o3d.core.Tensor.from_numpy(rays))
    np.testing.assert_allclose(hits['t_hit'].numpy(), place.sensor_height, atol=0.12)


def test_a_pair_that_has_no_room_is_refused(place):
    with pytest.raises(ValueError, match=r'no room for two sensors'):
        scenes.random_pair(place, np.random.default_rng(0), 5000.0, 5001.0)


def test_drives_keep_the_step_and_look_ahead(kind, place):
    step = KINDS[kind].step
    poses = scenes.drive(place, 60, step)
    assert poses.shape == (60, 4, 4)
    assert all(is_rotation(pose[:3, :3]) for pose in poses)
    way = np.diff(poses[:, :2, 3], axis=0)    # in plan: stairs are steep, and the sensor level
    length = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(length, step, rtol=0.08)
    assert np.sum(way / length[:, None] * poses[:-1, :2, 0], axis=1).min() > 0.98
    turn = poses[:-1, :3, :3].transpose(0, 2, 1) @ poses[1:, :3, :3]
    angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.rad2deg(angle).max() < 12.0
    for pose in poses[::10]:
        points, _ = scan(place, pose, EVEN)
        assert np.linalg.norm(points, axis=1).min() > 0.4


def test_a_drive_longer_than_its_path_is_refused():
    with pytest.raises(ValueError, match=r'1000 scans, 2\.5 m apart, are more than the path'):
        scenes.drive(scenes.make('highway', 0), 1000, 2.5)


def test_a_closed_path_goes_round_and_round():
    yard = scenes.make('courtyard', 0)
    poses = scenes.drive(yard, 400, 0.3)
    assert np.ptp(poses[:, 0, 3]) > 6.0
    assert np.linalg.norm(poses[200:, :2, 3] - poses[0, :2, 3], axis=1).min() < 0.5


@pytest.mark.parametrize(('kind', 'pitch'), [
    ('tunnel', 7.3), ('tunnel_lamps_12', 12.0), ('tunnel_lamps_25', 25.0)])
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_tunnel_looks_the_same_a_pitch_further_on(kind, pitch, seed):
    tunnel = scenes.make(kind, seed)
    pose = scenes.drive(tunnel, 1, 0.8)[0]
    ranges, labels = images(tunnel, pose)
    again, labels_again = images(tunnel, moved(pose, pitch))
    # by rounding a ray at an edge may fall to the other side of it
    assert (np.abs(again - ranges) < 0.01).mean() > 0.999
    assert (labels == labels_again).mean() > 0.999
    if kind != 'tunnel':
        lamps = (labels == OTHER_OBJECT).sum()
        _, half_way = images(tunnel, moved(pose, pitch / 2))
        assert lamps > 10
        assert (half_way != labels).sum() > lamps


@pytest.mark.parametrize('kind', [name for name in KINDS if name.startswith('tunnel')
                                  or name in ('corridor', 'facade', 'highway')])
def test_the_end_of_a_long_place_is_out_of_reach(kind):
    long = scenes.make(kind, 0)
    rng = np.random.default_rng(0)
    reach = Lidar().max_range
    points = [pose[:3, :3] @ p + pose[:3, 3]
              for pose in scenes.random_pair(long, rng, *KINDS[kind].distances)
              for p in scan(long, pose)[0][::10]]
    ends = max(abs(long.area[0]), abs(long.area[1]))
    assert np.abs(np.array(points)[:, 0]).max() < ends + reach
    # there is still something to see right up to the range of the sensor
    floor = np.array([[side * (ends + reach - 1.0), np.mean(long.area[2:]), 10.0, 0, 0, -1.0]
                      for side in (-1, 1)], np.float32)
    hits = long.raycaster.cast_rays(o3d.core.Tensor.from_numpy(floor))
    assert np.isfinite(hits['t_hit'].numpy()).all()


def period(kind, seed):
    """Return by which of the pitches that are built, and others, scans along x agree, m."""
    place = scenes.make(kind, seed)
    pose = scenes.drive(place, 1, 1.0)[0]
    ranges, labels = images(place, pose)
    standing = ~np.isin(labels, [0, 40, 44, 48, 49, 72])
    found = []
    for shift in (*np.arange(0.5, 30.1, 0.5), 2.8, 3.2):
        again, _ = images(place, moved(pose, shift))
        if (np.abs(again - ranges)[standing] < 0.02).mean() > 0.97:
            found.append(round(float(shift), 1))
    return found


@pytest.mark.parametrize('kind', ['corridor', 'facade', 'facade_cars_regular',
                                  'parking_regular', 'orchard_regular'])
def test_what_is_regular_repeats(kind):
    shifts = period(kind, 0)
    assert shifts
    assert min(shifts) >= 2.0


@pytest.mark.parametrize('kind', ['facade_cars_random', 'parking_jittered', 'orchard_jittered',
                                  'garage_half_full', 'field', 'road_tunnel', 'hall', 'stairs'])
def test_what_is_unique_does_not(kind):
    assert period(kind, 0) == []


@pytest.mark.parametrize(('empty', 'full', 'label'), [
    ('garage_empty', 'garage_half_full', CAR), ('facade', 'facade_cars_random', CAR),
    ('tunnel', 'road_tunnel', CAR), ('tunnel', 'tunnel_lamps_12', OTHER_OBJECT)])
def test_a_kind_has_what_its_name_says(empty, full, label):
    assert label not in scenes.make(empty, 0).label_of_geometry
    assert label in scenes.make(full, 0).label_of_geometry


def test_stairs_have_steps_and_the_sensor_is_carried_level_up_them():
    stair = scenes.make('stairs', 0)
    poses = scenes.drive(stair, 80, 0.5)
    assert poses[-1, 2, 3] - poses[0, 2, 3] > 10.0
    assert poses[:, 2, 2].min() > np.cos(np.deg2rad(1.5))
    # down along the middle: treads are level, a rise apart
    x = np.arange(-15.0, 15.0, 0.01)
    rays = np.zeros((len(x), 6), np.float32)
    rays[:, 0], rays[:, 5] = x, -1.0
    rays[:, 2] = stair.ground_height(rays[:, :2]) + 1.0
    hits = stair.raycaster.cast_rays(o3d.core.Tensor.from_numpy(rays))
    rise = np.diff(rays[:, 2] - hits['t_hit'].numpy())
    up = rise[np.abs(rise) > 1e-3]
    assert len(up) > 50
    np.testing.assert_allclose(up, up[0], atol=1e-4)
    assert 0.15 < up[0] < 0.19


def test_highway_has_rails_and_posts_at_their_pitch():
    road = scenes.make('highway', 0)
    side = road.area[3] + 1.0 + 1.3
    for x in (-100.0, 0.0, 50.0):
        for y in (-side, side):
            assert distance_to_surfaces(road, [(x, y, 0.5)])[0] < 0.1
            assert distance_to_surfaces(road, [(x + 25.0, y, 0.9)])[0] > 0.3
    assert {FENCE, POLE} <= set(road.label_of_geometry.tolist())


def test_the_world_is_driven_through_in_any_place():
    coarse = Lidar(beams=16, columns=180)
    for place, step in (('street', 0.6), ('highway', 2.5), ('corridor', 0.3)):
        stamps, points, labels, poses = zip(*simulate(3, 1, coarse, place=place), strict=True)
        np.testing.assert_allclose(stamps, (0.0, 0.1, 0.2))
        way = np.linalg.norm(np.diff(np.array(poses)[:, :3, 3], axis=0), axis=1)
        np.testing.assert_allclose(way, step, rtol=0.03)
        assert all(len(p) == len(ids) > 500 for p, ids in zip(points, labels, strict=True))
    faster = [pose for *_, pose in simulate(2, 1, coarse, 12.0, 'highway')]
    assert np.linalg.norm(faster[1][:3, 3] - faster[0][:3, 3]) == pytest.approx(1.2, rel=0.01)


@pytest.mark.parametrize('kind', KINDS)
def test_every_place_has_way_enough_for_a_bag_of_the_demo(kind):
    for seed in range(3):
        assert len(scenes.drive(scenes.make(kind, seed), BAG_SCANS, KINDS[kind].step)) == BAG_SCANS
