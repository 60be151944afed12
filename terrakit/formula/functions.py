"""What formulas are written with, beside the operators of Python."""

from __future__ import annotations

import math

from terrakit.formula.expression import Formula, Number, apply, as_formula


def absolute(a: Number) -> Formula:
    """Return ``|a|``."""
    return apply("absolute", a)


def minimum(a: Number, b: Number) -> Formula:
    """Return the smaller of two."""
    return apply("minimum", a, b)


def maximum(a: Number, b: Number) -> Formula:
    """Return the larger of two."""
    return apply("maximum", a, b)


def clamp(a: Number, low: Number, high: Number) -> Formula:
    """Return ``a`` held between ``low`` and ``high``."""
    return minimum(maximum(a, low), high)


def floor(a: Number) -> Formula:
    """Return the largest whole number that is not above ``a``."""
    return apply("floor", a)


def fraction(a: Number) -> Formula:
    """Return what ``a`` is above its floor, 0 to 1."""
    a = as_formula(a)
    return a - floor(a)


def square(a: Number) -> Formula:
    """Return ``a`` times itself."""
    a = as_formula(a)
    return a * a


def sqrt(a: Number) -> Formula:
    """Return the square root of what is not negative."""
    return apply("square_root", a)


def hypot(a: Number, b: Number) -> Formula:
    """Return ``sqrt(a^2 + b^2)``."""
    return sqrt(square(a) + square(b))


def exp2(a: Number) -> Formula:
    """Return 2 to the power ``a``."""
    return apply("exp2", a)


def exp(a: Number) -> Formula:
    """Return e to the power ``a``."""
    return exp2(as_formula(a) * math.log2(math.e))


def log2(a: Number) -> Formula:
    """Return the logarithm to base 2 of a number above 0 (above 1e-30, to be safe)."""
    return apply("log2", maximum(a, 1e-30))


def log(a: Number) -> Formula:
    """Return the natural logarithm of a number above 0."""
    return log2(a) * math.log(2.0)


def power(a: Number, exponent: Number) -> Formula:
    """Return ``a ** exponent`` for ``a`` that is not negative; negative counts as 0."""
    return apply("power", a, exponent)


def sine(a: Number) -> Formula:
    """Return the sine of an angle in radians."""
    return apply("sine", as_formula(a) * (0.5 / math.pi))


def cosine(a: Number) -> Formula:
    """Return the cosine of an angle in radians."""
    return apply("sine", as_formula(a) * (0.5 / math.pi) + 0.25)


def arctangent(y: Number, x: Number) -> Formula:
    """Return the angle of the direction (x, y) in radians, -pi to pi."""
    return apply("arctangent", y, x) * (2.0 * math.pi)


def tanh(a: Number) -> Formula:
    """Return the hyperbolic tangent."""
    e = exp(clamp(a, -10.0, 10.0) * 2.0)
    return (e - 1.0) / (e + 1.0)


def where(condition: Formula, a: Number, b: Number) -> Formula:
    """Return ``a`` where the condition holds, else ``b``."""
    return apply("where", condition, a, b)


def lerp(a: Number, b: Number, share: Number) -> Formula:
    """Return ``a`` where ``share`` is 0 and ``b`` where it is 1, linear between."""
    a = as_formula(a)
    return a + (as_formula(b) - a) * share


def linear_step(low: Number, high: Number, a: Number) -> Formula:
    """Return 0 below ``low``, 1 above ``high``, linear between."""
    low = as_formula(low)
    return clamp((as_formula(a) - low) / (as_formula(high) - low), 0.0, 1.0)


def smoothstep(low: Number, high: Number, a: Number) -> Formula:
    """Return 0 below ``low``, 1 above ``high``, and between the two a curve that is level at
    both ends, in slope and curvature (Perlin 2002).
    """
    t = linear_step(low, high, a)
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


def smooth_minimum(a: Number, b: Number, width: Number) -> Formula:
    """Return the smaller of two, rounded where they differ by less than ``width``.

    Cubic, so that slope and curvature have no jump (Quilez 2013).
    """
    a, b, width = as_formula(a), as_formula(b), as_formula(width)
    overlap = maximum(width - absolute(a - b), 0.0) / maximum(width, 1e-12)
    return minimum(a, b) - overlap * overlap * overlap * width * (1.0 / 6.0)


def smooth_maximum(a: Number, b: Number, width: Number) -> Formula:
    """Return the larger of two, rounded where they differ by less than ``width``."""
    return -smooth_minimum(-as_formula(a), -as_formula(b), width)


def polynomial(a: Number, *coefficients: float) -> Formula:
    """Return ``c0 + c1 a + c2 a^2 ...`` by Horner's rule."""
    a = as_formula(a)
    result = as_formula(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        result = result * a + coefficient
    return result
