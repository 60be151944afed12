"""Sum octaves of noise into rolling, self-similar ground."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, fbm
from terrakit_generators.fractals.octaves import Fractal


class Fbm(Fractal):
    """Sum octaves of noise into rolling, self-similar ground.

    Each octave lies on a lattice that is turned and shifted by its own hash, so that octaves never
    line up at lattice points::

        z(x) = offset + amplitude * sum_k gain^k n_k(lacunarity^k x / wavelength) / sum_k gain^k

    References
    ----------
    K. Perlin, "Improving noise", SIGGRAPH 2002. F. K. Musgrave, C. E. Kolb and R. S. Mace, "The
    synthesis and rendering of eroded fractal terrains", SIGGRAPH 1989.
    """

    name = "fbm"
    cites = ("Perlin 2002", "Musgrave, Kolb & Mace 1989")

    presets: ClassVar = {
        "hills": {"amplitude": 250.0, "wavelength": 3000.0, "hurst_exponent": 0.95},
        "rugged": {"amplitude": 1500.0, "wavelength": 8000.0, "hurst_exponent": 0.65},
        "rolling_downs": {"amplitude": 80.0, "wavelength": 2500.0, "hurst_exponent": 1.0},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return fbm(self.summed(place))
