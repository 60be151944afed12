"""Sum octaves whose detail fades on slopes, so that ground looks weathered."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, slope_damped
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal, SlopeBasis


class SlopeDamped(Fractal):
    """Sum octaves whose detail fades on slopes, so that ground looks weathered.

    Analytic slopes of the noise are summed along with it::

        z(x) = offset + amplitude * sum_k g_k n_k / (1 + damping |sum_j<=k g_j grad_j|^2) / sum g_k,
        g_k = gain^k

    References
    ----------
    I. Quilez, "Value noise derivatives", 2008.
    """

    name = "slope_damped"
    cites = ("Quilez 2008",)

    basis: SlopeBasis = parameter("gradient", "The noise that is summed.")

    damping: float = parameter(1.0, "How much slopes are smoothed; 0 is plain noise.", ge=0, le=100)

    presets: ClassVar = {
        "weathered": {"amplitude": 1200.0, "wavelength": 6000.0, "damping": 1.5},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return slope_damped(self.summed(place), self.damping)
