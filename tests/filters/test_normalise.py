"""The lowest and the highest point land exactly where they are told to."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import awkward_terrains, crop, rough_terrain
from terrakit_filters.normalise import Normalise

GROUND = rough_terrain((65, 48), relief=400.0)


def normalised(
    terrain: Heightfield = GROUND, device: str | None = "numpy", **settings: object
) -> np.ndarray:
    return np.asarray(execute(Normalise(**settings), terrain, Run(0, device)).elevation)


@pytest.mark.parametrize("device", ["numpy", None])
def test_ends_are_met_exactly(device: str | None) -> None:
    for low, high in ((0.0, 1000.0), (-123.4, 77.7), (0.0, 1.0)):
        for _, terrain in awkward_terrains():
            z = normalised(terrain, device, low=low, high=high)
            assert z.min() == np.float32(low)
            flat = np.ptp(terrain.elevation) == 0
            assert z.max() == np.float32(low if flat else high)


def test_between_the_ends_it_is_straight() -> None:
    z = GROUND.elevation.astype(np.float64)
    expected = 100 + 250 * (z - z.min()) / np.ptp(z)
    assert normalised(low=100.0, high=350.0) == pytest.approx(expected, abs=1e-3)


def test_a_known_range_fits_tiles_and_a_measured_one_does_not() -> None:
    tile = crop(GROUND, 10, 7, 20, 20)
    known = {"source_low": -400.0, "source_high": 400.0}
    assert np.array_equal(normalised(tile, **known), normalised(**known)[10:30, 7:27])
    assert not np.array_equal(normalised(tile), normalised()[10:30, 7:27])


def test_heights_beyond_a_known_range_lie_beyond_the_new_one() -> None:
    z = normalised(source_low=0.0, source_high=100.0, low=0.0, high=50.0)
    assert z == pytest.approx(GROUND.elevation / 2, abs=1e-3)


def test_ranges_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ParameterError, match="low = 5 is above high = 1"):
        Normalise(low=5.0, high=1.0)
    with pytest.raises(ParameterError, match="source_low = 9 must be below source_high = 9"):
        Normalise(source_low=9.0, source_high=9.0)
    with pytest.raises(ParameterError, match="normalise: source_low = 5000 must be below"):
        normalised(source_low=5000.0)
