"""Formulas of the place: written once, computed in NumPy and in OpenCL with the same bits.

A :class:`Formula` is a node of a graph: a number, a coordinate, a layer, or an operation on other
formulas. Nothing is computed while it is written. :meth:`terrakit.formula.Place.computed`
computes it for every sample of a grid, either with NumPy, or as one fused kernel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact

if TYPE_CHECKING:
    from terrakit.formula.lattice import Lattice

F = np.float32


@dataclass(frozen=True)
class Operation:
    """One elementwise operation: the same bits in both languages."""

    numpy: Callable[..., Any]
    opencl: str
    host: Callable[..., float] | None = None
    """On plain numbers, so that constants fold; None where it is not worth it."""
    is_condition: bool = False


def _divided(a: float, b: float) -> float:
    return a / b if b else math.copysign(math.inf, a) if a else math.nan


OPERATIONS: dict[str, Operation] = {
    "add": Operation(lambda a, b: a + b, "{0} + {1}", lambda a, b: a + b),
    "subtract": Operation(lambda a, b: a - b, "{0} - {1}", lambda a, b: a - b),
    "multiply": Operation(lambda a, b: a * b, "{0} * {1}", lambda a, b: a * b),
    "divide": Operation(lambda a, b: a / b, "{0} / {1}", _divided),
    "negate": Operation(lambda a: -a, "-{0}", lambda a: -a),
    "absolute": Operation(np.abs, "formula_absolute({0})", abs),
    "minimum": Operation(
        lambda a, b: np.where(a < b, a, b),
        "({0} < {1} ? {0} : {1})",
        lambda a, b: a if a < b else b,
    ),
    "maximum": Operation(
        lambda a, b: np.where(a > b, a, b),
        "({0} > {1} ? {0} : {1})",
        lambda a, b: a if a > b else b,
    ),
    "floor": Operation(
        np.floor, "exact_floor({0})", lambda a: float(math.floor(a)) if math.isfinite(a) else a
    ),
    "square_root": Operation(
        np.sqrt, "noise_root({0})", lambda a: math.sqrt(a) if a >= 0 else math.nan
    ),
    "exp2": Operation(exact.exp2, "exact_exp2({0})"),
    "log2": Operation(exact.log2, "exact_log2({0})"),
    "power": Operation(exact.power, "exact_power({0}, {1})"),
    "sine": Operation(exact.sine, "exact_sine({0})"),
    "arctangent": Operation(exact.arctangent, "exact_arctangent({0}, {1})"),
    "where": Operation(np.where, "({0} ? {1} : {2})"),
    "below": Operation(lambda a, b: a < b, "({0} < {1})", is_condition=True),
    "at_most": Operation(lambda a, b: a <= b, "({0} <= {1})", is_condition=True),
    "equal": Operation(lambda a, b: a == b, "({0} == {1})", is_condition=True),
    "both": Operation(np.logical_and, "({0} & {1})", is_condition=True),
    "either": Operation(np.logical_or, "({0} | {1})", is_condition=True),
    "opposite": Operation(np.logical_not, "(!{0})", is_condition=True),
}
LEAVES = ("constant", "column", "row", "field", "state", "table")


class Formula:
    """A number that depends on the place; combine it with ``+ - * / **``, comparisons and
    the functions of :mod:`terrakit.formula`.

    Parameters
    ----------
    op
        A leaf, ``noise``, ``loop`` output, or a name in :data:`OPERATIONS`.
    args
        Formulas that it is made from.
    data
        What a leaf holds.
    """

    __slots__ = ("args", "data", "op")
    __array_ufunc__ = None  # NumPy scalars on the left hand on to us

    def __init__(self, op: str, args: tuple[Formula, ...] = (), data: Any = None) -> None:
        self.op = op
        self.args = args
        self.data = data

    @property
    def is_condition(self) -> bool:
        """Whether it is true or false rather than a number."""
        return self.op in OPERATIONS and OPERATIONS[self.op].is_condition

    @property
    def is_leaf(self) -> bool:
        """Whether it is there without being computed."""
        return self.op in LEAVES

    def __add__(self, other: Number) -> Formula:
        return apply("add", self, other)

    def __radd__(self, other: Number) -> Formula:
        return apply("add", other, self)

    def __sub__(self, other: Number) -> Formula:
        return apply("subtract", self, other)

    def __rsub__(self, other: Number) -> Formula:
        return apply("subtract", other, self)

    def __mul__(self, other: Number) -> Formula:
        return apply("multiply", self, other)

    def __rmul__(self, other: Number) -> Formula:
        return apply("multiply", other, self)

    def __truediv__(self, other: Number) -> Formula:
        return apply("divide", self, other)

    def __rtruediv__(self, other: Number) -> Formula:
        return apply("divide", other, self)

    def __pow__(self, exponent: Number) -> Formula:
        whole = exponent if isinstance(exponent, int) else None
        if whole is not None and 1 <= whole <= 8:
            result = self
            for _ in range(whole - 1):
                result = result * self
            return result
        return apply("power", self, exponent)

    def __neg__(self) -> Formula:
        return apply("negate", self)

    def __abs__(self) -> Formula:
        return apply("absolute", self)

    def __lt__(self, other: Number) -> Formula:
        return apply("below", self, other)

    def __gt__(self, other: Number) -> Formula:
        return apply("below", other, self)

    def __le__(self, other: Number) -> Formula:
        return apply("at_most", self, other)

    def __ge__(self, other: Number) -> Formula:
        return apply("at_most", other, self)

    def __and__(self, other: Formula) -> Formula:
        return apply("both", self, other)

    def __or__(self, other: Formula) -> Formula:
        return apply("either", self, other)

    def __invert__(self) -> Formula:
        return apply("opposite", self)

    def __bool__(self) -> bool:
        raise TypeError("a formula is neither true nor false; use where(condition, a, b)")

    def __repr__(self) -> str:
        if self.op == "constant":
            return f"{self.data:g}"
        return f"{self.op}({', '.join(map(repr, self.args))})"


Number = Formula | float


@dataclass(eq=False)
class Loop:
    """A sum over octaves: states that are renewed once an octave.

    The bodies are formulas of ``state`` and ``table`` leaves and of noise whose lattice belongs to
    this loop; they may use any formula from outside.
    """

    count: int
    start: tuple[Formula, ...] = ()
    body: tuple[Formula, ...] = ()
    tables: list[NDArray[np.float32]] = field(default_factory=list)

    def state(self, index: int) -> Formula:
        """Return what state ``index`` is at the beginning of an octave."""
        return Formula("state", data=(self, index))

    def table(self, values: list[float]) -> Formula:
        """Return a number that is another one in every octave."""
        self.tables.append(np.array(values, dtype=F))
        return Formula("table", data=(self, len(self.tables) - 1))

    def result(self, index: int) -> Formula:
        """Return what state ``index`` is in the end."""
        return Formula("loop", data=(self, index))


@dataclass(frozen=True, eq=False)
class Noise:
    """One evaluation of a noise basis on a lattice."""

    lattice: Lattice
    loop: Loop | None
    """The loop whose octaves its lattice follows; None for a single octave."""
    has_slope: bool = False


def constant(value: float) -> Formula:
    """Return a number as a formula."""
    return Formula("constant", data=float(value))


def as_formula(value: Number) -> Formula:
    """Return a formula, whatever was given."""
    return value if isinstance(value, Formula) else constant(float(value))


def apply(op: str, *values: Number) -> Formula:
    """Return an elementwise operation; on constants alone it is computed at once.

    Every result is rounded to 32 bits, so that a number and a layer of that number are the same.
    """
    args = tuple(as_formula(value) for value in values)
    host = OPERATIONS[op].host
    if host is not None and all(arg.op == "constant" for arg in args):
        with np.errstate(over="ignore"):
            return constant(float(F(host(*(float(F(arg.data)) for arg in args)))))
    return Formula(op, args)
