"""A gorge: a narrow cut with walls of rock, far deeper than its floor is wide."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    exp,
    linear_step,
    maximum,
    smooth_maximum,
    smooth_minimum,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import FINEST, Landform


class Gorge(Landform):
    """Saw a winding gorge into the land: steep walls, ledges, clefts and a narrow floor.

    With ``d`` the distance to the axis and ``a`` metres ahead::

        z = offset - depth + min(depth, tan(wall_angle) max(0, d - width / 2))
            + tan(shoulder_slope) (d - rim) beyond the rim, which levels off - tan(slope) a
    """

    name = "gorge"
    portrait: ClassVar[float] = 1600.0

    depth: float = parameter(300.0, "Depth of the floor below the rims.", unit="m", ge=0, le=1e5)
    gorge_width: float = parameter(
        40.0, "Distance between the walls at their foot.", unit="m", gt=0, le=1e6
    )
    wall_angle: float = parameter(74.0, "Steepness of the walls.", unit="deg", ge=30, le=85)
    shoulder_slope: float = parameter(
        16.0, "Steepness of the land above the rims.", unit="deg", ge=0, le=45
    )
    slope: float = parameter(1.5, "How steeply its floor falls.", unit="deg", ge=0, le=60)
    direction: float = parameter(
        200.0, "Where it leads down to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(
        1.0, "How much it winds: 0 is straight, 1 is a river's gorge.", ge=0, le=2
    )

    presets: ClassVar = {
        "mountain_gorge": {},
        "slot": {
            "depth": 40.0,
            "gorge_width": 3.0,
            "wall_angle": 84.0,
            "shoulder_slope": 5.0,
            "winding": 1.6,
        },
        "breakthrough": {"depth": 450.0, "gorge_width": 160.0, "wall_angle": 66.0, "slope": 0.3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the gorge and of the land above it."""
        roughness = place.value(self, "roughness")
        steep = math.tan(math.radians(self.wall_angle))
        rim = 0.5 * self.gorge_width + self.depth / steep
        rough = self.warped(place, 0.9 * rim, roughness * (0.1 * rim), 6, hurst_exponent=0.55)
        right, ahead = self.course(rough, self.direction, 9.0 * rim, 1.2 * self.winding * rim)
        distance = absolute(right)
        # Clefts run down the walls where side streams and joints have opened them
        foot = self.drained(
            rough, distance - 0.5 * self.gorge_width, 1.1 * rim, roughness, 4, 0.4, "clefts"
        )
        wall = maximum(foot, 0.0) * steep
        # Ledges, where a softer bed has gone
        bed = 0.17 * max(self.depth, FINEST)
        beds = self.unevenness(place, 4.0 * rim, 3, "beds") * bed
        ledge = self._ledges((wall + beds) * (1.0 / bed)) * bed - beds
        wall = wall + (ledge - wall) * (0.5 * roughness / (roughness + 0.25))
        wall = maximum(wall, 0.0)
        beyond = self.drained(
            rough, maximum(distance - rim, 0.0), 2.5 * rim, roughness, 4, 0.5, "shoulder"
        )
        reach = 6.0 * rim
        gentle = math.tan(math.radians(self.shoulder_slope)) * reach
        above = (1.0 - exp(-beyond * (1.0 / reach))) * gentle
        hills = self.unevenness(place, 5.0 * rim, 10, "hills", 0.85) * (
            (above + 0.25 * self.depth) * 0.9
        )
        far = linear_step(0.6 * rim, 2.0 * rim, distance)
        top = above + hills * far + self.depth
        cut = smooth_minimum(wall, top, roughness * (0.12 * self.depth))
        rocks = self.unevenness(place, 0.5 * rim, 7, "rocks", 0.6) * (
            linear_step(0.0, 0.3 * self.depth, wall) * (0.05 * self.depth) + 0.02 * self.gorge_width
        )
        fall = ahead * math.tan(math.radians(self.slope))
        return self.ground(place, smooth_maximum(cut, 0.0, 1e-6) + rocks - self.depth - fall)

    @staticmethod
    def _ledges(beds: Formula) -> Formula:
        """Return beds with every cliff steeper and a ledge below it."""
        from terrakit.formula import floor, smoothstep

        whole = floor(beds)
        return whole + smoothstep(0.15, 0.85, beds - whole)
