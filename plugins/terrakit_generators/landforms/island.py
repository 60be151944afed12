"""An island: a cone bent by noise, a crater folded into its top, a shelf, the deep sea."""

from __future__ import annotations

import math
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    clamp,
    fbm,
    hypot,
    maximum,
    minimum,
    power,
    smoothstep,
    sqrt,
    square,
)
from terrakit.parameters import Maskable, parameter
from terrakit_generators.landforms.round_form import RoundForm

LEAST_EXPONENT = 0.1
"""Least power to which the cone is raised, however strong the noise."""


class Island(RoundForm):
    """Raise an island: a cone to the power of noise, a crater folded in, a shelf, the deep sea.

    ::

        h_A = 1 - (r / R)^P                           the cone, 0 beyond R
        h_C = h_A^max(0.1, 1 + kappa_N n(x))          bent by noise n, -1 to 1
        u   = h_C - kappa_C,  f = sqrt(u^2 + e^2) - e
        h_0 = kappa_C (1 - f / f(h_C = 0))            folded down where it is above kappa_C
        z   = H h_0 - shelf depth

    With ``e = 0`` the fold is ``kappa_C - |u|``, a rim like a knife. Around the cone lies a shelf,
    and beyond it the ground falls to the deep sea. The volume over the shelf, without noise and
    crater, is ``pi R^2 H P / (P + 2)``.

    References
    ----------
    Sheet S10 of the founding works, after their equations 1 to 5.
    """

    name = "island"
    portrait: ClassVar[float] = 14000.0

    summit_height: float = parameter(
        1400.0, "Height of the top above the land around.", unit="m", ge=0, le=20000
    )
    radius: float = parameter(
        5000.0, "Distance from the middle to the foot or rim.", unit="m", gt=0, le=1e6
    )
    profile_exponent: float = parameter(
        1.0, "Shape of the flanks: 1 is a cone, 2 a dome, below 1 concave.", ge=0.5, le=6
    )
    noise_strength: Maskable = parameter(
        0.45, "How much noise bends the cone into ridges and bays.", ge=0, le=0.9
    )
    noise_wavelength: float = parameter(
        2600.0, "Distance between the largest ridges and bays.", unit="m", gt=0, le=1e6
    )
    crater_level: float = parameter(
        0.86,
        "Share of the height above which the top is folded into a crater; 1 for none.",
        ge=0.3,
        le=1,
    )
    rim_rounding: float = parameter(
        0.02,
        "Roundness of the crater's rim, as a share of the height; 0 is a knife.",
        ge=0,
        le=0.5,
        advanced=True,
    )
    shelf_depth: float = parameter(
        60.0, "Depth of the foot and the shelf below the sea.", unit="m", ge=0, le=5000
    )
    shelf_width: float = parameter(
        900.0, "Width of the shelf around the foot.", unit="m", ge=0, le=1e6
    )
    depth: float = parameter(
        1200.0, "Depth of the sea floor around, below the land.", unit="m", ge=0, le=12000
    )

    presets: ClassVar = {
        "volcanic": {"crater_level": 0.7, "profile_exponent": 0.8, "summit_height": 1800.0},
        "high": {"summit_height": 2400.0, "crater_level": 1.0, "noise_strength": 0.6},
        "low": {
            "summit_height": 150.0,
            "crater_level": 1.0,
            "profile_exponent": 2.0,
            "shelf_depth": 30.0,
            "shelf_width": 2500.0,
            "depth": 400.0,
        },
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        top, radius, shelf = self.summit_height, self.radius, self.shelf_depth
        x, y = self.surroundings(place, 1.1 * radius, 0.2, octaves=6)
        r = hypot(x, y)
        rho = r * (1.0 / radius)

        # The cone to the power of noise, and the crater that is folded into it
        cone = clamp(1.0 - power(minimum(rho, 1.0), self.profile_exponent), 0.0, 1.0)
        bent = cone
        if self.noise_strength != 0.0:
            octaves = place.octaves(
                "gradient",
                self.noise_wavelength,
                9,
                place.words(f"{self.name} bend", self.seed),
                gain=0.54,
            )
            noise = clamp(fbm(octaves) * 1.8, -1.0, 1.0)
            bent = power(
                cone, maximum(1.0 + place.value(self, "noise_strength") * noise, LEAST_EXPONENT)
            )
        land = self._folded(bent) * top
        natural = minimum(place.value(self, "roughness"), 1.0)
        gullies = minimum(self.spokes(place, x, y, 0.5 * radius, 13.0, 0.5), 1.0)
        flank = smoothstep(0.0, 0.3, cone) * smoothstep(0.12, 0.5, rho)
        land = land - natural * flank * (1.0 - gullies) * (0.11 * top)

        # The shelf, its edge and the foot of the slope to the deep sea
        fall = max(1.0, 2.2 * max(self.depth - shelf, 0.0))
        edge = self.unevenness(place, 0.9 * radius, 7, "shelf") * (0.55 * self.shelf_width)
        outward = maximum(r - (radius + self.shelf_width) + edge, 0.0) * (1.0 / fall)
        deep = outward * outward
        drop = deep / (deep + 0.35 * (outward + 0.05)) * max(self.depth - shelf, 0.0)
        detail = self.unevenness(place, 0.25 * radius)
        rough = smoothstep(0.0, 0.25, cone) * (0.05 * top) + 0.012 * max(self.depth, shelf) * (
            smoothstep(0.0, 0.2, outward)
        )
        return self.ground(place, land - shelf - drop + detail * (rough + 0.05 * shelf))

    def _folded(self, bent: Formula) -> Formula:
        """Return the cone, mirrored downwards where it is above the crater's level."""
        level, rounding = self.crater_level, self.rim_rounding
        if level == 1.0:
            return bent
        foot = math.hypot(level, rounding) - rounding
        fold = sqrt(square(bent - level) + rounding**2) - rounding
        return level - fold * (level / foot)
