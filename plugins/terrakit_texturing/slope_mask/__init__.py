"""A mask of ground between two slopes."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import model_validator

from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_texturing.mask import Field, Mask, falling, rising, steepness


class SlopeMask(Mask):
    """Select ground by how steep it is.

    The mask is 1 from ``slope_min`` to ``slope_max`` and fades out over ``slope_blend`` beyond::

        m = s(tan(min - b), tan(min), |grad z|) (1 - s(tan(max), tan(max + b), |grad z|))

    with the smooth step ``s(a, b, x) = t^2 (3 - 2 t)``, ``t = (x - a) / (b - a)`` within 0 to 1.

    References
    ----------
    D. S. Ebert et al., "Texturing and Modeling", 2003 (smoothstep). B. K. P. Horn, "Hill shading
    and the reflectance map", 1981 (slope of gridded heights).
    """

    name = "slope_mask"
    cites = ("Ebert, Musgrave, Peachey, Perlin & Worley 2003",)
    locality = "stencil"
    trial: ClassVar = {"allow_empty": True}

    layer: str = parameter("mask_slope", "Name of the layer to write; begins with mask_.")
    slope_min: float = parameter(
        30.0, "Gentlest slope that is fully selected.", unit="deg", ge=0, lt=90
    )
    slope_max: float = parameter(
        90.0, "Steepest slope that is fully selected.", unit="deg", ge=0, le=90
    )
    slope_blend: float = parameter(
        5.0, "Over how many degrees the mask fades out on either side.", unit="deg", ge=0, le=90
    )

    presets: ClassVar = {
        "cliffs": {"layer": "mask_cliffs", "slope_min": 50.0, "slope_blend": 6.0},
        "scree_slopes": {"layer": "mask_scree_slopes", "slope_min": 28.0, "slope_max": 38.0},
        "walkable": {"layer": "mask_walkable", "slope_min": 0.0, "slope_max": 30.0},
        "flats": {"layer": "mask_flats", "slope_min": 0.0, "slope_max": 4.0, "slope_blend": 3.0},
    }

    @model_validator(mode="after")
    def _in_order(self) -> SlopeMask:
        if self.slope_min > self.slope_max:
            raise ValueError(
                f"slope_min = {self.slope_min:g}: must not be above slope_max = {self.slope_max:g}"
            )
        return self

    def reach(self, spacing: float) -> int | None:
        """Return 1: slopes look at the nearest samples."""
        del spacing
        return 1

    def remedy(self) -> str:
        """Return how to select something."""
        return (
            f"no ground has a slope of {self.slope_min:g} to {self.slope_max:g} deg; "
            "lower slope_min or raise slope_max"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask; tangents are compared, so no arc tangent decides a byte."""
        del run
        steep = steepness(surface)
        low, high, blend = self.slope_min, self.slope_max, self.slope_blend
        selected = np.ones_like(steep)
        if low > 0:
            selected *= rising(steep, _tangent(low - blend), _tangent(low))
        if high < 90:
            selected *= falling(steep, _tangent(high), _tangent(high + blend))
        return selected


def _tangent(angle: float) -> float:
    """Return the tangent of an angle in degrees, finite up to 90 and beyond."""
    return math.tan(math.radians(max(-89.0, min(angle, 89.999))))
