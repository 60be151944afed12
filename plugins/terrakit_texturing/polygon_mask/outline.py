"""Polygons in the plane: whether they are sound, what is inside, and how far their edge is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ring = NDArray[np.float64]
"""Corners of shape (n, 2), x and y, metres; the last is joined to the first."""
MOST_POINTS = 20_000
BLOCK = 64
"""Rows that are looked at together."""


def checked(value: Any) -> list[list[list[list[float]]]]:
    """Return polygons whose every ring is sound, as plain lists of numbers.

    Raises
    ------
    ValueError
        With the polygon, the ring and the point, counted from 1, and the way out.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError("must be a list of polygons, each a list of rings [[x, y], ...]")
    total = 0
    polygons = []
    for number, polygon in enumerate(value, start=1):
        if not isinstance(polygon, (list, tuple)) or not polygon:
            raise ValueError(f"polygon {number} must be a list of at least one ring [[x, y], ...]")
        rings = [_ring(ring, f"polygon {number}", at) for at, ring in enumerate(polygon, start=1)]
        total += sum(len(ring) for ring in rings)
        if total > MOST_POINTS:
            raise ValueError(f"more than {MOST_POINTS} points; simplify the outlines")
        place = crossing([np.array(ring) for ring in rings])
        if place is not None:
            raise ValueError(
                f"polygon {number} crosses itself near ({place[0]:.6g}, {place[1]:.6g}); "
                "move a point, or split it in two polygons"
            )
        for at, ring in enumerate(rings, start=1):
            if _area(np.array(ring)) <= 1e-12:
                raise ValueError(
                    f"polygon {number}, ring {at} encloses nothing: its points lie on one line"
                )
        polygons.append(rings)
    return polygons


def _ring(value: Any, where: str, number: int) -> list[list[float]]:
    where = f"{where}, ring {number}"
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"{where} must be a list of points [x, y]")
    ring: list[list[float]] = []
    for at, point in enumerate(value, start=1):
        if (
            not isinstance(point, (list, tuple))
            or len(point) != 2
            or not all(isinstance(c, (int, float)) and not isinstance(c, bool) for c in point)
        ):
            raise ValueError(f"{where}, point {at} must be [x, y] in metres")
        x, y = (float(c) for c in point)
        if not (math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= 1e9):
            raise ValueError(f"{where}, point {at} is ({x:g}, {y:g}); must be within 1e9 m")
        if not ring or ring[-1] != [x, y]:
            ring.append([x, y])
    if len(ring) > 1 and ring[0] == ring[-1]:  # GeoJSON closes its rings
        ring.pop()
    if len(ring) < 3:
        raise ValueError(f"{where} has {len(ring)} different points; needs at least 3")
    return ring


def _area(ring: Ring) -> float:
    """Return how much of the square of its extent a ring encloses."""
    x, y = (ring - ring[0]).T
    area = 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
    extent = float(np.ptp(x) ** 2 + np.ptp(y) ** 2)
    return area / extent if extent > 0 else 0.0  # a ring so small that its square vanishes


def edges_of(rings: list[Ring]) -> NDArray[np.float64]:
    """Return every edge as x and y of its two ends, of shape (n, 4)."""
    return np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])


def crossing(rings: list[Ring]) -> tuple[float, float] | None:
    """Return where two edges cross, or None; edges that only touch do not cross."""
    edges = edges_of(rings)
    edges = edges[np.argsort(np.minimum(edges[:, 0], edges[:, 2]), kind="stable")]
    first = np.minimum(edges[:, 0], edges[:, 2])
    last = np.maximum(edges[:, 0], edges[:, 2])
    ends = np.searchsorted(first, last, side="right")
    for i, end in enumerate(ends.tolist()):
        ax, ay, bx, by = edges[i]
        cx, cy, dx, dy = edges[i + 1 : end].T
        c_side = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        d_side = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
        a_side = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
        b_side = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
        # Ends that lie on the other edge give 0, or a little of either sign from rounding
        slack = 1e-12 * ((bx - ax) ** 2 + (by - ay) ** 2 + (dx - cx) ** 2 + (dy - cy) ** 2)
        apart = np.abs([a_side, b_side, c_side, d_side]).min(axis=0)
        found = (c_side * d_side < 0) & (a_side * b_side < 0) & (apart > slack)
        if found.any():
            j = int(np.argmax(found))
            share = a_side[j] / (a_side[j] - b_side[j])
            return float(ax + share * (bx - ax)), float(ay + share * (by - ay))
    return None


def inside(rings: list[Ring], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples of the axes ``x`` (rising) and ``y`` (falling) are inside.

    A sample is inside if a ray to the west crosses the edges an odd number of times; so rings
    within rings are holes, whichever way round they run.
    """
    crossed = np.zeros((len(y), len(x) + 1), dtype=np.uint8)
    north_up = -y
    for ax, ay, bx, by in edges_of(rings).tolist():
        if ay == by:
            continue
        if ay > by:  # from south to north, so that an edge has one bit pattern for both sides
            ax, ay, bx, by = bx, by, ax, ay
        # Rows with ay <= y < by: a corner belongs to one of its two edges
        begin = int(np.searchsorted(north_up, -by, side="right"))
        end = int(np.searchsorted(north_up, -ay, side="right"))
        if begin < end:
            at = ax + (y[begin:end] - ay) * ((bx - ax) / (by - ay))
            crossed[np.arange(begin, end), np.searchsorted(x, at)] ^= 1
    odd: NDArray[np.uint8] = np.bitwise_xor.accumulate(crossed, axis=1)
    return odd[:, :-1].astype(bool)


def distance_to_edge(
    rings: list[Ring], x: NDArray[np.float64], y: NDArray[np.float64], most: float
) -> NDArray[np.float64]:
    """Return the distance of every sample to the nearest edge, at most ``most`` metres."""
    squared = np.full((len(y), len(x)), most * most)
    for first in range(0, len(y), BLOCK):
        rows = slice(first, first + BLOCK)
        north, south = y[rows][0] + most, y[rows][-1] - most
        for ax, ay, bx, by in edges_of(rings).tolist():
            if max(ay, by) < south or min(ay, by) > north:
                continue
            # The part of the edge that these rows can see
            ends = [ax, bx]
            if ay != by:
                shares = sorted(((south - ay) / (by - ay), (north - ay) / (by - ay)))
                ends = [ax + min(max(s, 0.0), 1.0) * (bx - ax) for s in shares]
            begin = int(np.searchsorted(x, min(ends) - most, side="left"))
            end = int(np.searchsorted(x, max(ends) + most, side="right"))
            if begin < end:
                part = squared[rows, begin:end]
                edge = (ax, ay, bx, by)
                np.minimum(part, _squared_distance(edge, x[begin:end], y[rows]), out=part)
    distance: NDArray[np.float64] = np.sqrt(squared)
    return distance


def _squared_distance(
    edge: tuple[float, float, float, float], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the squared distance of samples to one edge."""
    ax, ay, bx, by = edge
    ex, ey = bx - ax, by - ay
    px, py = (x - ax)[None, :], (y - ay)[:, None]
    along: NDArray[np.float64] = np.clip((px * ex + py * ey) / (ex * ex + ey * ey), 0.0, 1.0)
    dx, dy = px - along * ex, py - along * ey
    squared: NDArray[np.float64] = dx * dx + dy * dy
    return squared
