"""Pictures of a terrain as a model that stands before the viewer, drawn column by column.

Every column of the picture looks into a vertical plane. Along it the heights are a profile, whose
running highest line of sight says how far each pixel sees (Anderson 1982, "Hidden line elimination
in projected grid surfaces"). The place between two samples is solved for, so there are neither
steps nor holes. The lens is shifted, as that of a view camera: uprights stay upright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.color import srgb_from_linear
from terrakit.shading import blurred, gradient, hypsometric

Picture = NDArray[np.uint8]
Floats = NDArray[np.float32]
Coordinates = NDArray[np.float64]

FIELD_OF_VIEW = 34.0
"""Degrees across the picture."""
MARGIN = 0.95
"""Share of the picture that the terrain may fill."""
PLINTH = 0.02
"""Rock below the lowest ground, of the longer side."""
FINER = 2
"""Pixels a side that are averaged into one."""
AT_ONCE = 128
"""Columns of the picture worked on together: bounds the memory."""
HAZE = 0.30
"""Share of the air's colour as far behind the block as the camera stands before it."""

_SUN = (1.0, 0.93, 0.80)
_SKY = (0.62, 0.76, 1.0)
_SAND = (0.52, 0.41, 0.26)
_SHALLOW = (0.13, 0.30, 0.34)
_DEEP = (0.02, 0.085, 0.14)
_ROCK = ((0.21, 0.175, 0.15), (0.30, 0.255, 0.215))
_ABOVE = (0.63, 0.71, 0.80)
_BEHIND = (0.84, 0.85, 0.85)
_BEFORE = (0.70, 0.69, 0.68)


@dataclass(frozen=True)
class Camera:
    """Where a terrain is seen from; all lengths in metres, around the terrain's middle."""

    direction: float
    """Where it looks, degrees clockwise from north."""
    distance: float
    """From the terrain's middle, along the ground."""
    aside: float
    height: float
    shift: float
    """Tangent of the angle by which the lens looks down."""
    focus: float
    """Focal length, of the picture's width."""

    @classmethod
    def around(
        cls,
        extent: tuple[float, float],
        heights: tuple[float, float],
        size: tuple[int, int],
        direction: float = 18.0,
        pitch: float = 26.0,
        zoom: float = 1.0,
    ) -> Camera:
        """Return a camera just so far away that a block fills the picture.

        Parameters
        ----------
        extent
            West-east and south-north, metres.
        heights
            Lowest and highest, metres.
        size
            Width and height of the picture, pixels.
        direction
            Where it looks, degrees clockwise from north.
        pitch
            How far it looks down, degrees.
        zoom
            Over 1 is closer than needed to see everything.
        """
        bearing, down = math.radians(direction), math.tan(math.radians(pitch))
        half = 0.5 * MARGIN
        focus = 0.5 / math.tan(math.radians(FIELD_OF_VIEW) / 2.0)
        place, distance = [], 0.0
        corners = [
            (east * extent[0] / 2.0, north * extent[1] / 2.0, z)
            for east in (-1, 1)
            for north in (-1, 1)
            for z in heights
        ]
        seen = [
            (
                east * math.cos(bearing) - north * math.sin(bearing),
                east * math.sin(bearing) + north * math.cos(bearing),
                z,
            )
            for east, north, z in corners
        ]
        # A point (a, distance + g) is in the frame if |a - place| <= share * (distance + g)
        for axis, share in ((0, half / focus), (1, half / focus * size[1] / size[0])):
            along = [right if axis == 0 else z + down * ahead for right, ahead, z in seen]
            ahead = [g for _, g, _ in seen]
            most = max(a - share * g for a, g in zip(along, ahead, strict=True))
            least = max(-a - share * g for a, g in zip(along, ahead, strict=True))
            place.append((most - least) / 2.0)
            distance = max(distance, (most + least) / (2.0 * share))
        height = place[1] + distance * down
        return cls(direction, distance, place[0], height, down, focus * zoom)


def perspective_image(
    elevation: NDArray[np.floating],
    spacing: float,
    sea_level: float | None = None,
    azimuth: float = 285.0,
    altitude: float = 32.0,
    exaggeration: float = 1.0,
    colours: Floats | None = None,
    *,
    size: tuple[int, int] = (900, 500),
    direction: float = 18.0,
    pitch: float = 26.0,
    zoom: float = 1.0,
    heights: tuple[float, float] | None = None,
    water_depth: NDArray[np.floating] | None = None,
    sediment: NDArray[np.floating] | None = None,
) -> Picture:
    """Return the terrain as a block seen from one side and above, sRGB of shape (height, width, 3).

    Parameters
    ----------
    elevation
        Heights of shape (rows, cols), metres, row 0 north.
    spacing
        Distance between samples, metres.
    sea_level
        Height of the sea, or None for a world without.
    azimuth, altitude
        Where the light comes from, degrees clockwise from north and above the horizon.
    exaggeration
        Factor on all heights.
    colours
        Ground colours, linear; by default :func:`~terrakit.shading.hypsometric` tints.
    size
        Width and height of the picture, pixels.
    direction, pitch
        Where the viewer looks, degrees clockwise from north and down from the horizon.
    zoom
        Over 1 is closer than needed to see everything.
    heights
        Lowest and highest ground that the viewer stands back for, metres; the terrain's own if
        None. Pictures with the same heights have the same frame.
    water_depth
        Water on the ground, metres; it is drawn with its surface.
    sediment
        Loose material on the bedrock, metres; tints the ground where no ``colours`` are given.
    """
    up = float(exaggeration)
    ground = np.asarray(elevation, np.float32)
    wet = np.zeros_like(ground) if water_depth is None else np.asarray(water_depth, np.float32)
    if sea_level is not None:
        wet = np.maximum(wet, np.float32(sea_level) - ground)
    wet = np.maximum(wet, np.float32(0.0))
    base = hypsometric(ground, None) if colours is None else np.asarray(colours, np.float32)
    if colours is None and sediment is not None:
        base = with_sediment(base, sediment)
    low, high = heights or (float(ground.min()), float(ground.max()))
    extent = ((ground.shape[1] - 1) * spacing, (ground.shape[0] - 1) * spacing)
    floor = low * up - PLINTH * max(*extent, spacing)
    camera = Camera.around(extent, (floor, high * up), size, direction, pitch, zoom)
    surface = (ground + wet) * np.float32(up)
    lit = _lit(base, surface, wet, spacing, azimuth, altitude)
    block = _Block(surface, wet * np.float32(up), lit, spacing, floor, azimuth)
    return _draw(block, camera, size)


def with_sediment(colours: Floats, sediment: NDArray[np.floating]) -> Floats:
    """Return linear ground colours with loose material drawn as sand, full from about 6 m."""
    thickness = np.maximum(np.asarray(sediment, np.float32), np.float32(0.0))
    cover = np.float32(1.0) - np.exp(thickness / np.float32(-2.5))
    share = (np.float32(0.75) * cover)[..., None]
    tinted: Floats = colours + (np.array(_SAND, np.float32) - colours) * share
    return tinted


def with_water(colours: Floats, water_depth: NDArray[np.floating]) -> Floats:
    """Return linear ground colours under water: a film of less than 2 cm does not show."""
    depth = np.maximum(np.asarray(water_depth, np.float32), np.float32(0.0))[..., None]
    edge = np.clip((depth - np.float32(0.02)) / np.float32(0.2), 0.0, 1.0)
    edge = edge * edge * (np.float32(3.0) - np.float32(2.0) * edge)
    dark = np.float32(1.0) - np.exp(depth / np.float32(-8.0))
    shallow, deep = np.array(_SHALLOW, np.float32), np.array(_DEEP, np.float32)
    seen: Floats = colours + (shallow + (deep - shallow) * dark - colours) * edge * np.float32(0.9)
    return seen


def _lit(
    colours: Floats, surface: Floats, wet: Floats, spacing: float, azimuth: float, altitude: float
) -> Floats:
    """Return the light that every sample sends out: a warm sun with shadows, a blue sky."""
    towards, above = math.radians(azimuth), math.radians(altitude)
    sun_east, sun_north = math.sin(towards), math.cos(towards)
    east, south = gradient(surface, spacing)
    steep = np.sqrt(east * east + south * south + np.float32(1.0))
    facing = math.sin(above) - math.cos(above) * (sun_east * east - sun_north * south)
    sunlit = _sunlit(surface, spacing, (sun_east, sun_north), math.tan(above))
    direct = np.maximum(facing / steep, 0.0).astype(np.float32) * sunlit
    sky = _open_sky(surface, spacing) * (np.float32(0.5) + np.float32(0.5) / steep)
    sun, blue = np.array(_SUN, np.float32), np.array(_SKY, np.float32)
    light = direct[..., None] * sun * np.float32(1.25) + sky[..., None] * blue * np.float32(0.36)
    lit: Floats = (with_water(colours, wet) * light).astype(np.float32)
    return lit


def _sunlit(surface: Floats, spacing: float, sun: tuple[float, float], rise: float) -> Floats:
    """Return 0 in cast shadow to 1 in sunlight, with a soft edge."""
    rows, cols = surface.shape
    east, north = sun
    highest = np.full(surface.shape, -np.inf, np.float32)
    reach = float(np.ptp(surface)) / max(rise, 1e-3) / spacing
    along, last = 1.0, (0, 0)
    while along <= min(reach, math.hypot(rows, cols)):
        right, down = round(along * east), round(-along * north)
        along = max(along + 1.0, along * 1.04)
        if (right, down) == last or abs(right) >= cols or abs(down) >= rows:
            continue
        last = right, down
        here = (
            slice(max(0, -down), rows - max(0, down)),
            slice(max(0, -right), cols - max(0, right)),
        )
        there = (
            slice(max(0, down), rows - max(0, -down)),
            slice(max(0, right), cols - max(0, -right)),
        )
        away = np.float32(1.0 / (spacing * math.hypot(right, down)))
        horizon = (surface[there] - surface[here]) * away
        np.maximum(highest[here], horizon, out=highest[here])
    soft = np.clip((np.float32(rise * 1.12) - highest) / np.float32(rise * 0.24), 0.0, 1.0)
    return blurred(soft * soft * (np.float32(3.0) - np.float32(2.0) * soft), 1)


def _open_sky(surface: Floats, spacing: float) -> Floats:
    """Return how much of the sky is seen: below 1 in valleys, above it on crests."""
    total = np.ones(surface.shape, np.float32)
    for radius in (2, 6, 18, 54):
        if min(surface.shape) > radius:
            rise = (surface - blurred(surface, radius)) / np.float32(radius * spacing * 0.3)
            total += np.float32(0.17) * rise / np.sqrt(np.float32(1.0) + rise * rise)
    return total


@dataclass(frozen=True)
class _Block:
    """A lit terrain, cut off at its border and at ``floor``; heights and depths as drawn."""

    surface: Floats
    wet: Floats
    lit: Floats
    spacing: float
    floor: float
    azimuth: float

    @property
    def extent(self) -> Coordinates:
        """West-east and south-north, metres."""
        rows, cols = self.surface.shape
        return np.array([(cols - 1) * self.spacing, (rows - 1) * self.spacing])

    def places(self, at: Coordinates) -> tuple[Coordinates, Coordinates]:
        """Return rows and columns of points ``at`` east and north of the middle."""
        rows, cols = self.surface.shape
        row = (rows - 1) / 2.0 - at[..., 1] / self.spacing
        col = (cols - 1) / 2.0 + at[..., 0] / self.spacing
        return np.clip(row, 0.0, rows - 1.0), np.clip(col, 0.0, cols - 1.0)


def _draw(block: _Block, camera: Camera, size: tuple[int, int]) -> Picture:
    """Return the picture, strip by strip, each first with ``FINER`` times as many pixels a side."""
    wide, tall = size[0] * FINER, size[1] * FINER
    focus = camera.focus * wide
    # What a row of the picture rises, and a column moves aside, for each metre ahead
    row_up = (tall - 1) / 2.0 - np.arange(tall, dtype=np.float64)
    rise: Coordinates = row_up / focus - camera.shift
    aside = (np.arange(wide) - (wide - 1) / 2.0) / focus
    bearing = math.radians(camera.direction)
    ahead = np.array([math.sin(bearing), math.cos(bearing)])
    right = np.array([math.cos(bearing), -math.sin(bearing)])
    eye: Coordinates = camera.aside * right - camera.distance * ahead
    rays: Coordinates = ahead + aside[:, None] * right
    near, far, face = _crossing(eye, rays, block.extent)
    clear = float(near[far > near].min()) if (far > near).any() else 0.0
    picture = np.empty((size[1], size[0], 3), np.uint8)
    for first in range(0, wide, AT_ONCE):
        count = min(AT_ONCE, wide - first)
        strip = np.repeat(_background(tall)[:, None], count, axis=1)
        some = first + np.flatnonzero(far[first : first + count] > near[first : first + count])
        if len(some):
            row, ray, along, cut = _seen(
                block, camera, eye, rays[some], near[some], far[some], rise
            )
            ray = some[ray]
            at = eye + rays[ray] * along[:, None]
            colour = _coloured(block, camera, at, cut, face[ray], rise[row] * along)
            haze = np.clip((along - clear) / (2.0 * camera.distance), 0.0, 1.0)[:, None]
            colour += (np.array(_BEHIND, np.float32) - colour) * (HAZE * haze).astype(np.float32)
            strip[row, ray - first] = colour
        shrunk = strip.reshape(size[1], FINER, count // FINER, FINER, 3).mean(axis=(1, 3))
        picture[:, first // FINER : (first + count) // FINER] = srgb_from_linear(shrunk)
    return picture


def _coloured(
    block: _Block,
    camera: Camera,
    at: Coordinates,
    cut: NDArray[np.bool_],
    face: Coordinates,
    above: Coordinates,
) -> Floats:
    """Return the colour of points ``at`` east and north, ``above`` the eye."""
    places = block.places(at)
    colour = np.stack([_between(block.lit[..., k], *places) for k in range(3)], axis=-1)
    # Where the block is cut: rock, or water above the ground there
    here = places[0][cut], places[1][cut]
    top, wet = _between(block.surface, *here), _between(block.wet, *here)
    under = (top - camera.height - above[cut]).astype(np.float32)
    share = np.clip(np.float32(1.0) - under / (top - np.float32(block.floor)), 0.0, 1.0)
    rock = _rock(share, face[cut], block.azimuth)
    colour[cut] = np.where((under < wet)[:, None], np.array(_SHALLOW, np.float32), rock)
    return colour


def _seen(
    block: _Block,
    camera: Camera,
    eye: Coordinates,
    rays: Coordinates,
    near: Coordinates,
    far: Coordinates,
    rise: Coordinates,
) -> tuple[NDArray[np.intp], NDArray[np.intp], Coordinates, NDArray[np.bool_]]:
    """Return what the rays see: row of the picture, ray, how far ahead, whether the block's side.

    The first point of a profile is the foot of the block's side, the second its upper edge.
    """
    longest = float(((far - near) * np.hypot(rays[:, 0], rays[:, 1])).max())
    count = max(2, math.ceil(longest / block.spacing) + 1)
    ahead = near[:, None] + (far - near)[:, None] * np.linspace(0.0, 1.0, count)
    profile = _between(block.surface, *block.places(eye + rays[:, None] * ahead[..., None]))
    foot = np.full((len(rays), 1), block.floor)
    ahead = np.concatenate((near[:, None], ahead), axis=1)
    sight = (np.concatenate((foot, profile), axis=1) - camera.height) / ahead
    highest = np.maximum.accumulate(sight, axis=1)
    rows, columns, distances, sides = [], [], [], []
    for column in range(len(rays)):
        after = np.searchsorted(highest[column], rise)
        row = np.flatnonzero((after > 0) & (after <= count))
        after = after[row]
        # The profile is straight between two points, of which the ray passes the first above
        low, top = sight[column, after - 1], sight[column, after]
        share = (rise[row] - low) / np.where(top > low, top - low, 1.0)
        start = ahead[column, after - 1]
        distances.append(start + share * (ahead[column, after] - start))
        rows.append(row)
        columns.append(np.full(row.shape, column))
        sides.append(after == 1)
    return (
        np.concatenate(rows),
        np.concatenate(columns),
        np.concatenate(distances),
        np.concatenate(sides),
    )


def _crossing(
    eye: Coordinates, rays: Coordinates, extent: Coordinates
) -> tuple[Coordinates, Coordinates, Coordinates]:
    """Return where rays enter and leave a block around the origin, and the bearing of the face."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (-extent / 2.0 - eye) / rays, (extent / 2.0 - eye) / rays
    enter, leave = np.fmin(first, second), np.fmax(first, second)
    near, far = enter.max(axis=1), leave.min(axis=1)
    west_east = np.where(rays[:, 0] > 0, 270.0, 90.0)
    north_south = np.where(rays[:, 1] > 0, 180.0, 0.0)
    face = np.where(enter[:, 0] > enter[:, 1], west_east, north_south)
    return np.maximum(near, 1e-6 * float(extent.max())), far, face


def _between(field: Floats, row: Coordinates, col: Coordinates) -> Floats:
    """Return the field between its samples, bilinear."""
    top = np.minimum(row.astype(np.intp), max(0, field.shape[0] - 2))
    left = np.minimum(col.astype(np.intp), max(0, field.shape[1] - 2))
    south, east = (row - top).astype(np.float32), (col - left).astype(np.float32)
    below, beside = min(1, field.shape[0] - 1), min(1, field.shape[1] - 1)
    upper = field[top, left] * (1 - east) + field[top, left + beside] * east
    lower = field[top + below, left] * (1 - east) + field[top + below, left + beside] * east
    mixed: Floats = upper * (1 - south) + lower * south
    return mixed


def _rock(share: NDArray[np.floating], face: Coordinates, azimuth: float) -> Floats:
    """Return the colour of the block's sides, from the foot 0 to the top 1; bright to the sun."""
    sun = np.cos(np.radians(face - azimuth))
    light = 0.62 + 0.38 * np.maximum(sun, 0.0)
    dark, pale = (np.array(tone) for tone in _ROCK)
    rock = (dark + (pale - dark) * share[:, None]) * light[:, None]
    colour: Floats = rock.astype(np.float32)
    return colour


def _background(tall: int) -> Floats:
    """Return the colour of every row behind the terrain: sky above, ground below."""
    share = np.linspace(0.0, 1.0, tall)[:, None]
    above, behind, before = (np.array(tone) for tone in (_ABOVE, _BEHIND, _BEFORE))
    upper = above + (behind - above) * np.clip(share / 0.5, 0.0, 1.0)
    lower = behind + (before - behind) * np.clip((share - 0.5) / 0.5, 0.0, 1.0)
    colours: Floats = np.where(share < 0.5, upper, lower).astype(np.float32)
    return colours
