"""Arrays of any layout, archives that come back bit for bit, and nothing pickled."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from terrakit.errors import InputError, TerrakitError
from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit_files.npz import Npz
from terrakit_files.numpy import Numpy


def load(path, **settings):
    return Numpy(**settings).load(path, Run())


def heights(rows=5, cols=7):
    values = np.random.default_rng(2).normal(100, 50, (rows, cols)).astype(np.float32)
    values[0, -1] = 900
    return values


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v,
        np.asfortranarray,
        lambda v: v.astype(">f4"),
        lambda v: v.astype("<f8"),
        lambda v: np.repeat(np.repeat(v, 2, 0), 3, 1)[::2, ::3],
    ],
)
def test_every_layout_gives_the_same(tmp_path, change):
    np.save(tmp_path / "a.npy", change(heights()))
    terrain = load(tmp_path / "a.npy", spacing=3.0)
    assert np.array_equal(terrain.elevation, heights())
    assert terrain.elevation[0, -1] == 900
    assert (terrain.spacing, terrain.origin) == (3.0, (0.0, 12.0))


@pytest.mark.parametrize("kind", ["?", "u1", "i2", ">u2", "i8", "f2"])
def test_every_real_type(tmp_path, kind):
    values = (np.arange(12) % 2).reshape(3, 4).astype(kind)
    np.save(tmp_path / "a.npy", values)
    assert np.array_equal(load(tmp_path / "a.npy", spacing=1.0).elevation, values.astype("f4"))


def terrain_with_everything():
    values = heights()
    values[1, 1] = -0.0
    values[2, 2] = -9999
    layers = {"wetness": values * 0.5, "material_rock": np.ones_like(values), "my_own": values}
    return Heightfield(values, 0.1, (412345.678, 5412000.1), "EPSG:32632", layers)


@pytest.mark.parametrize("compress", [False, True])
def test_round_trip_is_bit_for_bit(tmp_path, compress):
    before = terrain_with_everything()
    (path,) = Npz(compress=compress).export(before, tmp_path / "a.npz", Run())
    assert Numpy.recognises(path, path.read_bytes()[:64])
    after = load(path)
    assert after.grid == before.grid
    assert list(after) == list(before)
    for name in before:
        assert after.layer(name).tobytes() == before.layer(name).tobytes()


def test_bytes_do_not_depend_on_the_time(tmp_path, monkeypatch):
    before = terrain_with_everything()
    first = Npz().export(before, tmp_path / "a.npz", Run())[0].read_bytes()
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    (tmp_path / "a.npz").unlink()
    assert Npz().export(before, tmp_path / "a.npz", Run())[0].read_bytes() == first
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert {info.date_time[0] for info in archive.infolist()} == {1980}
    with np.load(tmp_path / "a.npz", allow_pickle=False) as plain:
        assert np.array_equal(plain["elevation"], before.elevation)
        assert float(plain["spacing"]) == 0.1


def test_a_layer_may_not_take_a_name_of_the_format(tmp_path):
    terrain = Heightfield(heights(), 1.0, layers={"spacing": heights()})
    with pytest.raises(InputError, match="layer 'spacing'"):
        Npz().export(terrain, tmp_path / "a.npz", Run())
    assert not list(tmp_path.iterdir())


def test_which_array_of_an_archive(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, dem=heights(), other=np.arange(3))
    assert np.array_equal(load(path, spacing=1.0).elevation, heights())
    np.savez(path, dem=heights(), other=heights() + 1)
    with pytest.raises(
        InputError, match=r"several 2-D arrays \(dem, other\); say which: key = dem"
    ):
        load(path, spacing=1.0)
    assert load(path, spacing=1.0, key="other").elevation[0, -1] == 901
    with pytest.raises(InputError, match="no array 'nothing'; it has: dem, other"):
        load(path, spacing=1.0, key="nothing")
    np.savez(path, line=np.arange(3))
    with pytest.raises(InputError, match="no 2-D array; it has: line"):
        load(path, spacing=1.0)
    np.savez_compressed(path, elevation=heights(), b=heights(), mask_a=heights(3, 3))
    assert list(load(path, spacing=1.0)) == ["elevation"]
    np.savez(path, elevation=heights(), wetness=np.zeros((5, 7)), stranger=heights())
    assert list(load(path, spacing=1.0)) == ["elevation", "wetness"]


def test_degrees_of_an_archive_are_not_taken_for_metres(tmp_path):
    path = tmp_path / "jacksboro.npz"
    np.savez(path, elevation=heights().astype("i2"), dx=0.000833, dy=0.000833, xmin=-84.4)
    with pytest.raises(InputError, match=r"say spacing = metres .*it holds dx = 0.000833 and dy"):
        load(path)
    assert load(path, spacing=83.0).spacing == 83.0


def test_jacksboro_itself():
    cbook = pytest.importorskip("matplotlib.cbook")
    from pathlib import Path

    path = Path(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))
    terrain = load(path, spacing=83.0)
    assert terrain.shape == (344, 403)
    assert 200 < terrain.elevation.min() < terrain.elevation.max() < 1200


def test_nothing_pickled_is_run(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "canary"), "w"))

    objects = np.empty((2, 2), object)
    objects[:] = Bomb()
    np.save(tmp_path / "a.npy", objects)
    np.savez(tmp_path / "b.npz", elevation=objects)
    np.savez(tmp_path / "c.npz", elevation=heights(), spacing=np.array(Bomb(), object))
    for name in ("a.npy", "b.npz", "c.npz"):
        with pytest.raises(InputError, match=rf"^{name}: holds pickled objects"):
            load(tmp_path / name, spacing=1.0)
    assert not (tmp_path / "canary").exists()


@pytest.mark.parametrize(
    ("values", "got"),
    [
        (np.zeros((2, 2), complex), "complex128"),
        (np.zeros(5), r"\(5,\)"),
        (np.zeros((2, 2, 2)), r"\(2, 2, 2\)"),
        (np.float32(1), r"shape \(\)"),
        (np.zeros((2, 2), "U3"), "<U3"),
        (np.zeros((2, 2), "M8[s]"), "datetime64"),
        (np.zeros((2, 2), [("a", "f4")]), "float32|f4"),
    ],
)
def test_what_is_no_real_grid(tmp_path, values, got):
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(InputError, match=rf"a\.npy: needs a 2-D real array, got .*({got})"):
        load(tmp_path / "a.npy", spacing=1.0)


def test_nan_nodata_and_no_spacing(tmp_path):
    values = heights()
    values[2, 1] = np.inf
    values[3, 1] = np.nan
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(InputError, match=r"2 of 35 cells .*row 2, column 1"):
        load(tmp_path / "a.npy", spacing=1.0)
    with pytest.warns(UserWarning, match="filled: nearest"):
        terrain = load(tmp_path / "a.npy", spacing=1.0, fill="nearest")
    assert terrain.layer("valid").sum() == 33
    np.save(tmp_path / "b.npy", heights())
    with pytest.raises(InputError, match="say spacing"):
        load(tmp_path / "b.npy")


def test_claims_are_checked_before_memory_is_taken(tmp_path):
    head = io.BytesIO()
    header = {"descr": "<f4", "fortran_order": False, "shape": (100_000, 100_000)}
    np.lib.format.write_array_header_1_0(head, header)
    path = tmp_path / "a.npy"
    path.write_bytes(head.getvalue() + bytes(40))
    with pytest.raises(InputError, match=r"cut short: 40 of 40,000,000,000 bytes"):
        load(path, spacing=1.0)
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("elevation.npy", path.read_bytes())
    with pytest.raises(InputError, match="cut short"):
        load(tmp_path / "b.npz", spacing=1.0)
    np.save(path, heights())
    with pytest.raises(InputError, match="35 cells > limit 30"):
        load(path, spacing=1.0, max_cells=30)


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_every_truncation_is_one_line(tmp_path, suffix):
    whole = tmp_path / f"a{suffix}"
    if suffix == ".npy":
        np.save(whole, heights(32, 32))
    else:
        Npz().export(Heightfield(heights(32, 32), 1.0), whole, Run())
    content = whole.read_bytes()
    cut = tmp_path / f"cut{suffix}"
    for length in range(0, len(content) - 1, max(1, len(content) // 80)):
        cut.write_bytes(content[:length])
        with pytest.raises(InputError, match=r"^cut\.np[yz]: [^\n]*$"):
            load(cut, spacing=1.0)


def test_flipped_bytes_never_raise_anything_else(tmp_path):
    rng = np.random.default_rng(0)
    (whole,) = Npz().export(Heightfield(heights(8, 8), 1.0), tmp_path / "a.npz", Run())
    content = whole.read_bytes()
    for _ in range(150):
        broken = bytearray(content)
        broken[rng.integers(0, len(broken))] ^= 1 << rng.integers(0, 8)
        (tmp_path / "b.npz").write_bytes(broken)
        try:
            load(tmp_path / "b.npz", spacing=1.0)
        except TerrakitError as error:
            assert str(error).startswith("b.npz: ")  # noqa: PT017


def test_other_content(tmp_path):
    for name, content in {"a.npy": b"", "b.npy": b"text", "c.npz": b"PK\x03\x04rubbish"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=rf"^{name}: "):
            load(tmp_path / name, spacing=1.0)
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "missing.npy", spacing=1.0)
