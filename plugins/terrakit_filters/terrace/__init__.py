"""Benches: steps in a slope, as strata of hard and soft rock leave them."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import (
    Formula,
    FormulaFilter,
    Place,
    clamp,
    fbm,
    floor,
    lerp,
    maximum,
    smoothstep,
    where,
)
from terrakit.parameters import Maskable, Seed, parameter

LEAST_RISER = 0.12
"""Share of a bench's height over which its riser climbs, at full sharpness."""
UNEVEN = 0.45
"""How far an edge may lie from where even benches have it, in bench heights; below one half."""


class Terrace(FormulaFilter):
    """Cut slopes into benches: level treads and steep risers between them.

    The height is counted in benches, t = (z + n - offset) / bench_height; n is the lie of the
    strata, noise of up to ``undulation`` metres. Bench i lies between the edges
    e_i = i + variation h(i), with h a hash of i within 0.45 of 0, and its ground becomes::

        z' = z_i + (z_i+1 - z_i) ((1 - s) f + s smooth((f - 1/2) / w + 1/2)) - n
        f  = (t - e_i) / (e_i+1 - e_i),  z_i = offset + bench_height e_i

    with s the sharpness and w the share of a bench that its riser takes. It rises with z, keeps
    the order of heights at a place, and leaves the mean height of a long slope as it is.
    """

    name = "terrace"
    fields = 3
    trial: ClassVar = {"bench_height": 20.0, "wavelength": 200.0, "undulation": 4.0}
    turning: ClassVar = {"undulation": 0.0}
    idle: ClassVar = {"sharpness": 0.0}

    bench_height: float = parameter(
        80.0, "Height from one bench to the next.", unit="m", ge=0.1, le=1e5
    )
    sharpness: float = parameter(
        0.85, "0 leaves the slope, 1 makes level treads and cliffs.", ge=0, le=1
    )
    variation: float = parameter(
        0.6, "How uneven the benches are in height; 0 makes them all alike.", ge=0, le=1
    )
    undulation: float = parameter(
        20.0, "How far the strata rise and fall across the land.", unit="m", ge=0, le=1e5
    )
    wavelength: float = parameter(
        2000.0, "Distance between the largest of those waves.", unit="m", gt=0, le=1e8
    )
    offset: float = parameter(
        0.0, "Height of one of the edges, where benches are even.", unit="m", ge=-1e6, le=1e6
    )
    share: Maskable = parameter(
        1.0, "Where it counts: 0 leaves the ground, 1 is all benches.", ge=0, le=1
    )
    seed: Seed = parameter(0, "Another number or word gives other benches.")

    presets: ClassVar = {
        "mesa": {"bench_height": 160.0, "sharpness": 1.0, "variation": 0.9},
        "rice": {
            "bench_height": 4.0,
            "sharpness": 1.0,
            "variation": 0.2,
            "undulation": 1.0,
            "wavelength": 300.0,
        },
        "quarry": {"bench_height": 15.0, "sharpness": 1.0, "variation": 0.0, "undulation": 0.0},
        "worn": {"bench_height": 60.0, "sharpness": 0.55, "variation": 0.8},
    }

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the height of the bench."""
        if self.sharpness == 0:
            return ground
        strata = self._strata(place)
        raised = ground if strata is None else ground + strata
        t = (raised - self.offset) * (1.0 / self.bench_height)
        low, high = self._edges(place, t)
        thickness = maximum(high - low, 1.0 - 2.0 * UNEVEN)
        f = clamp((t - low) / thickness, 0.0, 1.0)
        riser = 1.0 + (LEAST_RISER - 1.0) * self.sharpness
        climbed = smoothstep(0.5 - 0.5 * riser, 0.5 + 0.5 * riser, f)
        risen = f * (1.0 - self.sharpness) + climbed * self.sharpness
        # From the nearer edge, so that the treads on both sides of it are level to the bit
        level = where(risen < 0.5, low + thickness * risen, high - thickness * (1.0 - risen))
        bench = self.offset + self.bench_height * level
        if strata is not None:
            bench = bench - strata
        share = place.value(self, "share")
        return where(share < 1.0, lerp(ground, bench, share), bench)

    def _strata(self, place: Place) -> Formula | None:
        """Return how much lower the strata lie than on average, metres."""
        if self.undulation == 0:
            return None
        words = place.words(f"{self.name} strata", self.seed)
        return fbm(place.octaves("gradient", self.wavelength, 4, words)) * self.undulation

    def _edges(self, place: Place, t: Formula) -> tuple[Formula, Formula]:
        """Return the lower and the upper edge of the bench in which ``t`` lies."""
        whole = floor(t)
        if self.variation == 0:
            return whole, whole + 1.0
        words = place.words(f"{self.name} benches", self.seed)

        def edge(step: float) -> Formula:
            number = whole + step
            uneven = place.noise_at("white", number, 0.0, words)
            return number + uneven * (UNEVEN * self.variation)

        before, first, second, after = (edge(step) for step in (-1.0, 0.0, 1.0, 2.0))
        under, over = t < first, t >= second
        low = where(under, before, where(over, second, first))
        return low, where(under, first, where(over, after, second))
