"""Square noise, then warp and damp it by its own slopes: soft, folded mountains."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, jordan
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal, SlopeBasis


class Jordan(Fractal):
    """Square noise, then warp and damp it by its own slopes: soft, folded mountains.

    References
    ----------
    G. de Carpentier, "Scape: procedural basics", 2007.
    """

    name = "jordan"
    cites = ("de Carpentier 2007",)

    basis: SlopeBasis = parameter("gradient", "The noise that is summed.")

    slope_warp: float = parameter(0.4, "How far slopes draw finer octaves with them.", ge=0, le=4)
    damping: float = parameter(1.0, "How much slopes are smoothed; 0 is plain noise.", ge=0, le=100)

    presets: ClassVar = {
        "folds": {"amplitude": 1500.0, "wavelength": 8000.0, "slope_warp": 0.6},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return jordan(self.summed(place), self.slope_warp, self.damping)
