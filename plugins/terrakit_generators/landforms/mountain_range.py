"""A mountain range: a winding crest with spurs, passes and foothills."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    exp,
    maximum,
    minimum,
    ridged_multifractal,
    smoothstep,
    sqrt,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class MountainRange(Landform):
    """Fold up a mountain range: a winding crest, spurs to both sides, passes, foothills.

    With ``c`` the distance to the axis over half the width::

        z = H e^(-1.9 c^1.5) e(s) (0.22 + 0.4 (1 - 1.3 c) + 0.45 spurs + 0.38 ridges)

    where ``spurs`` run down from the axis to both sides, ``ridges`` is warped ridged noise
    (Musgrave 1994) and ``e(s)`` ends the range smoothly. Without roughness the bracket is 1.

    References
    ----------
    F. K. Musgrave, in D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "mountain_range"
    cites = ("Ebert et al. 1994",)
    portrait: ClassVar[float] = 46000.0

    length: float = parameter(42000.0, "Length from end to end.", unit="m", gt=0, le=1e7)
    range_width: float = parameter(16000.0, "Width from foot to foot.", unit="m", gt=0, le=1e6)
    summit_height: float = parameter(
        2600.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    direction: float = parameter(
        62.0, "Where its length points, degrees clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(1.0, "How much it winds: 0 is straight, 1 is natural.", ge=0, le=2)
    foothills: float = parameter(
        0.12, "Height of the foothills, as a share of the summits'.", ge=0, le=1
    )

    presets: ClassVar = {
        "alps": {
            "length": 60000.0,
            "range_width": 26000.0,
            "summit_height": 3200.0,
            "winding": 1.4,
        },
        "sierra": {
            "length": 50000.0,
            "range_width": 9000.0,
            "summit_height": 2400.0,
            "winding": 0.6,
        },
        "old": {"summit_height": 900.0, "range_width": 20000.0, "roughness": 0.6, "foothills": 0.3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, half, length = self.summit_height, 0.5 * self.range_width, 0.5 * self.length
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)
        bent = self.warped(place, 0.8 * self.range_width, natural * (0.07 * self.range_width), 6)
        right, ahead = self.course(
            bent, self.direction, 1.3 * self.length, 0.24 * self.range_width * self.winding
        )
        across = absolute(right) * (1.0 / half)
        along = absolute(ahead) * (1.0 / length)
        mass = exp(-minimum(across * sqrt(across) * 1.9, 40.0)) * smoothstep(1.15, 0.35, along)

        # Spurs to both sides of the crest, and ridges of all sizes upon them
        crest = maximum(1.0 - across * 1.3, 0.0)
        spurs = self._spurs(bent, right, ahead)
        ridges = ridged_multifractal(
            bent.octaves(
                "gradient",
                0.27 * self.range_width,
                10,
                place.words(f"{self.name} ridges", self.seed),
                gain=0.47,
            ),
            1.0,
            1.8,
        )
        body = 1.0 + natural * (0.40 * crest + 0.45 * spurs + 0.38 * ridges - 0.78)
        foot = smoothstep(0.01, 0.12, mass) * smoothstep(0.5, 0.12, mass)
        detail = self.unevenness(place, 0.2 * self.range_width)
        return self.ground(
            place,
            mass * maximum(body, 0.08) * top
            + natural * foot * ridges * (self.foothills * top)
            + (detail + rough) * (0.006 * top)
            + detail * minimum(mass * 3.0, 1.0) * (0.03 * top),
        )

    def _spurs(self, place: Place, right: Formula, ahead: Formula) -> Formula:
        """Return 1 on the spurs that run down from the axis, 0 between them."""
        total, weight = right * 0.0, 0.0
        for number, (size, share) in enumerate(((0.30, 1.0), (0.17, 0.6), (0.09, 0.3))):
            cell = size * self.range_width
            words = place.words(f"{self.name} spurs {number}", self.seed)
            noise = place.noise_at(
                "gradient", ahead * (1.0 / cell), right * (1.0 / (3.2 * cell)), words
            )
            total = total + maximum(1.0 - absolute(noise) * 2.2, 0.0) * share
            weight += share
        return total * (1.0 / weight)
