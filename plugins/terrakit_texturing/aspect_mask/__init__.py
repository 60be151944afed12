"""A mask of slopes that face one way."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_texturing.mask import F, Field, Mask, rising, tangents


class AspectMask(Mask):
    """Select slopes by the direction that they face, downhill.

    With the unit vector ``d`` of the direction and the downhill vector ``a = -grad z``, the mask
    is 1 where the angle between them is at most half of ``direction_width`` and fades out over
    ``direction_blend`` beyond::

        m = s(cos(w/2 + b), cos(w/2), a . d / |a|) s(0, tan(flat), |a|)

    Flat ground faces nowhere: the mask fades out on slopes below ``flat_slope``.

    References
    ----------
    B. K. P. Horn, "Hill shading and the reflectance map", Proc. IEEE 69, 1981 (aspect).
    """

    name = "aspect_mask"
    cites = ("Horn 1981",)
    locality = "stencil"
    turning: ClassVar = None
    trial: ClassVar = {"allow_empty": True}

    layer: str = parameter("mask_aspect", "Name of the layer to write; begins with mask_.")
    direction: float = parameter(
        180.0,
        "Direction that the slopes face, clockwise from north: 90 is east, 180 south.",
        unit="deg",
        ge=-360,
        le=360,
    )
    direction_width: float = parameter(
        90.0, "Range of directions that is fully selected.", unit="deg", ge=0, le=360
    )
    direction_blend: float = parameter(
        30.0, "Over how many degrees the mask fades out on either side.", unit="deg", ge=0, le=180
    )
    flat_slope: float = parameter(
        3.0, "Slope below which ground faces nowhere, and the mask fades.", unit="deg", ge=0, lt=90
    )

    presets: ClassVar = {
        f"{word}_faces": {"layer": f"mask_{word}_faces", "direction": angle}
        for word, angle in (("north", 0.0), ("east", 90.0), ("south", 180.0), ("west", 270.0))
    }

    def reach(self, spacing: float) -> int | None:
        """Return 1: slopes look at the nearest samples."""
        del spacing
        return 1

    def remedy(self) -> str:
        """Return how to select something."""
        return (
            f"no slope faces {self.direction:g} deg within {self.direction_width / 2:g}; "
            "raise direction_width or lower flat_slope"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask; cosines are compared, so no arc cosine decides a byte."""
        del run
        south, east = tangents(surface)
        bearing = math.radians(self.direction % 360.0)
        # Downhill is against the gradient; a rise to the south is a fall to the north
        along = south * F(math.cos(bearing)) - east * F(math.sin(bearing))
        steep = np.sqrt(south * south + east * east)
        sloping = steep > 0
        facing = np.asarray(along / np.where(sloping, steep, F(1)), dtype=F)
        inner = min(self.direction_width / 2, 180.0)
        outer = min(inner + self.direction_blend, 180.0)
        foot, top = (math.cos(math.radians(angle)) for angle in (outer, inner))
        selected = rising(facing, foot, top) if inner < 180.0 else np.ones_like(steep)
        slant = math.tan(math.radians(self.flat_slope))
        return np.where(sloping, selected * rising(steep, 0.0, slant), F(0))
