"""An archipelago: islands of all sizes with the shelves that they share."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    clamp,
    hypot,
    maximum,
    minimum,
    power,
    ridged_multifractal,
    smoothstep,
    square,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.round_form import RoundForm

SCALES = ((1.0, 1.0), (0.47, 0.62), (0.21, 0.42))
"""Size of the cells of large, middling and small islands, and how high they reach."""
REACH = 0.62
"""Distance in cells at which an island ends."""
SHELF = 0.14
"""Potential at the edge of the shelf."""
COAST = 0.30
"""Potential at the coast."""


class Archipelago(RoundForm):
    """Scatter islands of all sizes, with shelves that they share, over an area of the sea.

    Every cell of three jittered lattices (Worley 1996) holds an island whose potential falls with
    the distance ``F1`` from its point; how large it is, ``s``, is slow noise::

        p = max_k  h_k s_k(x) (1 - (F1_k / 0.62)^2)^2  +  noise

    and the height is one profile of the potential: deep sea, slope, shelf, coast, mountains.

    References
    ----------
    S. Worley, "A cellular texture basis function", SIGGRAPH 1996.
    """

    name = "archipelago"
    cites = ("Worley 1996",)
    portrait: ClassVar[float] = 60000.0

    radius: float = parameter(
        26000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    direction: float = parameter(
        70.0, "Where its length points, degrees clockwise from north.", unit="deg", ge=-360, le=360
    )
    elongation: float = parameter(1.4, "Length over width; 1 is round.", ge=1, le=10)
    island_spacing: float = parameter(
        11000.0, "Distance between large islands.", unit="m", gt=0, le=1e6
    )
    summit_height: float = parameter(
        900.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    shelf_depth: float = parameter(
        90.0, "Depth of the foot and the shelf below the sea.", unit="m", ge=0, le=5000
    )
    depth: float = parameter(
        1100.0, "Depth of the sea floor around, below the land.", unit="m", ge=0, le=12000
    )

    presets: ClassVar = {
        "chain": {"elongation": 3.5, "radius": 9000.0, "island_spacing": 9000.0},
        "skerries": {
            "island_spacing": 2500.0,
            "radius": 9000.0,
            "summit_height": 70.0,
            "shelf_depth": 25.0,
            "depth": 120.0,
        },
        "aegean": {"summit_height": 700.0, "depth": 500.0, "shelf_depth": 140.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        spacing = self.island_spacing
        rough = place.value(self, "roughness")
        x, y = self.surroundings(place, 1.2 * self.radius, 0.1, self.direction)
        r = hypot(x, y * (1.0 / self.elongation)) * (1.0 / self.radius)
        area = smoothstep(1.1, 0.45, r)

        # The potential: the strongest island, and noise where there is one
        potential = x * 0.0
        for number, (size, height) in enumerate(SCALES):
            potential = maximum(potential, self._islands(place, number, size * spacing) * height)
        noise = self.unevenness(place, 0.45 * spacing, 10, "coast", 0.75)
        uneven = noise * (0.16 * minimum(potential * 4.0 + 0.1, 1.0) * area)
        p = potential * area + uneven

        # One profile for all
        shelf, depth = self.shelf_depth, max(self.depth, self.shelf_depth)
        rise = smoothstep(-0.02, SHELF + 0.02, p - 0.55 * uneven) * (depth - shelf)
        slope = clamp((p - SHELF) * (1.0 / (COAST - SHELF)), 0.0, 1.0) * shelf
        up = clamp((p - COAST) * (1.0 / (1.0 - COAST)), 0.0, 1.2)
        ridges = ridged_multifractal(
            place.octaves(
                "gradient", 0.16 * spacing, 8, place.words(f"{self.name} ridges", self.seed)
            ),
            1.0,
            2.0,
        )
        natural = minimum(rough, 1.0)
        land = (
            power(up, 0.9) * (1.0 + natural * (ridges * 1.3 - 0.75)) * (0.85 * self.summit_height)
        )
        floor = self.unevenness(place, 0.6 * spacing, 8, "floor")
        return self.ground(
            place,
            land + slope + rise - depth + floor * (0.05 * depth) * smoothstep(COAST, -0.05, p),
        )

    def _islands(self, place: Place, number: int, cell: float) -> Formula:
        """Return the potential of the islands of one size, 0 to 1."""
        words = place.words(f"{self.name} islands {number}", self.seed)
        reach = 0.3 * cell * min(self.irregularity, 1.5)
        if reach > 0.0:
            place = self.warped(place, 0.9 * cell, reach, 5, f"islands {number}")
        away = (place.noise("cellular_f1", cell, words) + 1.0) * 0.5
        bell = square(maximum(1.0 - square(away * (1.0 / REACH)), 0.0))
        sizes = place.words(f"{self.name} sizes {number}", self.seed)
        size = clamp(place.noise("gradient", 1.3 * cell, sizes) * 1.3 + 0.5, 0.0, 1.0)
        return bell * (0.06 + 0.94 * square(size))
