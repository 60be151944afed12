"""A cuesta: a long gentle slope down the dip of a hard bed, and a steep scarp behind it."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    clamp,
    maximum,
    minimum,
    smooth_maximum,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import FINEST, Landform


class Cuesta(Landform):
    """Tilt a hard bed: a gentle dip slope with shallow valleys, a notched scarp with a cliff.

    With ``a`` metres ahead of the crest, in the direction of the dip::

        z = offset + max(0, min(height - tan(dip) a, height + tan(scarp_angle) a))

    It runs right and left of its middle without an end.
    """

    name = "cuesta"
    portrait: ClassVar[float] = 5000.0

    scarp_height: float = parameter(
        280.0, "Height of the crest above the land around.", unit="m", ge=0, le=1e5
    )
    dip: float = parameter(5.0, "Tilt of the beds.", unit="deg", gt=0, le=45)
    scarp_angle: float = parameter(
        30.0, "Steepness of the scarp, without its cliff.", unit="deg", gt=0, le=80
    )
    cliff_height: float = parameter(
        60.0, "Height of the cliff below the edge.", unit="m", ge=0, le=1e5
    )
    direction: float = parameter(
        120.0, "Where the beds dip to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(1.0, "How much its crest winds: 0 is straight.", ge=0, le=2)

    presets: ClassVar = {
        "cuesta": {},
        "hogback": {"dip": 32.0, "scarp_angle": 42.0, "cliff_height": 20.0, "scarp_height": 160.0},
        "escarpment": {"dip": 1.5, "scarp_height": 320.0, "cliff_height": 90.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the cuesta."""
        roughness = place.value(self, "roughness")
        height = max(self.scarp_height, FINEST)
        down = math.tan(math.radians(self.dip))
        steep = math.tan(math.radians(self.scarp_angle))
        cliff = min(self.cliff_height, 0.9 * height)
        wall = math.tan(math.radians(max(75.0, self.scarp_angle)))
        run = (height - cliff) / steep + cliff / wall
        rough = self.warped(place, 2.5 * run, roughness * (0.2 * run), 6, "edge", 0.65)
        # The line of the crest runs across the dip: right of it is ahead of the axis
        ahead, _ = self.course(rough, self.direction - 90.0, 9.0 * run, 1.3 * self.winding * run)
        # Bays, out of which springs carry the scarp away
        behind = self.drained(rough, run + ahead, 1.6 * run, roughness, 5, 0.5, "bays")
        scarp = self._scarp(behind, run, height, cliff, steep, wall)
        # Shallow valleys run down the dip
        far = height / down
        straight = rough.around(self.center, self.direction)
        up = self.drained(
            rough,
            far - ahead,
            0.4 * min(far, 8.0 * run),
            roughness,
            3,
            0.1,
            "dip valleys",
            straight,
        )
        back = minimum(up, far * 1.25) * down
        rounded = roughness * (0.03 * height)
        top = minimum(back, scarp)
        foot = smooth_maximum(top, 0.0, rounded)
        hills = self.unevenness(place, 3.0 * run, 9, "hills", 0.95) * (0.1 * height)
        detail = self.unevenness(place, 0.7 * run, 8, "slope", 0.7)
        steepness = clamp(behind * (1.0 / run), 0.0, 1.0)
        steepness = steepness * (1.0 - steepness) * 4.0
        return self.ground(place, foot + hills + detail * (steepness * 0.1 + 0.012) * height)

    @staticmethod
    def _scarp(
        behind: Formula, run: float, height: float, cliff: float, steep: float, wall: float
    ) -> Formula:
        """Return the height of the scarp at metres from its foot, and beyond its crest."""
        below = minimum(behind * steep, height - cliff)
        above = maximum(behind - (height - cliff) / steep, 0.0) * wall
        return below + above
