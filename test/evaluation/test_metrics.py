"""Metrics against values computed by hand."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import InputError
from sgor_ros.core.common import se3
from sgor_ros.evaluation.metrics import inliers
from sgor_ros.evaluation.metrics import pose_error
from sgor_ros.evaluation.metrics import trajectory


def pose(x=0.0, y=0.0, z=0.0, yaw_deg=0.0):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('z', yaw_deg, degrees=True).as_matrix()
    T[:3, 3] = x, y, z
    return T


def test_rotation_error_is_the_angle_between_and_resolves_small_ones():
    assert pose_error.rotation_error_deg(pose(yaw_deg=30), pose(yaw_deg=-60)) == pytest.approx(90)
    assert pose_error.rotation_error_deg(pose(yaw_deg=1), pose(x=9, yaw_deg=1.0001)) == (
        pytest.approx(1e-4, rel=1e-6))
    assert pose_error.rotation_error_deg(pose(yaw_deg=180), pose()) == pytest.approx(180)


def test_translation_error_is_a_distance_whatever_the_rotation():
    assert pose_error.translation_error_m(pose(1, 2, 3, yaw_deg=70), pose(1, 5, 7)) == 5.0


def test_inlier_scores_by_hand():
    # residuals along x: truth moves by 0, the estimate by 1
    source = np.zeros((5, 3))
    target = np.zeros((5, 3))
    target[:, 0] = [0.0, 0.4, 0.5, 1.0, 9.0]
    # within 0.55 of the truth: rows 0 1 2; of the estimate: rows 2 3 (row 1 is 0.6 away)
    scores = inliers.inlier_scores(source, target, pose(x=1), pose(), 0.55)
    assert scores.precision == pytest.approx(1 / 2)
    assert scores.recall == pytest.approx(1 / 3)
    assert scores.f1 == pytest.approx(0.4)


def test_inlier_scores_are_zero_where_nothing_is_right():
    far = inliers.inlier_scores(np.zeros((3, 3)), np.zeros((3, 3)), pose(x=9), pose(), 0.6)
    assert (far.precision, far.recall, far.f1) == (0.0, 0.0, 0.0)


def test_drift_of_a_scaled_straight_line_is_the_scale_error():
    truth = np.array([pose(x=i) for i in range(21)])
    estimate = np.array([pose(x=1.02 * i) for i in range(21)])
    drift = trajectory.drift(estimate, truth, (5.0, 10.0, 50.0))
    assert drift.translation_percent == pytest.approx(2.0)
    assert drift.rotation_deg_per_m == pytest.approx(0.0, abs=1e-9)
    assert drift.stretches == 16 + 11    # the 50 m do not fit


def test_drift_of_a_turning_estimate():
    truth = np.array([pose(x=i) for i in range(11)])
    estimate = np.array([pose(x=i, yaw_deg=0.1 * i) for i in range(11)])
    drift = trajectory.drift(estimate, truth, (10.0,))
    assert drift.rotation_deg_per_m == pytest.approx(0.1)
    # the end is where it should be in the first frame, and so it is in the last
    assert drift.translation_percent == pytest.approx(0.0, abs=1e-9)


def test_drift_does_not_see_the_frame_of_the_trajectory():
    truth = np.array([pose(x=math.cos(a), y=math.sin(a), yaw_deg=math.degrees(a))
                      for a in np.linspace(0, 6, 50)])
    drift = trajectory.drift(pose(3, 4, 5, yaw_deg=33) @ truth, truth, (1.0, 2.0))
    assert drift.stretches > 0
    assert drift.translation_percent == pytest.approx(0.0, abs=1e-9)
    assert drift.rotation_deg_per_m == pytest.approx(0.0, abs=1e-6)


def test_drift_without_a_stretch_is_not_a_number():
    drift = trajectory.drift(np.array([pose()]), np.array([pose()]))
    assert math.isnan(drift.translation_percent)
    assert drift.stretches == 0
    with pytest.raises(InputError, match=r'\(2, 4, 4\)'):
        trajectory.drift(np.zeros((2, 4, 4)), np.zeros((3, 4, 4)))


def test_relative_errors_are_of_the_step_that_is_wrong():
    truth = np.array([pose(x=i) for i in range(4)])
    estimate = truth.copy()
    estimate[2:] = [pose(2.3, yaw_deg=2), pose(2.3) @ pose(yaw_deg=2) @ pose(1)]
    rotation, translation = trajectory.rpe(estimate, truth)
    assert rotation == pytest.approx([0, 2, 0], abs=1e-6)
    assert translation == pytest.approx([0, 0.3, 0], abs=1e-9)


def former_rpe(estimate, truth):
    """Return what stood in place of evo's: RE and TE of each step."""
    steps = [(se3.inverse(estimate[i]) @ estimate[i + 1], se3.inverse(truth[i]) @ truth[i + 1])
             for i in range(len(truth) - 1)]
    return (np.array([pose_error.rotation_error_deg(*step) for step in steps]),
            np.array([pose_error.translation_error_m(*step) for step in steps]))


@pytest.mark.parametrize('digits', [5, 16])
@pytest.mark.parametrize('noise', [1e-6, 0.02, 1.0])
def test_evo_gives_the_former_figures(noise, digits):
    """Of a curved track in six dimensions: APE, RPE and the error of the end.

    Poses of files are rounded, so that their rotations are not quite orthogonal.
    """
    rng = np.random.default_rng(3)
    poses = [np.eye(4)]
    for _ in range(60):
        poses.append(poses[-1] @ pose(1.0, 0.1, 0.02, yaw_deg=5))
    truth = np.array(poses).round(digits)
    off = [se3.compose(Rotation.from_rotvec(noise * rng.normal(size=3)).as_matrix(),
                       noise * rng.normal(size=3)) for _ in poses]
    estimate = truth @ np.array(off)
    rotation, translation = trajectory.rpe(estimate, truth)
    before = former_rpe(estimate, truth)
    assert rotation == pytest.approx(before[0], abs=1e-6)
    # it sees them from the true end, whose rotation may keep lengths to five digits only
    close = {'abs': 1e-12} if digits == 16 else {'rel': 1e-4}
    assert translation == pytest.approx(before[1], **close)
    rotation, translation = trajectory.ape(estimate, truth)
    assert translation == pytest.approx(
        np.linalg.norm(estimate[:, :3, 3] - truth[:, :3, 3], axis=1), abs=1e-12)
    assert rotation == pytest.approx(
        [pose_error.rotation_error_deg(*each) for each in zip(estimate, truth, strict=True)],
        abs=1e-6)
    errors = trajectory.track_errors(estimate, truth, (10.0,))
    first = truth[0] @ se3.inverse(estimate[0])
    assert errors.end_translation_m == pytest.approx(
        pose_error.translation_error_m(first @ estimate[-1], truth[-1]))
    assert errors.ape_m[0] == pytest.approx(0.0, abs=1e-12)


def test_one_pose_has_no_relative_error():
    errors = trajectory.track_errors(np.eye(4)[None], pose(3)[None])
    assert len(errors.rotation_deg) == len(errors.translation_m) == 0
    assert errors.ape_m == pytest.approx([0.0])


@pytest.mark.parametrize('length', [10, 25, 40])
def test_drift_is_rpe_of_evo_where_both_take_the_same_stretches(length):
    """With steps of 1 m the first pose beyond a length is the nearest to it, too."""
    from evo.core.metrics import PoseRelation
    from evo.core.metrics import RPE
    from evo.core.metrics import Unit
    from evo.core.trajectory import PosePath3D
    rng = np.random.default_rng(0)
    truth, estimate = [np.eye(4)], [pose(5, -3, 1, yaw_deg=40)]
    for i in range(120):
        step = pose(1.0, yaw_deg=2 * math.sin(i / 9))
        off = pose(*rng.normal(0, 0.02, 3), yaw_deg=rng.normal(0, 0.1))
        truth.append(truth[-1] @ step)
        estimate.append(estimate[-1] @ step @ off)
    # shorter by a hair, so that rounding puts no end on the other side
    drift = trajectory.drift(np.array(estimate), np.array(truth), (length - 1e-6,))
    means = []
    for relation in (PoseRelation.translation_part, PoseRelation.rotation_angle_deg):
        # its tolerance lets shorter stretches in at the end
        rpe = RPE(relation, length, Unit.meters, rel_delta_tol=0.01, all_pairs=True,
                  pairs_from_reference=True)
        rpe.process_data((PosePath3D(poses_se3=truth), PosePath3D(poses_se3=estimate)))
        assert len(rpe.error) == drift.stretches == 121 - length
        means.append(np.mean(rpe.error) / length)
    assert drift.translation_percent == pytest.approx(100 * means[0], rel=1e-6)
    assert drift.rotation_deg_per_m == pytest.approx(means[1], rel=1e-6)
