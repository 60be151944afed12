"""A caldera: a volcano whose top fell in."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    exp,
    hypot,
    maximum,
    minimum,
    smooth_minimum,
    smoothstep,
    square,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm


class Caldera(RoundForm):
    """Let the top of a volcano fall in: steep inner walls, a wide floor, a dome that rose again.

    ::

        z(r) = h e^(-(r - R) / w)        outside, the flanks of what was there
        z(r) = h - D                     the floor, reached over walls in two slices
        z(r) += d (1 - (r_d / R_d)^2)^2  the resurgent dome

    The rim is scalloped: where slices of the wall slid in, it curves outwards.

    References
    ----------
    P. W. Lipman, "Subsidence of ash-flow calderas", Bulletin of Volcanology 59, 1997. R. L. Smith
    and R. A. Bailey, "Resurgent cauldrons", Geological Society of America Memoir 116, 1968.
    """

    name = "caldera"
    cites = ("Lipman 1997", "Smith & Bailey 1968")
    portrait: ClassVar[float] = 20000.0

    radius: float = parameter(
        4000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    rim_height: float = parameter(
        800.0, "Height of the rim above the land around.", unit="m", ge=0, le=10000
    )
    depth: float = parameter(650.0, "Depth of the floor below the rim.", unit="m", ge=0, le=10000)
    flank_width: float = parameter(
        3500.0, "Distance over which the flanks fall to a third.", unit="m", gt=0, le=1e6
    )
    dome_height: float = parameter(
        260.0, "Height of the dome on the floor; 0 for none.", unit="m", ge=0, le=10000
    )

    presets: ClassVar = {
        "crater_lake": {"depth": 1100.0, "rim_height": 1000.0, "dome_height": 0.0},
        "resurgent": {"radius": 9000.0, "rim_height": 500.0, "dome_height": 420.0},
        "sunken": {"rim_height": 250.0, "depth": 420.0, "dome_height": 0.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        radius, rim, depth, width = (
            self.radius,
            self.rim_height,
            self.depth,
            self.flank_width,
        )
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)
        x, y = self.surroundings(place, 1.3 * radius, 0.12)
        r = hypot(x, y)
        detail = self.unevenness(place, 0.4 * radius)

        # The flanks, with gullies that begin at the rim because they are older than it
        outward = (r - radius) * (1.0 / width)
        share = exp(-minimum(maximum(outward, -2.0), 40.0))
        gullies = minimum(self.spokes(place, x, y, radius, 26.0, 0.5), 1.0)
        carved = natural * minimum(share, 1.0) * (1.0 - square(minimum(share, 1.0)) * 0.55)
        flanks = share * rim - carved * (1.0 - gullies) ** 2 * (0.30 * rim)
        flanks = flanks + detail * minimum(share, 1.0) * (0.09 * rim)

        # The hole: a fault, slices of the wall that slid, and the floor
        edge = r * (1.0 / radius)
        if self.irregularity > 0.0:
            edge = edge - self._scallops(place, x, y) * (0.10 * self.irregularity)
        slid = 0.62 * smoothstep(0.86, 1.0, edge) + 0.38 * smoothstep(0.62, 0.84, edge)
        lost = maximum(edge - 0.995, 0.0) * (8.0 * depth)
        hole = slid * depth + lost + (rim - depth)
        hole = hole + detail * (0.010 * depth + smoothstep(0.55, 0.8, edge) * (0.08 * depth))
        if self.dome_height > 0.0:
            hole = hole + self._dome(place, x, y, detail)
        z = smooth_minimum(flanks, hole, natural * (0.05 * depth))
        return self.ground(place, z + (detail + rough) * (0.006 * rim))

    def _scallops(self, place: Place, x: Formula, y: Formula) -> Formula:
        """Return how far the wall stepped back: arcs with points between them."""
        words = place.words(f"{self.name} scallops", self.seed)
        r = maximum(hypot(x, y), 0.05 * self.radius)
        noise = place.noise_at("gradient", x / r * 1.7, y / r * 1.7, words)
        return absolute(noise) * 2.0

    def _dome(self, place: Place, x: Formula, y: Formula, detail: Formula) -> Formula:
        """Return the dome: off the middle, split by a graben along its top."""
        words = place.words(f"{self.name} dome", self.seed)
        away = [(word / 2**32 - 0.5) * 0.35 * self.radius for word in words]
        if self.irregularity == 0.0:
            away = [0.0, 0.0]
        dx, dy = x - away[0], y - away[1]
        size = 0.40 * self.radius
        bell = square(maximum(1.0 - square(hypot(dx, dy) * (1.0 / size)), 0.0))
        natural = minimum(place.value(self, "roughness"), 1.0)
        graben = exp(-minimum(square((dx * 0.8 + dy * 0.6) * (1.0 / (0.07 * size))), 40.0))
        return bell * (1.0 + detail * 0.4 - natural * graben * 0.3) * self.dome_height
