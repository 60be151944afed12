"""A mask of outlines that somebody drew: lakes, fields, building land."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit.world import sample_axes
from terrakit_texturing.mask import F, Field, Mask, smooth
from terrakit_texturing.polygon_mask.outline import checked, distance_to_edge, inside

SIDES = {"outside": (0.0, 1.0), "middle": (-0.5, 0.5), "inside": (-1.0, 0.0)}
"""Where the fade begins and ends, in widths of the feather outside the outline."""


class PolygonMask(Mask):
    """Select what lies within polygons in world coordinates, with holes and a soft edge.

    Polygons are written as in GeoJSON's MultiPolygon: a list of polygons, each a list of rings,
    each a list of points ``[x, y]`` in metres; the first ring is the outline, further ones are
    holes. With the distance d to the outline, positive outside::

        m = 1 - s(d / feather)        s(t) = t^2 (3 - 2 t), t within 0 to 1

    References
    ----------
    M. Shimrat, "Algorithm 112: position of point relative to polygon", CACM 5, 1962.
    """

    name = "polygon_mask"
    cites = ("Shimrat 1962",)
    fields = 12
    locality = "pointwise"
    turning: ClassVar = None
    trial: ClassVar = {
        "allow_empty": True,
        "polygons": [
            [
                [[20.0, 30.0], [290.0, 10.0], [250.0, 280.0], [130.0, 170.0]],
                [[150.0, 80.0], [200.0, 90.0], [180.0, 130.0]],
            ],
        ],
    }

    layer: str = parameter("mask_polygon", "Name of the layer to write; begins with mask_.")
    polygons: list[list[list[list[float]]]] = parameter(
        ..., "Polygons as lists of rings of points [x, y] in metres; rings after the first: holes."
    )
    feather: float = parameter(20.0, "Width of the soft edge; 0 is sharp.", unit="m", ge=0, le=1e6)
    feather_side: Literal["outside", "middle", "inside"] = parameter(
        "outside", "Where the soft edge lies, seen from the outline."
    )

    @field_validator("polygons", mode="before")
    @classmethod
    def _sound(cls, value: Any) -> Any:
        return checked(value)

    def remedy(self) -> str:
        """Return how to select something."""
        if not self.polygons:
            return "polygons = []: there is nothing to be inside of; add one"
        corners = np.concatenate([np.array(ring) for polygon in self.polygons for ring in polygon])
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        return (
            f"polygons cover {west:g} to {east:g} m east and {south:g} to {north:g} m north, and "
            "no sample of the terrain lies there; move them, or raise feather"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        x, y = sample_axes(surface.grid)
        selected = np.zeros(surface.shape, dtype=F)
        for polygon in self.polygons:
            run.check()
            rings = [np.array(ring) for ring in polygon]
            window = self._window(rings[0], x, y)
            part = selected[window]
            if part.size:
                np.maximum(part, self._one(rings, x[window[1]], y[window[0]]), out=part)
        return selected

    def _window(
        self, outline: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[slice, slice]:
        """Return the rows and columns that the polygon can reach."""
        (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
        rows = np.searchsorted(-y, [-(north + self.feather), -(south - self.feather)])
        cols = np.searchsorted(x, [west - self.feather, east + self.feather])
        return slice(int(rows[0]), int(rows[1]) + 1), slice(int(cols[0]), int(cols[1]) + 1)

    def _one(
        self, rings: list[NDArray[np.float64]], x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> Field:
        within = inside(rings, x, y)
        if self.feather == 0:
            return within.astype(F)
        distance = distance_to_edge(rings, x, y, self.feather)
        distance = np.where(within, -distance, distance) / self.feather
        start, end = SIDES[self.feather_side]
        return F(1) - smooth(((distance - start) / (end - start)).astype(F))
