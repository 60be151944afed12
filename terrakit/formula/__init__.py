"""Formulas of the place: written once, computed in NumPy and in OpenCL with the same bits.

::

    from terrakit.formula import FormulaGenerator, Place, fbm, smoothstep

A generator or filter whose ``height`` is a formula needs no kernel and no reference of its own.
"""

from __future__ import annotations

from terrakit.formula.expression import Formula, Number, as_formula, constant
from terrakit.formula.fractal import (
    Octaves,
    billow,
    fbm,
    heterogeneous_terrain,
    hybrid_multifractal,
    jordan,
    multifractal,
    ridged_multifractal,
    slope_damped,
    swiss,
    turbulence,
    variable_lacunarity,
)
from terrakit.formula.functions import (
    absolute,
    arctangent,
    clamp,
    cosine,
    exp,
    exp2,
    floor,
    fraction,
    hypot,
    lerp,
    linear_step,
    log,
    log2,
    maximum,
    minimum,
    polynomial,
    power,
    sine,
    smooth_maximum,
    smooth_minimum,
    smoothstep,
    sqrt,
    square,
    tanh,
    where,
)
from terrakit.formula.operators import FormulaFilter, FormulaGenerator
from terrakit.formula.place import Place

__all__ = [  # noqa: RUF022  (sorted as people read, case aside)
    "absolute",
    "arctangent",
    "as_formula",
    "billow",
    "clamp",
    "constant",
    "cosine",
    "exp",
    "exp2",
    "fbm",
    "floor",
    "Formula",
    "FormulaFilter",
    "FormulaGenerator",
    "fraction",
    "heterogeneous_terrain",
    "hybrid_multifractal",
    "hypot",
    "jordan",
    "lerp",
    "linear_step",
    "log",
    "log2",
    "maximum",
    "minimum",
    "multifractal",
    "Number",
    "Octaves",
    "Place",
    "polynomial",
    "power",
    "ridged_multifractal",
    "sine",
    "slope_damped",
    "smooth_maximum",
    "smooth_minimum",
    "smoothstep",
    "sqrt",
    "square",
    "swiss",
    "tanh",
    "turbulence",
    "variable_lacunarity",
    "where",
]
