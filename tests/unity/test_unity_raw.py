"""The RAW is read back by the rules of Unity's import dialog, not by the writer's own code."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from terrakit.errors import InputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.running import Run
from terrakit_unity.unity_raw import UnityRaw
from terrakit_unity.unity_raw.alphamaps import bytes_of, cell_weights


def unity_import(raw: Path, dialog: dict) -> tuple[np.ndarray, dict]:
    """Return heights[z, x] in metres as Unity's wizard makes them of the dialog's fields."""
    side = dialog["heightmap"]["resolution"]
    content = raw.read_bytes()
    assert dialog["heightmap"]["depth"] == "Bit16"
    assert len(content) == 2 * side * side
    assert (side - 1) & (side - 2) == 0
    assert 33 <= side <= 4097
    little = dialog["heightmap"]["byteOrder"] == "Windows"
    heights = np.zeros((side, side))
    for z in range(side):
        for x in range(side):
            at = 2 * (z * side + x)
            value = int.from_bytes(content[at : at + 2], "little" if little else "big")
            row = side - 1 - z if dialog["heightmap"]["flipVertically"] else z
            heights[row, x] = value * (1.0 / 65536.0)
    size = dialog["terrainSize"]
    return heights * size["y"] + dialog["position"]["y"], size


def rough(side=33, **settings):
    rng = np.random.default_rng(0)
    return Heightfield(rng.normal(400, 120, (side, side)), 5.0, **settings)


def exported(terrain, folder, **settings):
    files = UnityRaw(**settings).export(terrain, folder / "hill.raw", Run(seed=3))
    assert sorted(p.name for p in folder.iterdir()) == sorted(p.name for p in files)
    return files, json.loads((folder / "hill.json").read_text())


def test_every_height_comes_back_within_half_a_step(tmp_path):
    terrain = rough()
    files, dialog = exported(terrain, tmp_path)
    heights, size = unity_import(files[0], dialog)
    step = size["y"] / 65536
    assert np.abs(heights[::-1] - terrain.elevation).max() <= step / 2 * 1.0001
    assert (size["x"], size["z"]) == (160.0, 160.0)
    raw = np.fromfile(files[0], "<u2")
    assert (raw.min(), raw.max()) == (0, 65535)
    assert step == pytest.approx(np.ptp(terrain.elevation) / 65535, rel=1e-6)


@pytest.mark.parametrize(
    ("row", "col", "z", "x", "name"),
    [
        (0, 0, 32, 0, "northWest"),
        (0, -1, 32, 32, "northEast"),
        (-1, 0, 0, 0, "southWest"),
        (-1, -1, 0, 32, "southEast"),
    ],
)
def test_a_spike_lands_in_its_corner(tmp_path, row, col, z, x, name):
    values = np.zeros((33, 33))
    values[row, col] = 50.0
    files, dialog = exported(Heightfield(values, 5.0), tmp_path)
    heights, _ = unity_import(files[0], dialog)
    assert heights[z, x] == pytest.approx(50.0, abs=0.001)
    assert np.count_nonzero(heights) == 1
    corners = {key: corner["value"] for key, corner in dialog["corners"].items()}
    assert corners == {**dict.fromkeys(corners, 0), name: 65535}
    assert dialog["corners"][name]["height"] == pytest.approx(50.0)


def test_given_range_is_kept_exactly(tmp_path):
    values = np.linspace(0, 600, 33 * 33).reshape(33, 33)
    files, dialog = exported(Heightfield(values, 5.0), tmp_path, height_min=0.0, height_max=600.0)
    assert dialog["terrainSize"]["y"] == 600.0
    assert dialog["heightOffset"] == 0.0
    raw = np.fromfile(files[0], "<u2").reshape(33, 33)[::-1]
    expected = np.minimum(np.floor(values.astype("f4") / 600 * 65536 + 0.5), 65535)
    assert np.array_equal(raw, expected)
    with pytest.raises(InputError, match=r"from 0 to 600 m and leave .* height_max = 500"):
        UnityRaw(height_max=500.0).export(Heightfield(values, 5.0), tmp_path / "b.raw", Run())
    with pytest.raises(InputError, match="leave height_min = 10 to"):
        UnityRaw(height_min=10.0).export(Heightfield(values, 5.0), tmp_path / "b.raw", Run())
    with pytest.raises(InputError, match="must be above"):
        UnityRaw(height_min=10.0, height_max=5.0).scale(np.zeros((2, 2), np.float32))
    assert not (tmp_path / "b.raw").exists()


@pytest.mark.parametrize(
    ("shape", "near"),
    [((32, 32), "33"), ((1024, 1024), "513 and 1025"), ((33, 65), "65"), ((5000, 5000), "4097")],
)
def test_sizes_that_unity_would_tear_are_refused(shape, near):
    with pytest.raises(InputError, match=rf"{shape[0]}x{shape[1]} samples; .*{near}"):
        UnityRaw().check(Grid(shape, 1.0))
    UnityRaw(resample=True).check(Grid(shape, 1.0))
    for side in (33, 65, 129, 257, 513, 1025, 2049, 4097):
        UnityRaw().check(Grid((side, side), 1.0))


def test_resampling_keeps_planes_edges_and_true_sizes(tmp_path):
    row, col = np.mgrid[:40, :60].astype(float)
    terrain = Heightfield(3 * col - 2 * row + 200, 5.0)
    files, dialog = exported(terrain, tmp_path, resample=True)
    heights, size = unity_import(files[0], dialog)
    assert heights.shape == (65, 65)
    assert (size["x"], size["z"]) == (295.0, 195.0)
    z, x = np.mgrid[:65, :65] / 64
    assert np.allclose(heights, 3 * 59 * x - 2 * 39 * (1 - z) + 200, atol=0.01)


def test_flat_terrain_warns_and_stays_at_its_height(tmp_path):
    with pytest.warns(UserWarning, match="the terrain is flat"):
        files, dialog = exported(Heightfield(np.full((33, 33), 123.5), 5.0), tmp_path)
    heights, size = unity_import(files[0], dialog)
    assert size["y"] > 0
    assert (heights == 123.5).all()


def with_materials(count):
    rng = np.random.default_rng(1)
    weights = rng.random((count, 33, 33)).astype(np.float32) ** 4
    weights /= weights.sum(axis=0)
    weights[:, :9, -9:] = 0.0
    weights[-1, :9, -9:] = 1.0
    layers = {f"material_m{i}": weights[i] for i in range(count)}
    return rough(layers=layers), weights


@pytest.mark.parametrize("count", [1, 3, 4, 6])
def test_alphamaps_sum_to_255_and_lie_north_up(tmp_path, count):
    terrain, weights = with_materials(count)
    files, dialog = exported(terrain, tmp_path)
    pictures = [Image.open(tmp_path / name) for name in dialog["alphamaps"]["files"]]
    assert len(pictures) == -(-count // 4)
    assert all(p.mode == "RGBA" and p.size == (32, 32) for p in pictures)
    stack = np.concatenate([np.asarray(p) for p in pictures], axis=-1).astype(int)
    assert (stack.sum(axis=-1) == 255).all()
    assert dialog["alphamaps"]["resolution"] == 32
    for layer in dialog["layers"]:
        file = dialog["alphamaps"]["files"].index(layer["file"])
        channel = 4 * file + "RGBA".index(layer["channel"])
        assert channel == layer["index"] == int(layer["name"][1:])
        cells = weights[layer["index"]]
        mean = (cells[:-1, :-1] + cells[1:, :-1] + cells[:-1, 1:] + cells[1:, 1:]) / 4
        assert np.abs(stack[..., channel] - mean * 255).max() < 1.0001
        assert layer["tileSize"] == {"x": 10.0, "y": 10.0}
    assert stack[2, 29, count - 1] == 255
    assert [f.name for f in files[2:]] == dialog["alphamaps"]["files"]


def test_cells_without_any_material_get_the_first():
    cells = cell_weights([np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32)])
    assert np.array_equal(bytes_of(cells)[:, 0, 0], [255, 0])


def test_sidecar_says_all_that_the_dialog_asks(tmp_path):
    _, dialog = exported(rough(origin=(100.0, 900.0)), tmp_path)
    assert dialog["heightmap"]["file"] == "hill.raw"
    assert dialog["worldSouthWest"] == {"east": 100.0, "north": 740.0}
    assert dialog["about"]["seed"] == "3"
    text = "\n".join(dialog["importRecipe"])
    for word in ("Resolution 33", "Byte Order Windows", "Flip Vertically off", "Size X 160"):
        assert word in text
    assert dialog["alphamaps"]["files"] == dialog["layers"] == []


def test_same_bytes_twice(tmp_path):
    terrain, _ = with_materials(5)
    first = {p.name: p.read_bytes() for p in exported(terrain, tmp_path)[0]}
    assert {p.name: p.read_bytes() for p in exported(terrain, tmp_path)[0]} == first


def test_the_main_file_may_not_be_the_sidecar(tmp_path):
    for name in ("a.json", "run.raw"):
        with pytest.raises(InputError, match=r"sidecar would be \w+\.json, which is taken"):
            UnityRaw().export(rough(), tmp_path / name, Run())
