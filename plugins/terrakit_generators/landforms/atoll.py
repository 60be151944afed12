"""An atoll: a ring of reef around a lagoon, on a mountain that sank."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    exp,
    hypot,
    maximum,
    minimum,
    smoothstep,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm


class Atoll(RoundForm):
    """Grow a ring of reef with passes around a lagoon, on top of a mountain that sank.

    Across the reef, with ``q`` metres outside of its outer edge and ``w`` its width::

        z(q) = -1 - D (1 - e^(-q tan a / D))        q > 0, the outer slope at the angle a
        z(q) = -1, or an islet of the height h      -w < q < 0, the reef flat
        z(q) = -1 - L (1 - e^((q + w) / w))         q < -w, the lagoon

    Passes cut the ring; patch reefs grow in the lagoon up to low tide. 0 is the level of the sea.

    References
    ----------
    C. Darwin, "The Structure and Distribution of Coral Reefs", 1842.
    """

    name = "atoll"
    cites = ("Darwin 1842",)
    portrait: ClassVar[float] = 22000.0

    radius: float = parameter(
        7000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    reef_width: float = parameter(700.0, "Width of the reef.", unit="m", gt=0, le=1e5)
    islet_height: float = parameter(
        4.0, "Height of the islets on the reef above the sea; 0 for none.", unit="m", ge=0, le=100
    )
    lagoon_depth: float = parameter(
        50.0, "Depth of the lagoon below the sea.", unit="m", ge=0, le=1000
    )
    passes: int = parameter(4, "How many channels cut the reef.", ge=0, le=24)
    depth: float = parameter(
        1500.0, "Depth of the sea floor around, below the land.", unit="m", ge=0, le=12000
    )
    outer_slope: float = parameter(
        38.0, "Steepness of the reef's outer side.", unit="deg", ge=1, le=80
    )

    presets: ClassVar = {
        "pacific": {"depth": 4000.0, "radius": 12000.0, "passes": 2},
        "maldives": {"depth": 350.0, "passes": 16, "lagoon_depth": 60.0, "islet_height": 2.0},
        "small": {"radius": 1800.0, "reef_width": 350.0, "lagoon_depth": 18.0, "passes": 0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        radius, width, lagoon = (
            self.radius,
            min(self.reef_width, 0.5 * self.radius),
            self.lagoon_depth,
        )
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)
        x, y = self.surroundings(place, 1.5 * radius, 0.17)
        q = hypot(x, y) - radius
        detail = self.unevenness(place, 0.22 * radius)
        fine = self.unevenness(place, 1.3 * width, 7, "islets")

        # Outer slope, with spurs and grooves; reef flat; lagoon
        steep = math.tan(math.radians(self.outer_slope))
        spokes = self.spokes(place, x, y, radius, 22.0, 1.0)
        down = maximum(q, 0.0) * (steep / max(self.depth, 1.0))
        sunk = (1.0 - exp(-minimum(down, 40.0))) * self.depth
        sunk = sunk * (
            1.0 + natural * (0.30 * (0.5 - minimum(spokes, 1.0))) * exp(-minimum(down, 40.0))
        )
        inward = maximum(-q * (1.0 / width) - 1.0, 0.0)
        basin = 1.0 - exp(-minimum(inward, 40.0))
        z = -1.0 - sunk - basin * lagoon
        z = z + detail * (
            smoothstep(0.0, 0.6, down) * (0.05 * self.depth) + basin * (0.18 * lagoon)
        )

        # Patch reefs stand in the lagoon, up to low tide
        size = 1.0 / (1.6 * width)
        patches = (
            place.noise_at(
                "gradient",
                (x * 0.6 - y * 0.8) * size,
                (x * 0.8 + y * 0.6) * size,
                place.words(f"{self.name} patches", self.seed),
            )
            + fine * 0.5
        )
        reefs = natural * smoothstep(0.42, 0.60, patches) * basin
        z = z + reefs * maximum(-2.0 - z, 0.0) * 0.93

        # Islets on the flat, nearer to its lagoon side
        flat = smoothstep(-1.0, -0.80, q * (1.0 / width)) * smoothstep(
            -0.12, -0.4, q * (1.0 / width)
        )
        islets = smoothstep(-0.08, 0.12, self._windward(place, x, y) + fine * 0.7)
        if self.islet_height > 0.0:
            z = z + flat * islets * (self.islet_height + 1.0) * (1.0 + fine * 0.4)

        # Passes through the ring
        channel = self._passes(place, x, y)
        sill = -minimum(maximum(0.7 * lagoon, 4.0), 40.0)
        ring = smoothstep(3.0, 1.2, inward)
        return self.ground(place, z - channel * ring * maximum(z - sill, 0.0))

    def _windward(self, place: Place, x: Formula, y: Formula) -> Formula:
        """Return where islets stand: noise around the ring."""
        r = maximum(hypot(x, y), 0.05 * self.radius)
        words = place.words(f"{self.name} windward", self.seed)
        return place.noise_at("gradient", x / r * 2.3, y / r * 2.3, words) + 0.05

    def _passes(self, place: Place, x: Formula, y: Formula) -> Formula:
        """Return 1 in the passes, 0 beside them."""
        total = x * 0.0
        half = 0.35 * self.reef_width
        for number in range(self.passes):
            word, _ = place.words(f"{self.name} pass {number}", self.seed)
            angle = 2.0 * math.pi * (number + 0.8 * word / 2**32) / self.passes
            ahead = x * math.sin(angle) + y * math.cos(angle)
            aside = x * math.cos(angle) - y * math.sin(angle)
            near = smoothstep(2.0 * half, 0.6 * half, maximum(aside, -aside))
            total = maximum(total, near * smoothstep(0.2 * self.radius, 0.5 * self.radius, ahead))
        return total
