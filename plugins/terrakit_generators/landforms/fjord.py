"""A fjord: a glacier's trough, cut below the sea, with a sill at its mouth."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Number,
    Place,
    absolute,
    clamp,
    hypot,
    lerp,
    maximum,
    minimum,
    power,
    ridged_multifractal,
    smooth_minimum,
    smoothstep,
)
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform

STEEPNESS = 4.0
"""Exponent of the trough: 2 is a bowl, 4 a glacier's U."""


class Fjord(Landform):
    """Cut a fjord: deep troughs with steep walls through a plateau, drowned, with a sill.

    Across a trough at the distance ``d``, with the floor ``f`` and the plateau ``P``::

        z = f + (P - f) t^4 / (1 + t^4),  t = d / a

    where ``a`` makes the water as wide as it is asked for. Along the trough the floor falls from
    the head to the basin, which is overdeepened, and rises again to the sill at the mouth
    (Nesje & Whillans 1994). Side fjords hang above the main one. 0 is the level of the sea.

    References
    ----------
    H. Svensson, "Is the cross-section of a glacial valley a parabola?", Journal of Glaciology 3,
    1959. A. Nesje and I. M. Whillans, "Erosion of Sognefjord, Norway", Geomorphology 9, 1994.
    """

    name = "fjord"
    cites = ("Svensson 1959", "Nesje & Whillans 1994")
    portrait: ClassVar[float] = 30000.0

    length: float = parameter(22000.0, "Length from end to end.", unit="m", gt=0, le=1e7)
    fjord_width: float = parameter(1900.0, "Width of the water.", unit="m", gt=0, le=1e6)
    depth: float = parameter(480.0, "Depth of the deepest water.", unit="m", ge=0, le=12000)
    sill_depth: float = parameter(
        70.0, "Depth of the water over the sill at the mouth.", unit="m", ge=0, le=5000
    )
    plateau_height: float = parameter(
        1150.0, "Height of the plateau behind the walls.", unit="m", gt=0, le=10000
    )
    direction: float = parameter(
        245.0, "Where it opens to the sea, clockwise from north.", unit="deg", ge=-360, le=360
    )
    branches: int = parameter(3, "How many side fjords there are.", ge=0, le=8)
    winding: float = parameter(1.0, "How much it winds: 0 is straight, 1 is natural.", ge=0, le=2)

    presets: ClassVar = {
        "norway": {"length": 26000.0, "depth": 700.0, "plateau_height": 1400.0, "branches": 4},
        "sound": {"fjord_width": 3500.0, "depth": 250.0, "plateau_height": 500.0, "branches": 5},
        "milford": {"length": 14000.0, "fjord_width": 1600.0, "depth": 290.0, "branches": 1},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        rough = place.value(self, "roughness")
        natural = minimum(rough, 1.0)
        bent = self.warped(place, 2.5 * self.fjord_width, natural * (0.16 * self.fjord_width), 6)
        right, ahead = self.course(
            bent, self.direction, 0.9 * self.length, 0.10 * self.length * self.winding
        )
        plateau = self._plateau(place, ahead)

        # The main trough; its floor from the head (0) to the mouth (1)
        at = ahead * (1.0 / self.length) + 0.5
        basin = 4.0 * clamp(at, 0.0, 1.0) * (1.0 - clamp(at, 0.0, 1.0))
        deep = power(basin, 0.7) * (self.depth - min(self.sill_depth, self.depth))
        head = smoothstep(0.0, 0.14, at)
        floor = -deep - head * min(self.sill_depth, self.depth)
        inland = maximum(-at, 0.0) * (2.2 * self.plateau_height)
        seaward = maximum(at - 1.0, 0.0) * (self.length * 0.03)
        floor = floor + inland - minimum(seaward, 2.0 * self.sill_depth + 60.0)
        narrow = lerp(0.55, 1.0, smoothstep(-0.15, 0.35, at))
        z = self._trough(plateau, floor, absolute(right), 1.0, narrow)

        for number in range(self.branches):
            side = self._branch(place, plateau, right, ahead, number)
            z = smooth_minimum(z, side, natural * (0.05 * self.plateau_height))
        detail = self.unevenness(place, 0.8 * self.fjord_width)
        dry = smoothstep(-0.2 * self.depth - 1.0, 0.2 * self.plateau_height, z)
        return self.ground(
            place, z + detail * (dry * (0.07 * self.plateau_height) + 0.02 * self.depth)
        )

    def _plateau(self, place: Place, ahead: Formula) -> Formula:
        """Return the land before there was ice: a plateau that falls to a coast with skerries."""
        top, width = self.plateau_height, self.fjord_width
        hills = self.unevenness(place, 3.2 * width, 10, "plateau", 0.75)
        coast = self.unevenness(place, 2.6 * width, 8, "shore", 0.6)
        beyond = (ahead - 0.5 * self.length) * (1.0 / width) - coast * 2.4
        land = 1.0 - smoothstep(-1.8, 1.4, beyond)
        back = lerp(0.62, 1.0, smoothstep(0.45, -0.3, ahead * (1.0 / self.length)))
        shelf = 1.5 * self.sill_depth + 80.0
        natural = minimum(place.value(self, "roughness"), 1.0)
        peaks = ridged_multifractal(
            place.octaves("gradient", 2.1 * width, 9, place.words(f"{self.name} peaks", self.seed)),
            1.0,
            2.0,
        )
        uneven = hills * (0.22 * top) + natural * (peaks - 0.45) * (0.55 * top)
        return land * back * (top + shelf) - shelf + uneven * (0.18 + 0.82 * land)

    def _trough(
        self, plateau: Formula, floor: Formula, away: Formula, size: float, narrow: Number
    ) -> Formula:
        """Return the land with a trough cut into it."""
        share = max(self.depth, 0.05 * self.plateau_height)
        share = share / (share + self.plateau_height)
        reach = 0.5 * self.fjord_width * size / (share / (1.0 - share)) ** (1.0 / STEEPNESS)
        t = away / (narrow * reach)
        t = minimum(t, 40.0)
        wall = t * t * t * t
        wall = wall / (1.0 + wall)
        return minimum(plateau, floor + maximum(plateau - floor, 0.0) * wall)

    def _branch(
        self, place: Place, plateau: Formula, right: Formula, ahead: Formula, number: int
    ) -> Formula:
        """Return the land with a side fjord cut into it, which hangs above the main one."""
        words = place.words(f"{self.name} branch {number}", self.seed)
        some, other = (word / 2**32 for word in words)
        side = 1.0 if (number + (some > 0.5)) % 2 else -1.0
        start = (0.5 - (number + 0.3 + 0.5 * other) / max(self.branches, 1)) * 0.80 * self.length
        turn = math.radians(42.0 + 30.0 * some)  # away from the sea, as its ice came
        length = (0.22 + 0.16 * other) * self.length
        out = right * side
        along = out * math.sin(turn) - (ahead - start) * math.cos(turn)
        aside = out * math.cos(turn) + (ahead - start) * math.sin(turn)
        swing = place.noise_at("gradient", along * (2.4 / length), 0.37, words)
        aside = aside + swing * (0.14 * length * self.winding) * smoothstep(
            0.0, 0.4 * length, along
        )
        behind = maximum(-along, 0.0) * 1.5
        share = clamp(along * (1.0 / length), 0.0, 2.0)
        floor = -(0.62 - 0.2 * other) * self.depth * (1.0 - share) + maximum(share - 0.75, 0.0) * (
            1.6 * self.plateau_height
        )
        size = 0.42 + 0.2 * some
        return self._trough(plateau, floor, hypot(aside, behind), size, 1.0)
