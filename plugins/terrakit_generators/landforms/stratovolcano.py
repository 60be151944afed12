"""A stratovolcano: a steep, concave cone with a crater in its top."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    exp,
    hypot,
    maximum,
    minimum,
    smooth_minimum,
    smoothstep,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm

FALLS = 3.0
"""Distances over which the cone falls by a factor of e, between the crater and the foot."""


class Stratovolcano(RoundForm):
    """Build a steep, concave volcano with a summit crater and gullies down its flanks.

    ::

        z(r) = H e^(-(r - r_c) / r_0),  r_0 = (R - r_c) / 3   outside of the crater
        z(r) = H - D (1 - (r / r_c)^2)                        within

    Gullies (barrancos) begin below the rim, are deepest at ``r_0`` and end on the apron.

    References
    ----------
    D. Karatson et al., "The regular shape of stratovolcanoes", Journal of Volcanology and
    Geothermal Research 193, 2010.
    """

    name = "stratovolcano"
    cites = ("Karatson et al. 2010",)
    portrait: ClassVar[float] = 22000.0

    summit_height: float = parameter(
        2500.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    radius: float = parameter(
        12000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    crater_radius: float = parameter(
        550.0, "Radius of the crater in the top; 0 for none.", unit="m", ge=0, le=1e5
    )
    crater_depth: float = parameter(
        250.0, "Depth of the crater in the top below its rim.", unit="m", ge=0, le=10000
    )
    gully_depth: float = parameter(
        170.0, "Depth of the gullies where they are deepest.", unit="m", ge=0, le=5000
    )
    gullies: int = parameter(22, "About how many large gullies run down.", ge=1, le=200)

    presets: ClassVar = {
        "fuji": {
            "summit_height": 3000.0,
            "radius": 17000.0,
            "crater_radius": 350.0,
            "gully_depth": 60.0,
            "gullies": 34,
            "irregularity": 0.6,
        },
        "cinder": {
            "summit_height": 150.0,
            "radius": 900.0,
            "crater_radius": 190.0,
            "crater_depth": 75.0,
            "gully_depth": 5.0,
            "gullies": 40,
            "roughness": 0.5,
        },
        "dissected": {"gully_depth": 420.0, "gullies": 14, "roughness": 1.5, "irregularity": 1.4},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, crater = self.summit_height, min(self.crater_radius, 0.8 * self.radius)
        fall = (self.radius - crater) / FALLS
        x, y = self.surroundings(place, 0.6 * self.radius, 0.07)
        r = hypot(x, y)
        rough = place.value(self, "roughness")

        # The cone, and the bowl that is cut into its top
        outward = (r - crater) * (1.0 / fall)
        share = exp(-maximum(outward, -1.0))
        flank = maximum(outward, 0.0)
        gullies = minimum(self.spokes(place, x, y, fall, float(self.gullies), 0.3), 1.0)
        detail = self.unevenness(place, 0.25 * self.radius)
        below_rim = smoothstep(0.0, 0.5, flank)
        cone = share * top
        carved = below_rim * flank * exp(1.0 - flank) * minimum(share * 5.0, 1.0)
        cut = carved * (1.0 - gullies) ** 2 * self.gully_depth
        uneven = (detail + rough) * (0.004 * top) + detail * minimum(share * 3.0, 1.0) * (
            0.035 * top
        ) * (0.35 + 0.65 * below_rim)
        if crater == 0.0:
            return self.ground(place, cone - cut * minimum(rough, 1.0) + uneven)
        depth = self.crater_depth
        bowl = (r * (1.0 / crater)) ** 2 * depth + (top - depth)
        return self.ground(
            place,
            smooth_minimum(cone - cut * minimum(rough, 1.0), bowl, 0.15 * depth) + uneven,
        )
