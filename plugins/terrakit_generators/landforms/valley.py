"""A valley: what a river or a glacier has cut, with side ravines and a falling floor."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import Formula, Place, absolute, exp, power, smooth_maximum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Valley(Landform):
    """Cut a winding valley with side ravines: V-shaped by a river or U-shaped by a glacier.

    With ``d`` the distance to the foot of the sides and ``a`` metres ahead::

        z = offset - depth e^(-(d / w)^p) - tan(slope) a,   p = roundness

    ``w`` is such that nine tenths of the depth are climbed between the axis and the shoulder,
    half the width away. Ravines lower the sides in proportion to their height.

    References
    ----------
    H. Svensson, "Is the cross-section of a glacial valley a parabola?", Journal of Glaciology 3,
    1959.
    """

    name = "valley"
    cites = ("Svensson 1959",)
    portrait: ClassVar[float] = 6000.0

    depth: float = parameter(
        500.0, "Depth of the floor below the shoulders.", unit="m", ge=0, le=1e5
    )
    valley_width: float = parameter(
        4000.0, "Distance between the shoulders.", unit="m", gt=0, le=1e6
    )
    floor_width: float = parameter(60.0, "Width of the level floor.", unit="m", ge=0, le=1e6)
    roundness: float = parameter(
        1.4, "Shape of the section: 1 is a V, 2 a bowl, 4 a glacier's trough.", ge=0.3, le=12
    )
    slope: float = parameter(1.0, "How steeply its floor falls.", unit="deg", ge=0, le=60)
    direction: float = parameter(
        155.0, "Where it leads down to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(
        1.0, "How much it winds: 0 is straight, 1 is a river's valley.", ge=0, le=2
    )
    ravine_depth: float = parameter(
        0.6, "How deep side ravines cut, as a share of the sides' height.", ge=0, le=0.95
    )

    presets: ClassVar = {
        "v_shaped": {},
        "u_shaped": {
            "depth": 750.0,
            "floor_width": 500.0,
            "roundness": 3.5,
            "slope": 0.7,
            "winding": 0.45,
            "ravine_depth": 0.3,
        },
        "broad": {
            "depth": 120.0,
            "floor_width": 600.0,
            "roundness": 2.0,
            "slope": 0.2,
            "ravine_depth": 0.6,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the valley."""
        roughness = place.value(self, "roughness")
        width = self.valley_width
        rough = self.warped(place, 0.4 * width, roughness * (0.04 * width), 5)
        swing = 0.22 * self.winding * width
        right, ahead = self.course(rough, self.direction, 1.5 * width, swing)
        straight = rough.around(self.center, self.direction)
        floor = 0.5 * min(self.floor_width, 0.9 * width)
        foot = absolute(right) - floor
        foot = self.drained(
            rough, foot, 0.5 * width, roughness, 5, self.ravine_depth, "ravines", straight[::-1]
        )
        distance = smooth_maximum(foot, 0.0, roughness * (0.01 * width))
        # The shoulder, where a tenth of the depth is left
        scale = (0.5 * width - floor) / math.log(10.0) ** (1.0 / self.roundness)
        climbed = 1.0 - exp(-power(distance * (1.0 / scale), self.roundness))
        detail = self.unevenness(place, 0.35 * width, 9) * (climbed + 0.01)
        fall = ahead * math.tan(math.radians(self.slope))
        return self.ground(place, (climbed - 1.0 + detail * 0.2) * self.depth - fall)
