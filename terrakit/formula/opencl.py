"""Formulas in OpenCL: one fused kernel for a graph, in the order of its plan.

Numbers (constants, seeds, lattices) are arguments of the kernel, so that another setting of the
same operator needs no new kernel. On processor cores a work-item computes ``WIDTH`` samples of a
row: every stage is a loop over them that the compiler makes wide, and what one stage hands to the
next is a short array. Elsewhere ``WIDTH`` is 1, and those arrays are registers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import Device, DeviceArray
from terrakit.formula.expression import OPERATIONS, Formula
from terrakit.formula.lattice import Lattice
from terrakit.formula.plan import LoopPlan, Plan
from terrakit.noise import BASES, source

WIDTH = 256
"""Samples of a row that a work-item of a processor computes."""
BEGINNING = """
#ifdef TERRAKIT_CPU
#define WIDTH {width}
#define EACH NOISE_LOOP for (int c = 0; c < count; ++c)
#else
#define WIDTH 1
#define EACH for (int c = 0; c < 1; ++c)
#endif

__attribute__((always_inline)) inline float formula_absolute(float a)
{{
    return as_float(as_int(a) & 0x7fffffff);
}}

// Cells in the fixed point of lattice positions
__attribute__((always_inline)) inline ulong formula_fixed(float cells)
{{
    const float held = cells > -1e9f ? (cells < 1e9f ? cells : 1e9f) : -1e9f;
    const int cut = (int)held;
    const int whole = (float)cut > held ? cut - 1 : cut;
    const int part = (int)((held - (float)whole) * 16777216.0f);
    return ((ulong)(long)whole << 32) + ((ulong)part << 8);
}}

__attribute__((always_inline)) inline float formula_fraction(ulong position)
{{
    return (float)((uint)position >> 8) * 5.9604644775390625e-8f;
}}

__attribute__((always_inline)) inline int formula_within(int place, int count)
{{
    return place < 0 ? 0 : (place < count ? place : count - 1);
}}

// Catmull & Rom 1974; made of differences alone, so that what is level stays level
__attribute__((always_inline)) inline float formula_spline(
    float before, float here, float there, float beyond, float t)
{{
    const float a = here - before, b = there - here, c = beyond - there;
    const float bend = 3.0f * b - 2.0f * a - c;
    return here + 0.5f * t * ((a + b) + t * (bend + t * (a - 2.0f * b + c)));
}}

__attribute__((always_inline)) inline float formula_line(
    __global const float *line, int first, int cols, float t)
{{
    return formula_spline(
        line[formula_within(first - 1, cols)], line[first],
        line[formula_within(first + 1, cols)], line[formula_within(first + 2, cols)], t);
}}

// The sample at or before a place, and how far beyond it the place is; borders end both
__attribute__((always_inline)) inline int2 formula_between(int place, float moved, int count)
{{
    const float held = moved > -1e9f ? (moved < 1e9f ? moved : 1e9f) : -1e9f;
    const int cut = (int)held;
    const int whole = (float)cut > held ? cut - 1 : cut;
    const int at = place + whole;
    const float t = held - (float)whole;
    const bool inside = at >= 0 && at < count - 1;
    return (int2)(formula_within(at, count), as_int(inside ? t : 0.0f));
}}

// A field between its samples, moved from column x and row y; beyond the border
// samples are repeated
__attribute__((always_inline)) inline float formula_sampled(
    __global const float *field, int rows, int cols, int x, int y, float east, float south)
{{
    const int2 across = formula_between(x, east, cols), down = formula_between(y, south, rows);
    const int col = across.x, row = down.x;
    const float t = as_float(across.y), s = as_float(down.y);
    float lines[4];
    for (int k = 0; k < 4; ++k) {{
        const int line = formula_within(row - 1 + k, rows);
        lines[k] = formula_line(field + (size_t)line * cols, col, cols, t);
    }}
    return formula_spline(lines[0], lines[1], lines[2], lines[3], s);
}}
"""


def compute(
    formulas: Sequence[Formula], shape: tuple[int, int], device: Device
) -> list[DeviceArray]:
    """Return the values of each formula at every sample, on the device."""
    rows, cols = shape
    kernel = _Kernel(Plan(formulas))
    results = [device.empty(shape) for _ in formulas]
    held = [device.upload(values) for values in kernel.arguments()]
    fields = [layer.on(device) for layer in kernel.fields]
    blocks = -(-cols // WIDTH) if device.is_cpu else cols
    device.program_from_source("formula.cl", kernel.source()).launch(
        "formula_compute",
        (rows, blocks),
        *results,
        *held,
        *fields,
        np.int32(rows),
        np.int32(cols),
        local=(4, 1) if device.is_cpu else None,
    )
    device.finish()
    return results


class _Kernel:
    """The source of a plan's kernel, and the numbers that it is launched with.

    The source depends on the shape of the graph alone: not on a number in it, nor on how many
    octaves a loop has.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.names: dict[int, str] = {}
        self.constants: list[float] = []
        self.offsets: list[int] = []
        self.columns: list[NDArray[np.float32]] = []
        self.rows: list[NDArray[np.float32]] = []
        self.fields: list[Any] = []
        self.tables: list[float] = []
        self.lattices: dict[Lattice, str] = {}
        self.octaves = 0
        self.lines: list[str] = []
        for number, formula in enumerate(plan.outside):
            self._name(formula, f"v{number}")
        for order, loop in enumerate(plan.loops):
            for number, formula in enumerate(loop.inside):
                self.names[id(formula)] = f"l{order}_{number}"
        self.kept = self._kept()
        deepest = max(plan.levels.values(), default=0)
        for level in range(deepest + 1):
            for order, loop in enumerate(plan.loops):
                if loop.level == level:
                    self._write_loop(order, loop)
            self._write_stage(level)

    def arguments(self) -> list[NDArray[Any]]:
        """Return the arrays that the kernel takes, in order; none is empty."""
        lattices = list(self.lattices)
        return [
            np.array([*self.constants, 0.0], dtype=np.float32),
            np.array([*self.offsets, 0], dtype=np.int32),
            np.concatenate([*self.columns, np.zeros(1, np.float32)]),
            np.concatenate([*self.rows, np.zeros(1, np.float32)]),
            np.array([*self.tables, 0.0], dtype=np.float32),
            np.concatenate([*(a.eastward.ravel() for a in lattices), np.zeros(1, np.int64)]),
            np.concatenate([*(a.northward.ravel() for a in lattices), np.zeros(1, np.int64)]),
            np.concatenate([*(a.metres for a in lattices), np.zeros((1, 4), np.float32)]),
            np.concatenate([*(a.turns for a in lattices), np.zeros((1, 2), np.float32)]),
            np.concatenate([*(a.seeds for a in lattices), np.zeros((1, 2), np.uint32)]),
        ]

    def source(self) -> str:
        """Return the whole program."""
        parameters = [
            *(f"__global float *result{n}" for n in range(len(self.plan.results))),
            "__global const float *constants",
            "__global const int *offsets",
            "__global const float *columns",
            "__global const float *lines",
            "__global const float *tables",
            "__global const ulong *eastward",
            "__global const ulong *northward",
            "__global const float *metres",
            "__global const float *turns",
            "__global const uint *seeds",
            *(f"__global const float *field{n}" for n in range(len(self.fields))),
            "const int rows",
            "const int cols",
        ]
        return (
            source(lattice.basis for lattice in self.lattices)
            + BEGINNING.format(width=WIDTH)
            + "\n__kernel void formula_compute(\n    "
            + ",\n    ".join(parameters)
            + ")\n{\n    const int row = (int)get_global_id(1);\n"
            "    const int first = (int)get_global_id(0) * WIDTH;\n"
            "    if (row >= rows || first >= cols) return;\n"
            "    const int count = cols - first < WIDTH ? cols - first : WIDTH;\n"
            "    const size_t start = (size_t)row * cols + first;\n    "
            + "\n    ".join(self.lines)
            + "\n}\n"
        )

    def _name(self, formula: Formula, name: str) -> None:
        """Give a formula its name, and a leaf its place among the arguments."""
        op, data = formula.op, formula.data
        if op == "constant":
            self.lines.append(f"const float {name} = constants[{len(self.constants)}];")
            self.constants.append(data)
        elif op == "row":
            self.lines.append(f"const float {name} = lines[{len(self.rows)} * rows + row];")
            self.rows.append(data)
        elif op == "column":
            name = f"columns[{len(self.columns)} * cols + first + c]"
            self.columns.append(data)
        elif op == "field":
            name = f"field{len(self.fields)}[start + c]"
            self.fields.append(data)
        self.names[id(formula)] = name

    def _offset(self, value: int) -> str:
        """Return how the source calls a whole number that may be another one next time."""
        self.offsets.append(value)
        return f"offsets[{len(self.offsets) - 1}]"

    def _kept(self) -> set[int]:
        """Return what one stage computes for another, and so goes through an array."""
        levels = self.plan.levels
        kept = set()
        for formula in self.plan.outside:
            if formula.op != "loop":
                level = levels[id(formula)]
                kept |= {id(arg) for arg in formula.args if levels[id(arg)] < level}
        for plan in self.plan.loops:
            kept |= {id(f) for f in (*plan.loop.start, *plan.captured)}
        return kept

    def _write_stage(self, level: int) -> None:
        """Write what is computed after the loops of one level, as one wide loop."""
        chosen = [f for f in self.plan.outside if self.plan.levels[id(f)] == level]
        here = [f for f in chosen if not f.is_leaf and f.op != "loop"]
        results = [
            f"result{number}[start + c] = {self.names[id(formula)]};"
            for number, formula in enumerate(self.plan.results)
            if self.plan.levels[id(formula)] == level
        ]
        if not here and not results:
            return
        arrays = [f for f in here if id(f) in self.kept]
        for formula in arrays:
            kind = "int" if formula.is_condition else "float"
            self.lines.append(f"{kind} {self.names[id(formula)]}_kept[WIDTH];")
        kept = [f"{self.names[id(f)]}_kept[c] = {self.names[id(f)]};" for f in arrays]
        self._write_each(here, "0", [*kept, *results])
        for formula in arrays:
            self.names[id(formula)] += "_kept[c]"

    def _write_loop(self, order: int, plan: LoopPlan) -> None:
        """Write a loop over octaves, each of which is a wide loop."""
        loop = plan.loop
        states = [f"state{order}_{index}" for index in range(len(loop.start))]
        for state in states:
            self.lines.append(f"float {state}[WIDTH];")
        starts = [
            f"{state}[c] = {self.names[id(start)]};"
            for state, start in zip(states, loop.start, strict=True)
        ]
        self._write_each([], "0", starts)
        count = self._offset(loop.count)
        self.lines.append(f"for (int k = 0; k < {count}; ++k) {{")
        if loop.tables:
            first = self._offset(len(self.tables))
            self.tables += [float(v) for v in np.stack(loop.tables, axis=1).ravel()]
            width = len(loop.tables)
            for formula in plan.inside:
                if formula.op == "table":
                    place = f"{first} + k * {width} + {formula.data[1]}"
                    self.lines.append(f"const float {self.names[id(formula)]} = tables[{place}];")
        loads = [
            f"const float {self.names[id(f)]} = {states[f.data[1]]}[c];"
            for f in plan.inside
            if f.op == "state"
        ]
        ends = [
            f"{state}[c] = {self.names[id(body)]};"
            for state, body in zip(states, loop.body, strict=True)
        ]
        here = [f for f in plan.inside if not f.is_leaf]
        self._write_each(here, "k", ends, loads)
        self.lines.append("}")
        for formula in self.plan.outside:
            if formula.op == "loop" and formula.data[0] is loop:
                self.names[id(formula)] = f"{states[formula.data[1]]}[c]"

    def _write_each(
        self, formulas: list[Formula], octave: str, after: list[str], before: Sequence[str] = ()
    ) -> None:
        """Write a wide loop that computes some formulas for every sample."""
        for formula in formulas:
            if formula.op == "noise":
                self._write_position(formula, octave)
        lines = [*before]
        for formula in formulas:
            lines += self._value(formula)
        lines += after
        self.lines += ["EACH {", *(f"    {line}" for line in lines), "}"]

    def _write_position(self, formula: Formula, octave: str) -> None:
        """Write where a noise's lattice lies under the samples of this row."""
        lattice, n = formula.data.lattice, self.names[id(formula)]
        if lattice not in self.lattices:
            self.lattices[lattice] = self._offset(self.octaves)
            self.octaves += lattice.octaves
        self.lines.append(f"const int {n}_k = {self.lattices[lattice]} + {octave};")
        for axis, name in enumerate("uv"):
            line = f"(size_t)(2 * {n}_k + {axis})"
            self.lines.append(f"const ulong {n}_{name}_row = northward[{line} * rows + row];")
            self.lines.append(
                f"__global const ulong *{n}_{name} = eastward + {line} * cols + first;"
            )
        self.lines.append(
            f"const uint {n}_low = seeds[2 * {n}_k], {n}_high = seeds[2 * {n}_k + 1];"
        )
        if formula.args:
            parts = ", ".join(f"{n}_m{i} = metres[4 * {n}_k + {i}]" for i in range(4))
            self.lines.append(f"const float {parts};")
        if formula.data.has_slope:
            self.lines.append(
                f"const float {n}_cosine = turns[2 * {n}_k], {n}_sine = turns[2 * {n}_k + 1];"
            )

    def _value(self, formula: Formula) -> list[str]:
        """Return the lines that compute one formula for one sample."""
        name, args = self.names[id(formula)], [self.names[id(arg)] for arg in formula.args]
        if formula.op == "part":
            ending = ("", "_east", "_north")[formula.data]
            return [f"const float {name} = {args[0]}{ending};"]
        if formula.op == "noise":
            return self._noise(formula, name, args)
        if formula.op == "sample":
            field = args[2].partition("[")[0]
            at = f"first + c, row, {args[0]}, -{args[1]}"
            return [f"const float {name} = formula_sampled({field}, rows, cols, {at});"]
        kind = "int" if formula.is_condition else "float"
        return [f"const {kind} {name} = {OPERATIONS[formula.op].opencl.format(*args)};"]

    def _noise(self, formula: Formula, n: str, args: list[str]) -> list[str]:
        lines = []
        for axis, (east, north) in (("u", (0, 1)), ("v", (2, 3))):
            moved = ""
            if args:
                cells = f"{n}_m{east} * {args[0]} + {n}_m{north} * {args[1]}"
                moved = f" + formula_fixed({cells})"
            lines.append(f"const ulong {n}_p{axis} = {n}_{axis}[c] + {n}_{axis}_row{moved};")
        at = (
            f"(int)({n}_pu >> 32), (int)({n}_pv >> 32), formula_fraction({n}_pu), "
            f"formula_fraction({n}_pv), {n}_low, {n}_high"
        )
        basis = BASES[formula.data.lattice.basis]
        if not formula.data.has_slope:
            return [*lines, f"const float {n} = {basis.opencl}({at});"]
        return [
            *lines,
            f"float {n}_slope_u, {n}_slope_v;",
            f"const float {n} = {basis.opencl}_slope({at}, &{n}_slope_u, &{n}_slope_v);",
            f"const float {n}_east = {n}_cosine * {n}_slope_u + {n}_sine * {n}_slope_v;",
            f"const float {n}_north = {n}_cosine * {n}_slope_v - {n}_sine * {n}_slope_u;",
        ]
