"""Where bird's-eye-view maps agree: shifts and quarter turns of clutter that stands once."""
from galleries import gallery
from galleries import index_of
from galleries import moved
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.core.hypotheses.map_correlation import _normal_space_sample
from sgor_ros.core.hypotheses.map_correlation import _peaks
from sgor_ros.core.hypotheses.map_correlation import correlate_maps
from sgor_ros.core.hypotheses.map_correlation import QUARTER_TURNS

STEP = 1.2    # metres: two cells of the map, each a maximum correspondence distance


def clutter(seed=0, count=60):
    """Return posts at random places that face anywhere: points and normals."""
    rng = np.random.default_rng(seed)
    feet = np.c_[rng.uniform(-15, 15, (count, 2)), np.zeros(count)]
    angles = rng.uniform(0, 2 * np.pi, count)
    normals = np.c_[np.cos(angles), np.sin(angles), np.zeros(count)]
    heights = np.array([[0, 0, z] for z in np.arange(-1.4, 1.5, 0.4)])
    return ((feet[:, None] + heights).reshape(-1, 3), np.repeat(normals, len(heights), axis=0))


def seen_from(pose, points, normals, **kwargs):
    """Return the index of a sensor at a pose in the frame of the points."""
    return index_of(se3.transform(se3.inverse(pose), points), normals @ pose[:3, :3], **kwargs)


@pytest.mark.parametrize('quarter', [0, 1, 2, 3])
@pytest.mark.parametrize('yaw_deg', [0.0, 33.0])
def test_a_shift_and_a_quarter_turn_are_found(quarter, yaw_deg):
    """From a start that is off by them; the heading of the start is kept, its place is not."""
    points, normals = clutter()
    truth = moved(3.7, -5.2, 0.0, yaw_deg)
    target, source = index_of(points, normals), seen_from(truth, points, normals)
    # turned about the source's sensor, which stands at the start
    start = moved(-2.0, 4.0, 0.0, yaw_deg - 90.0 * quarter)
    found = correlate_maps(source, target, start, 30.0)
    turned = np.flatnonzero([se3.angle(T[:3, :3] @ truth[:3, :3].T) < 1e-6 for T in found])
    best = found[turned[0]]
    assert np.abs(best[:2, 3] - truth[:2, 3]).max() <= STEP
    np.testing.assert_array_equal(best[2:], truth[2:])
    # whole steps from the start
    steps = (best[:2, 3] - start[:2, 3]) / STEP
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_twelve_peaks_of_the_turn_as_it_is_and_six_of_each_other():
    """The highest of each first."""
    points, normals = clutter()
    index = index_of(points, normals)
    found = correlate_maps(index, index, moved(0.0), 30.0)
    angles = np.degrees(np.arctan2(found[:, 1, 0], found[:, 0, 0])) % 360
    np.testing.assert_allclose(angles, np.repeat([0, 90, 180, 270], (12, 6, 6, 6)), atol=1e-9)
    assert len(np.unique(found.round(6), axis=0)) == 30


def test_the_pose_itself_is_no_other():
    """Nor what is a step beside it; the same turned is one."""
    points, normals = clutter()
    index = index_of(points, normals)
    found = correlate_maps(index, index, np.eye(4), 30.0)
    straight = found[np.abs(found[:, 0, 0] - 1) < 1e-9]
    assert len(straight) == 12
    assert np.abs(straight[:, :2, 3]).max(axis=1).min() > 1.5 * STEP
    # two steps beside the truth it is found, which is the best of all
    found = correlate_maps(index, index, moved(2 * STEP), 30.0)
    np.testing.assert_allclose(found[0], np.eye(4), atol=1e-9)


@pytest.mark.parametrize('radius', [4.0, 9.5])
def test_shifts_reach_as_far_as_the_radius(radius):
    points, normals = clutter()
    index = index_of(points, normals)
    start = moved(8.4, -8.4)
    found = correlate_maps(index, index, start, radius)
    shifts = found[:, :2, 3] - start[:2, 3]
    assert np.abs(shifts).max() <= radius
    home = np.linalg.norm(found[:12, :2, 3], axis=1).min()
    assert bool(home < 0.01) is (radius > 8.4)


def test_the_plane_of_the_ground_is_that_of_the_target():
    """The same clutter lying on its side: shifts and turns are in the plane it stands on."""
    points, normals = clutter()
    roll = moved(roll_deg=90.0)
    up = roll[:3, :3] @ [0.0, 0.0, 1.0]
    lying = index_of(points @ roll[:3, :3].T, normals @ roll[:3, :3].T, up=up)
    start = roll @ moved(2 * STEP, 4 * STEP) @ se3.inverse(roll)
    found = correlate_maps(lying, lying, start, 30.0)
    np.testing.assert_allclose(found @ np.array([0, 0, 0, 1.0]) @ [*up, 0], 0, atol=1e-9)
    assert np.abs(found[:12] - np.eye(4)).max(axis=(1, 2)).min() < 1e-9
    np.testing.assert_allclose([T[:3, :3] @ up for T in found], np.tile(up, (30, 1)), atol=1e-9)


def test_labels_tell_things_apart():
    """What stands in one band of height: with another label it is nowhere to be found."""
    points, normals = clutter()
    band = (points[:, 2] > 0) & (points[:, 2] < 1.2)
    one, other = (index_of(points[band], normals[band], label=label) for label in (1, 2))
    found = correlate_maps(one, one, moved(2 * STEP), 30.0)
    np.testing.assert_allclose(found[0], np.eye(4), atol=1e-9)
    assert correlate_maps(other, one, moved(2 * STEP), 30.0).shape == (0, 4, 4)


def test_no_map_no_peak():
    points, normals = clutter()
    index = index_of(points, normals)
    assert correlate_maps(index, index, moved(500.0), 30.0).shape == (0, 4, 4)
    nothing = index_of(points[:0], normals[:0])
    assert correlate_maps(nothing, index, np.eye(4), 30.0).shape == (0, 4, 4)


def test_pillars_agree_one_pitch_apart():
    """Each 8 m: the two highest peaks of all shifts lie nearest to that on the grid, 8.4 m."""
    index = index_of(*gallery(pitch=8.0))
    found = correlate_maps(index, index, np.eye(4), 30.0)
    straight = found[np.abs(found[:, 0, 0] - 1) < 1e-9]
    np.testing.assert_allclose(np.sort(straight[:2, 0, 3]), [-8.4, 8.4], atol=1e-9)
    np.testing.assert_allclose(straight[:, 1, 3], 0.0, atol=1e-9)


def test_quarter_turns():
    np.testing.assert_array_equal([QUARTER_TURNS[k] @ [1, 0, 5] for k in range(4)],
                                  [[1, 0, 5], [0, 1, 5], [-1, 0, 5], [0, -1, 5]])
    np.testing.assert_array_equal([QUARTER_TURNS[k] @ [0, 1, 5] for k in range(4)],
                                  [[0, 1, 5], [-1, 0, 5], [0, -1, 5], [1, 0, 5]])


def test_peaks_are_the_highest_and_none_is_next_to_another():
    hits = np.zeros((2, 6, 5), np.int32)
    hits[0, 0, 0], hits[0, 1, 1], hits[0, 2, 2], hits[0, 5, 4], hits[0, 4, 3] = 9, 8, 7, 6, 5
    hits[0, 0, 4], hits[0, 5, 0] = 4, 3
    hits[1, 3, 2] = 1
    assert _peaks(hits.copy(), (3, 3)) == [(0, 0, 0), (0, 2, 2), (0, 5, 4), (1, 3, 2)]
    assert _peaks(hits.copy(), (9, 9)) == [(0, 0, 0), (0, 2, 2), (0, 5, 4), (0, 0, 4), (0, 5, 0),
                                      (1, 3, 2)]
    assert _peaks(hits.copy(), (2, 0)) == [(0, 0, 0), (0, 2, 2)]
    assert _peaks(np.zeros((4, 3, 3), np.int32), (4, 4, 4, 4)) == []


def test_normal_space_sampling_by_hand():
    """10 of 3, 7 and 90: all of the few, what they leave is for the others; in order."""
    sectors = np.repeat([5, 0, 2], [90, 3, 7])
    for most, counts in ((10, (3, 4, 3)), (30, (3, 7, 20)), (2, (0, 1, 1)), (200, (3, 7, 90))):
        rows = _normal_space_sample(sectors, most)
        assert (np.diff(rows) > 0).all()
        found = tuple(int((sectors[rows] == sector).sum()) for sector in (0, 2, 5))
        assert sum(found) == min(most, 100)
        if most > 2:
            assert found == counts
    assert _normal_space_sample(sectors[:0], 10).shape == (0,)
