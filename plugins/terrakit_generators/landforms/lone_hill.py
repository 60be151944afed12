"""A lone hill: a rounded rise that stands by itself in a plain."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, hypot, maximum, minimum, smoothstep, square
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm


class LoneHill(RoundForm):
    """Raise a rounded hill that stands by itself in a plain.

    A quartic bell, level on top and at the foot, seen through a warp of the place, with faint
    gullies on its flanks::

        z(r) = H (1 - (r / R)^2)^2  for r < R, else 0

    Its volume without unevenness is pi R^2 H / 3.
    """

    name = "lone_hill"
    portrait: ClassVar[float] = 1400.0

    summit_height: float = parameter(
        120.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    radius: float = parameter(
        400.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )

    presets: ClassVar = {
        "knoll": {"summit_height": 30.0, "radius": 140.0},
        "inselberg": {"summit_height": 260.0, "radius": 420.0, "roughness": 1.6},
        "tor": {"summit_height": 70.0, "radius": 320.0, "roughness": 2.5, "irregularity": 1.5},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, radius = self.summit_height, self.radius
        x, y = self.surroundings(place, 1.3 * radius, 0.15)
        r = hypot(x, y) * (1.0 / radius)
        bell = square(maximum(1.0 - square(minimum(r, 1.0)), 0.0))
        flank = bell * (1.0 - bell) * 4.0
        gullies = self.spokes(place, x, y, 0.5 * radius, 9.0)
        rough = place.value(self, "roughness")
        detail = self.unevenness(place, 0.8 * radius)
        plain = smoothstep(0.0, 1.0, bell * 3.0)
        return self.ground(
            place,
            bell * top
            - flank * rough * (1.0 - minimum(gullies, 1.0)) * (0.05 * top)
            + (detail + rough) * (0.012 * top)
            + detail * plain * (0.065 * top),
        )
