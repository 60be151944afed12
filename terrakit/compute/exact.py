"""NumPy twins of ``exact.cl``: the same bits from the same operations in the same order.

Hash: C. Wellons, "Prospecting for hash functions" (2018), lowbias32. Logarithm and exponential:
truncated series of atanh and of 2**x on a reduced range, evaluated by Horner's rule in float32;
the sine likewise, the arctangent by a polynomial fitted for the least largest error.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

F = np.float32
U = np.uint32

_LOG2 = (
    0.26230818925253880,
    0.32059889797532520,
    0.41219858311113240,
    0.57707801635558540,
    0.96179669392597560,
    2.88539008177792680,
)
_EXP2 = (
    1.5252733804059840e-5,
    1.5403530393381608e-4,
    1.3333558146428443e-3,
    9.6181291076284770e-3,
    5.5504108664821580e-2,
    2.4022650695910070e-1,
    6.9314718055994530e-1,
    1.0,
)
_SINE = (
    -15.0946425768229730,
    42.0586939448786400,
    -76.7058597530613900,
    81.6052492760750500,
    -41.3417022403997600,
    6.28318530717958650,
)
_ARCTANGENT = (
    0.00108412954328,
    -0.00534827649107,
    0.01267250269068,
    -0.02106152176488,
    0.03152511981160,
    -0.05302623867888,
    0.15915432426105,
)


def mix(values: ArrayLike) -> NDArray[np.uint32]:
    """Return a hash of each 32-bit integer."""
    x = np.atleast_1d(np.asarray(values)).astype(U)
    x = x ^ (x >> U(16))
    x = x * U(0x7FEB352D)
    x = x ^ (x >> U(15))
    x = x * U(0x846CA68B)
    return x ^ (x >> U(16))


def hashed(seed: tuple[int, int], i: ArrayLike, j: ArrayLike) -> NDArray[np.uint32]:
    """Return a hash of the seed (two 32-bit words) and lattice points ``i``, ``j``."""
    first = mix(np.asarray(i).astype(U) ^ U(seed[0]))
    return mix(mix(first + np.asarray(j).astype(U)) ^ U(seed[1]))


def uniform(hashes: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return a number in [0, 1) for each hash, exact in float32."""
    return (hashes >> U(8)).astype(F) * F(2.0**-24)


def normal(hashes: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return a nearly normal number of mean 0 and deviation 1 for each hash, within -3.47 to 3.47.

    The sum of four uniforms of 16 bits: whole numbers, so that one multiplication rounds.
    """
    other = mix(hashes ^ U(0x9E3779B9))
    low = U(0xFFFF)
    total = (hashes & low) + (hashes >> U(16)) + (other & low) + (other >> U(16))
    result: NDArray[np.float32] = (total.astype(np.int32) - np.int32(131070)).astype(F)
    return result * F(2.6428998e-5)


def log2(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the base-2 logarithm of positive, normal floats."""
    bits = values.view(np.int32)
    exponent = (bits >> 23) - 127
    mantissa = ((bits & 0x007FFFFF) | 0x3F800000).view(F)
    high = mantissa > F(1.41421356)
    mantissa = np.where(high, mantissa * F(0.5), mantissa)
    exponent = exponent + high
    t = (mantissa - F(1)) / (mantissa + F(1))
    s = t * t
    p = np.full_like(s, F(_LOG2[0]))
    for coefficient in _LOG2[1:]:
        p = p * s + F(coefficient)
    result: NDArray[np.float32] = exponent.astype(F) + t * p
    return result


def exp2(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 2 to the power of each value."""
    clamped = np.minimum(np.maximum(values, F(-126)), F(127))
    whole = np.floor(clamped + F(0.5))
    f = clamped - whole
    p = np.full_like(f, F(_EXP2[0]))
    for coefficient in _EXP2[1:]:
        p = p * f + F(coefficient)
    scale = ((whole.astype(np.int32) + 127) << 23).view(F)
    return np.where(values < F(-126), F(0), p * scale)


def power(
    values: NDArray[np.float32], exponent: float | NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return ``values ** exponent`` for values that are not negative."""
    exponents = np.asarray(exponent, dtype=F)
    tiny = ~(values >= F(1.17549435e-38))
    safe = np.where(tiny, F(1), values)
    at_zero = np.where(exponents == F(0), F(1), F(0))
    return np.where(tiny, at_zero, exp2(exponents * log2(safe)))


def sine(turns: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the sine of shares of a whole circle: ``sin(2 pi t)``, within 2e-7 for small t."""
    r = turns - np.floor(turns + F(0.5))
    q = np.where(r > F(0.25), F(0.5) - r, np.where(r < F(-0.25), F(-0.5) - r, r))
    s = q * q
    p = np.full_like(s, F(_SINE[0]))
    for coefficient in _SINE[1:]:
        p = p * s + F(coefficient)
    result: NDArray[np.float32] = q * p
    return result


def arctangent(y: NDArray[np.float32], x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the direction of (x, y) as a share of a circle, -1/2 to 1/2, within 1e-7."""
    ax, ay = np.where(x < F(0), -x, x), np.where(y < F(0), -y, y)
    low, high = np.where(ax < ay, ax, ay), np.where(ax < ay, ay, ax)
    r = low / np.where(high > F(1e-30), high, F(1e-30))
    s = r * r
    p = np.full_like(s, F(_ARCTANGENT[0]))
    for coefficient in _ARCTANGENT[1:]:
        p = p * s + F(coefficient)
    octant = r * p
    quarter = np.where(ax < ay, F(0.25) - octant, octant)
    half_turn = np.where(x < F(0), F(0.5) - quarter, quarter)
    return np.where(y < F(0), -half_turn, half_turn)
