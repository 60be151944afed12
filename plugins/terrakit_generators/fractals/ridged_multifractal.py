"""Turn noise into sharp ridges on which finer ridges sit."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, ridged_multifractal
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class RidgedMultifractal(Fractal):
    """Turn noise into sharp ridges on which finer ridges sit.

    Each octave is weighted by the one before, so that slopes are rough and valleys smooth::

        s_k = w_k (ridge_offset - |n_k|)^2,  w_k = clamp(ridge_gain s_(k-1), 0, 1)
        z(x) = offset + amplitude * sum_k gain^k s_k / most

    References
    ----------
    F. K. Musgrave in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "ridged_multifractal"
    cites = ("Musgrave 1994",)

    ridge_offset: float = parameter(
        1.0, "Height of the ridges before squaring; 1 makes them sharp.", ge=0.5, le=2
    )
    ridge_gain: float = parameter(
        2.0, "How strongly fine ridges gather on the large ones.", ge=0, le=10
    )

    presets: ClassVar = {
        "sierra": {"amplitude": 1800.0, "wavelength": 7000.0, "hurst_exponent": 0.9},
        "needles": {"amplitude": 900.0, "wavelength": 1800.0, "ridge_gain": 3.0},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return ridged_multifractal(self.summed(place), self.ridge_offset, self.ridge_gain)
