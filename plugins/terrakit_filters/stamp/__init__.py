"""Presses another terrain into this one: a crater, a volcano, a hill."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import field_validator, model_validator

from terrakit.errors import InputError, ParameterError
from terrakit.heightfield import Field, Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import StepName, parameter
from terrakit.running import Run
from terrakit.sources import Chain
from terrakit.world import is_part, sample_axes
from terrakit_filters.sampling import F, Numbers, sampled

BLOCK = 256
"""Rows that are stamped at once, so that memory stays small."""

MOST_SAMPLES = 8193
"""Samples a side of a stamp that is made here."""


class Stamp(Filter):
    """Put another terrain down at a place, turned and scaled, with a soft edge.

    A sample p of the terrain takes the height of the stamp at ``q = R(-angle) (p - at) / scale``
    from the stamp's own middle, times ``height_scale`` plus ``offset``::

        z' = z + w (blend(z, h s(q) + o) - z)        blend: sum, greater, smaller or the stamp
        w  = 1 inside, falling to 0 over the last ``feather`` metres before the edge

    A chain of operators is made about its own middle, wherever it is put, so that moving the stamp
    does not change its shape; a step is taken as it is. Between its samples the stamp is a cubic
    (Catmull & Rom).

    References
    ----------
    E. Catmull and R. Rom, "A class of local interpolating splines", 1974.
    """

    name = "stamp"
    cites = ("Catmull & Rom 1974",)
    fields = 8
    locality = "pointwise"
    turning: ClassVar = None
    trial: ClassVar = {"stamp": 40.0, "radius": 90.0, "feather": 30.0}

    stamp: float | Chain | None = parameter(
        None,
        "The stamp: operators that make a terrain, or a height.",
        unit="m",
        ge=-1e6,
        le=1e6,
    )
    from_step: StepName | None = parameter(
        None, "An earlier step to stamp, of any size; it goes before stamp."
    )
    at: list[float] | None = parameter(
        None, "World x and y of the stamp's middle; the middle of the world without it.", unit="m"
    )
    radius: float = parameter(
        1000.0,
        "From the stamp's middle to its edge, after scaling.",
        unit="m",
        ge=1e-3,
        le=1e6,
    )
    outline: Literal["disc", "square"] = parameter(
        "disc", "Outline of the stamp; a square turns with it."
    )
    feather: float = parameter(
        300.0, "Width of the soft edge, inside the outline; 0 is sharp.", unit="m", ge=0, le=1e6
    )
    mode: Literal["add", "max", "min", "replace"] = parameter(
        "add", "Add the stamp's height, take the greater or smaller of the two, or replace."
    )
    angle: float = parameter(
        0.0, "How far to turn, counter-clockwise seen from above.", unit="deg", ge=-360, le=360
    )
    scale: float = parameter(1.0, "How much wider the stamp becomes.", ge=1e-4, le=1e4)
    height_scale: float = parameter(1.0, "What its heights are multiplied by.", ge=-1e4, le=1e4)
    offset: float = parameter(0.0, "What is added to its heights.", unit="m", ge=-1e6, le=1e6)

    @field_validator("at")
    @classmethod
    def _a_place(cls, at: list[float] | None) -> list[float] | None:
        if at is not None and len(at) != 2:
            raise ValueError("must be [x, y] in metres")
        return at

    @model_validator(mode="after")
    def _something(self) -> Stamp:
        if self.stamp is None and self.from_step is None:
            raise ValueError("needs stamp (operators or a height) or from_step (an earlier step)")
        return self

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain with the stamp."""
        x, y = sample_axes(surface.grid)
        middle = self._middle(surface.grid, run)
        reach = self.radius * (math.sqrt(2.0) if self.outline == "square" else 1.0)
        cols = slice(*np.searchsorted(x, [middle[0] - reach, middle[0] + reach]).tolist())
        rows = slice(*np.searchsorted(-y, [-middle[1] - reach, reach - middle[1]]).tolist())
        if cols.start == cols.stop or rows.start == rows.stop:
            if is_part(surface.grid, run.world):
                return surface
            raise InputError(
                f"at = [{middle[0]:g}, {middle[1]:g}], radius = {self.radius:g}: no sample of the "
                f"terrain lies there (x {x[0]:g} to {x[-1]:g}, y {y[-1]:g} to {y[0]:g} m); move it"
            )
        stamp = self._stamp(surface, reach, run)
        elevation = surface.elevation.copy()
        for first in range(rows.start, rows.stop, BLOCK):
            run.check()
            part = slice(first, min(first + BLOCK, rows.stop)), cols
            east, north = (x[cols] - middle[0])[None, :], (y[part[0]] - middle[1])[:, None]
            elevation[part] = self._pressed(elevation[part], stamp, east, north)
        return surface.with_layers(elevation=elevation)

    def _pressed(
        self, height: Field, stamp: Heightfield | None, east: Numbers, north: Numbers
    ) -> Field:
        """Return heights after the stamp, at places relative to its middle."""
        turn = math.radians(self.angle)
        cosine, sine = math.cos(turn), math.sin(turn)
        u, v = cosine * east + sine * north, cosine * north - sine * east
        if self.outline == "disc":
            beyond = np.sqrt(east * east + north * north) - (self.radius - self._feather)
        else:
            beyond = np.maximum(np.abs(u), np.abs(v)) - (self.radius - self._feather)
        t = np.minimum(np.maximum(beyond / self._feather, 0.0), 1.0)
        weight = 1.0 - t * t * (3.0 - 2.0 * t)
        raised: float | Numbers
        if stamp is not None:
            raised = self._height_of(stamp, u, v)
        else:
            assert isinstance(self.stamp, (int, float))
            raised = float(self.stamp)
        pressed = raised * self.height_scale + self.offset
        before = height.astype(np.float64)
        if self.mode == "add":
            blend = before + pressed
        elif self.mode == "max":
            blend = np.maximum(before, pressed)
        elif self.mode == "min":
            blend = np.minimum(before, pressed)
        else:
            blend = np.broadcast_to(pressed, before.shape)
        result: Field = (before * (1.0 - weight) + blend * weight).astype(F)
        return np.where(weight > 0.0, result, height)

    def _height_of(self, stamp: Heightfield, u: Numbers, v: Numbers) -> Numbers:
        unit = self.scale * stamp.spacing
        col = 0.5 * (stamp.shape[1] - 1) + u / unit
        row = 0.5 * (stamp.shape[0] - 1) - v / unit
        return sampled(stamp.elevation, row, col, "cubic").astype(np.float64)

    @property
    def _feather(self) -> float:
        """The soft edge; never quite nothing, so that it can be divided by."""
        return max(min(self.feather, self.radius), 1e-9 * self.radius)

    def _middle(self, grid: Grid, run: Run) -> tuple[float, float]:
        if self.at is not None:
            return self.at[0], self.at[1]
        world = grid if run.world is None else run.world
        (x, y), (width, height) = world.north_west, world.size
        return x + 0.5 * width, y - 0.5 * height

    def _stamp(self, surface: Heightfield, reach: float, run: Run) -> Heightfield | None:
        """Return the stamp's terrain; None where it is one height."""
        if self.from_step is not None:
            return self._step(run)
        if not isinstance(self.stamp, Chain):
            return None
        spacing = surface.spacing / self.scale
        half = math.ceil(reach / surface.spacing) + 1
        if 2 * half + 1 > MOST_SAMPLES:
            raise ParameterError(
                f"radius = {self.radius:g}: the stamp would have {2 * half + 1} samples a side, "
                f"at most {MOST_SAMPLES}; lower radius or use a coarser terrain"
            )
        grid = Grid((2 * half + 1,) * 2, spacing, (-half * spacing, half * spacing))
        alone = run.for_step(run.step)
        alone.world = grid
        return alone.terrain(self.stamp, grid)

    def _step(self, run: Run) -> Heightfield:
        assert self.from_step is not None
        found = run.named(self.from_step)
        if not isinstance(found, Heightfield):
            raise ParameterError(f"from_step = {self.from_step!r}: is a mesh; name a grid")
        least = 0.5 * self.scale * min(found.grid.size)
        if least < self.radius * (1 - 1e-9):
            raise ParameterError(
                f"radius = {self.radius:g}: from_step = {self.from_step!r} reaches only {least:g} "
                "m from its middle; lower radius or raise scale"
            )
        return found
