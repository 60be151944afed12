"""A plain: nearly level land, which old river courses cross."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import Formula, Place, absolute, maximum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Plain(Landform):
    """Make a plain: a gentle fall, low swells and the traces of old river courses.

    With ``a`` metres ahead::

        z = offset - tan(slope) a + R (relief n - channel_depth max(0, 1 - |c| / c_0)^2)

    where ``n`` and ``c`` are noise and ``R`` is the roughness: with 0 of it the plain is a plane.
    """

    name = "plain"
    portrait: ClassVar[float] = 6000.0

    slope: float = parameter(0.06, "How steeply it falls.", unit="deg", ge=0, le=60)
    direction: float = parameter(
        130.0, "Where it falls to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    relief: float = parameter(
        3.0, "Height of the swells above the hollows, about.", unit="m", ge=0, le=1e4
    )
    wavelength: float = parameter(1500.0, "Length of the largest swells.", unit="m", gt=0, le=1e6)
    channel_depth: float = parameter(
        1.5, "Depth of the old river courses; 0 leaves them out.", unit="m", ge=0, le=1e4
    )

    presets: ClassVar = {
        "river_plain": {"slope": 0.03, "relief": 2.0, "channel_depth": 2.0},
        "till_plain": {"slope": 0.1, "relief": 8.0, "wavelength": 700.0, "channel_depth": 0.0},
        "playa": {"slope": 0.0, "relief": 0.4, "channel_depth": 0.15},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the plain."""
        _, ahead = place.around(self.center, self.direction)
        swells = self.unevenness(place, self.wavelength, octaves=8, hurst_exponent=0.9)
        height = swells * (1.5 * self.relief) - ahead * math.tan(math.radians(self.slope))
        if self.channel_depth > 0:
            height = height - self._old_courses(place) * self.channel_depth
        return self.ground(place, height)

    def _old_courses(self, place: Place) -> Formula:
        """Return 1 in the bed of a river that has left it, 0 away from it."""
        bend = 0.4 * self.wavelength
        wound = self.warped(place, bend, 0.55 * bend, octaves=2, stream="bends")
        right, ahead = wound.around(self.center, self.direction)
        words = place.words(f"{self.name} courses", self.seed)
        # Drawn out down the fall, where its zero lines are the courses
        noise = place.noise_at(
            "gradient",
            right * (1.0 / (1.1 * self.wavelength)),
            ahead * (1.0 / (4.0 * self.wavelength)),
            words,
        )
        course = maximum(1.0 - absolute(noise) * 14.0, 0.0)
        return course * course * (3.0 - course * 2.0) * place.value(self, "roughness")
