"""Draw ridges down their own slopes, like flanks that gullies have cut."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, swiss
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal, SlopeBasis


class Swiss(Fractal):
    """Draw ridges down their own slopes, like flanks that gullies have cut.

    Every octave is moved along the slopes of those before it, and is stronger where they are high.

    References
    ----------
    G. de Carpentier, "Scape: procedural basics", 2007.
    """

    name = "swiss"
    cites = ("de Carpentier 2007",)

    basis: SlopeBasis = parameter("gradient", "The noise that is summed.")

    slope_warp: float = parameter(0.15, "How far slopes draw finer octaves with them.", ge=0, le=4)

    presets: ClassVar = {
        "flanks": {"amplitude": 1500.0, "wavelength": 8000.0, "slope_warp": 0.2},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return swiss(self.summed(place), self.slope_warp)
