"""Pictures of relief: shading after the Swiss school, with hypsometric tints.

One light from the north-west is what readers of maps expect (Imhof 1982); a second and third from
its sides keep ridges that run along the light from vanishing (Mark 1992), and a local relief term
darkens valleys and lightens crests as the open sky would (Kennelly & Stewart 2006).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terrakit.color import srgb_from_linear

Picture = NDArray[np.uint8]
Floats = NDArray[np.float32]

FLAT = 0.62
"""Shade of level ground, between deepest shadow 0 and full light 1."""

STEPS = 4096
"""Heights that tints tell apart: far more than eight bits can show."""

UNDER_WATER = 0.5
"""Contrast of relief below the sea, of 1."""

_LAND = (
    (0.00, "7d9c86"),
    (0.14, "a3b58f"),
    (0.32, "d0cb9e"),
    (0.52, "dcc193"),
    (0.72, "c49e7c"),
    (0.89, "cdb9a8"),
    (1.00, "f4f1ee"),
)
_SEA = ((0.00, "b4d3d6"), (0.25, "86b5c6"), (0.60, "5389a8"), (1.00, "2c5a80"))
_SHADOW = (0.135, 0.155, 0.245)
_LIGHT = (1.0, 0.965, 0.87)


def hillshade(
    elevation: NDArray[np.floating],
    spacing: float,
    azimuth: float = 315.0,
    altitude: float = 45.0,
    exaggeration: float = 1.0,
) -> Floats:
    """Return how bright the ground is, 0 to 1; level ground is :data:`FLAT`.

    Parameters
    ----------
    elevation
        Heights of shape (rows, cols), metres, row 0 north.
    spacing
        Distance between samples, metres.
    azimuth
        Where the light comes from, degrees clockwise from north.
    altitude
        How high the light stands, degrees above the horizon.
    exaggeration
        Factor on all heights before shading.

    Returns
    -------
    ndarray of shape (rows, cols), float32
        Direct light and local relief together.
    """
    height = np.asarray(elevation, dtype=np.float32) * np.float32(exaggeration)
    direct = _direct_light(height, spacing, azimuth, altitude)
    return np.clip(direct + np.float32(0.16) * _openness(height, spacing), 0.0, 1.0)


def hypsometric(elevation: NDArray[np.floating], sea_level: float | None = 0.0) -> Floats:
    """Return a colour for every height, as linear red, green and blue.

    Colours run from the lowest to the highest land, half by height and half by rank, so that
    neither a plain nor a lone summit takes the whole scale. Water is blue and darkens with depth.

    Parameters
    ----------
    elevation
        Heights of shape (rows, cols), metres.
    sea_level
        Height of the water, or None for a world without.
    """
    height = np.asarray(elevation, dtype=np.float32)
    water = np.zeros(height.shape, bool) if sea_level is None else height < sea_level
    if water.all():
        return _sea_colours(height, float(sea_level or 0.0))
    land = height if not water.any() else height[~water]
    tints = _land_colours(land, float(sea_level or 0.0) if water.any() else None)
    if not water.any():
        return tints
    colours = np.empty((*height.shape, 3), np.float32)
    colours[~water] = tints
    colours[water] = _sea_colours(height[water], float(sea_level or 0.0))
    return colours


def relief_image(
    elevation: NDArray[np.floating],
    spacing: float,
    sea_level: float | None = 0.0,
    azimuth: float = 315.0,
    altitude: float = 45.0,
    exaggeration: float | None = None,
    colours: Floats | None = None,
) -> Picture:
    """Return a shaded relief, sRGB of shape (rows, cols, 3), north up.

    Parameters
    ----------
    elevation
        Heights of shape (rows, cols), metres.
    spacing
        Distance between samples, metres.
    sea_level
        Height of the water, or None for a world without.
    azimuth, altitude
        Where the light comes from, degrees.
    exaggeration
        Factor on all heights before shading; None chooses one by how steep the terrain is.
    colours
        Ground colours to shade, linear; by default :func:`hypsometric` tints.
    """
    height = np.asarray(elevation, dtype=np.float32)
    if exaggeration is None:
        exaggeration = suggested_exaggeration(height, spacing)
    shade = hillshade(height, spacing, azimuth, altitude, exaggeration)
    base = hypsometric(height, sea_level) if colours is None else colours
    contrast = np.full(height.shape, 1.0, np.float32)
    if colours is None:
        contrast = _aerial_contrast(height, sea_level)
    light = (shade - np.float32(FLAT)) * contrast
    dark = np.clip(-light / np.float32(FLAT), 0.0, 1.0)[..., None]
    bright = np.clip(light / np.float32(1.0 - FLAT), 0.0, 1.0)[..., None]
    # Shadows are cool and keep some of the ground's colour; lit slopes lean to warm white.
    shadow = base * np.float32(0.12) + np.array(_SHADOW, np.float32) * np.float32(0.3)
    depth = dark * (np.float32(1.5) - np.float32(0.5) * dark) * np.float32(0.88)
    picture = base + (shadow - base) * depth
    gloss = np.where(contrast < UNDER_WATER * 1.01, np.float32(0.12), np.float32(0.5))[..., None]
    picture += (np.array(_LIGHT, np.float32) - picture) * bright * bright * gloss
    return srgb_from_linear(picture)


def suggested_exaggeration(elevation: NDArray[np.floating], spacing: float) -> float:
    """Return the factor that gives a terrain's steeper slopes a good contrast, 0.5 to 20."""
    slope = np.hypot(*gradient(np.asarray(elevation, dtype=np.float32), spacing))
    steep = float(np.quantile(slope, 0.9)) if slope.size else 0.0
    return min(max(1.0 / max(steep, 1e-6), 0.5), 20.0) if steep > 1e-6 else 1.0


def blurred(values: NDArray[np.floating], radius: int) -> Floats:
    """Return ``values`` after three box blurs of ``radius`` samples, close to a Gaussian."""
    field = np.asarray(values, dtype=np.float64)
    for axis in (0, 1):
        reach = min(radius, field.shape[axis] - 1)
        for _ in range(3 if reach > 0 else 0):
            field = _box(field, reach, axis)
    return field.astype(np.float32)


def gradient(height: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Return the rise to the east and to the south, metres a metre."""
    east, south = np.zeros_like(height), np.zeros_like(height)
    if height.shape[1] > 1:
        east = np.gradient(height, np.float32(spacing), axis=1).astype(np.float32)
    if height.shape[0] > 1:
        south = np.gradient(height, np.float32(spacing), axis=0).astype(np.float32)
    return east, south


def _direct_light(height: Floats, spacing: float, azimuth: float, altitude: float) -> Floats:
    """Lambert's law under a main light and two weak ones 60 degrees to its sides."""
    east, south = gradient(height, spacing)
    length = np.sqrt(east * east + south * south + np.float32(1.0))
    up = math.sin(math.radians(altitude))
    flat = math.cos(math.radians(altitude))
    lit = np.zeros(height.shape, np.float32)
    for turn, share in ((0.0, 0.62), (-60.0, 0.19), (60.0, 0.19)):
        towards = math.radians(azimuth + turn)
        x, y = flat * math.sin(towards), flat * math.cos(towards)
        toward_light = np.float32(up) - np.float32(x) * east + np.float32(y) * south
        lit += np.float32(share) * np.maximum(toward_light / length, np.float32(0.0))
    # A bend of tone, so that level ground is FLAT and the lightest slope is 1.
    level, top = np.float32(up), np.float32(1.0)
    below = lit / level * np.float32(FLAT)
    above = np.float32(FLAT) + (lit - level) / max(top - level, np.float32(1e-3)) * np.float32(
        1.0 - FLAT
    )
    return np.where(lit < level, below, np.minimum(above, np.float32(1.0))).astype(np.float32)


def _openness(height: Floats, spacing: float) -> Floats:
    """Return -1 in deep valleys to 1 on sharp crests, over three scales."""
    total = np.zeros(height.shape, np.float32)
    for radius, share in ((2, 0.3), (8, 0.35), (24, 0.35)):
        if min(height.shape) <= radius:
            continue
        difference = (height - blurred(height, radius)) / np.float32(radius * spacing * 0.25)
        total += np.float32(share) * difference / np.sqrt(np.float32(1.0) + difference**2)
    return total.astype(np.float32)


def _aerial_contrast(height: Floats, sea_level: float | None) -> Floats:
    """Haze lies in the valleys: relief is clearer the higher it stands (Imhof 1982)."""
    low, high = float(height.min()), float(height.max())
    if sea_level is not None and low < sea_level < high:
        low = sea_level
    rise = (blurred(height, 3) - np.float32(low)) / np.float32(max(high - low, 1e-6))
    contrast: Floats = np.float32(0.88) + np.float32(0.27) * np.clip(rise, 0.0, 1.0)
    if sea_level is not None:
        contrast[height < sea_level] = UNDER_WATER
    return contrast


def _land_colours(land: Floats, shore: float | None) -> Floats:
    low, high = (float(v) for v in np.quantile(land, (0.002, 0.998)))
    low = shore if shore is not None else low
    if high - low <= 1e-6:
        return np.broadcast_to(_ramp(_LAND, np.full(1, 0.35)), (*land.shape, 3)).copy()
    place = np.clip((land - np.float32(low)) / np.float32(high - low), 0.0, 1.0)
    index = (place * np.float32(STEPS - 1) + np.float32(0.5)).astype(np.uint16)
    by_height = np.linspace(0.0, 1.0, STEPS)
    rank = np.cumsum(np.bincount(index.ravel(), minlength=STEPS)) / land.size
    scale = 0.6 * by_height + 0.4 * blurred(np.stack((rank, rank)), STEPS // 64)[0]
    tints: Floats = np.take(_ramp(_LAND, scale), index, axis=0)
    return tints


def _sea_colours(height: Floats, sea_level: float) -> Floats:
    depth = np.float32(sea_level) - height
    share = np.sqrt(depth / np.float32(max(float(depth.max()), 1e-6)))
    index = (share * np.float32(STEPS - 1) + np.float32(0.5)).astype(np.uint16)
    blues: Floats = np.take(_ramp(_SEA, np.linspace(0.0, 1.0, STEPS)), index, axis=0)
    return blues


def _ramp(stops: tuple[tuple[float, str], ...], place: NDArray[np.float64]) -> Floats:
    """Return linear colours at ``place`` on a scale without kinks, so that no band shows."""
    at = [position for position, _ in stops]
    fine = np.linspace(0.0, 1.0, 513)
    parts = []
    for channel in range(3):
        values = [int(code[2 * channel : 2 * channel + 2], 16) / 255.0 for _, code in stops]
        even = np.interp(fine, at, values)
        smooth = blurred(np.stack((even, even)), 16)[0].astype(np.float64)
        linear = np.where(smooth <= 0.04045, smooth / 12.92, ((smooth + 0.055) / 1.055) ** 2.4)
        parts.append(np.interp(place, fine, linear).astype(np.float32))
    return np.stack(parts, axis=-1)


def _box(field: NDArray[np.float64], radius: int, axis: int) -> NDArray[np.float64]:
    """Mean over ``2 * radius + 1`` samples along ``axis``; edge values are repeated."""
    pad = [(0, 0), (0, 0)]
    pad[axis] = (radius + 1, radius)
    total = np.cumsum(np.pad(field, pad, mode="edge"), axis=axis)
    count = 2 * radius + 1
    after = np.take(total, range(count, total.shape[axis]), axis=axis)
    before = np.take(total, range(total.shape[axis] - count), axis=axis)
    return np.asarray((after - before) / count, dtype=np.float64)
