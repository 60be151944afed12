"""Ground as an erosion counts it: heights, and the bedrock under what is loose.

Material that leaves is taken from the loose layer first, and what arrives is loose. So bedrock is
the lowest that the ground has been, and its height needs no other bookkeeping.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion, Surface
from terrakit.parameters import Schedule
from terrakit.quanta import Quanta
from terrakit.running import Run

SIDES = ("north", "south", "west", "east")
DEEPEST = 2**30
"""Thickest loose material, quanta, so that the bedrock stays an int32."""
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]


def loose_on(surface: Surface, quanta: Quanta) -> Counts:
    """Return the thickness of loose material, quanta."""
    if "sediment" not in surface:
        return np.zeros(surface.elevation.shape, dtype=np.int32)
    counts = np.rint(surface.layer("sediment").astype(np.float64) / quanta.quantum)
    return np.clip(counts, 0, DEEPEST).astype(np.int32)


def during(
    operator: Erosion, name: str, surface: Surface, sweeps: int
) -> Callable[[int], NDArray[np.float64]]:
    """Return what gives a maskable parameter's value in each of so many sweeps."""

    def at(sweep: int) -> NDArray[np.float64]:
        value = operator.value(name, surface, sweep / sweeps if sweeps else 0.0)
        return np.asarray(value, dtype=np.float64)

    if changes(operator, name):
        return at
    constant = at(0)
    return lambda sweep: constant


def changes(operator: Erosion, name: str) -> bool:
    """Return whether a parameter changes during the run."""
    return isinstance(getattr(operator, name), Schedule)


def ring_of(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return zeros for what leaves through north, south, west and east, along each."""
    return np.zeros((len(SIDES), max(shape)), dtype=np.int64)


def layers_after(
    surface: Surface, quanta: Quanta, start: Counts, loose: Counts, end: Counts, bed: Counts
) -> dict[str, Floats]:
    """Return sediment, erosion and deposition after a run.

    Parameters
    ----------
    surface
        The surface before.
    quanta
        How heights are counted.
    start, loose
        Height and loose material before, quanta.
    end, bed
        Height and bedrock after, quanta.
    """

    def before(name: str) -> Floats:
        if name in surface:
            return np.maximum(surface.layer(name), np.float32(0))
        return np.zeros(start.shape, dtype=np.float32)

    after = end - bed
    change = end.astype(np.int64) - start
    return {
        "sediment": np.where(after == loose, before("sediment"), quanta.metres(after)),
        "erosion": before("erosion") + quanta.metres(np.maximum(-change, 0)),
        "deposition": before("deposition") + quanta.metres(np.maximum(change, 0)),
    }


def book(
    run: Run,
    quanta: Quanta,
    surface: Heightfield,
    start: Counts,
    end: Counts,
    exported: NDArray[np.int64],
    came: Mapping[str, int] | None = None,
) -> None:
    """Book what was there, what came, what left through each side and what is there now.

    Parameters
    ----------
    run
        Whose ledger it is.
    quanta, surface
        How heights are counted, and on which cells.
    start, end
        Heights before and after, quanta.
    exported
        What left through north, south, west and east, along each, quanta.
    came
        What came from elsewhere, by source, quanta.
    """
    area = surface.cell_area
    volume = quanta.quantum * area
    run.ledger.open("rock", quanta.volume(start, area))
    for source, amount in (came or {}).items():
        if amount:
            run.ledger.came("rock", source, amount * volume)
    for side, leaving in zip(SIDES, exported, strict=True):
        if leaving.any():
            run.ledger.left("rock", f"border {side}", int(leaving.sum()) * volume)
    changed = np.abs(end.astype(np.int64) - start)
    run.ledger.close("rock", quanta.volume(end, area), int(changed.sum()) * 0.5 * volume)
