"""Yardsticks of running water: hollows, valleys against ridges, and the tree of the rivers.

Water leaves over the whole border of the map. Areas and lengths of basins that the border cuts are
those of the part on the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.relief import Heights
from terrakit.quanta import Quanta
from terrakit.routing import reference as routing

Counts = NDArray[np.int32]

REACH = 10
"""Steps over which the slope of a river is taken: heights in whole metres have flats."""
SLOPE_AREA_SAMPLES = 50
"""Cells that a bin of the slope-area fit must have."""
BINS_PER_DECADE = 5
OUTLET_SHARE = 0.05
"""Reaches that drain more of the map than this are left out of the slope-area fit: so near the
border the map, not the river, sets the slope."""
HACK_CELLS = 100
"""Cells that a point must drain to count for Hack's law."""
HORTON_CELLS = 20
"""Cells that make a stream, for Horton's ratios."""


@dataclass(frozen=True)
class Drainage:
    """Where the water of every cell goes; all arrays are flat, cells numbered row by row."""

    receiver: NDArray[np.int32]
    area: NDArray[np.int32]
    """Cells that drain through each cell, itself included."""
    elevation: NDArray[np.float64]
    """Height (m) of the ground, which need not fall along the flow."""
    step: NDArray[np.float64]
    """Distance (m) to the receiver, 0 at an outlet."""
    longest: NDArray[np.float64]
    """Longest way (m) along the flow from the divide to each cell."""
    pits: int
    """Cells that must be raised to drain."""
    peaks: int
    """The same on the terrain turned upside down."""


def drain(elevation: Heights, spacing: float) -> Drainage:
    """Route water over the terrain and over its mirror image below the ground."""
    quanta = Quanta.fitting(elevation.astype(np.float32), spacing)
    height = quanta.count(elevation.astype(np.float32))
    outlet = np.ones(height.shape, np.uint8)
    outlet[1:-1, 1:-1] = 0
    level, mirrored_level = _filled(height, outlet), _filled(-height, outlet)
    receiver = _flow(level, outlet)

    columns = height.shape[1]
    cell = np.arange(height.size)
    is_diagonal = routing.is_diagonal_step(cell, receiver, columns)
    step = np.where(is_diagonal, np.sqrt(2.0), 1.0) * (receiver != cell) * spacing
    return Drainage(
        receiver=receiver,
        area=routing.drainage_area(receiver),
        elevation=elevation.ravel(),
        step=step,
        longest=routing.longest_length(receiver, columns).astype(np.float64) * spacing,
        pits=int(np.count_nonzero(level > height)),
        peaks=int(np.count_nonzero(mirrored_level > -height)),
    )


def pit_fraction(water: Drainage) -> float:
    """Return the fraction of cells that must be raised to drain: filled > z.

    Filled is the lowest surface above the terrain from which every cell has a way to the border
    that never rises (Priority-Flood; Barnes, Lehman & Mulla 2014, doi:10.1016/j.cageo.2013.04.024).
    """
    return water.pits / water.area.size


def updown_asymmetry(water: Drainage) -> float:
    """Return log10((peaks + 1) / (pits + 1)), counted in cells.

    Pits are the cells that must be raised to drain, peaks those of the terrain -z. Rivers join
    all valleys but cut the ridges between them, so -z is full of hollows. Noise is alike both ways
    up: 0. The 1 stands for the cell that was not found.
    """
    if water.pits + water.peaks == 0:
        raise NotMeasured("the terrain has neither pits nor peaks")
    return float(np.log10((water.peaks + 1) / (water.pits + 1)))


def slope_area(water: Drainage, spacing: float) -> tuple[float, float]:
    """Return (theta, R2) of the slope-area law S = k A^-theta.

    S is the fall of the ground over ten steps downstream (below 0 where water must climb out of a
    pit), A the mean log area along the same ten steps (the area at the upper end alone makes theta
    0.1 too low). The means of S in bins of log A, five to a decade, are fitted in log-log, each
    with the weight of its number of cells. Reaches start where at least 10 cells drain, and end
    before 5 % of the map does.

    References
    ----------
    Flint, "Stream gradient as a function of order, magnitude, and discharge", WRR 1974;
    Mudd et al. 2018, doi:10.5194/esurf-6-505-2018.
    """
    log_area = np.log10(water.area * spacing**2)
    receiver = water.receiver.astype(np.intp)
    end = np.arange(water.area.size, dtype=np.intp)
    length = np.zeros(water.area.size)
    reach_area = np.zeros(water.area.size)
    for _ in range(REACH):
        reach_area += log_area[end] / REACH
        whole = receiver[end] != end
        length += water.step[end]
        end = receiver[end]
    used = whole & (water.area >= REACH) & (water.area[end] < OUTLET_SHARE * water.area.size)
    slope = (water.elevation - water.elevation[end])[used] / length[used]
    reach_area = reach_area[used]
    if not reach_area.size:
        raise NotMeasured(f"no river is {REACH} cells long")

    # Average the slopes in bins of area
    bins = np.floor(reach_area * BINS_PER_DECADE).astype(np.int64)
    bins -= bins.min()
    count = np.bincount(bins)
    total_slope = np.bincount(bins, weights=slope)
    good = (count >= SLOPE_AREA_SAMPLES) & (total_slope > 0)
    if np.count_nonzero(good) < 4:
        raise NotMeasured("too few rivers for a slope-area fit")
    weight = count[good].astype(np.float64)
    x = np.bincount(bins, weights=reach_area)[good] / weight
    y = np.log10(total_slope[good] / weight)

    # Fit the line
    x, y = x - np.average(x, weights=weight), y - np.average(y, weights=weight)
    tilt = float(np.sum(weight * x * y) / np.sum(weight * x * x))
    spread = float(np.sum(weight * y * y))
    explained = tilt**2 * float(np.sum(weight * x * x)) / spread if spread > 1e-12 else 0.0
    return -tilt, explained


def hack_exponent(water: Drainage) -> float:
    """Return h of Hack's law L ~ A^h over all cells that drain at least 100.

    L is the longest way along the flow from the divide; a straight line by least squares through
    (log A, log L).

    References
    ----------
    Hack 1957, USGS Prof. Paper 294-B; Rigon et al. 1996, doi:10.1029/96WR02397.
    """
    if np.ptp(water.elevation) == 0:
        raise NotMeasured("the terrain is flat")
    channel = water.area >= HACK_CELLS
    x, y = np.log(water.area[channel]), np.log(water.longest[channel])
    if x.size < HACK_CELLS or np.ptp(x) < 1.0:
        raise NotMeasured(f"too few cells drain {HACK_CELLS} others")
    return float(np.polyfit(x, y, 1)[0])


def horton_ratios(water: Drainage) -> tuple[float, float, float]:
    """Return Horton's ratios (R_b, R_a, R_l) of stream numbers, areas and lengths.

    Streams start where 20 cells drain and are ordered after Strahler; a stream is the chain of
    cells of one order. The ratios are 10 to the slope of log10 (number, mean area, mean length)
    against the order. The highest order, which the border cuts short, is left out where three
    others remain.

    References
    ----------
    Horton 1945, doi:10.1130/0016-7606(1945)56[275:EDOSAT]2.0.CO;2; Strahler 1957.
    """
    channel = np.flatnonzero(water.area >= HORTON_CELLS)
    number = np.zeros(water.area.size, np.int32)
    number[channel] = np.arange(channel.size)
    receiver = number[water.receiver[channel]]  # what drains enough drains into what does, too
    order: NDArray[np.int32] = routing.strahler_order(receiver)
    highest = int(order.max(initial=0))
    if highest < 3:
        raise NotMeasured("the rivers branch less than three times")

    # Sum up the streams at their lower ends
    continues = order[receiver] == order
    lower_end = routing.follow(np.where(continues, receiver, np.arange(receiver.size)))
    length = np.bincount(lower_end, weights=water.step[channel], minlength=receiver.size)
    is_end = lower_end == np.arange(receiver.size)
    streams = order[is_end]
    count = np.bincount(streams).astype(np.float64)
    area = np.bincount(streams, weights=water.area[channel][is_end])
    length = np.bincount(streams, weights=length[is_end])

    # Fit a geometric series to each
    orders = np.arange(1, max(3, highest - 1) + 1)

    def ratio(series: NDArray[np.float64]) -> float:
        return float(10 ** np.polyfit(orders, np.log10(series), 1)[0])

    count, area, length = count[orders], area[orders], length[orders]
    if not length.all():
        raise NotMeasured("the largest river is a single cell")
    return 1 / ratio(count), ratio(area / count), ratio(length / count)


def _filled(height: Counts, outlet: NDArray[np.uint8]) -> Counts:
    """Return the level to which water rises before it finds a way out."""
    steepest = routing.receivers(height, outlet)
    receiver = routing.drain_depressions(height, outlet, steepest, 0)
    return routing.filled(height, receiver).reshape(height.shape)


def _flow(level: Counts, outlet: NDArray[np.uint8]) -> Counts:
    """Return receivers that run down the filled surface, and the shortest way over its lakes.

    The receivers of :func:`terrakit.routing.route` cut through the ground instead. Slopes along a
    cut look like those of a river even in noise, and would hide that water had to climb.
    """
    rows, columns = level.shape
    receiver = routing.receivers(level, outlet)
    level = level.ravel()
    cell = np.arange(level.size)
    stuck = (receiver == cell) & (outlet.ravel() == 0)
    shore = cell[~stuck]
    while shore.size:
        reached = []
        for down, right in routing.SCAN_ORDER:
            row, column = shore // columns + down, shore % columns + right
            inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            near, here = (row * columns + column)[inside], shore[inside]
            joins = stuck[near] & (level[near] == level[here])
            receiver[near[joins]] = here[joins]
            stuck[near[joins]] = False
            reached.append(near[joins])
        shore = np.concatenate(reached)
    return receiver
