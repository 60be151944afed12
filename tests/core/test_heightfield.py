"""Heightfields: where samples lie, what may be put in, and that nobody else can change it."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

from terrakit import Grid, Heightfield, InputError, ResourceError, Run, generate
from terrakit.compute import choose_device

RAMP = np.arange(12.0).reshape(3, 4)


def test_default_origin_puts_the_south_west_sample_at_zero() -> None:
    terrain = Heightfield(RAMP, 10.0)
    assert terrain.origin == (0.0, 20.0)
    assert terrain.grid.size == (30.0, 20.0)
    assert terrain.cell_area == 100.0
    assert repr(terrain) == "Heightfield(3x4, 10 m, layers=['elevation'])"


def test_array_is_copied_and_read_only() -> None:
    source = RAMP.astype(np.float32)
    terrain = Heightfield(source, 1.0)
    source[0, 0] = 99.0
    assert terrain.elevation[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        terrain.elevation[0, 0] = 1.0


@pytest.mark.parametrize(
    "make",
    [
        lambda a: np.asfortranarray(a),
        lambda a: a.astype(">f4"),
        lambda a: a[:, ::-1][:, ::-1],
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a.astype(np.int16),
        lambda a: a.tolist(),
    ],
)
def test_any_memory_layout_gives_the_same_bytes(make: Any) -> None:
    expected = RAMP.astype(np.float32)
    terrain = Heightfield(make(RAMP), 1.0)
    assert terrain.elevation.tobytes() == expected.tobytes()
    assert terrain.elevation.flags.c_contiguous


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros(5), "2-D"),
        (np.zeros((2, 2, 2)), "2-D"),
        (np.zeros((2, 2), complex), "complex"),
        (np.array([["a", "b"]]), "real"),
        (np.array([[0.0, np.nan], [1.0, np.inf]]), r"2 of 4 .* row 0, column 1"),
        (np.array([[0.0, 1e39]]), "1 of 2"),
    ],
)
def test_what_is_no_terrain_is_refused(array: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Heightfield(array, 1.0)


@pytest.mark.parametrize("spacing", [0.0, -1.0, np.nan, np.inf, 1e-300])
def test_spacing_is_positive_and_finite(spacing: float) -> None:
    with pytest.raises(InputError, match="spacing"):
        Grid((3, 3), spacing)


def test_layers_are_shared_and_added_to_a_new_terrain() -> None:
    terrain = Heightfield(RAMP, 1.0, layers={"sediment": np.ones((3, 4))})
    more = terrain.with_layers(wetness=np.zeros((3, 4)))
    assert list(terrain) == ["elevation", "sediment"]
    assert list(more) == ["elevation", "sediment", "wetness"]
    assert more.layers["sediment"] is terrain.layers["sediment"]
    assert "sediment" not in more.without_layers("sediment")
    with pytest.raises(InputError, match="elevation"):
        terrain.without_layers("elevation")
    with pytest.raises(InputError, match=r"'rain'.*has: elevation, sediment"):
        terrain.layer("rain")
    with pytest.raises(InputError, match="shape"):
        terrain.with_layers(rain=np.zeros((4, 3)))
    with pytest.raises(TypeError):
        terrain.layers["x"] = None  # type: ignore[index]


def test_pickle_keeps_bytes_and_read_only_arrays() -> None:
    terrain = Heightfield(RAMP, 2.0, (5.0, 6.0), "EPSG:3857", {"sediment": RAMP})
    again = pickle.loads(pickle.dumps(terrain))
    assert again.grid == terrain.grid
    for name in terrain:
        assert again.layer(name).tobytes() == terrain.layer(name).tobytes()
        assert not again.layer(name).flags.writeable


def test_layer_moves_only_when_asked() -> None:
    if not choose_device().is_opencl:
        pytest.skip("no OpenCL device")
    device = Run().device
    assert device is not None
    terrain = Heightfield(RAMP, 1.0)
    assert terrain.layers["elevation"].places == ("host",)
    array = terrain.on(device)
    assert terrain.on(device) is array
    assert terrain.layers["elevation"].places == ("host", device.name)
    there = Heightfield.on_grid(terrain.grid, device.upload(terrain.elevation))
    assert there.layers["elevation"].places == (device.name,)
    assert pickle.loads(pickle.dumps(there)).elevation.tobytes() == terrain.elevation.tobytes()


def test_a_generated_terrain_is_checked_where_it_is() -> None:
    run = Run(seed=1)
    if run.device is None:
        pytest.skip("needs an OpenCL device")
    terrain = generate("fbm", (40, 33), 10.0, run=run)
    assert terrain.layers["elevation"].places == (run.device.name,)
    spoiled = np.zeros((40, 33), np.float32)
    spoiled[3, 4], spoiled[39, 32], spoiled[0, 0] = np.nan, np.inf, -np.inf
    layer = Heightfield(run.device.upload(spoiled), 10.0).layers["elevation"]
    assert layer.not_finite() == 3
    assert layer.places == (run.device.name,)


def test_a_device_is_not_asked_for_more_memory_than_it_has() -> None:
    info = choose_device()
    if not info.is_opencl:
        pytest.skip("needs an OpenCL device")
    small = dataclasses.replace(info, memory=10_000)
    with pytest.raises(ResourceError, match=r"fbm: 4096 samples x .* of device .*--device numpy"):
        generate("fbm", 64, 10.0, run=Run(device=small))


def test_xarray_round_trip() -> None:
    pytest.importorskip("xarray")
    terrain = Heightfield(RAMP, 5.0, (100.0, 200.0), "EPSG:32632", {"sediment": RAMP / 2})
    dataset = terrain.to_xarray()
    assert dataset.sediment.attrs["units"] == "m"
    assert dataset.attrs["crs"] == "EPSG:32632"
    assert float(dataset.elevation.sel(x=100.0, y=200.0)) == RAMP[0, 0]
    again = Heightfield.from_xarray(dataset.elevation.assign_attrs(crs="EPSG:32632"))
    assert again.grid == terrain.grid
    assert again.elevation.tobytes() == terrain.elevation.tobytes()


def test_xarray_may_run_south_first_and_east_first() -> None:
    pytest.importorskip("xarray")
    terrain = Heightfield(RAMP, 5.0)
    flipped = terrain.to_xarray().elevation.isel(y=slice(None, None, -1), x=slice(None, None, -1))
    assert Heightfield.from_xarray(flipped).elevation.tobytes() == terrain.elevation.tobytes()


def test_xarray_cells_must_be_square_and_even() -> None:
    xarray = pytest.importorskip("xarray")
    for y, x, message in (
        ([2.0, 1.0, 0.0], [0.0, 2.0, 4.0, 6.0], "square"),
        ([2.0, 1.0, 0.0], [0.0, 1.0, 3.0, 4.0], "evenly"),
    ):
        array = xarray.DataArray(RAMP, {"y": y, "x": x}, ("y", "x"))
        with pytest.raises(InputError, match=message):
            Heightfield.from_xarray(array)
    with pytest.raises(InputError, match="coordinate"):
        Heightfield.from_xarray(xarray.DataArray(RAMP, dims=("y", "x")))


def test_notebook_shows_a_hillshade() -> None:
    picture = Heightfield(np.random.default_rng(1).random((700, 40)) * 50, 10.0)._repr_png_()
    assert picture.startswith(b"\x89PNG")


def test_numpy_sees_the_heights() -> None:
    terrain = Heightfield(RAMP, 1.0)
    assert np.asarray(terrain).shape == (3, 4)
    assert np.array(terrain, dtype=np.float64).dtype == np.float64
