"""One octave of any noise."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, FormulaGenerator, Place
from terrakit.parameters import Maskable, Seed, parameter
from terrakit_generators.fractals.octaves import Basis


class Noise(FormulaGenerator):
    """Make one octave of noise, the stuff of which the fractals are summed.

    ::

        z(x) = offset + amplitude * n(x / wavelength)

    References
    ----------
    K. Perlin, "Improving noise", SIGGRAPH 2002. S. Worley, "A cellular texture basis function",
    SIGGRAPH 1996. S. Gustavson, "Simplex noise demystified", 2005.
    """

    name = "noise"
    cites = ("Perlin 2002", "Worley 1996", "Gustavson 2005")
    fields = 3
    portrait: ClassVar[float] = 8000.0

    amplitude: Maskable = parameter(
        100.0, "Highest possible rise above and fall below the offset.", unit="m", ge=0, le=1e6
    )
    wavelength: float = parameter(
        1000.0, "Distance between the largest hills.", unit="m", gt=0, le=1e8
    )
    basis: Basis = parameter("gradient", "The noise that is summed.")
    offset: Maskable = parameter(
        0.0, "Height of the middle of the range.", unit="m", ge=-1e6, le=1e6
    )
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    presets: ClassVar = {
        "swell": {"basis": "simplex", "wavelength": 3000.0},
        "cobbles": {"basis": "cellular_f1", "wavelength": 20.0, "amplitude": 2.0},
        "cracked_mud": {"basis": "cellular_f2_minus_f1", "wavelength": 5.0, "amplitude": 0.2},
        "fields": {"basis": "cellular_value", "wavelength": 400.0, "amplitude": 10.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place."""
        words = place.words(self.name, self.seed)
        noise = place.noise(self.basis, self.wavelength, words)
        return noise * place.value(self, "amplitude") + place.value(self, "offset")
