"""Heights held between two limits."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import model_validator

from terrakit.formula import Formula, FormulaFilter, Place, smooth_maximum, smooth_minimum
from terrakit.parameters import parameter


class Clamp(FormulaFilter):
    """Raise what is too low and cut off what is too high, at a hard edge or a soft one.

    With transition w the edge is rounded where the ground is nearer than w to a limit; it stays
    within both limits, and keeps the order of heights::

        z' = smooth_min(smooth_max(z, low, w), high, w),   smooth_max(a, b, w) = max(a, b) + w q^3/6
        q  = max(0, 1 - |a - b| / w)

    References
    ----------
    I. Quilez, "Smooth minimum", 2013.
    """

    name = "clamp"
    cites = ("Quilez 2013",)
    fields = 3
    trial: ClassVar = {"low": -20.0, "high": 60.0, "transition": 15.0}
    idle: ClassVar = {"low": None, "high": None}

    low: float | None = parameter(
        0.0, "Height below which nothing lies; none without it.", unit="m", ge=-1e6, le=1e6
    )
    high: float | None = parameter(
        None, "Height above which nothing lies; none without it.", unit="m", ge=-1e6, le=1e6
    )
    transition: float = parameter(
        0.0,
        "How near to a limit the ground begins to bend; 0 is a hard edge.",
        unit="m",
        ge=0,
        le=1e6,
    )

    presets: ClassVar = {
        "sea_floor": {"low": 0.0},
        "plateau": {"low": None, "high": 1000.0, "transition": 150.0},
    }

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low is None or self.high is None:
            return self
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high = {self.high:g}; swap them")
        if self.transition > self.high - self.low:
            raise ValueError(
                f"transition = {self.transition:g}: must be at most the {self.high - self.low:g} m "
                "from low to high, or both edges meet"
            )
        return self

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the height within the limits."""
        if self.low is not None:
            ground = smooth_maximum(ground, self.low, self.transition)
        if self.high is not None:
            ground = smooth_minimum(ground, self.high, self.transition)
        return ground
