"""Multiply octaves: plains here, mountains there."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, multifractal
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class Multifractal(Fractal):
    """Multiply octaves: plains here, mountains there.

    ::

        z(x) = offset + amplitude * prod_k (gain^k n_k + bias) / prod_k (gain^k / 2 + bias)

    The amplitude is the height where every octave stands at half its range; peaks are higher.

    References
    ----------
    F. K. Musgrave in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "multifractal"
    cites = ("Musgrave 1994",)

    bias: float = parameter(
        1.0, "What is added to the noise before octaves are multiplied.", ge=0, le=2
    )

    presets: ClassVar = {
        "lonely_peaks": {"amplitude": 1500.0, "wavelength": 5000.0, "hurst_exponent": 0.6},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return multifractal(self.summed(place), self.bias)
