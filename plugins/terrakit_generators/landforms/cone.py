"""A cone: a lone mountain of even slopes, with spurs and gullies."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, hypot, maximum, minimum, smooth_maximum, smoothstep
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm


class Cone(RoundForm):
    """Raise a lone mountain of even slopes, with a pointed top, spurs and gullies.

    ::

        z(r) = H max(1 - r / R, 0) - gullies

    Its volume without unevenness is pi R^2 H / 3. The foot is rounded and the spurs deepen with
    the roughness.
    """

    name = "cone"
    portrait: ClassVar[float] = 8000.0

    summit_height: float = parameter(
        1200.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    radius: float = parameter(
        3000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    spurs: int = parameter(7, "About how many ridges run down from the top.", ge=1, le=200)

    presets: ClassVar = {
        "matterhorn": {"summit_height": 1700.0, "radius": 2000.0, "spurs": 4, "roughness": 1.2},
        "spoil_heap": {"summit_height": 90.0, "radius": 140.0, "spurs": 24, "roughness": 0.3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, radius = self.summit_height, self.radius
        x, y = self.surroundings(place, 0.9 * radius, 0.12)
        rough = place.value(self, "roughness")
        r = hypot(x, y) * (1.0 / radius)
        slope = 1.0 - r
        cone = smooth_maximum(slope, 0.0, minimum(rough, 1.0) * 0.35)
        flank = smoothstep(0.0, 0.35, cone) * smoothstep(0.0, 0.45, r)
        gullies = minimum(self.spokes(place, x, y, 0.4 * radius, float(self.spurs), 0.45), 1.0)
        detail = self.unevenness(place, 0.5 * radius)
        return self.ground(
            place,
            maximum(cone, 0.0) * top
            - flank * rough * (1.0 - gullies) * (0.22 * top)
            + (detail + rough) * (0.012 * top)
            + detail * minimum(cone * 2.5, 1.0) * (0.09 * top),
        )
