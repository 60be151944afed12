"""What all landforms have in common: where they are, what is around them, and unevenness."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from terrakit.formula import (
    Formula,
    FormulaGenerator,
    Number,
    Octaves,
    Place,
    absolute,
    as_formula,
    fbm,
    maximum,
    minimum,
    sine,
    sqrt,
    square,
)
from terrakit.parameters import Maskable, Seed, parameter

FARTHEST = 1e9


def _on_earth(point: list[float]) -> list[float]:
    if max(abs(part) for part in point) > FARTHEST:
        raise ValueError("must lie within 1e9 m of the world's origin")
    return point


Point = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_on_earth)]
"""World x and y, metres."""
FINEST = 0.002
"""Length of the finest unevenness, metres: what samples a kilometre apart can still place."""


class Landform(FormulaGenerator):
    """A form of the land that has a name: it lies at a place and has a size, in metres."""

    locality: ClassVar[str] = "pointwise"
    fields: ClassVar[int] = 4

    center: Point | None = parameter(
        None, "World x and y of its middle; the middle of the world without it.", unit="m"
    )
    offset: Maskable = parameter(0.0, "Height of the land around it.", unit="m", ge=-1e6, le=1e6)
    roughness: Maskable = parameter(
        1.0, "Unevenness of the ground: 0 is the bare form, 1 is natural.", ge=0, le=10
    )
    seed: Seed = parameter(0, "Another number or word gives another one of its kind.")

    def unevenness(
        self,
        place: Place,
        wavelength: float,
        octaves: int = 9,
        stream: str = "detail",
        hurst_exponent: float = 0.8,
    ) -> Formula:
        """Return fractal noise times the roughness, within about -1 to 1.

        Parameters
        ----------
        place
            Where.
        wavelength
            Length of the largest unevenness, metres.
        octaves
            How fine it gets: each octave is half as long.
        stream
            Name of its random numbers within the operator.
        hurst_exponent
            Smoothness.
        """
        gain = 1.97**-hurst_exponent
        octave = self.octaves(place, wavelength, octaves, stream, gain)
        return fbm(octave) * place.value(self, "roughness")

    def octaves(
        self, place: Place, wavelength: float, count: int, stream: str, gain: float = 0.5
    ) -> Octaves:
        """Return octaves of gradient noise, none of them finer than sand.

        Parameters
        ----------
        place
            Where.
        wavelength
            Length of the largest, metres.
        count
            How many there are at most.
        stream
            Name of its random numbers within the operator.
        gain
            How high each octave is, relative to the one before.
        """
        wavelength = max(wavelength, FINEST)
        count = min(count, 1 + int(math.log(wavelength / FINEST) / math.log(1.97)))
        words = place.words(f"{self.name} {stream}", self.seed)
        return place.octaves("gradient", wavelength, count, words, gain=gain)

    def warped(
        self,
        place: Place,
        wavelength: float,
        reach: Number,
        octaves: int = 3,
        stream: str = "outline",
        hurst_exponent: float = 0.7,
    ) -> Place:
        """Return the place moved by noise: outlines that are taken there are no ruler's lines.

        Parameters
        ----------
        place
            Where.
        wavelength
            Length of the largest bends, metres.
        reach
            About how far the farthest places move, metres; times the roughness, if 0 of it is to
            leave the bare form.
        octaves
            How fine the bends get.
        stream
            Name of its random numbers within the operator.
        hurst_exponent
            Smoothness of the bends.
        """
        gain = 1.97**-hurst_exponent
        east, north = (
            fbm(self.octaves(place, wavelength, octaves, f"{stream} {axis}", gain))
            * (as_formula(reach) * 2.0)
            for axis in ("east", "north")
        )
        return place.displaced(east, north)

    def course(
        self,
        place: Place,
        direction: float,
        wavelength: float,
        reach: float,
        stream: str = "course",
    ) -> tuple[Formula, Formula]:
        """Return metres right of a winding line through the middle, and metres ahead.

        The line swings to the sides as it goes ahead; what is measured across it is the distance
        to its tangent, so that a valley along it keeps its width.

        Parameters
        ----------
        place
            Where.
        direction
            Where the line leads, degrees clockwise from north.
        wavelength
            From one bend to the next but one, metres.
        reach
            About how far it swings to either side, metres.
        stream
            Name of its random numbers within the operator.
        """
        right, ahead = place.around(self.center, direction)
        if reach == 0.0:
            return right, ahead
        finer = 1.0 / wavelength
        phase, size = (
            place.words(f"{self.name} {stream} {what}", self.seed) for what in ("phase", "size")
        )

        def swing(along: Formula) -> Formula:
            turns = along * finer
            late = place.noise_at("gradient", turns * 0.9, 0.37, phase) * 2.6
            far = place.noise_at("gradient", turns * 1.3, 0.61, size) * 0.9 + 0.85
            return sine(turns * (2.0 * math.pi) + late) * far * reach

        step = wavelength / 64.0
        tangent = (swing(ahead + step) - swing(ahead - step)) * (0.5 / step)
        return (right - swing(ahead)) / sqrt(square(tangent) + 1.0), ahead

    def drained(
        self,
        place: Place,
        distance: Formula,
        spacing: float,
        roughness: Formula,
        levels: int = 4,
        depth: float = 0.5,
        stream: str = "ravines",
        down: tuple[Formula, Formula] | None = None,
    ) -> Formula:
        """Return a distance from where the water goes, after ravines have branched off from there.

        Every level of ravines follows the zero lines ``n = 0`` of finer noise, which climb away
        from the ravines before at a share ``g`` of the rate of the slope that they cut::

            d <- min(d, g d + |n| / |grad n|),   g = 1 - depth / 2^level

        So whatever height is made of the distance, its ravines fall towards where it is 0. Spurs
        rise by what ravines sink, so that the form as a whole keeps its size.

        Parameters
        ----------
        place
            Where.
        distance
            Metres from the river, or from the foot of a slope; below 0 nothing changes.
        spacing
            Metres from one large ravine to the next, about.
        roughness
            Of the ground, where it has not been moved: 0 leaves the distance as it is.
        levels
            How often ravines have side ravines.
        depth
            How deep the largest cut, as a share of the height of the slope, at a roughness of 1.
        stream
            Name of its random numbers within the operator.
        down
            Metres along the slope and down it, if ravines are to run straight down.
        """
        roughness = minimum(roughness, 1.0)
        whole = as_formula(1.0)
        for level in range(levels):
            cell = max(spacing / 1.9**level, FINEST)
            words = place.words(f"{self.name} {stream} {level}", self.seed)
            if down is None:
                noise = place.noise("gradient", cell, words)
            else:
                drawn = cell * (1.0 + 1.5 * 0.5**level)
                noise = place.noise_at(
                    "gradient", down[0] * (1.0 / cell), down[1] * (1.0 / drawn), words
                )
            aside = absolute(noise) * (0.6 * cell)
            share = 1.0 - roughness * (depth * 0.5**level)
            distance = minimum(distance, maximum(distance, 0.0) * share + aside)
            whole = whole * share
        return distance / sqrt(maximum(whole, 1e-3))

    def ground(self, place: Place, height: Number) -> Formula:
        """Return a height above the land around."""
        return place.value(self, "offset") + height
