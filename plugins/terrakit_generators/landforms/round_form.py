"""Landforms that lie around a middle: hills, volcanoes, craters, islands."""

from __future__ import annotations

import math

from terrakit.formula import Formula, Number, Place, fbm, hypot, log, maximum, sqrt, square
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform

ROUNDING = 0.04
"""Half-width of the bottom of a gully, in units of its noise."""


class RoundForm(Landform):
    """A landform around a middle, whose outline strays from the circle as nature's do."""

    irregularity: float = parameter(
        1.0, "How far the outline strays from the ideal: 0 is a perfect circle.", ge=0, le=3
    )

    def surroundings(
        self,
        place: Place,
        reach: float,
        strength: float = 0.16,
        direction: float = 0.0,
        octaves: int = 6,
        stream: str = "outline",
    ) -> tuple[Formula, Formula]:
        """Return metres right and ahead of the middle, seen through a warp of the place.

        Parameters
        ----------
        place
            Where.
        reach
            Length of the largest bends of the outline, metres.
        strength
            Farthest displacement in units of ``reach``, where the irregularity is 1.
        direction
            Where "ahead" is, degrees clockwise from north.
        octaves
            How fine the bends get.
        stream
            Name of the random numbers within the operator.
        """
        if self.irregularity == 0.0:
            return place.around(self.center, direction)
        far = 2.0 * strength * reach * self.irregularity
        east, north = (
            fbm(
                place.octaves(
                    "gradient",
                    reach,
                    octaves,
                    place.words(f"{self.name} {stream} {axis}", self.seed),
                )
            )
            for axis in ("east", "north")
        )
        return place.displaced(east * far, north * far).around(self.center, direction)

    def spokes(
        self,
        place: Place,
        x: Formula,
        y: Formula,
        inner: float,
        count: float,
        spread: float = 0.25,
        octaves: int = 3,
        stream: str = "spokes",
    ) -> Formula:
        """Return 0 in gullies that run down from the middle, and up to about 1 between them.

        Noise on a disc whose radius grows with the logarithm of the distance: its features are
        drawn out along the slope, and new gullies begin between the old ones farther down.

        Parameters
        ----------
        place
            Where.
        x, y
            Metres from the middle.
        inner
            Distance at which there are ``count`` gullies, metres.
        count
            How many large gullies there are.
        spread
            How much their number grows by each factor of e in distance.
        octaves
            Gullies within gullies.
        stream
            Name of the random numbers within the operator.
        """
        r = maximum(hypot(x, y), 0.02 * inner)
        growth = maximum(1.0 + spread * log(r * (1.0 / inner)), 0.05)
        total: Number = 0.0
        weight, weights, turn = 1.0, 0.0, 0.7
        for octave in range(octaves):
            across = growth / r * (count * 1.97**octave / (2.0 * math.pi))
            cosine, sine = math.cos(turn), math.sin(turn)
            noise = place.noise_at(
                "gradient",
                (x * cosine - y * sine) * across,
                (x * sine + y * cosine) * across,
                place.words(f"{self.name} {stream} {octave}", self.seed),
            )
            total = total + (sqrt(square(noise) + ROUNDING**2) - ROUNDING) * (2.2 * weight)
            weights += weight
            weight *= 0.5
            turn += 1.1
        return total * (1.0 / weights)
