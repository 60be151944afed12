"""Gives a terrain another spacing, or the samples of another step."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from terrakit.errors import InputError, ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import StepName, parameter
from terrakit.running import Run
from terrakit_filters.sampling import Numbers, resampled, taken_along

MOST_SAMPLES = 2**28


class Resample(Filter):
    """Take the terrain and all its layers to a finer or coarser grid.

    Finer samples lie on cubics through the old ones (Catmull & Rom), so those that both grids
    share keep their values. Coarser samples are means under a tent as wide as the new spacing, so
    that no detail finer than they can show is folded into them. Planes stay planes. Layers are
    taken linearly, numbered layers (plates, ``valid``) from the nearest sample.

    The first sample in the north-west stays where it is; at most one new spacing of ground is lost
    in the east and the south, where the extent is no multiple of it.

    References
    ----------
    E. Catmull and R. Rom, "A class of local interpolating splines", 1974. P. Heckbert,
    "Fundamentals of texture mapping and image warping", 1989 (prefiltering).
    """

    name = "resample"
    cites = ("Catmull & Rom 1974", "Heckbert 1989")
    fields = 12
    locality = "global"
    changes_grid = True
    turning: ClassVar = None
    trial: ClassVar = {"spacing": 7.0}

    spacing: float | None = parameter(
        None, "Distance between the new samples.", unit="m", ge=1e-6, le=1e9
    )
    like: StepName | None = parameter(
        None, "An earlier step in place of a spacing, whose samples to take."
    )
    method: Literal["smooth", "pick"] = parameter(
        "smooth", "smooth takes means where it coarsens, pick the values at the very places."
    )

    @model_validator(mode="after")
    def _something(self) -> Resample:
        if self.spacing is None and self.like is None:
            raise ValueError("needs spacing (metres) or like (an earlier step); neither is given")
        return self

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return the new grid; only a run knows that of another step."""
        if self.like is not None or self.spacing is None:
            return None
        rows, cols = (
            math.floor((n - 1) * grid.spacing / self.spacing * (1 + 1e-12) + 1e-9) + 1
            for n in grid.shape
        )
        if min(rows, cols) < 2:
            raise InputError(
                f"spacing = {self.spacing:g}: leaves {rows}x{cols} samples of a terrain of "
                f"{grid.size[0]:g} x {grid.size[1]:g} m; use a smaller one"
            )
        if rows * cols > MOST_SAMPLES:
            raise InputError(
                f"spacing = {self.spacing:g}: makes {rows}x{cols} = {rows * cols} samples > "
                f"{MOST_SAMPLES}; use a larger one"
            )
        return Grid((rows, cols), self.spacing, grid.north_west, grid.crs)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain on the new grid."""
        old = surface.grid
        new = self.grid_after(old) or self._of_step(old, run)
        step = new.spacing / old.spacing
        (x, y), (old_x, old_y) = new.north_west, old.north_west
        row = _settled((old_y - y) / old.spacing + np.arange(new.shape[0]) * step)
        col = _settled((x - old_x) / old.spacing + np.arange(new.shape[1]) * step)
        width = 1.0 if self.method == "pick" else step
        run.check()
        return taken_along(surface, new, lambda field, way: resampled(field, row, col, width, way))

    def _of_step(self, old: Grid, run: Run) -> Grid:
        assert self.like is not None
        other = run.named(self.like)
        if not isinstance(other, Heightfield):
            raise ParameterError(f"like = {self.like!r}: is a mesh; name a step with a grid")
        new = other.grid
        slack = 1e-6 * old.spacing
        (x, y), (old_x, old_y) = new.north_west, old.north_west
        if (
            x < old_x - slack
            or y > old_y + slack
            or x + new.size[0] > old_x + old.size[0] + slack
            or y - new.size[1] < old_y - old.size[1] - slack
        ):
            raise InputError(
                f"like = {self.like!r}: reaches from ({x:g}, {y - new.size[1]:g}) to "
                f"({x + new.size[0]:g}, {y:g}) m, beyond this terrain; crop that step first"
            )
        return new


def _settled(at: NDArray[np.floating[Any]]) -> Numbers:
    """Return places with those that are a sample's but for rounding put exactly there."""
    whole = np.floor(at + 0.5)
    return np.where(np.abs(at - whole) < 1e-7, whole, at).astype(np.float64)
