"""Sum octaves that noise stretches here and crowds there."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, variable_lacunarity
from terrakit.parameters import parameter
from terrakit_generators.fractals.octaves import Fractal


class VariableLacunarity(Fractal):
    """Sum octaves that noise stretches here and crowds there.

    Every octave is displaced by noise of its own wavelength::

        n_k(x) -> n_k(x + distortion * wavelength_k * (a_k(x), b_k(x)))

    References
    ----------
    F. K. Musgrave in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "variable_lacunarity"
    cites = ("Musgrave 1994",)

    distortion: float = parameter(
        0.4, "How far an octave is moved, as a share of its wavelength.", ge=0, le=4
    )

    presets: ClassVar = {
        "gnarled": {"amplitude": 400.0, "wavelength": 3000.0, "distortion": 0.8},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return variable_lacunarity(
            self.summed(place),
            self.summed(place, "east"),
            self.summed(place, "north"),
            self.distortion,
        )
