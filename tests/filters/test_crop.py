"""Every sample that is kept keeps its values and its place in the world."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, InputError, ParameterError
from terrakit_filters.crop import Crop


def world(shape: tuple[int, int] = (40, 60), spacing: float = 10.0) -> Heightfield:
    """Return ground whose height and layer say where in the world it is."""
    x, y = 3000.0, 8000.0
    east = x + np.arange(shape[1]) * spacing
    north = y - np.arange(shape[0]) * spacing
    height, layer = np.meshgrid(north, east, indexing="ij")
    return Heightfield(height, spacing, (x, y), "EPSG:32632", {"uplift": layer})


@pytest.mark.parametrize(
    ("bounds", "shape", "origin"),
    [
        ([3100.0, 7700.0, 3300.0, 7900.0], (21, 21), (3100.0, 7900.0)),
        ([3104.0, 7696.0, 3296.0, 7904.0], (21, 21), (3100.0, 7900.0)),  # to the nearest samples
        ([0.0, 0.0, 3095.0, 1e6], (40, 11), (3000.0, 8000.0)),  # beyond the terrain
    ],
)
def test_samples_keep_their_place(bounds: list[float], shape: Any, origin: Any) -> None:
    cut = Crop(bounds=bounds)(world())
    assert cut.shape == shape
    assert cut.origin == origin
    assert cut.crs == "EPSG:32632"
    assert np.array_equal(cut.elevation[:, 0], origin[1] - 10.0 * np.arange(shape[0]))
    assert np.array_equal(cut.layer("uplift")[0], origin[0] + 10.0 * np.arange(shape[1]))


def test_bounds_beside_the_terrain_are_refused_with_where_it_lies() -> None:
    for bounds in ([0.0, 0.0, 100.0, 100.0], [3101.0, 7701.0, 3104.0, 7900.0]):
        with pytest.raises(InputError, match="spans 3000 to 3590 m east and 7610 to 8000 m north"):
            Crop(bounds=bounds)(world())


@pytest.mark.parametrize("bounds", [[0.0, 0.0, 1.0], [5.0, 0.0, 1.0, 9.0], [0.0, 9.0, 1.0, 9.0]])
def test_bounds_that_hold_nothing_are_refused(bounds: list[float]) -> None:
    with pytest.raises(ParameterError, match="bounds.*west < east"):
        Crop(bounds=bounds)
