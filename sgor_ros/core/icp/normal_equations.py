"""The normal equations of ICP: what one pair of points adds to them, for every fit here.

A pair has a residual and a (3, 3) information of it: that of GICP, or of a plane. The step is a
translation, then a rotation about the source's origin, in the target frame.
"""
import numba

TERMS = 27
"""Of the sums: 21 of the information, its lower triangle row by row, and 6 of the gradient."""


@numba.njit(cache=True, nogil=True, inline='always')
def add_pair(total, lx, ly, lz, ixx, ixy, ixz, iyy, iyz, izz, ex, ey, ez):
    """Add a pair to the sums; return its information times its residual.

    Parameters
    ----------
    total : (27,) float64
    lx, ly, lz : float64
        Lever: the source point turned into the target frame, about the source's origin, metres.
    ixx, ixy, ixz, iyy, iyz, izz : float64
        Information of the residual.
    ex, ey, ez : float64
        Residual: source point less target point, metres.
    """
    # rows of the mixed part: lever x row of the information
    rxx, rxy, rxz = _cross(lx, ly, lz, ixx, ixy, ixz)
    ryx, ryy, ryz = _cross(lx, ly, lz, ixy, iyy, iyz)
    rzx, rzy, rzz = _cross(lx, ly, lz, ixz, iyz, izz)
    # of the rotation: lever x column of the mixed part
    wxx, wyx, wzx = _cross(lx, ly, lz, rxx, ryx, rzx)
    _, wyy, wzy = _cross(lx, ly, lz, rxy, ryy, rzy)
    _, _, wzz = _cross(lx, ly, lz, rxz, ryz, rzz)
    gx = ixx * ex + ixy * ey + ixz * ez
    gy = ixy * ex + iyy * ey + iyz * ez
    gz = ixz * ex + iyz * ey + izz * ez
    tx, ty, tz = _cross(lx, ly, lz, gx, gy, gz)
    for k, value in enumerate((
            ixx, ixy, iyy, ixz, iyz, izz, rxx, ryx, rzx, wxx, rxy, ryy, rzy, wyx, wyy,
            rxz, ryz, rzz, wzx, wzy, wzz, gx, gy, gz, tx, ty, tz)):
        total[k] += value
    return gx, gy, gz


@numba.njit(cache=True, nogil=True, inline='always')
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
