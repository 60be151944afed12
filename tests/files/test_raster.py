"""Rasters made here with rasterio come in where they lie on the ground, and bad ones do not."""

from __future__ import annotations

import struct
import warnings

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from terrakit.errors import InputError, TerrakitError
from terrakit.running import Run
from terrakit_files.raster import Raster, metres_a_degree

UTM = "EPSG:32632"
WEST, NORTH = 500_000.0, 5_200_000.0


def place(west, north, across, down):
    return Affine(across, 0, west, 0, -down, north)


def spiked(rows=6, cols=8, kind="float32"):
    """Heights with a spike in the north-east corner."""
    values = (np.arange(rows * cols).reshape(rows, cols) % 50 + 10).astype(kind)
    values[0, -1] = 120
    return values


def write(path, values, transform=None, crs=UTM, tags=None, unit=None, scale=None, **profile):
    bands = values if values.ndim == 3 else values[None]
    placed = place(WEST, NORTH, 10, 10) if transform is None else transform
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        with rasterio.open(
            path,
            "w",
            driver=profile.pop("driver", "GTiff"),
            count=len(bands),
            dtype=bands.dtype,
            height=bands.shape[1],
            width=bands.shape[2],
            crs=crs,
            transform=placed,
            **profile,
        ) as dataset:
            if tags:
                dataset.update_tags(**tags)
            if unit:
                dataset.set_band_unit(1, unit)
            if scale:
                dataset.scales, dataset.offsets = [scale[0]], [scale[1]]
            dataset.write(bands)
    return path


def load(path, **settings):
    return Raster(**settings).load(path, Run())


@pytest.mark.parametrize("meaning", ["Area", "Point"])
def test_origin_is_the_centre_of_the_first_pixel(tmp_path, meaning):
    values = spiked()
    path = write(tmp_path / "a.tif", values, tags={"AREA_OR_POINT": meaning})
    terrain = load(path)
    assert terrain.origin == (WEST + 5, NORTH - 5)
    assert terrain.spacing == 10
    assert terrain.crs == UTM
    assert np.array_equal(terrain.elevation, values)
    assert terrain.elevation[0, -1] == 120
    assert list(terrain) == ["elevation"]


def test_point_sampled_srtm_lies_on_whole_degrees(tmp_path):
    values = np.zeros((1201, 1201), ">i2")
    values[0, -1] = 900
    values[5, 5] = -32768
    path = tmp_path / "N46E008.hgt"
    path.write_bytes(values.tobytes())
    assert Raster.recognises(path, values.tobytes()[:64])
    with pytest.raises(InputError, match=r"degrees \(about 64\.\d x 92\.6 m at latitude 46\.50\)"):
        load(path)
    with pytest.raises(InputError, match=r"N46E008.hgt: 1 of 1,442,401 cells have no height"):
        load(path, spacing=90.0)
    with pytest.warns(UserWarning, match="no height"):
        terrain = load(path, spacing=90.0, fill="nearest")
    rows, cols = terrain.shape
    assert np.unravel_index(terrain.elevation.argmax(), terrain.shape) == (0, cols - 1)
    # Samples lie on whole degrees, so 1201 of them span one degree and not 1201/1200.
    north, east = metres_a_degree(46.5)
    assert (rows, cols) == (int(north / 90) + 1, int(east / 90) + 1)


@pytest.mark.parametrize(
    "packing",
    [
        {}, {"compress": "lzw"}, {"compress": "deflate", "predictor": 3}, {"BIGTIFF": "YES"},
        {"tiled": True, "blockxsize": 16, "blockysize": 16}, {"ENDIANNESS": "BIG"},
        {"compress": "zstd"},
    ],
)  # fmt: skip
def test_every_packing_is_exact(tmp_path, packing):
    values = np.random.default_rng(0).normal(500, 300, (33, 47)).astype(np.float32)
    path = write(tmp_path / "a.tif", values, **packing)
    assert Raster.recognises(path, path.read_bytes()[:64])
    assert np.array_equal(load(path).elevation, values)


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint16", "int32", "float32", "float64"])
def test_every_number_type(tmp_path, kind):
    terrain = load(write(tmp_path / "a.tif", spiked(kind=kind)))
    assert terrain.elevation.dtype == np.float32
    assert np.array_equal(terrain.elevation, spiked())


def test_scale_offset_and_feet(tmp_path):
    path = write(tmp_path / "a.tif", spiked(kind="int16"), scale=(0.1, 100.0))
    assert np.allclose(load(path).elevation, spiked() * 0.1 + 100)
    path = write(tmp_path / "b.tif", spiked(), unit="ft")
    with pytest.warns(UserWarning, match="heights are in ft; converted"):
        assert np.allclose(load(path).elevation, spiked() * 0.3048)


def test_coordinates_in_feet_become_metres(tmp_path):
    path = write(tmp_path / "a.tif", spiked(), place(1e6, 2e6, 10, 10), "EPSG:2263")
    with pytest.warns(UserWarning, match="US survey foot; converted"):
        terrain = load(path)
    assert terrain.spacing == pytest.approx(3.048006)
    assert terrain.origin[0] == pytest.approx(1000005 * 0.3048006096)
    assert terrain.crs is None


def test_nodata_is_refused_filled_or_replaced(tmp_path):
    values = spiked()
    values[2, 3] = values[2, 4] = -9999
    path = write(tmp_path / "a.tif", values, nodata=-9999)
    with pytest.raises(InputError, match=r"2 of 48 cells .*\(first at row 2, column 3\); fill"):
        load(path)
    expected = {"min": 10.0, "value": 7.0, "nearest": None}
    for fill, height in expected.items():
        with pytest.warns(UserWarning, match="2 of 48 cells have no height"):
            terrain = load(path, fill=fill, fill_value=7.0)
        assert np.array_equal(np.argwhere(terrain.layer("valid") == 0), [[2, 3], [2, 4]])
        if height is not None:
            assert terrain.elevation[2, 3] == height
        else:
            near = {values[1, 3], values[3, 3], values[2, 2]}
            assert terrain.elevation[2, 3] in near
        kept = values != -9999
        assert np.array_equal(terrain.elevation[kept], values[kept])


def test_untagged_nodata_is_asked_about(tmp_path):
    values = spiked()
    values[1, 1] = -9999
    path = write(tmp_path / "a.tif", values)
    with pytest.raises(InputError, match=r"minimum -9999 \(1 cells\) looks like nodata"):
        load(path)
    with pytest.warns(UserWarning, match="filled: nearest"):
        assert load(path, nodata=-9999, fill="nearest").elevation.min() >= 10
    assert load(path, nodata=5).elevation.min() == -9999


def test_nan_all_missing_and_impossible_heights(tmp_path):
    values = spiked()
    values[3, 1] = np.nan
    with pytest.raises(InputError, match="1 of 48 cells"):
        load(write(tmp_path / "a.tif", values))
    with pytest.raises(InputError, match="no valid cell"):
        load(write(tmp_path / "b.tif", np.full((5, 5), np.nan, "f4")), fill="min")
    values[3, 1] = 1e33
    with pytest.raises(InputError, match=r"reach 1e\+33 m.*nodata"):
        load(write(tmp_path / "c.tif", values))
    fine = 5e6 + np.linspace(0, 0.01, 48).reshape(6, 8)
    with pytest.warns(UserWarning, match=r"float32 steps are 0\.5 m"):
        load(write(tmp_path / "d.tif", fine))


def test_degrees_need_a_spacing_and_then_become_metres(tmp_path):
    degree = 1 / 3600
    corner = place(8.0, 46.0, degree, degree)
    values = np.repeat(np.linspace(0, 1000, 90, dtype="f4")[:, None], 90, axis=1)
    path = write(tmp_path / "a.tif", values, corner, "EPSG:4326")
    with pytest.raises(InputError, match=r"degrees \(about 21\.5 x 30\.9 m at latitude 45\.99"):
        load(path)
    terrain = load(path, spacing=30.0)
    north, east = metres_a_degree(45.9875)
    assert terrain.shape == (int(89 * degree * north / 30) + 1, int(89 * degree * east / 30) + 1)
    slope = np.diff(terrain.elevation[:, 5]).mean() / 30.0
    assert slope == pytest.approx(1000 / (89 * degree * north), rel=0.02)


def test_metres_a_degree_at_the_ends():
    assert metres_a_degree(0) == pytest.approx((110574.3, 111319.5), abs=0.1)
    assert metres_a_degree(90) == pytest.approx((111693.9, 0.0), abs=0.1)


def test_cells_that_are_not_square(tmp_path):
    values = np.repeat(np.linspace(0, 90, 10, dtype="f4")[None], 7, axis=0)
    path = write(tmp_path / "a.tif", values, place(WEST, NORTH, 30, 10))
    with pytest.raises(InputError, match="30 x 10 m, not square; say spacing = 10"):
        load(path)
    terrain = load(path, spacing=10)
    assert terrain.shape == (7, 28)
    assert np.allclose(terrain.elevation[3], np.linspace(0, 90, 28), atol=1e-4)
    assert terrain.origin == (WEST + 15, NORTH - 5)


def test_spacing_resamples_what_says_otherwise(tmp_path):
    plane = np.add.outer(np.arange(41.0), 2 * np.arange(41.0))
    path = write(tmp_path / "a.tif", plane)
    assert load(path, spacing=10).shape == (41, 41)
    finer, coarser = load(path, spacing=5), load(path, spacing=20)
    assert finer.shape == (81, 81)
    assert np.allclose(finer.elevation[::2, ::2], plane, atol=1e-4)
    assert coarser.shape == (21, 21)
    assert np.allclose(coarser.elevation[1:-1, 1:-1], plane[2:-2:2, 2:-2:2], atol=1e-3)
    with pytest.raises(InputError, match="cells > limit"):
        load(path, spacing=0.001, max_cells=10_000)


def test_south_up_east_left_and_rotated(tmp_path):
    values = spiked()
    south_up = Affine(10, 0, WEST, 0, 10, NORTH - 60)
    terrain = load(write(tmp_path / "a.tif", values[::-1], south_up))
    assert np.array_equal(terrain.elevation, values)
    assert terrain.origin == (WEST + 5, NORTH - 5)
    mirrored = Affine(-10, 0, WEST + 80, 0, -10, NORTH)
    terrain = load(write(tmp_path / "b.tif", values[:, ::-1], mirrored))
    assert np.array_equal(terrain.elevation, values)
    assert terrain.origin == (WEST + 5, NORTH - 5)
    rotated = Affine(10, 1, WEST, 1, -10, NORTH)
    with pytest.raises(InputError, match="is rotated"):
        load(write(tmp_path / "c.tif", values, rotated))


def test_without_coordinates_the_spacing_must_be_said(tmp_path):
    path = write(tmp_path / "a.tif", spiked(), Affine.identity(), None)
    with pytest.raises(InputError, match="how far its samples are apart; say spacing"):
        load(path)
    terrain = load(path, spacing=2.0)
    assert (terrain.spacing, terrain.origin) == (2.0, (0.0, 10.0))


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (3, 8)])
def test_small_and_oblong(tmp_path, shape):
    assert load(write(tmp_path / "a.tif", np.ones(shape, "f4"))).shape == shape


def test_bands_pictures_and_complex(tmp_path):
    two = np.stack((spiked(), spiked() + 100))
    path = write(tmp_path / "a.tif", two)
    assert load(path, band=2).elevation.max() == 220
    with pytest.raises(InputError, match="band = 3: the file has 2"):
        load(path, band=3)
    with pytest.warns(UserWarning, match="3 bands of 8 bits are a picture"):
        load(write(tmp_path / "b.tif", np.stack([spiked(kind="uint8")] * 3)))
    with pytest.raises(InputError, match="needs a 2-D real array, got complex"):
        load(write(tmp_path / "c.tif", spiked().astype("complex64")))


def test_ascii_grid(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(
        "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n"
        "1 2 3.5\n4 5 6\n"
    )
    assert Raster.recognises(path, path.read_bytes())
    terrain = load(path)
    assert np.array_equal(terrain.elevation, [[1, 2, 3.5], [4, 5, 6]])
    assert terrain.origin == (105.0, 215.0)
    path.write_text("ncols 3\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 10\n1 2 3\n")
    with pytest.raises(InputError, match=r"^a.asc: .*(cut short|damaged)"):
        load(path)


def tiff_header(width, height):
    """A TIFF of 138 bytes or so that claims any size."""
    entries = [
        (256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 32), (259, 3, 1, 1), (262, 3, 1, 1),
        (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, 2**31), (339, 3, 1, 3),
    ]  # fmt: skip
    body = struct.pack("<H", len(entries))
    body += b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<I", 8) + body + struct.pack("<I", 0)


def test_a_header_that_asks_for_too_much(tmp_path):
    path = tmp_path / "huge.tif"
    path.write_bytes(tiff_header(50_000, 100_000))
    with pytest.raises(
        InputError, match=r"huge.tif: claims .* \(20\.0 GB\) but the file has 134 bytes"
    ):
        load(path)
    honest = write(tmp_path / "b.tif", spiked())
    with pytest.raises(InputError, match="48 cells > limit 40"):
        load(honest, max_cells=40)


def test_every_truncation_is_one_line_that_names_the_file(tmp_path):
    values = np.random.default_rng(0).normal(500, 300, (64, 64)).astype(np.float32)
    whole = write(tmp_path / "a.tif", values, compress="deflate").read_bytes()
    cut = tmp_path / "cut.tif"
    for length in np.linspace(0, len(whole) - 1, 60).astype(int):
        cut.write_bytes(whole[:length])
        with pytest.raises(InputError) as caught:
            load(cut)
        assert str(caught.value).startswith("cut.tif: ")
        assert "\n" not in str(caught.value)


def test_flipped_bytes_never_raise_anything_else(tmp_path):
    rng = np.random.default_rng(0)
    values = rng.normal(500, 300, (32, 32)).astype(np.float32)
    whole = bytearray(write(tmp_path / "a.tif", values, compress="lzw").read_bytes())
    path = tmp_path / "b.tif"
    for _ in range(60):
        broken = bytearray(whole)
        broken[rng.integers(0, 400)] ^= 1 << rng.integers(0, 8)
        path.write_bytes(broken)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            try:
                load(path, spacing=10, fill="min")
            except TerrakitError as error:
                assert str(error).startswith("b.tif: ")  # noqa: PT017


def test_other_content_missing_and_odd_names(tmp_path):
    for name, content in {"a.tif": b"", "b.tif": b"II*\0", "c.tif": b"<html>no</html>"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=f"^{name}: "):
            load(tmp_path / name)
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "missing.tif")
    with pytest.raises(InputError, match="is a folder"):
        load(tmp_path)
    (tmp_path / "x.vrt").write_text("<VRTDataset rasterXSize='2' rasterYSize='2'/>")
    with pytest.raises(InputError, match=r"^x.vrt: "):
        load(tmp_path / "x.vrt")
    path = write(tmp_path / "plain.tif", spiked())
    for name in ("with blank?.tif", "-lead.tif", "a!b'c\"d.tif", "ü\nä.tif", b"\xff\xfe.tif"):
        odd = tmp_path / (name if isinstance(name, str) else name.decode(errors="surrogateescape"))
        odd.write_bytes(path.read_bytes())
        assert load(odd).shape == (6, 8)


def test_crs_objects_survive_as_text(tmp_path):
    local = CRS.from_proj4("+proj=tmerc +lat_0=47 +lon_0=8 +k=1 +ellps=WGS84 +units=m")
    terrain = load(write(tmp_path / "a.tif", spiked(), crs=local))
    assert CRS.from_user_input(terrain.crs) == local
