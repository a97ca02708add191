"""An arc tangent that compilers can turn into vector instructions."""
import math

import numba
import numpy as np


@numba.njit(cache=True, nogil=True, inline='always')
def atan2(y, x):
    """Return the angle of (x, y) in float32, radians in [-pi, pi], good to 2e-6."""
    ax = abs(x)
    ay = abs(y)
    t = min(ax, ay) / max(max(ax, ay), np.float32(1e-30))
    s = t * t
    a = np.float32(-0.0117212)
    a = a * s + np.float32(0.05265332)
    a = a * s + np.float32(-0.11643287)
    a = a * s + np.float32(0.19354346)
    a = a * s + np.float32(-0.33262347)
    a = a * s + np.float32(0.99997726)
    a = a * t
    a = np.float32(math.pi / 2) - a if ay > ax else a
    a = np.float32(math.pi) - a if x < 0 else a
    return -a if y < 0 else a
