"""A mesa: a table of hard rock with cliffs all round, on slopes of softer beds."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import Formula, Place, clamp, hypot, maximum, minimum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Mesa(Landform):
    """Raise a table mountain: a flat top, a cliff of hard rock and gullied slopes below it.

    With ``r`` the distance beyond the edge of the top::

        z = offset + height - min(cliff_height, tan(wall_angle) r) - what the slope below falls

    The slope below the cliff starts at the talus angle and flattens towards its foot, which it
    reaches as a parabola. Edges have bays and noses, slopes have gullies and a ledge.
    """

    name = "mesa"
    portrait: ClassVar[float] = 3600.0

    table_height: float = parameter(
        320.0, "Height of the top above the land around.", unit="m", ge=0, le=1e5
    )
    radius: float = parameter(
        750.0, "Distance from the middle of the top to its edge.", unit="m", gt=0, le=1e6
    )
    elongation: float = parameter(1.5, "How much longer than wide the top is.", ge=1, le=20)
    direction: float = parameter(
        70.0, "Where its long side points, clockwise from north.", unit="deg", ge=-360, le=360
    )
    cliff_height: float = parameter(
        110.0, "Height of the cliff below the edge.", unit="m", ge=0, le=1e5
    )
    wall_angle: float = parameter(80.0, "Steepness of the walls.", unit="deg", ge=30, le=85)
    talus_angle: float = parameter(
        34.0, "Steepness of the slope of debris below the cliff.", unit="deg", gt=0, lt=90
    )

    presets: ClassVar = {
        "table_mountain": {},
        "butte": {
            "table_height": 220.0,
            "radius": 90.0,
            "elongation": 1.2,
            "cliff_height": 120.0,
        },
        "tepui": {
            "table_height": 800.0,
            "radius": 2500.0,
            "cliff_height": 500.0,
            "wall_angle": 84.0,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the table mountain."""
        roughness = place.value(self, "roughness")
        radius, height = self.radius, self.table_height
        cliff = min(self.cliff_height, height)
        bays = self.warped(place, 1.3 * radius, roughness * (0.3 * radius), 3, "bays", 0.8)
        moved = self.warped(bays, 0.3 * radius, roughness * (0.035 * radius), 5, "edge", 0.5)
        right, ahead = moved.around(self.center, self.direction)
        # An ellipse of the area of the circle; its distance, to the first order
        longer = math.sqrt(self.elongation)
        u, v = right * longer, ahead * (1.0 / longer)
        round_distance = maximum(hypot(u, v), 1e-6 * radius)
        rate = maximum(hypot(u * longer, v * (1.0 / longer)), 1e-6 * radius)
        distance = round_distance * (round_distance - radius) / rate
        steep = math.tan(math.radians(self.wall_angle))
        foot = cliff / steep
        # Noses of the cliff stand out where it is less jointed
        joints = self.unevenness(place, 0.16 * radius, 5, "joints", 0.5)
        fallen = clamp((distance + joints * (0.25 * foot)) * steep, 0.0, cliff)
        slope = math.tan(math.radians(self.talus_angle))
        rest = height - cliff
        # A parabola that leaves the cliff at the talus angle and ends level
        apron = 2.0 * rest / slope
        gullies = self.drained(place, apron - (distance - foot), 0.3 * radius, roughness, 4, 0.45)
        start = maximum(distance - foot, 0.0)
        away = clamp(start * (1.0 / max(apron, 1e-6)), 0.0, 1.0)
        cut = clamp(gullies * (1.0 / max(apron, 1e-6)), 0.0, 1.0)
        smooth = (1.0 - away) * (1.0 - away)
        gullied = cut * cut
        # At its head the slope is whole, and at its foot the gullies run out on fans
        share = minimum(away * 4.0, 1.0) * minimum((1.0 - away) * 1.5, 1.0)
        below = smooth + (minimum(gullied, smooth + 0.1) - smooth) * share
        ledge = self.unevenness(place, 0.5 * radius, 8, "slope", 0.7)
        detail = ledge * (smooth * share * (0.25 * rest) + 0.012 * height)
        plain = self.unevenness(place, 1.5 * radius, 9, "plain") * (0.05 * height)
        return self.ground(place, (cliff - fallen) + below * rest + detail + plain)
