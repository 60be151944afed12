"""An undulating plain: long low swells with swales between them, and no rivers."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import Formula, Place, cosine, minimum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class UndulatingPlain(Landform):
    """Roll the ground in gentle swells and swales that bend, fork and fade.

    With ``d`` metres across them, and where they bend ``d`` moved by noise::

        z = offset + height (1 - cos(2 pi d / wavelength)) / 2

    The swells are higher here and lower there; swales have no channel at their bottom.
    """

    name = "undulating_plain"
    portrait: ClassVar[float] = 5000.0

    swell_height: float = parameter(
        25.0, "Height of the swells above the swales.", unit="m", ge=0, le=1e4
    )
    wavelength: float = parameter(
        600.0, "Distance from one swell to the next.", unit="m", gt=0, le=1e6
    )
    direction: float = parameter(
        60.0, "Where the swells run to, clockwise from north.", unit="deg", ge=-360, le=360
    )

    presets: ClassVar = {
        "swales": {},
        "prairie": {"swell_height": 12.0, "wavelength": 900.0},
        "downs": {"swell_height": 70.0, "wavelength": 1400.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the swells."""
        roughness = place.value(self, "roughness")
        wave = self.wavelength
        bent = self.warped(place, 3.4 * wave, roughness * (0.9 * wave), 2, hurst_exponent=1.0)
        right, _ = bent.around(self.center, self.direction)
        swell = 0.5 - cosine(right * (2.0 * math.pi / wave)) * 0.5
        # Swells end and others begin where the noise outweighs them
        size = 1.0 + self.unevenness(place, 2.3 * wave, 2, "size") * 1.8
        between = self.unevenness(place, 1.8 * wave, 2, "between", 1.0) * 1.9
        detail = self.unevenness(place, 0.3 * wave, 6) * (0.02 + swell * 0.03)
        return self.ground(
            place,
            (swell * size * (1.0 - minimum(roughness, 1.0) * 0.2) + between + detail)
            * self.swell_height,
        )
