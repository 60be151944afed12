"""A canyon: stairs of cliffs and benches in level beds, down to a winding river."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    as_formula,
    clamp,
    linear_step,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Canyon(Landform):
    """Cut a canyon with side canyons into level beds of rock: cliffs, slopes and benches.

    With ``d`` the distance to the river, less the reach of the side canyons::

        z = offset - depth (1 - S(u)),   u = (d - floor_width / 2) / (width / 2 - floor_width / 2)

    ``S`` is a staircase of ``benches + 1`` beds. Each bed begins level, as the bench on the bed
    below it, steepens as a slope of debris and ends in the cliff of its hard upper part; how thick
    and how wide each is follows from the seed.
    """

    name = "canyon"
    portrait: ClassVar[float] = 5000.0

    depth: float = parameter(450.0, "Depth of the floor below the rims.", unit="m", ge=0, le=1e5)
    canyon_width: float = parameter(2000.0, "Distance between the rims.", unit="m", gt=0, le=1e6)
    floor_width: float = parameter(70.0, "Width of the level floor.", unit="m", ge=0, le=1e6)
    benches: int = parameter(5, "How many benches there are between floor and rim.", ge=0, le=12)
    hardness: float = parameter(
        0.9,
        "Contrast of hard and soft beds: 0 is an even slope, 1 cliffs and benches.",
        ge=0,
        le=1,
    )
    side_canyons: float = parameter(
        1.4, "How far side canyons reach into the plateau, in half widths.", ge=0, le=5
    )
    direction: float = parameter(
        240.0, "Where it leads, clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(
        1.0, "How much it winds: 0 is straight, 1 is a river's canyon.", ge=0, le=2
    )

    presets: ClassVar = {
        "plateau": {},
        "grand": {
            "depth": 1500.0,
            "canyon_width": 14000.0,
            "floor_width": 120.0,
            "benches": 7,
            "side_canyons": 0.6,
        },
        "slot": {
            "depth": 60.0,
            "canyon_width": 30.0,
            "floor_width": 6.0,
            "benches": 2,
            "side_canyons": 1.5,
            "winding": 1.6,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the canyon and of the plateau around it."""
        roughness = place.value(self, "roughness")
        width = self.canyon_width
        rough = self.warped(place, 0.5 * width, roughness * (0.1 * width), 7, hurst_exponent=0.75)
        swing = 0.4 * self.winding * width
        right, _ = self.course(rough, self.direction, 2.4 * width, swing)
        floor = 0.5 * min(self.floor_width, 0.9 * width)
        distance = absolute(right) - floor
        if self.side_canyons > 0:
            share = self.side_canyons / (1.0 + self.side_canyons)
            distance = self.drained(
                rough, distance, 1.1 * width, roughness, 5, share, "side canyons"
            )
        climbed = distance * (1.0 / (0.5 * width - floor))
        # Beds are harder here and softer there, so that benches come and go
        beds = self.unevenness(place, 0.7 * width, 5, "beds", 0.6) * 0.05
        climbed = clamp(climbed, 0.0, 1.0)
        climbed = climbed + beds * climbed * (1.0 - climbed) * 4.0
        stairs = self._staircase(place, climbed)
        plateau = self.unevenness(place, 1.5 * width, 9, "plateau", 0.85)
        slope = stairs * (1.0 - stairs) * 4.0
        detail = self.unevenness(place, 0.12 * width, 7, "rocks", 0.65)
        height = stairs - 1.0 + plateau * stairs * 0.09 + detail * (slope * 0.035 + 0.006)
        return self.ground(place, height * self.depth)

    def _staircase(self, place: Place, climbed: Formula) -> Formula:
        """Return the height of a share of the way from floor to rim, both 0 to 1."""
        widths, heights = self.beds(place)
        stairs, at = as_formula(0.0), 0.0
        for width, height in zip(widths, heights, strict=True):
            edge, end = at + 0.82 * width, at + width
            slope = linear_step(at, edge, climbed)
            cliff = linear_step(edge, end, climbed)
            stairs = stairs + slope * slope * (0.4 * height) + cliff * (0.6 * height)
            at = end
        return stairs * self.hardness + climbed * (1.0 - self.hardness)

    def beds(self, place: Place) -> tuple[list[float], list[float]]:
        """Return how wide and how high each bed is from the floor up, as shares of 1."""
        words = [
            place.words(f"{self.name} bed {bed}", self.seed) for bed in range(self.benches + 1)
        ]
        widths = [0.5 + low / 2**32 for low, _ in words]
        heights = [0.6 + high / 2**32 for _, high in words]
        return [w / sum(widths) for w in widths], [h / sum(heights) for h in heights]
