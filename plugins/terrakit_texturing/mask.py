"""What all masks share: the layer that they write, its edges, and what happens if it is empty."""

from __future__ import annotations

import re
from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.operators import Texture
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit.world import is_part

F = np.float32
Field = NDArray[np.float32]


class Mask(Texture):
    """Write a layer from 0 (not selected) to 1 (selected) that other steps can follow."""

    writes: ClassVar[tuple[str, ...]] = ("mask_",)
    fields: ClassVar[int] = 8

    layer: str = parameter("mask_new", "Name of the layer to write; begins with mask_.")
    invert: bool = parameter(False, "Whether to select everything else instead.")
    allow_empty: bool = parameter(
        False, "Whether a mask that selects nothing is fine, rather than an error.", advanced=True
    )

    @field_validator("layer")
    @classmethod
    def _named_as_a_mask(cls, layer: str) -> str:
        if not re.fullmatch(r"mask_[a-z0-9_]+", layer):
            raise ValueError("must begin with mask_, then small letters, digits or _")
        return layer

    @abstractmethod
    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return how much each sample is selected, 0 to 1."""
        raise NotImplementedError

    @abstractmethod
    def remedy(self) -> str:
        """Return which parameter to change, and how, where nothing is selected."""
        raise NotImplementedError

    def texture(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain with the mask."""
        selected = self.select(surface, run)
        if self.invert:
            selected = F(1) - selected
        if not (self.allow_empty or selected.any() or is_part(surface.grid, run.world)):
            remedy = "invert = true, but everything is selected" if self.invert else self.remedy()
            raise InputError(f"{self.layer} is 0 everywhere: {remedy}; or set allow_empty = true")
        return surface.with_layers(**{self.layer: selected})


def smooth(t: Field) -> Field:
    """Return the smooth step of a share: 0 below 0, 1 above 1, ``t^2 (3 - 2t)`` between."""
    t = np.minimum(np.maximum(t, F(0)), F(1))
    # Rounding may lift the product a bit above 1
    return np.minimum(t * t * (F(3) - F(2) * t), F(1))


def rising(value: Field, foot: float, top: float) -> Field:
    """Return 0 up to ``foot``, 1 from ``top`` on, smoothly between; a hard step if they meet."""
    start, end = F(foot), F(top)
    if not start < end:
        return (value >= end).astype(F)
    return smooth((value - start) / (end - start))


def falling(value: Field, top: float, foot: float) -> Field:
    """Return 1 up to ``top``, 0 from ``foot`` on, smoothly between; a hard step if they meet."""
    start, end = F(top), F(foot)
    if not start < end:
        return (value <= start).astype(F)
    return F(1) - smooth((value - start) / (end - start))


def tangents(surface: Heightfield) -> tuple[Field, Field]:
    """Return the rise to the south and to the east, metres a metre, by central differences."""
    south, east = np.gradient(surface.elevation, F(surface.spacing))
    return np.asarray(south, dtype=F), np.asarray(east, dtype=F)


def steepness(surface: Heightfield) -> Field:
    """Return the tangent of the slope."""
    south, east = tangents(surface)
    south *= south
    east *= east
    south += east
    return np.sqrt(south, out=south)
