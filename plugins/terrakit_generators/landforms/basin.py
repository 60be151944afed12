"""A basin: a wide floor among mountains that close around it."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    hypot,
    linear_step,
    smoothstep,
    swiss,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Basin(Landform):
    """Sink a wide flat floor into the land, with aprons at the foot of a closed mountain rim.

    With ``r`` the distance to the middle and ``s`` the smoothstep that is level at both ends::

        z = offset - depth (1 - s(floor_radius, radius, r)) + R mountains
    """

    name = "basin"
    portrait: ClassVar[float] = 22000.0

    radius: float = parameter(
        8000.0, "Distance from the middle to the crest around it.", unit="m", gt=0, le=1e6
    )
    floor_radius: float = parameter(
        4500.0,
        "Distance from the middle to where the floor begins to rise.",
        unit="m",
        ge=0,
        le=1e6,
    )
    depth: float = parameter(
        600.0, "Depth of the floor below the land around.", unit="m", ge=0, le=1e5
    )
    mountain_height: float = parameter(
        700.0, "Height of the mountains above the land around.", unit="m", ge=0, le=1e5
    )

    presets: ClassVar = {
        "intermontane": {},
        "hollow": {
            "radius": 1500.0,
            "floor_radius": 600.0,
            "depth": 120.0,
            "mountain_height": 60.0,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the basin and of the mountains around it."""
        roughness = place.value(self, "roughness")
        floor_radius = min(self.floor_radius, 0.95 * self.radius)
        wall = self.radius - floor_radius
        moved = self.warped(place, 1.3 * self.radius, roughness * (0.22 * self.radius), 4)
        x, y = moved.around(self.center)
        distance = hypot(x, y)
        away = self.drained(place, distance - floor_radius, 0.7 * wall, roughness, 5, 0.5)
        rise = smoothstep(0.0, wall, away)
        peaks = swiss(self.octaves(place, 1.1 * wall, 9, "mountains"), 0.12)
        foot = linear_step(0.3 * wall, 1.2 * wall, away)
        mountains = peaks * foot * (1.35 * self.mountain_height) * roughness
        floor = self.unevenness(place, 0.4 * self.radius, 8) * (0.02 * self.depth)
        return self.ground(place, (rise - 1.0) * self.depth + mountains + floor)
