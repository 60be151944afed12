"""Erosions as textbooks have them, in plain NumPy and for numba: what many people begin with.

They are here to be measured against. None is bit-identical between machines, accounts for its
rock, or counts in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

TIME_STEP = 0.1
GRAVITY = 9.81
CAPACITY, DISSOLVING, SETTLING, DRYING = 0.1, 0.1, 0.1, 0.003

LIFETIME = 30
"""Steps that a drop lives."""
RADIUS = 3
"""Samples around a drop that it digs in."""
INERTIA, LOAD, PICK_UP, LAY_DOWN, EVAPORATION, LEAST_SLOPE = 0.05, 4.0, 0.3, 0.3, 0.01, 0.01


def talus(height: Floats, drop: float, sweeps: int) -> Floats:
    """Return the ground after sweeps in which slopes beyond ``drop`` a sample slide.

    A quarter of the largest excess leaves for the lower of eight neighbours, by their excess
    (Musgrave, Kolb & Mace 1989).
    """
    height = height.copy()
    for _ in range(sweeps):
        excess = []
        for down, right in _EIGHT:
            least = drop * math.hypot(down, right)
            excess.append(np.maximum(height - _shifted(height, down, right) - least, 0.0))
        total = sum(excess)
        most = np.maximum.reduce(excess)
        share = np.where(total > 0, 0.25 * most / np.where(total > 0, total, 1.0), 0.0)
        moved = [share * part for part in excess]
        height -= sum(moved)
        for (down, right), part in zip(_EIGHT, moved, strict=True):
            height += _shifted(part, -down, -right, 0.0)
    return height


def pipes(height: Floats, iterations: int) -> Floats:
    """Return the ground after water in virtual pipes has worked on it (Mei, Decaudin & Hu 2007)."""
    ground = height.copy()
    water, load = np.full_like(ground, 0.1), np.zeros_like(ground)
    north, south, west, east = (np.zeros_like(ground) for _ in range(4))
    row, col = np.indices(ground.shape, np.float32)
    for _ in range(iterations):
        level = ground + water
        for flux, (down, right) in (
            (north, (-1, 0)),
            (south, (1, 0)),
            (west, (0, -1)),
            (east, (0, 1)),
        ):
            flux += TIME_STEP * GRAVITY * (level - _shifted(level, down, right))
            np.maximum(flux, 0.0, out=flux)
        out = (north + south + west + east) * TIME_STEP
        share = np.minimum(1.0, water / np.maximum(out, 1e-9)).astype(np.float32)
        for flux in (north, south, west, east):
            flux *= share
        from_north, from_south = _shifted(south, -1, 0, 0.0), _shifted(north, 1, 0, 0.0)
        from_west, from_east = _shifted(east, 0, -1, 0.0), _shifted(west, 0, 1, 0.0)
        came = (from_north + from_south + from_west + from_east) * TIME_STEP
        after = water + came - out * share
        mean = np.maximum(0.5 * (water + after), 1e-3)
        u = 0.5 * (from_west - west + east - from_east) / mean
        v = 0.5 * (from_north - north + south - from_south) / mean
        rise = 0.5 * (_shifted(ground, 1, 0) - _shifted(ground, -1, 0))
        run = 0.5 * (_shifted(ground, 0, 1) - _shifted(ground, 0, -1))
        steep = rise * rise + run * run
        tilt = np.maximum(np.sqrt(steep / (1.0 + steep)), 0.05)
        lack = CAPACITY * tilt * np.sqrt(u * u + v * v) - load
        taken = np.where(lack > 0, DISSOLVING, SETTLING) * lack
        ground -= taken
        load += taken
        load = _at(load, row - v * TIME_STEP, col - u * TIME_STEP)
        water = after * (1.0 - DRYING * TIME_STEP)
    return ground


def drops(height: Floats, count: int, at_once: int = 4096) -> Floats:
    """Return the ground after drops, many of which run side by side (Beyer 2015)."""
    ground = height.copy()
    rows, cols = ground.shape
    random = np.random.default_rng(7)
    brush, weights = brush_of(RADIUS)
    for first in range(0, count, at_once):
        n = min(at_once, count - first)
        y, x = (
            random.uniform(RADIUS, rows - RADIUS - 2, n),
            random.uniform(RADIUS, cols - RADIUS - 2, n),
        )
        way_y, way_x, load = np.zeros(n), np.zeros(n), np.zeros(n)
        speed, water = np.ones(n), np.ones(n)
        for _ in range(LIFETIME):
            old_y, old_x = y, x
            here, slope_y, slope_x = _slope(ground, y, x)
            way_y = way_y * INERTIA - slope_y * (1.0 - INERTIA)
            way_x = way_x * INERTIA - slope_x * (1.0 - INERTIA)
            length = np.maximum(np.hypot(way_y, way_x), 1e-9)
            way_y, way_x = way_y / length, way_x / length
            y, x = y + way_y, x + way_x
            inside = (
                (y >= RADIUS) & (y < rows - RADIUS - 2) & (x >= RADIUS) & (x < cols - RADIUS - 2)
            )
            if not inside.any():
                break
            y, x, old_y, old_x = y[inside], x[inside], old_y[inside], old_x[inside]
            way_y, way_x, load = way_y[inside], way_x[inside], load[inside]
            speed, water, here = speed[inside], water[inside], here[inside]
            fall = here - _slope(ground, y, x)[0]
            room = np.maximum(fall, LEAST_SLOPE) * speed * water * LOAD
            settles = (load > room) | (fall < 0)
            down = np.where(fall < 0, np.minimum(-fall, load), (load - room) * LAY_DOWN) * settles
            up = np.where(settles, 0.0, np.minimum((room - load) * PICK_UP, fall))
            top, left = old_y.astype(np.intp), old_x.astype(np.intp)
            low, side = old_y - top, old_x - left
            for dy, dx, share in (
                (0, 0, (1 - low) * (1 - side)),
                (0, 1, (1 - low) * side),
                (1, 0, low * (1 - side)),
                (1, 1, low * side),
            ):
                np.add.at(ground, (top + dy, left + dx), down * share)
            for (dy, dx), weight in zip(brush, weights, strict=True):
                np.add.at(ground, (top + dy, left + dx), -up * weight)
            load += up - down
            speed = np.sqrt(np.maximum(speed * speed + fall * GRAVITY, 0.0))
            water = water * (1.0 - EVAPORATION)
    return ground


def brush_of(radius: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the samples around a drop, and what share of its digging each takes."""
    down, right = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    weight = np.maximum(radius - np.hypot(down, right), 0.0)
    some = weight > 0
    return np.stack((down[some], right[some]), axis=1), weight[some] / weight.sum()


def compiled_pipes(numba: Any) -> Callable[[Floats, int], Floats]:
    """Return :func:`pipes` as loops that numba compiles and shares between threads."""

    @numba.njit(parallel=True, fastmath=True)
    def flow(ground, water, flux):  # type: ignore[no-untyped-def]
        rows, cols = ground.shape
        for row in numba.prange(rows):
            for col in range(cols):
                level = ground[row, col] + water[row, col]
                total = 0.0
                for k in range(4):
                    r = row + (k == 1) - (k == 0)
                    c = col + (k == 3) - (k == 2)
                    new = 0.0
                    if 0 <= r < rows and 0 <= c < cols:
                        fall = level - ground[r, c] - water[r, c]
                        new = max(0.0, flux[k, row, col] + TIME_STEP * GRAVITY * fall)
                    flux[k, row, col] = new
                    total += new
                if total * TIME_STEP > water[row, col]:
                    share = water[row, col] / (total * TIME_STEP)
                    for k in range(4):
                        flux[k, row, col] *= share

    @numba.njit(parallel=True, fastmath=True)
    def erode(ground, water, flux, load, new_ground, new_water, carried, speed):  # type: ignore[no-untyped-def]
        rows, cols = ground.shape
        for row in numba.prange(1, rows - 1):
            for col in range(1, cols - 1):
                north, south = flux[1, row - 1, col], flux[0, row + 1, col]
                west, east = flux[3, row, col - 1], flux[2, row, col + 1]
                out = flux[0, row, col] + flux[1, row, col] + flux[2, row, col] + flux[3, row, col]
                after = water[row, col] + TIME_STEP * (north + south + west + east - out)
                mean = max(0.5 * (water[row, col] + after), 1e-3)
                u = 0.5 * (west - flux[2, row, col] + flux[3, row, col] - east) / mean
                v = 0.5 * (north - flux[0, row, col] + flux[1, row, col] - south) / mean
                rise = 0.5 * (ground[row + 1, col] - ground[row - 1, col])
                run = 0.5 * (ground[row, col + 1] - ground[row, col - 1])
                steep = rise * rise + run * run
                tilt = max(math.sqrt(steep / (1.0 + steep)), 0.05)
                lack = CAPACITY * tilt * math.sqrt(u * u + v * v) - load[row, col]
                taken = (DISSOLVING if lack > 0 else SETTLING) * lack
                new_ground[row, col] = ground[row, col] - taken
                carried[row, col] = load[row, col] + taken
                new_water[row, col] = after * (1.0 - DRYING * TIME_STEP)
                speed[0, row, col], speed[1, row, col] = u, v

    @numba.njit(parallel=True, fastmath=True)
    def advect(load, carried, speed):  # type: ignore[no-untyped-def]
        rows, cols = load.shape
        for row in numba.prange(rows):
            for col in range(cols):
                y = min(max(row - speed[1, row, col] * TIME_STEP, 0.0), rows - 1.001)
                x = min(max(col - speed[0, row, col] * TIME_STEP, 0.0), cols - 1.001)
                top, left = int(y), int(x)
                low, side = y - top, x - left
                upper = carried[top, left] * (1 - side) + carried[top, left + 1] * side
                lower = carried[top + 1, left] * (1 - side) + carried[top + 1, left + 1] * side
                load[row, col] = upper * (1 - low) + lower * low

    def run(height: Floats, iterations: int) -> Floats:
        ground, water = height.copy(), np.full_like(height, 0.1)
        new_ground, new_water = ground.copy(), water.copy()
        load, carried = np.zeros_like(height), np.zeros_like(height)
        flux = np.zeros((4, *height.shape), np.float32)
        speed = np.zeros((2, *height.shape), np.float32)
        for _ in range(iterations):
            flow(ground, water, flux)
            erode(ground, water, flux, load, new_ground, new_water, carried, speed)
            advect(load, carried, speed)
            ground, new_ground = new_ground, ground
            water, new_water = new_water, water
        return ground

    return run


def compiled_drops(numba: Any) -> Callable[[Floats, int], Floats]:
    """Return :func:`drops` as a loop over single drops, in one thread: two would race."""
    brush, weights = brush_of(RADIUS)

    @numba.njit(fastmath=True)
    def slope(ground, y, x):  # type: ignore[no-untyped-def]
        top, left = int(y), int(x)
        low, side = y - top, x - left
        a, b = ground[top, left], ground[top, left + 1]
        c, d = ground[top + 1, left], ground[top + 1, left + 1]
        here = (a * (1 - side) + b * side) * (1 - low) + (c * (1 - side) + d * side) * low
        return here, (c - a) * (1 - side) + (d - b) * side, (b - a) * (1 - low) + (d - c) * low

    @numba.njit(fastmath=True)
    def run(ground, starts):  # type: ignore[no-untyped-def]
        rows, cols = ground.shape
        for n in range(len(starts)):
            y = RADIUS + starts[n, 0] * (rows - 2 * RADIUS - 2)
            x = RADIUS + starts[n, 1] * (cols - 2 * RADIUS - 2)
            way_y, way_x, load, speed, water = 0.0, 0.0, 0.0, 1.0, 1.0
            for _ in range(LIFETIME):
                old_y, old_x = y, x
                here, slope_y, slope_x = slope(ground, y, x)
                way_y = way_y * INERTIA - slope_y * (1.0 - INERTIA)
                way_x = way_x * INERTIA - slope_x * (1.0 - INERTIA)
                length = math.sqrt(way_y * way_y + way_x * way_x)
                if length < 1e-9:
                    break
                way_y, way_x = way_y / length, way_x / length
                y, x = y + way_y, x + way_x
                if not (RADIUS <= y < rows - RADIUS - 2 and RADIUS <= x < cols - RADIUS - 2):
                    break
                fall = here - slope(ground, y, x)[0]
                room = max(fall, LEAST_SLOPE) * speed * water * LOAD
                top, left = int(old_y), int(old_x)
                if load > room or fall < 0:
                    down = min(-fall, load) if fall < 0 else (load - room) * LAY_DOWN
                    load -= down
                    low, side = old_y - top, old_x - left
                    ground[top, left] += down * (1 - low) * (1 - side)
                    ground[top, left + 1] += down * (1 - low) * side
                    ground[top + 1, left] += down * low * (1 - side)
                    ground[top + 1, left + 1] += down * low * side
                else:
                    up = min((room - load) * PICK_UP, fall)
                    load += up
                    for k in range(len(weights)):
                        ground[top + brush[k, 0], left + brush[k, 1]] -= up * weights[k]
                speed = math.sqrt(max(speed * speed + fall * GRAVITY, 0.0))
                water *= 1.0 - EVAPORATION
        return ground

    def work(height: Floats, count: int) -> Floats:
        ground: Floats = run(height.copy(), np.random.default_rng(7).random((count, 2)))
        return ground

    return work


_EIGHT = tuple((y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0))


def _shifted(field: Floats, down: int, right: int, beyond: float | None = None) -> Floats:
    """Return each sample's neighbour; beyond the edge the sample itself, or a number."""
    rows, cols = field.shape
    moved = field.copy() if beyond is None else np.full_like(field, beyond)
    here = slice(max(0, -down), rows - max(0, down)), slice(max(0, -right), cols - max(0, right))
    there = slice(max(0, down), rows - max(0, -down)), slice(max(0, right), cols - max(0, -right))
    moved[here] = field[there]
    return moved


def _at(field: Floats, row: NDArray[Any], col: NDArray[Any]) -> Floats:
    """Return the field between its samples."""
    row = np.clip(row, 0.0, field.shape[0] - 1.001)
    col = np.clip(col, 0.0, field.shape[1] - 1.001)
    top, left = row.astype(np.intp), col.astype(np.intp)
    low, side = (row - top).astype(np.float32), (col - left).astype(np.float32)
    upper = field[top, left] * (1 - side) + field[top, left + 1] * side
    lower = field[top + 1, left] * (1 - side) + field[top + 1, left + 1] * side
    mixed: Floats = upper * (1 - low) + lower * low
    return mixed


def _slope(ground: Floats, y: NDArray[Any], x: NDArray[Any]) -> tuple[Any, Any, Any]:
    """Return height and rise to the south and east between the samples."""
    top, left = y.astype(np.intp), x.astype(np.intp)
    low, side = y - top, x - left
    a, b = ground[top, left], ground[top, left + 1]
    c, d = ground[top + 1, left], ground[top + 1, left + 1]
    here = (a * (1 - side) + b * side) * (1 - low) + (c * (1 - side) + d * side) * low
    return here, (c - a) * (1 - side) + (d - b) * side, (b - a) * (1 - low) + (d - c) * low
