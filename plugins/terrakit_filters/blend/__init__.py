"""Two terrains made into one: added, multiplied, the higher of both."""

from __future__ import annotations

from typing import ClassVar, Literal

from terrakit.formula import (
    Formula,
    FormulaFilter,
    Place,
    absolute,
    lerp,
    maximum,
    minimum,
    power,
    smooth_maximum,
    smooth_minimum,
    where,
)
from terrakit.parameters import Maskable, parameter
from terrakit.sources import Source

LEAST_EXPONENT = 0.1
HIGHEST = 1e9
"""Metres at which a power ends, so that it stays finite."""


class Blend(FormulaFilter):
    """Join another terrain to this one, everywhere or under a mask.

    With z the ground, o the other terrain, B the base height and U the unit height::

        replace   o                        maximum   max(z, o), rounded over the transition
        add       z + o                    minimum   min(z, o), rounded over the transition
        subtract  z - o                    multiply  B + (z - B) o / U
        difference  |z - o|                power     B + U ((z - B) / U)^max(0.1, 1 + o / U)
        average   (z + o) / 2

    and share s takes z to z + s (blended - z). Products and powers need to know which height
    counts as 0 and which as 1: where the other terrain is U high, ``multiply`` leaves the ground;
    where it is 0 high, ``power`` does, which bends the ground between B and B + U down where o is
    above 0 and up where it is below, and leaves what is below B.

    References
    ----------
    I. Quilez, "Smooth minimum", 2013, for the transition.
    """

    name = "blend"
    cites = ("Quilez 2013",)
    fields = 5
    trial: ClassVar = {"other": {"use": "expression", "formula": "40*sin(x/60)*cos(y/80)"}}
    turning: ClassVar = {"other": 35.0}
    idle: ClassVar = {"share": 0.0}

    other: Source = parameter(
        ..., "The other terrain: one to make, an earlier step, or a height.", unit="m"
    )
    mode: Literal[
        "replace",
        "add",
        "subtract",
        "difference",
        "average",
        "multiply",
        "maximum",
        "minimum",
        "power",
    ] = parameter("add", "What becomes of the two heights.")
    share: Maskable = parameter(
        1.0, "Where it counts: 0 leaves the ground, 1 is all blended.", ge=0, le=1
    )
    transition: float = parameter(
        0.0,
        "For maximum and minimum: difference of heights below which the seam is rounded.",
        unit="m",
        ge=0,
        le=1e6,
    )
    base_height: float = parameter(
        0.0, "For multiply and power: height that counts as 0.", unit="m", ge=-1e6, le=1e6
    )
    unit_height: float = parameter(
        1000.0,
        "For multiply and power: height above the base that counts as 1.",
        unit="m",
        ge=0.001,
        le=1e6,
    )

    presets: ClassVar = {
        "carve": {"mode": "minimum", "transition": 30.0},
        "bury": {"mode": "maximum", "transition": 30.0},
        "detail": {"mode": "add", "share": 0.5},
    }

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the blended height."""
        if self.share == 0:
            return ground
        blended = self._blended(ground, place.terrain(self.other, "other"))
        share = place.value(self, "share")
        return where(share < 1.0, lerp(ground, blended, share), blended)

    def _blended(self, ground: Formula, other: Formula) -> Formula:
        if self.mode == "replace":
            return other
        if self.mode == "add":
            return ground + other
        if self.mode == "subtract":
            return ground - other
        if self.mode == "difference":
            return absolute(ground - other)
        if self.mode == "average":
            return (ground + other) * 0.5
        if self.mode == "maximum":
            return smooth_maximum(ground, other, self.transition)
        if self.mode == "minimum":
            return smooth_minimum(ground, other, self.transition)
        above, share = ground - self.base_height, other * (1.0 / self.unit_height)
        if self.mode == "multiply":
            return self.base_height + above * share
        risen = power(above * (1.0 / self.unit_height), maximum(1.0 + share, LEAST_EXPONENT))
        risen = minimum(risen, HIGHEST / self.unit_height)
        return where(above > 0.0, self.base_height + risen * self.unit_height, ground)
