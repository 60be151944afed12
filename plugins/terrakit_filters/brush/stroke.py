"""One recorded stroke of the brush, and what it covers of a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError, field_validator, model_validator
from pydantic_core.core_schema import ValidationInfo

from terrakit.heightfield import Grid
from terrakit.parameters import check_bounds, explain, parameter
from terrakit.world import FINE, parts

MOST_POINTS = 100_000
MOST_STROKES = 10_000
TOGETHER = 8
"""Segments that are looked at in one launch."""


class Stroke(BaseModel):
    """A line that was drawn with one tool, and how."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    tool: Literal["raise", "lower", "smooth", "flatten"] = parameter(
        ..., "What the brush does to the ground."
    )
    points: list[list[float]] = parameter(
        ..., "Corners [x, y] of the line, world metres; one point is a dab."
    )
    radius: float = parameter(..., "From the line to the brush's edge.", unit="m", gt=0, le=1e6)
    strength: float = parameter(
        ..., "Metres for raise and lower; for smooth and flatten a share, 0 to 1.", ge=0, le=1e5
    )
    hardness: float = parameter(
        0.3, "Share of the radius that works in full before the edge falls off.", ge=0, le=1
    )
    height: float | None = parameter(
        None, "Height to flatten to; that at the first point without it.", unit="m", ge=-1e6, le=1e6
    )

    @field_validator("*", mode="after")
    @classmethod
    def _bounds(cls, value: Any, info: ValidationInfo) -> Any:
        assert info.field_name is not None
        check_bounds(info.field_name, cls.model_fields[info.field_name], value)
        return value

    @field_validator("points", mode="before")
    @classmethod
    def _places(cls, points: Any) -> Any:
        if not isinstance(points, (list, tuple)) or not points:
            raise ValueError("must be a list of at least one point [x, y]")
        if len(points) > MOST_POINTS:
            raise ValueError(f"{len(points)} points > {MOST_POINTS}; draw it as several strokes")
        for at, point in enumerate(points, start=1):
            good = isinstance(point, (list, tuple)) and len(point) == 2
            if not good or not all(
                isinstance(c, (int, float)) and not isinstance(c, bool) and abs(c) <= 1e9
                for c in point
            ):
                raise ValueError(f"point {at} must be [x, y] in metres, within 1e9 m")
        return [[float(c) for c in point] for point in points]

    @model_validator(mode="after")
    def _fits_its_tool(self) -> Stroke:
        if self.radius < 1e-3:
            raise ValueError(f"radius = {self.radius:g}: must be at least 0.001 m; raise it")
        if self.tool in ("smooth", "flatten") and self.strength > 1:
            raise ValueError(
                f"strength = {self.strength:g}: must be 0 <= strength <= 1 for tool = {self.tool!r}"
            )
        if self.height is not None and self.tool != "flatten":
            raise ValueError(f"height = {self.height:g}: is for tool = 'flatten' only")
        return self


def checked(value: Any) -> list[Stroke]:
    """Return the strokes that a list of tables describes.

    Raises
    ------
    ValueError
        With the number of the stroke, its key, the value and the limit.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError("must be a list of strokes, each a table with tool, points and radius")
    if len(value) > MOST_STROKES:
        raise ValueError(f"{len(value)} strokes > {MOST_STROKES}; use several brush steps")
    strokes = []
    for number, table in enumerate(value, start=1):
        if not isinstance(table, (dict, Stroke)):
            raise ValueError(f"stroke {number} must be a table with tool, points and radius")
        try:
            strokes.append(table if isinstance(table, Stroke) else Stroke.model_validate(table))
        except ValidationError as error:
            raise ValueError(explain(error, Stroke, f"stroke {number}")) from None
    return strokes


@dataclass(frozen=True)
class Window:
    """A block of samples of a grid."""

    row: int
    col: int
    rows: int
    cols: int

    @property
    def part(self) -> tuple[slice, slice]:
        """The block, to index an array with."""
        return slice(self.row, self.row + self.rows), slice(self.col, self.col + self.cols)


@dataclass(frozen=True)
class Segments:
    """The line of a stroke as a grid sees it.

    Ends are whole parts of a sample from the world's origin, so that a sample's distance to them
    is the same in a tile as in the whole.
    """

    start: NDArray[np.int64]
    """x and y of where each segment begins, of shape (n, 2)."""
    along: NDArray[np.float32]
    """x and y of its end from there, in samples, and 1 over its squared length; (n, 3)."""

    @classmethod
    def of(cls, stroke: Stroke, spacing: float) -> Segments:
        """Return the segments of a stroke; a single point is a segment without length."""
        ends = np.array([[parts(c, spacing) for c in p] for p in stroke.points], dtype=np.int64)
        if len(ends) > 1:
            keep = np.concatenate([[True], (ends[1:] != ends[:-1]).any(axis=1)])
            ends = ends[keep]
        start, end = (ends[:-1], ends[1:]) if len(ends) > 1 else (ends, ends)
        step = (end - start).astype(np.float32) * np.float32(1 / FINE)
        squared = step[:, 0].astype(np.float64) ** 2 + step[:, 1].astype(np.float64) ** 2
        inverse = np.where(squared > 0, 1 / np.where(squared > 0, squared, 1.0), 0.0)
        return cls(start, np.hstack([step, inverse[:, None]]).astype(np.float32))

    def groups(self) -> list[slice]:
        """Return runs of neighbouring segments, to be looked at together."""
        return [slice(i, i + TOGETHER) for i in range(0, len(self.start), TOGETHER)]

    def reached(self, chosen: slice, radius: float, grid: Grid) -> Window | None:
        """Return the samples that some of the segments can reach, or None if there are none."""
        start = self.start[chosen].astype(np.float64) / FINE
        ends = np.concatenate([start, start + self.along[chosen, :2]])
        x, y = (parts(along, grid.spacing) / FINE for along in grid.north_west)
        # One sample more, for what rounding may move
        reach = radius / grid.spacing + 1.0
        row, rows = _reached(y - ends[:, 1], reach, grid.shape[0])
        col, cols = _reached(ends[:, 0] - x, reach, grid.shape[1])
        return Window(row, col, rows, cols) if rows > 0 and cols > 0 else None


def _reached(along: NDArray[np.float64], reach: float, count: int) -> tuple[int, int]:
    """Return the first sample within reach of some places, and how many there are."""
    first = min(max(float(along.min()) - reach, 0.0), float(count))
    last = min(max(float(along.max()) + reach, -1.0), count - 1.0)
    return math.ceil(first), math.floor(last) - math.ceil(first) + 1
