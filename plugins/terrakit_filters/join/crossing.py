"""Whether a line that runs on beyond both ends crosses itself."""

from __future__ import annotations

import math

Vector = tuple[float, float]


def crossing(points: list[Vector]) -> Vector | None:
    """Return where a line crosses or touches itself, or None.

    Its first and its last piece are rays that run on for ever. Neighbouring pieces share their
    point; they touch otherwise only where the line turns straight back.

    Parameters
    ----------
    points
        At least two points, no neighbours equal.
    """
    last = len(points) - 2
    pieces = []
    for k in range(last + 1):
        a, b = points[k], points[k + 1]
        low = -math.inf if k == 0 else 0.0
        high = math.inf if k == last else 1.0
        pieces.append((a, (b[0] - a[0], b[1] - a[1]), low, high))
    for k, (a, u, low, high) in enumerate(pieces):
        for j in range(k + 1, len(pieces)):
            b, v, from_, to = pieces[j]
            size = math.hypot(*u) * math.hypot(*v)
            area = u[0] * v[1] - u[1] * v[0]
            gap = b[0] - a[0], b[1] - a[1]
            is_parallel = abs(area) < 1e-12 * size
            if j == k + 1:  # neighbours meet in the point that they share, and nowhere else
                if is_parallel and u[0] * v[0] + u[1] * v[1] < 0:
                    return b
                continue
            if is_parallel:
                touch = _along(a, u, low, high, b, v, from_, to)
                if touch is not None:
                    return touch
                continue
            s = (gap[0] * v[1] - gap[1] * v[0]) / area
            t = (gap[0] * u[1] - gap[1] * u[0]) / area
            if low <= s <= high and from_ <= t <= to:
                return a[0] + s * u[0], a[1] + s * u[1]
    return None


def _along(
    a: Vector, u: Vector, low: float, high: float, b: Vector, v: Vector, from_: float, to: float
) -> Vector | None:
    """Return a point that two parallel pieces share, or None."""
    size = u[0] * u[0] + u[1] * u[1]
    gap = b[0] - a[0], b[1] - a[1]
    aside = abs(u[0] * gap[1] - u[1] * gap[0]) / math.sqrt(size)
    if aside > 1e-9 * max(1.0, math.hypot(*gap)):
        return None
    start = (gap[0] * u[0] + gap[1] * u[1]) / size
    pace = (v[0] * u[0] + v[1] * u[1]) / size
    ends = sorted(
        start + pace * end if math.isfinite(end) else math.copysign(math.inf, pace * end)
        for end in (from_, to)
    )
    first, last = max(low, ends[0]), min(high, ends[1])
    if first > last:
        return None
    at = first if math.isfinite(first) else last
    return a[0] + at * u[0], a[1] + at * u[1]
