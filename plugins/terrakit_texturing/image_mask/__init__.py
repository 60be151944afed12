"""A mask that was painted: a picture laid over the terrain."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import field_validator

from terrakit.errors import InputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.parameters import FilePath, parameter
from terrakit.running import Run
from terrakit.world import sample_axes
from terrakit_texturing.image_mask.picture import read_picture, stretched
from terrakit_texturing.mask import Field, Mask


class ImageMask(Mask):
    """Select what is bright in a picture that is laid over the terrain, north up.

    The middles of the picture's outermost pixels lie on the outermost samples, or on the sides of
    ``bounds``, so a picture with a pixel for every sample is taken as it is. Others are stretched:
    between pixels linearly, and where pixels are finer than samples with the mean around them
    (a tent as wide as the greater of the two).

    References
    ----------
    P. Heckbert, "Fundamentals of texture mapping and image warping", 1989 (resampling).
    """

    name = "image_mask"
    cites = ("Heckbert 1989",)
    fields = 12
    locality = "global"
    turning: ClassVar = None
    trial: ClassVar = {"picture": str(Path(__file__).with_name("trial.png"))}

    layer: str = parameter("mask_image", "Name of the layer to write; begins with mask_.")
    picture: FilePath = parameter(
        ..., "Picture file (PNG, JPEG, BMP, PGM or TIFF); white is selected, the top is north."
    )
    channel: Literal["luminance", "red", "green", "blue", "alpha"] = parameter(
        "luminance", "What of the picture counts; luminance takes what is transparent for black."
    )
    fit: Literal["stretch", "exact"] = parameter(
        "stretch", "stretch takes a picture of any size, exact wants a pixel for every sample."
    )
    bounds: list[float] | None = parameter(
        None,
        "West, south, east and north side of the picture in metres; all of it without.",
        unit="m",
    )

    @field_validator("bounds")
    @classmethod
    def _four_sides(cls, bounds: list[float] | None) -> list[float] | None:
        if bounds is not None and (
            len(bounds) != 4 or not (bounds[0] < bounds[2] and bounds[1] < bounds[3])
        ):
            raise ValueError("must be [west, south, east, north] with west < east, south < north")
        if bounds is not None and (
            max(abs(side) for side in bounds) > 1e9
            or min(bounds[2] - bounds[0], bounds[3] - bounds[1]) < 1e-3
        ):
            raise ValueError("sides must lie within 1e9 m and at least 0.001 m apart")
        return bounds

    def remedy(self) -> str:
        """Return how to select something."""
        return (
            f"picture = {Path(self.picture).name!r} is black in {self.channel} where it covers "
            "the terrain; check channel and bounds"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        name = Path(self.picture).name
        picture = read_picture(run.file(self.picture), self.channel)
        run.check()
        whole = self._whole(surface, run)
        if self.fit == "exact" and picture.shape != whole.shape:
            raise InputError(
                f"picture = {name!r}: has {picture.shape[1]}x{picture.shape[0]} pixels, the "
                f'terrain {whole.shape[1]}x{whole.shape[0]} samples; set fit = "stretch"'
            )
        if self.bounds is not None:
            west, south, east, north = self.bounds
        else:
            west, north = whole.north_west
            east, south = west + whole.size[0], north - whole.size[1]
        x, y = sample_axes(surface.grid)
        selected = stretched(picture, x, y, (west, south, east, north), surface.spacing)
        return np.ascontiguousarray(selected)

    def _whole(self, surface: Heightfield, run: Run) -> Grid:
        """Return what the picture covers: the world, of which the terrain may be a tile."""
        world = run.world
        if world is None or self.bounds is not None:
            return surface.grid
        return world if world.spacing == surface.spacing else surface.grid
