"""Heights stretched to a range."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator

from terrakit.errors import ParameterError
from terrakit.formula import Formula, Place, where
from terrakit.heightfield import Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run

F = np.float32


class Normalise(Filter):
    """Stretch the terrain so that its lowest point lies at ``low`` and its highest at ``high``.

    The measured range is that of the whole terrain, so this is the one filter that looks at
    everything: tiles that are normalised one by one do not fit together. Say ``source_low`` and
    ``source_high`` to map a known range instead; then heights beyond it lie beyond the new one::

        z' = low + (high - low) (z - source_low) / (source_high - source_low)

    Flat ground, which has no range, is put at ``low``.
    """

    name = "normalise"
    fields = 3
    locality = "global"
    trial: ClassVar = {"low": -100.0, "high": 350.0}

    low: float = parameter(0.0, "Height of the lowest point.", unit="m", ge=-1e6, le=1e6)
    high: float = parameter(1000.0, "Height of the highest point.", unit="m", ge=-1e6, le=1e6)
    source_low: float | None = parameter(
        None,
        "Height that becomes the low one; the terrain's lowest without it.",
        unit="m",
        ge=-1e6,
        le=1e6,
    )
    source_high: float | None = parameter(
        None,
        "Height that becomes the high one; the terrain's highest without it.",
        unit="m",
        ge=-1e6,
        le=1e6,
    )

    presets: ClassVar = {
        "hills": {"low": 0.0, "high": 300.0},
        "alpine": {"low": 400.0, "high": 4000.0},
    }

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(
                f"low = {self.low:g} is above high = {self.high:g}; swap them (reshape with "
                "formula = '-z' turns a terrain upside down)"
            )
        if self.source_low is not None and self.source_high is not None:
            _check_range(self.source_low, self.source_high)
        return self

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain within its new range."""
        lowest, highest = self._range(surface)
        width = F(highest) - F(lowest)
        if not width > 0:
            flat = np.full(surface.shape, F(self.low))
            return surface.with_layers(elevation=flat)
        place = Place(surface.grid, run, surface)
        (elevation,) = place.computed(self._stretched(place.layer(), lowest, float(width)))
        return surface.with_layers(elevation=elevation)

    def _range(self, surface: Heightfield) -> tuple[float, float]:
        """Return the heights that become the low and the high one."""
        lowest, highest = self.source_low, self.source_high
        if lowest is None:
            lowest = float(surface.elevation.min())
        if highest is None:
            highest = float(surface.elevation.max())
        if (self.source_low, self.source_high) != (None, None):
            _check_range(lowest, highest)
        return lowest, highest

    def _stretched(self, ground: Formula, lowest: float, width: float) -> Formula:
        """Return the new height; from the nearer end, so that both ends are met exactly."""
        share = (ground - lowest) / width
        rise = self.high - self.low
        return where(share < 0.5, self.low + share * rise, self.high - (1.0 - share) * rise)


def _check_range(lowest: float, highest: float) -> None:
    if not F(lowest) < F(highest):
        raise ParameterError(
            f"source_low = {lowest:g} must be below source_high = {highest:g}; without one of "
            "them the terrain's own lowest or highest counts"
        )
