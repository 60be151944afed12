"""A maar: a crater blown into flat ground, with a low ring of tuff around it."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, exp, hypot, maximum, minimum, smoothstep, where
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm

FLOOR = 0.62
"""Radius of the flat floor in units of the radius of the rim."""


class Maar(RoundForm):
    """Blow a crater into flat ground: steep walls, a flat floor below grade, a low ring of tuff.

    ::

        z(r) = -D                                  for r < 0.62 R, the floor, or a lake's bed
        z(r) = -D + (D + h) (3 t^2 - t^3) / 2      up the wall, t = (r/R - 0.62) / 0.38
        z(r) = h e^(-3 (r/R - 1) / w)              down the ring

    References
    ----------
    A. H. Graettinger, "Trends in maar crater size and shape", Journal of Volcanology and Geothermal
    Research 357, 2018.
    """

    name = "maar"
    cites = ("Graettinger 2018",)
    portrait: ClassVar[float] = 2000.0

    radius: float = parameter(
        400.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    depth: float = parameter(
        120.0, "Depth of the floor below the land around.", unit="m", ge=0, le=20000
    )
    rim_height: float = parameter(
        20.0, "Height of the rim above the land around.", unit="m", ge=0, le=10000
    )
    ring_width: float = parameter(
        0.9, "Width of the ring outside of the rim, in radii.", gt=0, le=5
    )

    presets: ClassVar = {
        "eifel": {"radius": 260.0, "depth": 75.0, "rim_height": 14.0},
        "wide": {"radius": 1300.0, "depth": 110.0, "rim_height": 30.0, "irregularity": 1.3},
        "tuff_ring": {"radius": 550.0, "depth": 12.0, "rim_height": 60.0, "ring_width": 0.6},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        radius, depth, rim = self.radius, self.depth, self.rim_height
        x, y = self.surroundings(place, 1.6 * radius, 0.11)
        r = hypot(x, y) * (1.0 / radius)
        rough = place.value(self, "roughness")
        detail = self.unevenness(place, 0.9 * radius)

        outside = maximum(r - 1.0, 0.0)
        ring = exp(-minimum(outside * (3.0 / self.ring_width), 40.0)) * rim
        rise = minimum(maximum((r - FLOOR) * (1.0 / (1.0 - FLOOR)), 0.0), 1.0)
        wall = rise * rise * (1.5 - 0.5 * rise)
        inside = wall * (depth + rim) - depth

        # Gullies in the wall and down the ring, a rim of uneven height, a floor of mud
        spokes = minimum(self.spokes(place, x, y, radius, 26.0), 1.0)
        steep = smoothstep(0.05, 0.5, rise) * smoothstep(0.5, 0.0, outside)
        crest = smoothstep(0.5, 1.0, rise) * exp(-minimum(outside * 3.0, 40.0))
        floor = 1.0 - smoothstep(0.0, 0.3, rise)
        plain = smoothstep(0.0, 0.6, outside)
        cut = rough * steep * (1.0 - spokes) * (0.05 * depth + 0.1 * rim)
        uneven = detail * (
            crest * (0.4 * rim) + (1.0 - floor) * (0.012 * radius) + floor * (0.002 * radius)
        ) + rough * plain * (0.008 * radius)
        return self.ground(place, where(r < 1.0, inside, ring) - cut + uneven)
