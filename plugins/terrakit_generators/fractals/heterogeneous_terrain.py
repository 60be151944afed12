"""Sum octaves so that ground is the rougher the higher it is."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, heterogeneous_terrain
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class HeterogeneousTerrain(Fractal):
    """Sum octaves so that ground is the rougher the higher it is.

    ::

        h_0 = n_0 + bias,  h_(k+1) = h_k + (n_k + bias) h_k gain^k

    The amplitude is the height where every octave stands at half its range; peaks are higher.

    References
    ----------
    F. K. Musgrave in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "heterogeneous_terrain"
    cites = ("Musgrave 1994",)

    bias: float = parameter(
        0.7, "What is added to the noise before octaves are multiplied.", ge=0, le=2
    )

    presets: ClassVar = {
        "coast_to_peaks": {"amplitude": 900.0, "wavelength": 9000.0, "bias": 0.3},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return heterogeneous_terrain(self.summed(place), self.bias)
