"""Sum octaves so that valleys are smooth and heights are rough."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, hybrid_multifractal
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class HybridMultifractal(Fractal):
    """Sum octaves so that valleys are smooth and heights are rough.

    Sums and products of octaves in one: what an octave adds is weighted by the height so far::

        s_k = min(w_k, 1) (n_k + bias) gain^k,  w_(k+1) = s_k weight_gain

    Detail dies out fast: Musgrave advises a Hurst exponent of a quarter.

    The amplitude is the height where every octave stands at half its range; peaks are higher.

    References
    ----------
    F. K. Musgrave in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "hybrid_multifractal"
    cites = ("Musgrave 1994",)

    hurst_exponent: float = parameter(
        0.3, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    bias: float = parameter(
        0.7, "What is added to the noise before octaves are multiplied.", ge=0, le=2
    )
    weight_gain: float = parameter(
        1.5, "How strongly high ground gathers finer detail.", ge=0, le=4
    )

    presets: ClassVar = {
        "foothills": {"amplitude": 600.0, "wavelength": 6000.0, "hurst_exponent": 0.25},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return hybrid_multifractal(self.summed(place), self.bias, self.weight_gain)
