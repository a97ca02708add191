"""Lanes of sixteen and bits of a word, against numpy."""
import numba
import numpy as np
import pytest

from sgor_ros.core.execution.simd import add_where
from sgor_ros.core.execution.simd import at_most
from sgor_ros.core.execution.simd import count
from sgor_ros.core.execution.simd import load
from sgor_ros.core.execution.simd import lowest
from sgor_ros.core.execution.simd import splat
from sgor_ros.core.execution.simd import store
from sgor_ros.core.execution.simd import total

rng = np.random.default_rng(0)


@numba.njit
def _arithmetic(a, b, c, out):
    x, y = load(a, 3), load(b, 0)    # 3: no alignment is asked for
    store(out, 1, x * y - splat(c) + x)


def test_arithmetic():
    a, b = rng.normal(size=(2, 19)).astype(np.float32)
    out = np.zeros(18, np.float32)
    _arithmetic(a, b, np.float32(0.7), out)
    np.testing.assert_allclose(out[1:17], a[3:] * b[:16] - np.float32(0.7) + a[3:], rtol=1e-5)
    assert out[0] == out[17] == 0


@numba.njit
def _compared(a, b):
    return at_most(load(a, 0), load(b, 0))


def test_comparisons_become_bits():
    """The lowest bit is that of the first lane; NaN is never at most anything."""
    a, b = rng.integers(0, 3, (2, 16)).astype(np.float32)
    a[5] = b[9] = np.nan
    expected = int(((a <= b) * 2**np.arange(16)).sum())
    assert 0 < expected < 2**16 - 1
    assert _compared(a, b) == expected


@numba.njit
def _summed(bits, a, b):
    return total(add_where(bits, load(a, 0), load(b, 0)))


@pytest.mark.parametrize('bits', [0, 1, 2**15, 0b1010_0110_0000_1101, 2**16 - 1])
def test_bits_choose_what_is_added(bits):
    """And what they leave out may be NaN."""
    a, b = rng.normal(size=(2, 16)).astype(np.float32)
    chosen = (bits >> np.arange(16)) & 1 == 1
    b[~chosen] = np.nan
    assert _summed(np.uint16(bits), a, b) == pytest.approx(a.sum() + b[chosen].sum(), rel=1e-5)


@numba.njit
def _places(word):
    return lowest(word), count(word)


@pytest.mark.parametrize('word', [1, 2**63, 0b1011000, 2**64 - 1])
def test_bits_of_a_word(word):
    assert _places(np.uint64(word)) == ((word & -word).bit_length() - 1, word.bit_count())
