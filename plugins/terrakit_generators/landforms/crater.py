"""An impact crater: bowl or basin, rim, blanket of ejecta, central peak."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    exp,
    hypot,
    maximum,
    minimum,
    ridged_multifractal,
    smooth_maximum,
    smooth_minimum,
    smoothstep,
    square,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm

DEPTH = 0.2
"""Depth of a simple crater in diameters, from rim to floor (Pike 1977)."""
RIM = 0.04
"""Height of its rim in diameters."""
PEAK = 0.35
"""Height of a central peak over the depth of the crater."""


class Crater(RoundForm):
    """Strike an impact crater: bowl, rim, blanket of ejecta, and in large ones a central peak.

    ::

        z(r) = h - D + D (r / R)^2   within, but not below the flat floor of a large crater
        z(r) = h (r / R)^-3          outside (McGetchin, Settle & Head 1973)

    Where nothing is said, a simple crater has ``D = 0.2 * 2R`` and ``h = 0.04 * 2R``. Above the
    ``transition_diameter`` its walls slump into terraces and its floor rebounds: the depth grows
    with the diameter to the power of 0.3 only (Pike 1977), and a peak of a third of it rises in
    the middle. The blanket is cast in rays.

    References
    ----------
    R. J. Pike, "Size-dependence in the shape of fresh impact craters on the moon", in Impact and
    Explosion Cratering, 1977. T. R. McGetchin, M. Settle and J. W. Head, Earth and Planetary
    Science Letters 20, 1973. H. J. Melosh, "Impact Cratering", 1989.
    """

    name = "crater"
    cites = ("Pike 1977", "McGetchin, Settle & Head 1973", "Melosh 1989")
    portrait: ClassVar[float] = 3200.0

    radius: float = parameter(
        600.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    depth: float | None = parameter(
        None,
        "Depth of the floor below the rim; without it as craters of its size have.",
        unit="m",
        ge=0,
        le=10000,
    )
    rim_height: float | None = parameter(
        None,
        "Height of the rim above the land around; without it as craters of its size have.",
        unit="m",
        ge=0,
        le=10000,
    )
    transition_diameter: float = parameter(
        3000.0,
        "Diameter above which craters have terraces and a peak: 3 km on Earth, 15 on the moon.",
        unit="m",
        gt=0,
        le=1e6,
        advanced=True,
    )
    rays: float = parameter(
        0.6, "How much the ejecta are cast in rays rather than evenly.", ge=0, le=1
    )

    presets: ClassVar = {
        "simple": {"radius": 600.0},
        "complex": {"radius": 9000.0},
        "moon": {"radius": 3000.0, "transition_diameter": 15000.0, "irregularity": 0.5},
        "old": {"depth": 90.0, "rim_height": 14.0, "rays": 0.1, "roughness": 1.8},
    }

    def shape(self) -> tuple[float, float, float]:
        """Return depth below the rim, height of the rim, and how complex it is, 0 to 1."""
        diameter, limit = 2.0 * self.radius, self.transition_diameter
        simple = min(diameter, limit)
        depth = DEPTH * simple * (diameter / simple) ** 0.3
        rim = RIM * simple * (diameter / simple) ** 0.4
        complexity = min(max((diameter / limit - 1.0) / 0.5, 0.0), 1.0)
        if self.depth is not None:
            depth = self.depth
        return depth, rim if self.rim_height is None else self.rim_height, complexity

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        radius = self.radius
        depth, rim, complexity = self.shape()
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)
        x, y = self.surroundings(place, 1.1 * radius, 0.05)
        r = hypot(x, y) * (1.0 / radius)
        detail = self.unevenness(place, 0.45 * radius)

        # The bowl; in a large crater slumped into terraces above a flat floor
        bowl = square(minimum(r, 4.0)) * depth + (rim - depth)
        if complexity > 0.0:
            bowl = self._slumped(bowl, r, detail, depth, rim, complexity)

        # The blanket, in rays and hummocks
        far = maximum(r, 0.5)
        fall = 1.0 / (far * far * far)
        spokes = self.spokes(place, x, y, radius, 30.0, 0.2)
        cast = 1.0 + natural * smoothstep(1.0, 1.6, r) * (2.2 * spokes - 0.9) * self.rays
        blanket = fall * cast * rim
        z = smooth_minimum(bowl, blanket, natural * (0.25 * rim))

        # A rim of uneven height, gullies down the wall, ground that is rougher near the crater
        near = exp(-minimum(square((r - 1.0) * 4.0), 40.0))
        wall = smoothstep(0.35, 0.75, r) * smoothstep(1.05, 0.95, r)
        cut = natural * wall * (1.0 - minimum(spokes, 1.0)) * (0.06 * depth)
        uneven = detail * (
            near * (0.6 * rim)
            + minimum(fall, 1.0) * (0.10 * depth) * smoothstep(0.2, 1.0, r)
            + 0.01 * depth
        ) + rough * smoothstep(1.0, 1.5, r) * (0.012 * depth)
        z = z - cut + uneven
        if complexity > 0.0:
            z = smooth_maximum(z, self._peak(place, x, y, depth, rim), natural * (0.1 * depth))
        return self.ground(place, z)

    def _slumped(
        self, bowl: Formula, r: Formula, detail: Formula, depth: float, rim: float, share: float
    ) -> Formula:
        """Return the bowl with a flat floor and three steps of terraces up its wall."""
        floor = rim - depth * (1.0 - 0.05 * share)
        start = 1.0 - 0.45 * share
        climb = minimum(maximum((r - start) * (1.0 / (1.0 - start)), 0.0), 3.0)
        at = minimum(climb + detail * 0.18 * smoothstep(0.0, 0.3, climb), 3.0)
        steps: Formula = at * 0.0
        for edge, height in ((0.12, 0.30), (0.42, 0.27), (0.74, 0.43)):
            steps = steps + smoothstep(edge - 0.12, edge + 0.2, at) * height
        above = maximum(climb - 1.0, 0.0)
        wall = (0.72 * steps + 0.28 * minimum(climb, 1.0) + above * above + above) * (rim - floor)
        return bowl * (1.0 - share) + (wall + floor) * share

    def _peak(self, place: Place, x: Formula, y: Formula, depth: float, rim: float) -> Formula:
        """Return the massif in the middle: a cluster of ridges on a mound."""
        radius = self.radius
        ridges = ridged_multifractal(
            place.octaves(
                "gradient",
                0.16 * radius,
                6,
                place.words(f"{self.name} peak", self.seed),
                gain=0.55,
            ),
            1.0,
            2.0,
        )
        natural = minimum(place.value(self, "roughness"), 1.0)
        r = hypot(x, y) * (1.0 / (0.22 * radius))
        mound = exp(-minimum(square(r), 40.0))
        rise = mound * (1.0 + natural * (1.3 * ridges - 0.65)) * (PEAK * 1.35 * depth)
        return rise + (rim - 1.05 * depth)
