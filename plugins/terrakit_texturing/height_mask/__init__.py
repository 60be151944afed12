"""A mask of ground between two heights."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import model_validator

from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_texturing.mask import Field, Mask, falling, rising


class HeightMask(Mask):
    """Select ground by its height.

    The mask is 1 from ``height_min`` to ``height_max`` and fades out over ``height_blend`` beyond::

        m = s(min - b, min, z) (1 - s(max, max + b, z))

    with the smooth step ``s(a, b, x) = t^2 (3 - 2 t)``, ``t = (x - a) / (b - a)`` within 0 to 1.
    Without a limit the mask is open on that side.

    References
    ----------
    D. S. Ebert et al., "Texturing and Modeling", 2003 (smoothstep).
    """

    name = "height_mask"
    cites = ("Ebert, Musgrave, Peachey, Perlin & Worley 2003",)
    locality = "pointwise"
    trial: ClassVar = {"allow_empty": True, "height_min": 0.0, "height_max": 50.0}

    layer: str = parameter("mask_height", "Name of the layer to write; begins with mask_.")
    height_min: float | None = parameter(
        None, "Lowest ground that is fully selected; everything below too without it.", unit="m"
    )
    height_max: float | None = parameter(
        None, "Highest ground that is fully selected; everything above too without it.", unit="m"
    )
    height_blend: float = parameter(
        50.0, "Over how many metres the mask fades out on either side.", unit="m", ge=0
    )

    presets: ClassVar = {
        "summits": {"layer": "mask_summits", "height_min": 2500.0, "height_blend": 300.0},
        "lowland": {"layer": "mask_lowland", "height_max": 300.0, "height_blend": 100.0},
        "beach": {
            "layer": "mask_beach",
            "height_min": -2.0,
            "height_max": 3.0,
            "height_blend": 1.0,
        },
    }

    @model_validator(mode="after")
    def _in_order(self) -> HeightMask:
        low, high = self.height_min, self.height_max
        if low is not None and high is not None and low > high:
            raise ValueError(f"height_min = {low:g}: must not be above height_max = {high:g}")
        return self

    def remedy(self) -> str:
        """Return how to select something."""
        low = "-inf" if self.height_min is None else f"{self.height_min:g}"
        high = "inf" if self.height_max is None else f"{self.height_max:g}"
        return f"no ground lies between {low} and {high} m; move height_min or height_max"

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        del run
        height = surface.elevation
        selected = np.ones_like(height)
        if self.height_min is not None:
            selected *= rising(height, self.height_min - self.height_blend, self.height_min)
        if self.height_max is not None:
            selected *= falling(height, self.height_max, self.height_max + self.height_blend)
        return selected
