"""Formulas in NumPy: the readable definition, and the oracle of the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import check_cancelled
from terrakit.formula.expression import OPERATIONS, Formula, Loop, Noise
from terrakit.formula.plan import LoopPlan, Plan
from terrakit.noise import BASES

F = np.float32
U = np.uint32
BLOCK = 2**17
"""Samples that are computed together, to bound the memory of the temporaries."""


def compute(formulas: Sequence[Formula], shape: tuple[int, int]) -> list[NDArray[np.float32]]:
    """Return the values of each formula at every sample."""
    rows, cols = shape
    plan = Plan(formulas)
    results = [np.empty(shape, dtype=F) for _ in formulas]
    lines = max(1, BLOCK // cols)
    for first in range(0, rows, lines):
        check_cancelled()
        part = slice(first, min(first + lines, rows))
        with np.errstate(all="ignore"):  # what a branch that is not taken computes does not count
            known = _Block(plan, part, cols).values()
        for result, formula in zip(results, formulas, strict=True):
            result[part] = known[id(formula)]
    return results


class _Block:
    """Some rows of a grid, on which a plan is carried out."""

    def __init__(self, plan: Plan, rows: slice, cols: int) -> None:
        self.plan = plan
        self.rows = rows
        self.row = np.arange(rows.start, rows.stop, dtype=np.int64)[:, None]
        self.col = np.arange(cols, dtype=np.int64)[None, :]

    def values(self) -> dict[int, Any]:
        """Return the value of every formula outside of loops, by identity."""
        known: dict[int, Any] = {}
        plans = {plan.loop: plan for plan in self.plan.loops}
        ends: dict[Loop, list[Any]] = {}
        for formula in self.plan.outside:
            if formula.op == "loop":
                loop, index = formula.data
                if loop not in ends:
                    ends[loop] = self._looped(plans[loop], known)
                known[id(formula)] = ends[loop][index]
            else:
                known[id(formula)] = self._value(formula, known, 0)
        return known

    def _looped(self, plan: LoopPlan, known: dict[int, Any]) -> list[Any]:
        states = [known[id(start)] for start in plan.loop.start]
        for octave in range(plan.loop.count):
            now = dict(known)
            for formula in plan.inside:
                if formula.op == "state":
                    now[id(formula)] = states[formula.data[1]]
                else:
                    now[id(formula)] = self._value(formula, now, octave)
            states = [now[id(body)] for body in plan.loop.body]
        return states

    def _value(self, formula: Formula, known: dict[int, Any], octave: int) -> Any:
        op, data = formula.op, formula.data
        if op == "constant":
            return F(data)
        if op == "column":
            return data[None, :]
        if op == "row":
            return data[self.rows, None]
        if op == "field":
            return data.host()[self.rows]
        if op == "table":
            return data[0].tables[data[1]][octave]
        if op == "sample":
            east, north, field = formula.args
            shape = (self.row.size, self.col.size)
            moved = (np.broadcast_to(known[id(part)], shape) for part in (east, north))
            return sampled(field.data.host(), self.row, self.col, *moved)
        args = [known[id(arg)] for arg in formula.args]
        if op == "noise":
            return self._noise(data, args, octave)
        if op == "part":
            return args[0][data]
        return OPERATIONS[op].numpy(*args)

    def _noise(self, noise: Noise, args: list[Any], octave: int) -> Any:
        lattice = noise.lattice
        u, v = (
            lattice.eastward[octave, axis][None, :]
            + lattice.northward[octave, axis, self.rows][:, None]
            for axis in (0, 1)
        )
        if args:
            a, b, c, d = lattice.metres[octave]
            u = u + _fixed(a * args[0] + b * args[1])
            v = v + _fixed(c * args[0] + d * args[1])
        basis = BASES[lattice.basis]
        low, high = (int(word) for word in lattice.seeds[octave])
        i, x = split(u)
        j, y = split(v)
        if not noise.has_slope:
            return basis.numpy(i, j, x, y, low, high)
        assert basis.numpy_slope is not None
        value, du, dv = basis.numpy_slope(i, j, x, y, low, high)
        cosine, sine = lattice.turns[octave]
        return value, cosine * du + sine * dv, cosine * dv - sine * du


def split(position: NDArray[np.int64]) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Return the lattice index and the fraction in [0, 1) of fixed-point positions."""
    bits = position.view(np.uint64)
    fraction = (bits & np.uint64(0xFFFFFFFF)).astype(U) >> U(8)
    return (bits >> np.uint64(32)).astype(U), fraction.astype(F) * F(2.0**-24)


def _fixed(cells: Any) -> NDArray[np.int64]:
    """Return numbers of cells in the fixed point of lattice positions."""
    held = np.where(cells > F(-1e9), np.where(cells < F(1e9), cells, F(1e9)), F(-1e9))
    whole = np.floor(held)
    part = ((held - whole) * F(16777216.0)).astype(U).astype(np.int64) << 8
    fixed: NDArray[np.int64] = (whole.astype(np.int64) << 32) + part
    return fixed


def sampled(
    field: NDArray[np.float32],
    row: NDArray[np.int64],
    col: NDArray[np.int64],
    east: NDArray[np.float32],
    north: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return a field between its samples by Catmull-Rom splines, moved by samples.

    Whole samples are counted in integers, so that it does not depend on the tile. Beyond the
    border its samples are repeated (Catmull & Rom 1974).
    """
    columns, t = _between(col, east, field.shape[1])
    rows, s = _between(row, -north, field.shape[0])
    lines = [_spline([field[line, column] for column in columns], t) for line in rows]
    return _spline(lines, s)


def _between(
    place: NDArray[np.int64], moved: NDArray[np.float32], count: int
) -> tuple[list[NDArray[np.int64]], NDArray[np.float32]]:
    """Return the four samples around each place, and where it is between the middle two."""
    held = np.where(moved > F(-1e9), np.where(moved < F(1e9), moved, F(1e9)), F(-1e9))
    whole = np.floor(held)
    at = place + whole.astype(np.int64)
    inside = (at >= 0) & (at < count - 1)
    first = np.clip(at, 0, count - 1)
    t = np.where(inside, held - whole, F(0))
    return [np.clip(first + step, 0, count - 1) for step in (-1, 0, 1, 2)], t


def _spline(around: list[NDArray[np.float32]], t: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a spline through four values, of whose differences alone it is made: level stays."""
    a, b, c = (after - before for before, after in pairwise(around))
    bend = F(3) * b - F(2) * a - c
    result: NDArray[np.float32] = around[1] + F(0.5) * t * (
        (a + b) + t * (bend + t * (a - F(2) * b + c))
    )
    return result
