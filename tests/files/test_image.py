"""Heightmaps keep every bit and their compass corners."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from PIL import Image as Pillow

from terrakit.errors import InputError
from terrakit.running import Run
from terrakit_files.image import Image


def load(path, **settings):
    return Image(**{"height_max": 65535.0, "spacing": 2.0, **settings}).load(path, Run())


def png(path, values, colour_type=0, depth=None, extra=()):
    """Write a PNG with nothing but zlib, so that no library rounds on the way."""
    depth = depth or values.dtype.itemsize * 8
    rows, cols = values.shape[:2]
    data = values.astype(values.dtype.newbyteorder(">")).reshape(rows, -1).view(np.uint8)
    packed = zlib.compress(b"".join(b"\0" + row.tobytes() for row in data))
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", cols, rows, depth, colour_type, 0, 0, 0)),
        *extra,
        (b"IDAT", packed),
        (b"IEND", b""),
    ]
    content = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    path.write_bytes(content)
    return path


def every_number():
    return np.arange(65536, dtype=np.uint16).reshape(128, 512)


def test_all_65536_values_survive_and_north_is_up(tmp_path):
    path = png(tmp_path / "a.png", every_number())
    assert Image.recognises(path, path.read_bytes()[:64])
    terrain = load(path)
    assert np.array_equal(terrain.elevation, every_number())
    assert (terrain.spacing, terrain.origin) == (2.0, (0.0, 254.0))
    assert list(terrain) == ["elevation"]


def test_heights_run_between_black_and_white(tmp_path):
    path = png(tmp_path / "a.png", every_number())
    terrain = load(path, height_min=-100.0, height_max=900.0)
    assert terrain.elevation[0, 0] == -100
    assert terrain.elevation[-1, -1] == 900
    assert np.allclose(terrain.elevation, every_number() / 65535 * 1000 - 100, atol=1e-4)


def test_gamma_alpha_and_transparency_are_ignored(tmp_path):
    grey = every_number()
    half = (b"gAMA", struct.pack(">I", 45455)), (b"tRNS", struct.pack(">H", 700))
    assert np.array_equal(load(png(tmp_path / "a.png", grey, extra=half)).elevation, grey)
    alpha = np.stack((grey, np.full_like(grey, 5)), axis=-1)
    assert np.array_equal(load(png(tmp_path / "b.png", alpha, 4)).elevation, grey)


def test_sixteen_bit_colour_is_kept_if_grey_and_refused_if_not(tmp_path):
    grey = every_number()
    same = np.stack((grey, grey, grey), axis=-1)
    assert np.array_equal(load(png(tmp_path / "a.png", same, 2)).elevation, grey)
    same[3, 3, 1] ^= 1
    with pytest.raises(InputError, match="is a colour picture; a heightmap must be grey"):
        load(png(tmp_path / "b.png", same, 2))


def test_eight_bits_warn_of_terraces(tmp_path):
    grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
    with pytest.warns(UserWarning, match="256 grey values over 255 m make terraces"):
        terrain = load(png(tmp_path / "a.png", grey), height_max=255.0)
    assert np.array_equal(terrain.elevation, grey)
    for mode, name in (("L", "b.bmp"), ("L", "b.pgm")):
        Pillow.fromarray(grey).convert(mode).save(tmp_path / name)
        with pytest.warns(UserWarning, match="terraces"):
            assert np.array_equal(load(tmp_path / name, height_max=255.0).elevation, grey)


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_few_bits_are_stretched(tmp_path, depth):
    packed = np.arange(8, dtype=np.uint8).reshape(4, 2) * 0x11
    width = 2 * 8 // depth
    path = png(tmp_path / "a.png", packed, depth=depth)
    content = bytearray(path.read_bytes())
    content[16:20] = struct.pack(">I", width)
    content[29:33] = struct.pack(">I", zlib.crc32(bytes(content[12:29])))
    path.write_bytes(content)
    bits = np.unpackbits(packed, axis=1).reshape(4, width, depth)
    expected = (bits * (1 << np.arange(depth)[::-1])).sum(axis=-1) / (2**depth - 1)
    with pytest.warns(UserWarning, match="terraces"):
        assert np.allclose(load(path, height_max=1.0).elevation, expected)


def test_palettes_give_grey_or_are_refused(tmp_path):
    index = np.array([[0, 1], [2, 3]], np.uint8)
    for name, table in (("g.png", [9] * 3 + [200] * 3 + [50] * 3 + [0] * 3), ("c.png", range(12))):
        picture = Pillow.fromarray(index)
        picture.putpalette(list(table))
        picture.save(tmp_path / name)
    with pytest.warns(UserWarning, match="terraces"):
        terrain = load(tmp_path / "g.png", height_max=255.0)
    assert np.array_equal(terrain.elevation, [[9, 200], [50, 0]])
    with pytest.raises(InputError, match="colour palette"):
        load(tmp_path / "c.png")


def test_content_decides_and_a_jpeg_says_so(tmp_path):
    path = tmp_path / "really.png"
    Pillow.fromarray(np.full((16, 16), 99, np.uint8)).save(path, "JPEG")
    assert Image.recognises(path, path.read_bytes()[:64])
    with pytest.warns(UserWarning, match="is a JPEG: lossy"):
        load(path)
    text = tmp_path / "text.png"
    text.write_text("<!doctype html>")
    assert not Image.recognises(text, text.read_bytes())
    with pytest.raises(InputError, match=r"^text.png: "):
        load(text)


def test_the_scale_must_be_said(tmp_path):
    path = png(tmp_path / "a.png", every_number())
    for settings in ({}, {"spacing": 1.0}, {"height_max": 10.0}):
        with pytest.raises(InputError, match=r"a.png: a picture has no scale; say height_max"):
            Image(**settings).load(path, Run())


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 5)])
def test_small_and_oblong(tmp_path, shape):
    values = np.arange(shape[0] * shape[1], dtype=np.uint16).reshape(shape)
    assert np.array_equal(load(png(tmp_path / "a.png", values)).elevation, values)


def test_broken_files_are_one_line(tmp_path):
    rng = np.random.default_rng(0)
    whole = png(tmp_path / "a.png", rng.integers(0, 65536, (64, 64)).astype(np.uint16)).read_bytes()
    cut = tmp_path / "cut.png"
    for length in np.linspace(0, len(whole) - 20, 50).astype(int):
        cut.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"^cut\.png: [^\n]*$"):
            load(cut)
    flipped = bytearray(whole)
    flipped[4000] ^= 0x10
    cut.write_bytes(flipped)
    with pytest.raises(InputError, match=r"^cut\.png: is cut short or damaged"):
        load(cut)


def test_impossible_and_huge_sizes(tmp_path):
    path = png(tmp_path / "a.png", every_number())
    for width, height in ((0, 0), (2**31 - 1, 2**31 - 1), (60_000, 60_000)):
        content = bytearray(path.read_bytes()[:150])
        content[16:24] = struct.pack(">II", width, height)
        content[29:33] = struct.pack(">I", zlib.crc32(bytes(content[12:29])))
        (tmp_path / "b.png").write_bytes(content)
        with pytest.raises(InputError, match=r"^b\.png: (claims|cannot be read|size)"):
            load(tmp_path / "b.png")
    with pytest.raises(InputError, match="65,536 cells > limit 1,000"):
        load(path, max_cells=1000)
