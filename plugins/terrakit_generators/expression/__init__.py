"""Terrain from arithmetic that the user writes."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import model_validator

from terrakit.errors import ParameterError
from terrakit.formula import Formula, FormulaGenerator, Place, arctangent, hypot
from terrakit.formula.parsing import check_text, formula_at, refuse_not_finite
from terrakit.heightfield import Grid, Layer
from terrakit.parameters import Seed, parameter
from terrakit_generators.landforms.landform import Point

NAMES = ("x", "y", "r", "theta", "east", "north")


class Expression(FormulaGenerator):
    """Make the terrain whose height is a formula of your own.

    ``x`` and ``y`` are metres east and north of the center, ``r`` the distance from it and
    ``theta`` the angle about it (radians, counter-clockwise from east); ``east`` and ``north`` are
    metres from the origin of the world. Angles of ``sin`` and its kin are in radians. Each call of
    a noise is a noise of its own, -1 to 1 (``ridged`` and ``turbulence`` 0 to 1).
    """

    name = "expression"
    fields = 3
    portrait: ClassVar[float] = 6000.0
    trial: ClassVar = {
        "formula": "90*sin(x/500)*cos(y/700) + k*fbm(400, 4) + 20*(r < 300)",
        "define": {"k": 30.0},
        "center": [120.0, 90.0],
    }

    formula: str = parameter(
        "500*exp(-(r/1500)**2) + 120*fbm(1800)",
        "Height in metres, of x, y, r, theta, pi, + - * / **, sin, sqrt, max, fbm(wavelength) ...",
    )
    define: dict[str, float | str] = parameter(
        {}, "Names of your own for numbers or parts of the formula: { k = 'sqrt(x*x + 1)' }."
    )
    center: Point | None = parameter(
        None,
        "World x and y from which x and y are measured; the middle of the world without it.",
        unit="m",
    )
    seed: Seed = parameter(0, "Another number or word gives other noise.")

    presets: ClassVar = {
        "ripples": {"formula": "60*sin(r/90)/(1 + r/400)"},
        "waves": {
            "formula": "30*(sin(x/190) + sin((0.8*x + 0.6*y)/170) + sin((y - 0.3*x)/230)) + 90"
        },
        "volcano": {
            "formula": "cone - 500*exp(-(r/260)**2) + 80*(ridged(900) - 0.5)*exp(-r/2500)",
            "define": {"cone": "1800*exp(-r/1500)"},
        },
        "dunes": {
            "formula": "5 + 35*crest*(0.6 + 0.4*noise(900))",
            "define": {
                "s": "(y + 0.35*x + 500*fbm(1600, 3)) / 330 % 1",
                "crest": "smoothstep(0, 0.72, s) - smoothstep(0.72, 1, s)",
            },
        },
    }

    @model_validator(mode="after")
    def _is_arithmetic(self) -> Self:
        try:
            check_text(self.formula, self.define, NAMES)
        except ParameterError as error:
            raise ValueError(str(error)) from None
        return self

    def height(self, place: Place) -> Formula:
        """Return the height at a place."""

        def x() -> Formula:
            return place.around(self.center)[0]

        def y() -> Formula:
            return place.around(self.center)[1]

        variables = {
            "x": x,
            "y": y,
            "r": lambda: hypot(x(), y()),
            "theta": lambda: arctangent(y(), x()),
            "east": lambda: place.x,
            "north": lambda: place.y,
        }
        return formula_at(place, self.formula, self.define, variables, self.name, self.seed)

    def check_result(self, grid: Grid, elevation: Layer) -> None:
        """Raise ParameterError where the formula divides by zero or the like."""
        refuse_not_finite(grid, elevation, self.formula)
