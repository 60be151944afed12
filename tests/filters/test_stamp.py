"""A stamp lands where it is put, turned and scaled, and keeps its shape wherever that is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terrakit import Grid, Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import crop, rough_terrain
from terrakit_filters.stamp import Stamp


def stamped(terrain: Heightfield, run: Run | None = None, **settings: Any) -> np.ndarray:
    return execute(Stamp(**settings), terrain, run or Run()).elevation.astype(np.float64)


def flat(height: float = 20.0) -> Heightfield:
    return Heightfield(np.full((41, 41), height), 10.0)


def wedge() -> Heightfield:
    """Return ground that rises by 1 m a sample to the east, 0 in its middle."""
    return Heightfield(np.tile(np.arange(-40.0, 41.0), (81, 1)), 10.0)


def test_a_height_in_a_disc_with_a_soft_edge() -> None:
    told = stamped(flat(), stamp=50.0, at=[200.0, 200.0], radius=100.0, feather=40.0)
    gap = np.hypot(*(np.indices((41, 41)) - 20)) * 10.0
    t = np.clip((gap - 60.0) / 40.0, 0, 1)
    assert np.allclose(told, 20 + 50 * (1 - t * t * (3 - 2 * t)), atol=1e-4)


@pytest.mark.parametrize(
    ("mode", "expected"), [("add", 50.0), ("max", 30.0), ("min", 20.0), ("replace", 30.0)]
)
def test_modes_in_the_middle(mode: str, expected: float) -> None:
    assert stamped(flat(), stamp=30.0, radius=100.0, mode=mode)[20, 20] == expected
    assert stamped(flat(), stamp=30.0, radius=100.0, mode=mode)[0, 0] == 20.0


@pytest.mark.parametrize(("angle", "uphill"), [(0.0, (0, 1)), (90.0, (-1, 0)), (180.0, (0, -1))])
def test_turning_is_counter_clockwise(angle: float, uphill: tuple[int, int]) -> None:
    how: dict[str, Any] = {"from_step": "wedge", "radius": 100.0, "mode": "replace", "feather": 0.0}
    told = stamped(flat(), Run(earlier={"wedge": wedge()}), angle=angle, **how)
    assert told[20 + 5 * uphill[0], 20 + 5 * uphill[1]] == pytest.approx(5.0, abs=1e-4)
    assert told[20 - 5 * uphill[0], 20 - 5 * uphill[1]] == pytest.approx(-5.0, abs=1e-4)


def test_scale_widens_and_height_scale_raises() -> None:
    how: dict[str, Any] = {"from_step": "wedge", "radius": 100.0, "mode": "replace", "feather": 0.0}
    run = Run(earlier={"wedge": wedge()})
    told = stamped(flat(), run, scale=2.0, height_scale=3.0, offset=7.0, **how)
    assert told[20, 24] == pytest.approx(7.0 + 3.0 * 4 / 2, abs=1e-4)


def test_a_chain_keeps_its_shape_wherever_it_is_put() -> None:
    hill = {"use": "fbm", "wavelength": 90.0, "amplitude": 30.0}
    how: dict[str, Any] = {"stamp": hill, "radius": 80.0}
    here = stamped(flat(0.0), at=[100.0, 100.0], **how)
    there = stamped(flat(0.0), at=[250.0, 290.0], **how)
    assert np.array_equal(here[30 - 9 : 30 + 10, 1:20], there[11 - 9 : 11 + 10, 16:35])
    assert np.ptp(here) > 5.0


@pytest.mark.parametrize("outline", ["disc", "square"])
def test_a_tile_equals_the_whole(outline: str) -> None:
    whole = rough_terrain((60, 60), 7.3, origin=(1e6, 2e6))
    tile = crop(whole, 17, 9, 21, 30)
    how: dict[str, Any] = {
        "stamp": {"use": "fbm", "wavelength": 90.0, "amplitude": 30.0},
        "at": [1e6 + 150.0, 2e6 - 200.0],
        "radius": 90.0,
        "feather": 30.0,
        "angle": 25.0,
        "outline": outline,
    }
    expected = stamped(whole, **how)[17:38, 9:39]
    assert np.array_equal(stamped(tile, Run(world=whole.grid), **how), expected)
    assert not np.array_equal(expected, tile.elevation)


def test_without_a_place_it_is_the_middle_of_the_world() -> None:
    world = Grid((41, 81), 10.0)
    east = Heightfield(np.zeros((41, 41)), 10.0, (400.0, 400.0))
    told = stamped(east, Run(world=world), stamp=9.0, radius=50.0, feather=0.0)
    assert told[20, 0] == 9.0
    assert told[20, 10] == 0.0


def test_what_cannot_be_stamped_is_refused() -> None:
    with pytest.raises(InputError, match=r"at = \[9000, 0\], radius = 50: no sample"):
        stamped(flat(), stamp=1.0, at=[9000.0, 0.0], radius=50.0)
    with pytest.raises(ParameterError, match="reaches only 400 m from its middle"):
        stamped(flat(), Run(earlier={"wedge": wedge()}), from_step="wedge", radius=500.0)
    with pytest.raises(ParameterError, match="needs stamp"):
        Stamp()
    with pytest.raises(ParameterError, match="at.*must be"):
        Stamp(stamp=1.0, at=[1.0])
