"""A mask by the distance to something: a layer, the coast, the border."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter, suggestion
from terrakit.running import Run
from terrakit_texturing.mask import F, Field, Mask, falling, rising


class DistanceMask(Mask):
    """Select ground by how far it is from a layer, from the coast or from the border.

    The mask is 1 from ``distance_min`` to ``distance_max`` and fades out over ``distance_blend``
    beyond. Distances are exact: the squares of whole numbers of samples are compared::

        d(p) = spacing min_q sqrt((p_x - q_x)^2 + (p_y - q_y)^2),   q where target_layer > threshold

    The coast is where land (at or above the sea level) meets water: the distance is to the nearest
    sample on the other side, from land and from water alike.

    References
    ----------
    C. R. Maurer, R. Qi and V. Raghavan, "A linear time algorithm for computing exact euclidean
    distance transforms", IEEE PAMI 25, 2003.
    """

    name = "distance_mask"
    cites = ("Maurer, Qi & Raghavan 2003",)
    fields = 12
    locality = "global"
    trial: ClassVar = {"allow_empty": True, "target": "layer", "target_layer": "elevation"}

    layer: str = parameter("mask_distance", "Name of the layer to write; begins with mask_.")
    target: Literal["layer", "coast", "border"] = parameter(
        "coast", "What the distance is measured to."
    )
    target_layer: str = parameter(
        "", "The layer, for target = layer; the target is where it exceeds the threshold."
    )
    threshold: float = parameter(0.5, "Value above which the layer counts, in its own unit.")
    distance_min: float = parameter(
        0.0, "Least distance that is fully selected.", unit="m", ge=0, le=1e9
    )
    distance_max: float = parameter(
        50.0, "Greatest distance that is fully selected.", unit="m", ge=0, le=1e9
    )
    distance_blend: float = parameter(
        150.0, "Over how many metres the mask fades out on either side.", unit="m", ge=0, le=1e9
    )

    presets: ClassVar = {
        "shore": {"layer": "mask_shore", "target": "coast", "distance_max": 30.0},
        "away_from_the_border": {
            "layer": "mask_inland",
            "target": "border",
            "distance_min": 500.0,
            "distance_max": 1e9,
            "distance_blend": 500.0,
        },
    }

    @model_validator(mode="after")
    def _in_order(self) -> DistanceMask:
        if self.distance_min > self.distance_max:
            raise ValueError(
                f"distance_min = {self.distance_min:g}: must not be above "
                f"distance_max = {self.distance_max:g}"
            )
        if self.target == "layer" and not self.target_layer:
            raise ValueError('target_layer is missing; name one, such as target_layer = "slope"')
        return self

    def remedy(self) -> str:
        """Return how to select something."""
        what = {
            "layer": f"target_layer = {self.target_layer!r} > threshold = {self.threshold:g}",
            "coast": "the coast",
            "border": "the border",
        }[self.target]
        return (
            f"no ground lies {self.distance_min:g} to {self.distance_max:g} m from {what}; "
            "lower distance_min, raise distance_max or change the target"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        if self.target == "border":
            distance = _to_border(surface.shape, surface.spacing)
        elif self.target == "layer":
            distance = to_nearest(self._counting(surface), surface.spacing)
        else:
            if run.sea_level is None:
                raise ParameterError(
                    'target = "coast": this world has no sea; set sea_level in the recipe, or '
                    'target = "layer" or "border"'
                )
            land = surface.elevation >= F(run.sea_level)
            distance = np.where(
                land,
                to_nearest(~land, surface.spacing),
                to_nearest(land, surface.spacing),
            )
        selected = falling(distance, self.distance_max, self.distance_max + self.distance_blend)
        if self.distance_min > 0:
            foot = max(self.distance_min - self.distance_blend, 0.0)
            selected *= rising(distance, foot, self.distance_min)
        return np.where(np.isfinite(distance), selected, F(0))

    def _counting(self, surface: Heightfield) -> NDArray[np.bool_]:
        if self.target_layer not in surface:
            known = suggestion(self.target_layer, list(surface))
            raise ParameterError(
                f"target_layer = {self.target_layer!r}: the terrain has no such layer{known}"
            )
        return surface.layer(self.target_layer) > F(self.threshold)


def to_nearest(target: NDArray[np.bool_], spacing: float) -> Field:
    """Return the distance of every sample to the nearest of ``target``; infinite without any."""
    if not target.any():
        return np.full(target.shape, F(math.inf))
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~target, return_distances=False, return_indices=True)
    row, col = nearest[0].astype(np.int64), nearest[1].astype(np.int64)
    row -= np.arange(target.shape[0])[:, None]
    col -= np.arange(target.shape[1])[None, :]
    squared = row * row + col * col
    distance: NDArray[np.float64] = np.sqrt(squared.astype(np.float64)) * spacing
    return distance.astype(F)


def _to_border(shape: tuple[int, int], spacing: float) -> Field:
    row, col = (np.minimum(np.arange(n), np.arange(n)[::-1]) for n in shape)
    return (np.minimum(row[:, None], col[None, :]) * spacing).astype(F)
