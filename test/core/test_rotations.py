"""Rotations and their vectors, against scipy."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros.core.common import se3


@pytest.mark.parametrize('angle', [0.0, 1e-9, 1e-3, 1.0, 2.5, 3.0, 3.14, np.pi - 1e-9])
def test_rotations_and_back(angle):
    """Any axis, from nothing to half a turn; single ones and many."""
    axes = np.random.default_rng(0).normal(size=(50, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    R = se3.rotations(vectors)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(se3.rotation_vectors(R), vectors, atol=1e-8)
    np.testing.assert_allclose(se3.rotation_vectors(R[0]), vectors[0], atol=1e-8)
    np.testing.assert_allclose(se3.rotations(vectors[0]), R[0], atol=1e-15)
    assert se3.angle(R[0]) == pytest.approx(angle, abs=1e-8)


def test_no_rotations():
    assert se3.rotations(np.empty((0, 3))).shape == (0, 3, 3)
    assert se3.rotation_vectors(np.empty((0, 3, 3))).shape == (0, 3)
