"""A shield volcano: a broad dome of thin lava flows with a caldera in its top."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    exp,
    hypot,
    maximum,
    minimum,
    smooth_maximum,
    smoothstep,
    square,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm

FULLNESS = 1.5
"""Exponent of the dome: 1 is a cone, 2 a paraboloid."""


class ShieldVolcano(RoundForm):
    """Build a broad dome of thin lava flows, with a pit in its top and a rift across it.

    ::

        z(r) = H (1 - (r / R)^1.5)  for r < R,  r^2 = x^2 + (y / e)^2

    with ``y`` along the rift and ``e`` the elongation. The caldera is a pit with steep walls and a
    flat floor; small cones stand along the rift, and tongues of lava run down from it. The volume
    of the dome without unevenness and caldera is ``pi R^2 e H 1.5 / 3.5``.

    References
    ----------
    M. J. Rossi, "Morphology and mechanism of eruption of postglacial shield volcanoes in Iceland",
    Bulletin of Volcanology 57, 1996.
    """

    name = "shield_volcano"
    cites = ("Rossi 1996",)
    portrait: ClassVar[float] = 34000.0

    summit_height: float = parameter(
        1300.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    radius: float = parameter(
        12000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    direction: float = parameter(
        55.0, "Where its length points, degrees clockwise from north.", unit="deg", ge=-360, le=360
    )
    elongation: float = parameter(1.35, "Length over width; 1 is round.", ge=1, le=10)
    crater_radius: float = parameter(
        1500.0, "Radius of the crater in the top; 0 for none.", unit="m", ge=0, le=1e5
    )
    crater_depth: float = parameter(
        160.0, "Depth of the crater in the top below its rim.", unit="m", ge=0, le=10000
    )
    flow_height: float = parameter(
        22.0, "Thickness of the lava tongues on its flanks.", unit="m", ge=0, le=1000
    )

    presets: ClassVar = {
        "iceland": {
            "summit_height": 550.0,
            "radius": 5000.0,
            "elongation": 1.05,
            "crater_radius": 320.0,
            "crater_depth": 50.0,
            "flow_height": 10.0,
        },
        "hawaii": {
            "summit_height": 4000.0,
            "radius": 38000.0,
            "elongation": 1.7,
            "crater_radius": 2300.0,
            "crater_depth": 180.0,
            "flow_height": 30.0,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, radius, crater = self.summit_height, self.radius, self.crater_radius
        x, y = self.surroundings(place, 0.9 * radius, 0.1, self.direction, 3)
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)

        # The dome, with a rounded foot where the ground is uneven
        r = hypot(x, y * (1.0 / self.elongation)) * (1.0 / radius)
        dome = smooth_maximum(1.0 - r**FULLNESS, 0.0, natural * 0.3)
        rift = exp(-square(x * (1.0 / (0.07 * radius)))) * smoothstep(
            1.05, 0.3, absolute(y) * (1.0 / (radius * self.elongation))
        )
        z = dome * top + natural * rift * (0.035 * top)

        # Tongues of lava: long, with steep sides and rough tops, thickest on the lower flanks
        outward = minimum(dome * 5.0, 1.0) * smoothstep(0.15, 0.6, r)
        tongues = self.spokes(place, x, y, 0.5 * radius, 34.0, 0.75, 3, "flows")
        young = smoothstep(0.25, 0.55, self.spokes(place, x, y, 0.5 * radius, 9.0, 0.5, 2, "ages"))
        z = (
            z
            + natural
            * outward
            * (smoothstep(0.3, 0.55, tongues) * (0.4 + 0.6 * young) + 0.3 * tongues)
            * self.flow_height
        )

        # Small cones along the rift
        if self.roughness != 0.0:
            vents = place.noise(
                "gradient", 0.055 * radius, place.words(f"{self.name} vents", self.seed)
            )
            z = z + natural * rift * smoothstep(0.35, 0.8, vents) * (0.03 * top)

        detail = self.unevenness(place, 0.2 * radius)
        z = z + (detail + rough) * (0.002 * top)
        z = z + detail * minimum(dome * 3.0, 1.0) * (0.016 * top)
        if crater == 0.0:
            return self.ground(place, z)

        # The caldera: pits that have run together, walls in two steps, a floor of ponded lava
        cx, cy = self.surroundings(place, 1.4 * crater, 0.16, self.direction, 5, "caldera")
        stretch = math.sqrt(self.elongation)
        pit = hypot(cx * stretch, cy * (1.0 / stretch)) * (1.0 / crater)
        wall = 0.65 * smoothstep(1.0, 0.88, pit) + 0.35 * smoothstep(0.78, 0.68, pit)
        rim = (1.0 - (min(crater / radius, 1.0)) ** FULLNESS) * top
        floor = rim - self.crater_depth
        sunk = maximum(z - floor - detail * (0.02 * self.crater_depth), 0.0)
        return self.ground(place, z - wall * sunk)
