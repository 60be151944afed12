"""Ground materials from slope, height and where loose material lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.heightfield import Heightfield
from terrakit.layers import ALBEDO
from terrakit.operators import Texture
from terrakit.parameters import Maskable, Seed, parameter
from terrakit.running import Run

F = np.float32
Field = NDArray[np.float32]
FINE = 2**20
"""Parts of a sample to which an origin between samples is rounded."""


@dataclass(frozen=True)
class Material:
    """One ground material and its two colours in linear light, between which it varies."""

    name: str
    dark: tuple[float, float, float]
    light: tuple[float, float, float]


MATERIALS = (
    Material("grass", (0.036, 0.050, 0.018), (0.095, 0.104, 0.042)),
    Material("rock", (0.110, 0.100, 0.090), (0.270, 0.250, 0.225)),
    Material("scree", (0.190, 0.175, 0.150), (0.330, 0.305, 0.265)),
    Material("sand", (0.420, 0.340, 0.210), (0.560, 0.470, 0.310)),
    Material("snow", (0.700, 0.740, 0.800), (0.880, 0.900, 0.930)),
)


class SlopeHeight(Texture):
    """Paint grass, rock, scree, sand and snow by slope, height and loose material.

    Every weight is a product of smooth steps, so there is no hard edge, and the five sum to 1.
    Thresholds are jittered by noise that is fixed in the world, not in the map::

        w_k = prod_f smoothstep(low_kf, high_kf, f) / sum_j w_j

    References
    ----------
    Sheet S24 of the founding works; smoothstep after D. S. Ebert et al., "Texturing and Modeling",
    2003.
    """

    name = "slope_height"
    uses = ("sediment",)
    writes = (*(f"material_{material.name}" for material in MATERIALS), *ALBEDO)
    cites = ("Ebert, Musgrave, Peachey, Perlin & Worley 2003",)
    fields = 16
    locality = "stencil"
    turning: ClassVar = {"variation": 0.0}

    rock_slope: Maskable = parameter(
        36.0, "Slope at which grass has given way to rock.", unit="deg", ge=0, lt=90
    )
    snow_line: Maskable = parameter(
        2200.0, "Height above which snow lies on ground that is not too steep.", unit="m"
    )
    snow_slope: Maskable = parameter(
        48.0, "Slope that snow no longer holds on.", unit="deg", ge=0, lt=90
    )
    tree_line: Maskable = parameter(1800.0, "Height above which grass thins out.", unit="m")
    beach_height: Maskable = parameter(0.0, "Height up to which the ground is sand.", unit="m")
    scree_thickness: float = parameter(
        1.0, "Thickness of loose material that shows as scree.", unit="m", gt=0
    )
    softness: float = parameter(
        0.25, "Width of the transitions: 0 is sharp, 1 is very soft.", ge=0.01, le=1
    )
    variation: float = parameter(
        0.35, "How much noise moves the limits and shades the colours.", ge=0, le=1
    )
    grain: float = parameter(180.0, "Size of the largest patches of that noise.", unit="m", gt=0)
    seed: Seed = parameter(0, "Another number or word gives other patches.")

    presets: ClassVar = {
        "alpine": {},
        "tropical": {"snow_line": 9000.0, "tree_line": 6000.0, "beach_height": 4.0},
        "desert": {"snow_line": 9000.0, "tree_line": -1000.0, "rock_slope": 28.0},
    }

    def reach(self, spacing: float) -> int | None:
        """Return 1: slopes look at the nearest samples."""
        del spacing
        return 1

    def texture(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain with material weights and a colour."""
        patches = self._patches(surface, run)
        weights = self._weights(surface, patches)
        colour = [np.zeros(surface.shape, dtype=F) for _ in ALBEDO]
        shade = np.clip(F(0.5) + F(self.variation) * patches, F(0), F(1))
        for material, weight in zip(MATERIALS, weights, strict=True):
            run.check()
            for channel, dark, light in zip(colour, material.dark, material.light, strict=True):
                channel += weight * (F(dark) + F(light - dark) * shade)
        layers = {f"material_{m.name}": w for m, w in zip(MATERIALS, weights, strict=True)}
        return surface.with_layers(**layers, **dict(zip(ALBEDO, colour, strict=True)))

    def _weights(self, surface: Heightfield, patches: Field) -> list[Field]:
        """Return the weight of every material, in the order of MATERIALS."""
        height = surface.elevation
        # Compare tangents, not angles: no arc tangent on the way to the bytes
        steepness = _steepness(height, surface.spacing)
        jitter = F(1) + F(0.5 * self.variation) * patches
        relief = F(150.0 * self.variation) * patches
        width = F(400.0 * self.softness)

        rocky = self._over(steepness * jitter, self._tangent("rock_slope", surface))
        holds = F(1) - self._over(steepness * jitter, self._tangent("snow_slope", surface))
        snowy = _step(height + relief, self._level("snow_line", surface), width) * holds
        bare = _step(height + relief, self._level("tree_line", surface), F(1.5) * width)
        sandy = F(1) - _step(height + F(0.02) * relief, self._level("beach_height", surface), F(4))
        loose = np.zeros_like(height)
        if "sediment" in surface:
            loose = _smooth(surface.layer("sediment") / F(2 * self.scree_thickness))

        # What lies on top hides what is beneath it, so that the sum is 1 by construction
        left = np.ones_like(height)
        snow = snowy
        left = left - snow
        sand = left * sandy
        left = left - sand
        scree = left * loose * (F(1) - F(0.5) * rocky) * (F(0.35) + F(0.65) * bare)
        left = left - scree
        rock = left * np.maximum(rocky, F(0.8) * bare)
        grass = np.maximum(left - rock, F(0))
        total = grass + rock + scree + sand + snow
        return [part / total for part in (grass, rock, scree, sand, snow)]

    def _over(self, steepness: Field, limit: Field) -> Field:
        """Return 0 below a steepness, 1 above it, smoothly between."""
        return _step(steepness, limit, F(self.softness) * limit + F(1e-3))

    def _tangent(self, parameter: str, surface: Heightfield) -> Field:
        angle = np.asarray(self.value(parameter, surface), dtype=np.float64)
        return np.tan(np.radians(angle)).astype(F)

    def _level(self, parameter: str, surface: Heightfield) -> Field:
        return np.asarray(self.value(parameter, surface), dtype=F)

    def _patches(self, surface: Heightfield, run: Run) -> Field:
        """Return value noise of three octaves within -1 to 1, fixed in the world."""
        rows, cols = surface.shape
        x0, y0 = surface.origin
        x = _along(x0, surface.spacing, np.arange(cols))
        y = _along(y0, surface.spacing, -np.arange(rows))
        total = np.zeros(surface.shape, dtype=F)
        size, share = self.grain, F(0.5)
        for octave in range(3):
            run.check()
            words = run.words(f"{self.name}.{octave}", self.seed)
            total += share * _value_noise(x / size, y / size, words)
            size, share = size * 0.43, share * F(0.6)
        return total


def _along(first: float, spacing: float, steps: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return world coordinates that depend on the sample alone, not on where its tile begins."""
    whole = round(first / spacing * FINE)
    return (whole + steps * FINE) * (spacing / FINE)


def _value_noise(x: NDArray[np.float64], y: NDArray[np.float64], seed: tuple[int, int]) -> Field:
    """Return smooth random values within -1 to 1 on the grid of ``x`` and ``y`` cells."""
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = _smooth((x - i).astype(F))[None, :], _smooth((y - j).astype(F))[:, None]
    corner = [
        [exact.uniform(exact.hashed(seed, i[None, :] + a, j[:, None] + b)) for a in (0, 1)]
        for b in (0, 1)
    ]
    south = corner[0][0] + fx * (corner[0][1] - corner[0][0])
    north = corner[1][0] + fx * (corner[1][1] - corner[1][0])
    return F(2) * (south + fy * (north - south)) - F(1)


def _steepness(height: Field, spacing: float) -> Field:
    """Return the tangent of the slope, by central differences."""
    south, east = np.gradient(height, F(spacing))
    return np.sqrt(south * south + east * east)


def _step(value: Field, middle: Field, width: np.float32 | Field) -> Field:
    """Return a smooth step from 0 to 1 around ``middle``, ``width`` wide on either side."""
    return _smooth((value - middle) / (F(2) * width) + F(0.5))


def _smooth(t: Field) -> Field:
    t = np.minimum(np.maximum(t, F(0)), F(1))
    return t * t * (F(3) - F(2) * t)
