"""Sum magnitudes of noise into cushions with sharp valleys between them."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, billow
from terrakit_generators.fractals.octaves import Fractal


class Billow(Fractal):
    """Sum magnitudes of noise into cushions with sharp valleys between them.

    ::

        z(x) = offset + amplitude * sum_k gain^k (2 |n_k| - 1) / sum_k gain^k

    References
    ----------
    D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "billow"
    cites = ("Ebert et al. 1994",)

    presets: ClassVar = {
        "old_hills": {"amplitude": 300.0, "wavelength": 4000.0},
        "cushions": {"amplitude": 60.0, "wavelength": 600.0, "octaves": 5},
    }

    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        return billow(self.summed(place))
