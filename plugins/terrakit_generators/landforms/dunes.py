"""Dunes: transverse ridges, barchans and stars, each with slip faces at the angle of repose."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from terrakit.errors import ParameterError
from terrakit.formula import (
    Formula,
    Place,
    as_formula,
    cosine,
    floor,
    fraction,
    hypot,
    linear_step,
    maximum,
    minimum,
    sine,
    sqrt,
    square,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform

STOSS = 0.72
"""Share of a transverse dune's length over which its windward side rises, at most."""
HORN = 0.95
"""Length of a barchan's horns, in half widths."""


class Dunes(Landform):
    """Blow sand into dunes: long ridges across the wind, lone crescents, or stars.

    The windward side rises gently, as a parabola, to the brink; behind it the slip face falls at
    the talus angle ``t``. With ``s`` metres to the foot of the slip face, ``e`` to the brink::

        z = offset + max(0, min(h (1 - (e / l)^2), tan(t) s))

    A barchan's brink trails downwind at its sides as a parabola, into two horns. A star has three
    or four arms, which sink outwards and whose sides are slip faces. Heights differ from dune to
    dune.

    References
    ----------
    R. A. Bagnold, "The Physics of Blown Sand and Desert Dunes", 1941. P. Hesp and K. Hastings,
    "Width, height and slope relationships and aerodynamic maintenance of barchans", Geomorphology
    22, 1998. N. Lancaster, "Star dunes", Progress in Physical Geography 13, 1989.
    """

    name = "dunes"
    cites = ("Bagnold 1941", "Hesp & Hastings 1998", "Lancaster 1989")
    portrait: ClassVar[float] = 1600.0

    form: Literal["transverse", "barchan", "star"] = parameter(
        "transverse", "transverse: long ridges; barchan: lone crescents; star: arms on all sides."
    )
    dune_height: float = parameter(16.0, "Height of a large dune.", unit="m", gt=0, le=1e4)
    wavelength: float = parameter(
        180.0, "Distance from one dune to the next.", unit="m", gt=0, le=1e6
    )
    direction: float = parameter(
        125.0, "Where the wind blows to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    talus_angle: float = parameter(32.0, "Steepness of the slip faces.", unit="deg", gt=0, le=60)

    presets: ClassVar = {
        "transverse": {},
        "barchan": {"form": "barchan", "dune_height": 13.0, "wavelength": 260.0},
        "star": {"form": "star", "dune_height": 90.0, "wavelength": 620.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the dunes."""
        self._check_size()
        sand = self.unevenness(place, 2.5 * self.wavelength, 5, "sand", 0.9)
        height = {
            "transverse": self._transverse,
            "barchan": self._barchans,
            "star": self._stars,
        }[self.form](place)
        ripples = self.unevenness(place, 0.12 * self.wavelength, 3, "ripples", 0.8)
        low = linear_step(0.0, 0.3 * self.dune_height, height)
        detail = sand * 0.12 + ripples * (0.012 + low * 0.01)
        return self.ground(place, height + detail * self.dune_height)

    def _check_size(self) -> None:
        """Raise ParameterError if lone dunes would not fit between their neighbours."""
        slope = math.tan(math.radians(self.talus_angle))
        if self.form == "barchan":
            across = 5.0 * max(1.1, HORN) + 1.0 / slope
            most = 0.75 * self.wavelength / across
        elif self.form == "star":
            most = 0.75 * self.wavelength * slope
        else:
            return
        if self.dune_height > most:
            raise ParameterError(
                f"dune_height = {self.dune_height:g}: {self.form} dunes at wavelength = "
                f"{self.wavelength:g} m are at most {most:.3g} m high; raise wavelength"
            )

    def _transverse(self, place: Place) -> Formula:
        """Return long ridges across the wind, which bend, swell and sink."""
        roughness = place.value(self, "roughness")
        wave, slope = self.wavelength, math.tan(math.radians(self.talus_angle))
        _, ahead = place.around(self.center, self.direction)
        turn = math.radians(self.direction)
        east, north = as_formula(math.sin(turn)), as_formula(math.cos(turn))
        # Crests bend; how they do decides how steep a slip face is, so its slope is needed too
        for octave, (cells, reach) in enumerate(((4.6, 0.95), (1.9, 0.3), (0.85, 0.075))):
            bend = self.octaves(place, cells * wave, 1, f"bend {octave}")
            value, along, across = bend.slope()
            moved, bent_east, bent_north = bend.sum(
                [0.0, 0.0, 0.0], lambda *_, parts=(value, along, across): list(parts)
            )
            size = roughness * (reach * wave)
            ahead = ahead + moved * size
            east = east + bent_east * size * (1.0 / (cells * wave))
            north = north + bent_north * size * (1.0 / (cells * wave))
        stretch = maximum(hypot(east, north), 0.3)
        # Share of the way from one foot to the next
        share = fraction(ahead * (1.0 / wave))
        swell = self.unevenness(place, 3.0 * wave, 3, "swell", 0.8)
        high = minimum(maximum(1.0 + swell * 1.3 - roughness * 0.12, 0.15), 1.3)
        high = high * self.dune_height
        to_foot = (1.0 - share) * wave / stretch
        lee = to_foot * slope
        # The windward side reaches its height where the slip face begins
        begins = 1.0 - minimum(high * stretch * (1.0 / (slope * wave)), 1.0 - 0.5 * STOSS)
        rise = minimum(share / begins, 1.0)
        stoss = high * rise * rise * (3.0 - 2.0 * rise)
        return minimum(stoss, lee)

    def _barchans(self, place: Place) -> Formula:
        """Return lone crescents, at a distance from one another."""
        roughness = place.value(self, "roughness")
        wave, slope = self.wavelength, math.tan(math.radians(self.talus_angle))
        moved = self.warped(place, 0.6 * wave, roughness * (0.03 * wave), 2, "shape")
        total = as_formula(0.0)
        for right, ahead, size, turn in self._sites(moved, 0.25):
            del turn
            high = size * self.dune_height
            wide = high * 5.0  # half of it: Hesp & Hastings 1998 have 8.8 heights + 13 m
            across = right / wide
            spread = maximum(1.0 - across * across, 0.0)
            local = high * spread
            horn, long = wide * HORN, wide * 1.1
            brink = across * across * horn
            to_brink = ahead - brink
            # The windward foot is half an ellipse, which ends where the horns do
            foot = (1.0 - sqrt(spread)) * (long + horn) - long
            windward = maximum(-to_brink, 0.0) / maximum(brink - foot, 1e-3 * wide)
            stoss = local * (1.0 - windward * windward)
            # Behind the brink at the angle of repose, also where the brink runs slantwise
            slant = sqrt(1.0 + square(across * (2.0 * HORN)))
            lee = local - maximum(to_brink, 0.0) * slope / slant
            total = maximum(total, minimum(stoss, lee))
        return total

    def _stars(self, place: Place) -> Formula:
        """Return stars of three or four arms that sink outwards."""
        roughness = place.value(self, "roughness")
        wave, slope = self.wavelength, math.tan(math.radians(self.talus_angle))
        moved = self.warped(place, 0.7 * wave, roughness * (0.05 * wave), 2, "shape")
        total = as_formula(0.0)
        for right, ahead, size, turn in self._sites(moved, 0.25):
            high = size * self.dune_height
            reach = 0.55 * wave
            distance = hypot(right, ahead) * (1.0 / (0.55 * wave))
            arms = as_formula(0.0)
            for arm in range(4):
                angle = turn * math.pi + (2.0 * math.pi * arm / 4 + 0.35 * math.sin(2.3 * arm))
                c, s = cosine(angle), sine(angle)
                along, aside = right * c + ahead * s, ahead * c - right * s
                outwards = maximum(along, 0.0) * (1.0 / reach)
                # The arm's crest curves to one side, as the sand is blown along it
                curved = aside - outwards * outwards * (0.22 * reach) * (1.0 if arm % 2 else -1.0)
                beside = hypot(curved, minimum(along, 0.0))
                left = maximum(1.0 - outwards, 0.0)
                length = 0.75 + 0.25 * ((arm * 7 + 2) % 5) / 4
                crest = high * left * (left * (0.25 * length) + 0.45)
                arms = maximum(arms, crest - beside * (0.85 * slope))
            # They stand on a plinth of their own sand
            plinth = square(maximum(1.0 - distance, 0.0)) * (0.3 * high)
            total = maximum(total, arms + plinth)
        return total

    def _sites(
        self, place: Place, spread: float
    ) -> list[tuple[Formula, Formula, Formula, Formula]]:
        """Return the four dunes that may reach a place.

        Parameters
        ----------
        place
            Where.
        spread
            How far dunes stand from the middle of their cell, in cells: at most 0.25, and then no
            dune that reaches less than 0.75 cells is missed.

        Returns
        -------
        list
            Metres right and downwind of the dune, its size about 0.45 to 1, and a number -1 to 1.
        """
        right, ahead = place.around(self.center, self.direction)
        u, v = right * (1.0 / self.wavelength), ahead * (1.0 / self.wavelength)
        first_u, first_v = floor(u - 0.5), floor(v - 0.5)
        seeds = [place.words(f"dunes {what}", self.seed) for what in ("u", "v", "size", "turn")]
        sites = []
        for i in (0.5, 1.5):
            for j in (0.5, 1.5):
                at_u, at_v = first_u + i, first_v + j
                a, b, c, d = (place.noise_at("white", at_u, at_v, seed) for seed in seeds)
                aside, along = u - at_u - a * spread, v - at_v - b * spread
                size = 0.72 + c * 0.28
                sites.append((aside * self.wavelength, along * self.wavelength, size, d))
        return sites
