"""Sum magnitudes of noise upward from a floor."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, fbm, turbulence
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class Turbulence(Fractal):
    """Sum magnitudes of noise upward from a floor.

    ::

        z(x) = offset + amplitude * sum_k gain^k |n_k| / sum_k gain^k

    With ``hard = false`` the noise itself is summed, raised to the same range.

    References
    ----------
    K. Perlin, "An image synthesizer", SIGGRAPH 1985.
    """

    name = "turbulence"
    cites = ("Perlin 1985",)

    hard: bool = parameter(True, "Whether valleys are sharp creases.")

    presets: ClassVar = {
        "badlands": {"amplitude": 200.0, "wavelength": 1500.0, "hurst_exponent": 0.7},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return turbulence(self.summed(place)) if self.hard else fbm(self.summed(place)) * 0.5 + 0.5
