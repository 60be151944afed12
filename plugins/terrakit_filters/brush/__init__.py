"""Replays strokes that somebody drew: the ground is raised, lowered, smoothed or flattened."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from terrakit.errors import InputError, ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit.world import FINE, is_part, parts
from terrakit_filters.brush import reference
from terrakit_filters.brush.stroke import Segments, Stroke, Window, checked

if TYPE_CHECKING:
    from terrakit.compute import Device, DeviceArray

F = np.float32
STEP = 0.2
"""Samples squared that one sweep may diffuse without ringing: below 1/4."""
LONGEST_STAGES = 63
FEWEST_ROUNDS = 12
"""Steps in time of which a smoothing is made: fewer damp too much."""
MOST_SWEEPS = 20_000


class Brush(Filter):
    """Replay brush strokes in order: raise, lower, smooth or flatten the ground along a line.

    A stroke works by the distance d to its line, so it is the same however densely its points were
    recorded, and never piles up on itself. With the weight w, 1 up to ``hardness`` of the radius
    and falling smoothly to 0 at the radius::

        raise, lower   z' = z +- strength w
        flatten        z' = z (1 - strength w) + height strength w
        smooth         dz/dt = div(w grad z)   until waves shorter than strength * radius are gone

    Smoothing is diffusion to the standard deviation ``strength * radius / 2`` at the line, whatever
    the spacing; nothing flows in or out of the brush, so the volume of the ground is kept.

    References
    ----------
    C. D. Meyer, D. S. Balsara and T. D. Aslam, "A stabilized Runge-Kutta-Legendre method for
    explicit super-time-stepping of parabolic and mixed equations", J. Comput. Phys. 257, 2014.
    """

    name = "brush"
    cites = ("Meyer, Balsara & Aslam 2014",)
    fields = 6
    locality = "global"
    turning: ClassVar = None
    idle: ClassVar = {"strokes": []}
    trial: ClassVar = {
        "strokes": [
            {
                "tool": "raise",
                "points": [[40.0, 50.0], [200.0, 90.0], [120.0, 30.0]],
                "radius": 45.0,
                "strength": 60.0,
            },
            {"tool": "lower", "points": [[150.0, 150.0]], "radius": 30.0, "strength": 25.0},
            {
                "tool": "smooth",
                "points": [[20.0, 120.0], [160.0, 140.0]],
                "radius": 60.0,
                "strength": 0.8,
            },
            {
                "tool": "flatten",
                "points": [[10.0, 20.0], [90.0, 30.0]],
                "radius": 30.0,
                "strength": 1.0,
                "hardness": 1.0,
            },
        ]
    }

    strokes: list[Stroke] = parameter(
        ..., "Strokes in order: tables of tool, points, radius, strength, hardness and height."
    )

    @field_validator("strokes", mode="before")
    @classmethod
    def _sound(cls, value: Any) -> Any:
        return checked(value)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after all strokes."""
        if not self.strokes:
            return surface
        windows = [self._window(i, surface.grid, run) for i in range(len(self.strokes))]
        # One of the two, with the same methods over its own kind of array
        device = run.device
        canvas: Any = _Canvas(surface) if device is None else _DeviceCanvas(surface, device)
        for index in run.steps(len(self.strokes)):
            window = windows[index]
            if window is not None:
                self._paint(index, window, canvas, run)
        return surface.with_layers(elevation=canvas.result())

    def _window(self, index: int, grid: Grid, run: Run) -> Window | None:
        stroke = self.strokes[index]
        window = Segments.of(stroke, grid.spacing).reached(slice(None), stroke.radius, grid)
        if window is None and not is_part(grid, run.world):
            (x, y), (width, height) = grid.north_west, grid.size
            px, py = stroke.points[0]
            raise InputError(
                f"strokes: stroke {index + 1} at ({px:g}, {py:g}) lies beside the terrain (x {x:g} "
                f"to {x + width:g} m, y {y - height:g} to {y:g} m); move it or leave it out"
            )
        return window

    def _paint(self, index: int, window: Window, canvas: Any, run: Run) -> None:
        stroke = self.strokes[index]
        weight = canvas.weight(stroke, window)
        if stroke.tool == "flatten":
            target = stroke.height
            if target is None:
                target = canvas.height_at(self._first_sample(index, canvas.grid))
            canvas.level(weight, window, stroke.strength, F(target))
        elif stroke.tool == "smooth":
            stages = self._stages(index, canvas.grid.spacing)
            rows, cols = window.row + window.rows // 2, window.col + window.cols // 2
            canvas.smooth(weight, window, stages, canvas.height_at((rows, cols)), run)
        else:
            sign = 1.0 if stroke.tool == "raise" else -1.0
            canvas.lift(weight, window, sign * stroke.strength)

    def _first_sample(self, index: int, grid: Grid) -> tuple[int, int]:
        """Return the sample nearest to where a stroke begins."""
        (px, py), (x, y) = self.strokes[index].points[0], grid.north_west
        row = math.floor((y - py) / grid.spacing + 0.5)
        col = math.floor((px - x) / grid.spacing + 0.5)
        if not (0 <= row < grid.shape[0] and 0 <= col < grid.shape[1]):
            raise InputError(
                f"strokes: stroke {index + 1} begins at ({px:g}, {py:g}), beside the terrain, "
                "where there is no height to flatten to; give it a height"
            )
        return row, col

    def _stages(self, index: int, spacing: float) -> list[tuple[float, float, float]]:
        """Return the factors of every sweep of a smoothing stroke."""
        stroke = self.strokes[index]
        spread = 0.5 * (0.5 * stroke.strength * stroke.radius / spacing) ** 2
        if spread == 0:
            return []
        longest = STEP * (LONGEST_STAGES**2 + LONGEST_STAGES) / 2
        rounds = max(FEWEST_ROUNDS, math.ceil(spread / longest)) if spread > STEP else 1
        share = spread / rounds
        count = next(s for s in range(1, LONGEST_STAGES + 1) if STEP * (s * s + s) / 2 >= share)
        if rounds * count > MOST_SWEEPS:
            raise ParameterError(
                f"strokes: stroke {index + 1}: radius = {stroke.radius:g}: smoothing takes "
                f"{rounds * count} sweeps at {spacing:g} m spacing, at most {MOST_SWEEPS}; use a "
                "smaller radius or strength, or a coarser terrain"
            )
        flow = 2.0 * share / (count * count + count)
        one = [(1.0, 0.0, flow)]
        one += [((2 * j - 1) / j, (1 - j) / j, (2 * j - 1) / j * flow) for j in range(2, count + 1)]
        return one * rounds


class _Canvas:
    """Heights on the host, painted on by the reference."""

    def __init__(self, surface: Heightfield) -> None:
        self.grid = surface.grid
        self.height = surface.elevation.copy()

    def result(self) -> NDArray[np.float32]:
        return self.height

    def height_at(self, sample: tuple[int, int]) -> float:
        return float(self.height[sample])

    def weight(self, stroke: Stroke, window: Window) -> NDArray[np.float32]:
        squared = np.full((window.rows, window.cols), reference.FAR)
        segments = Segments.of(stroke, self.grid.spacing)
        for chosen, block, x, y in _blocks(stroke, segments, self.grid, window):
            reference.cover(squared[block.part], segments, chosen, x, y)
        return reference.weigh(squared, *_edge(stroke, self.grid.spacing))

    def lift(self, weight: NDArray[np.float32], window: Window, amount: float) -> None:
        part = self.height[window.part]
        part[...] = reference.lift(part, weight, amount)

    def level(
        self, weight: NDArray[np.float32], window: Window, share: float, target: np.float32
    ) -> None:
        part = self.height[window.part]
        part[...] = reference.level(part, weight, share, target)

    def smooth(
        self,
        weight: NDArray[np.float32],
        window: Window,
        stages: list[tuple[float, float, float]],
        base: float,
        run: Run,
    ) -> None:
        part = self.height[window.part]
        now = part - F(base)
        before = now
        for factors in stages:
            run.check()
            before, now = now, reference.smooth(now, before, weight, factors)
        part[...] = np.where(weight > F(0), now + F(base), part)


class _DeviceCanvas:
    """Heights on a device, painted on by kernels."""

    def __init__(self, surface: Heightfield, device: Device) -> None:
        self.grid = surface.grid
        self.device = device
        self.height = device.copy(surface.on(device))
        self.program = device.program(__file__, "brush.cl")

    def result(self) -> DeviceArray:
        self.device.finish()
        return self.height

    def height_at(self, sample: tuple[int, int]) -> float:
        found = self.device.empty(1)
        index = np.int32(sample[0] * self.grid.shape[1] + sample[1])
        self.program.launch("brush_probe", 1, self.height, found, index)
        return float(found.download()[0])

    def weight(self, stroke: Stroke, window: Window) -> DeviceArray:
        squared = self.device.full((window.rows, window.cols), float(reference.FAR))
        segments = Segments.of(stroke, self.grid.spacing)
        start, along = self.device.upload(segments.start), self.device.upload(segments.along)
        for chosen, block, x, y in _blocks(stroke, segments, self.grid, window):
            self._launch(
                "brush_cover",
                block,
                squared,
                start,
                along,
                np.int32(chosen.start),
                np.int32(len(segments.start[chosen])),
                np.int64(x),
                np.int64(y),
                np.int64(FINE),
                np.int32(block.row * window.cols + block.col),
                np.int32(window.cols),
            )
        inner, falloff = _edge(stroke, self.grid.spacing)
        self._launch("brush_weigh", window, squared, F(inner), F(falloff))
        return squared

    def lift(self, weight: DeviceArray, window: Window, amount: float) -> None:
        self._launch("brush_lift", window, self.height, weight, F(amount), *self._place(window))

    def level(self, weight: DeviceArray, window: Window, share: float, target: np.float32) -> None:
        place = self._place(window)
        self._launch("brush_level", window, self.height, weight, F(share), target, *place)

    def smooth(
        self,
        weight: DeviceArray,
        window: Window,
        stages: list[tuple[float, float, float]],
        base: float,
        run: Run,
    ) -> None:
        now = self.device.empty((window.rows, window.cols))
        place = self._place(window)
        self._launch("brush_take", window, self.height, now, F(base), *place)
        before = self.device.copy(now)
        for factors in stages:
            run.check()
            self._launch("brush_smooth", window, now, before, weight, *(F(f) for f in factors))
            before, now = now, before
        self._launch("brush_put", window, self.height, now, weight, F(base), *place)

    def _place(self, window: Window) -> tuple[np.int32, np.int32]:
        cols = self.grid.shape[1]
        return np.int32(window.row * cols + window.col), np.int32(cols)

    def _launch(self, kernel: str, window: Window, *arguments: Any) -> None:
        self.program.launch(
            kernel,
            (window.rows,) if self.device.is_cpu else (window.rows, window.cols),
            *arguments,
            np.int32(window.rows),
            np.int32(window.cols),
            local=(4,) if self.device.is_cpu else None,
        )


def _edge(stroke: Stroke, spacing: float) -> tuple[float, float]:
    """Return where the brush's edge begins, and 1 over its width, in samples."""
    radius = stroke.radius / spacing
    inner = stroke.hardness * radius
    return inner, 1.0 / max(radius - inner, 1e-6 * radius)


def _blocks(stroke: Stroke, segments: Segments, grid: Grid, window: Window) -> Any:
    """Yield groups of segments, the block of the window that they reach, and where it lies."""
    x, y = (parts(along, grid.spacing) for along in grid.north_west)
    for chosen in segments.groups():
        block = segments.reached(chosen, stroke.radius, grid)
        if block is not None:
            place = x + block.col * FINE, y - block.row * FINE
            inner = Window(block.row - window.row, block.col - window.col, block.rows, block.cols)
            yield chosen, inner, *place
