"""Pictures: light from the right side, north up, no larger than promised."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from terrakit.errors import InputError, OutputError
from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit.shading import FLAT, blurred, hillshade, hypsometric, relief_image
from terrakit_files.preview import Preview


def cone(side=65, height=300.0, spacing=10.0):
    row, col = np.mgrid[:side, :side] - side // 2
    return np.maximum(0, height - np.hypot(row, col) * spacing).astype(np.float32)


def fractal(side):
    rng = np.random.default_rng(1)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    frequency[0, 0] = 1.0
    field = np.fft.ifft2(np.fft.fft2(rng.standard_normal((side, side))) / frequency**2).real
    return (field / field.std() * 200 + 100).astype(np.float32)


def test_level_ground_has_the_neutral_shade():
    shade = hillshade(np.full((9, 9), 512.0), 10.0)
    assert shade.dtype == np.float32
    assert np.allclose(shade, FLAT, atol=1e-6)


@pytest.mark.parametrize(("azimuth", "row", "col"), [(315, -1, -1), (45, -1, 1), (135, 1, 1)])
def test_slopes_towards_the_light_are_bright(azimuth, row, col):
    shade = hillshade(cone(), 10.0, azimuth=azimuth)
    middle, out = 32, 10
    lit = shade[middle + row * out, middle + col * out]
    dark = shade[middle - row * out, middle - col * out]
    assert lit > FLAT + 0.1
    assert dark < FLAT - 0.2
    assert shade.min() >= 0
    assert shade.max() <= 1


def test_valleys_are_darker_than_crests():
    ridge = np.abs(np.linspace(-200, 200, 101, dtype=np.float32))[None].repeat(60, axis=0)
    # Seen in the direction of the light's own axis neither side is lit more.
    valley, crest = hillshade(ridge, 10.0, 0.0), hillshade(-ridge, 10.0, 0.0)
    assert valley[30, 50] < FLAT < crest[30, 50]


def test_blur_keeps_constants_and_means():
    assert np.allclose(blurred(np.full((5, 7), 3.0), 9), 3.0)
    spike = np.zeros((41, 41))
    spike[20, 20] = 1.0
    assert blurred(spike, 3).sum() == pytest.approx(1.0)
    assert blurred(spike, 3)[20, 20] == blurred(spike, 3).max()


def test_tints_separate_water_and_rise_without_steps():
    heights = np.linspace(-100, 900, 4000, dtype=np.float32).reshape(40, 100)
    tint = hypsometric(heights)
    assert tint.shape == (40, 100, 3)
    assert (tint[heights < 0][:, 2] > tint[heights < 0][:, 0]).all()
    land = tint[heights > 0]
    assert (land[:, 2] < land[:, 1]).mean() > 0.9
    assert np.abs(np.diff(land, axis=0)).max() < 0.02
    dry = hypsometric(heights, sea_level=None)
    assert dry[0, 0, 1] > dry[0, 0, 2]


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2), (3, 200)])
@pytest.mark.parametrize("height", [-5.0, 0.0, 7.0])
def test_flat_and_tiny_terrains_have_a_picture(shape, height):
    picture = relief_image(np.full(shape, height), 10.0)
    assert picture.shape == (*shape, 3)
    assert picture.dtype == np.uint8
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 1


def test_the_picture_is_north_up_and_the_same_every_time(tmp_path):
    values = np.full((64, 64), 10.0, np.float32)
    values[:20, -20:] = -50.0
    terrain = Heightfield(values, 10.0)
    (path,) = Preview(sea_level=0.0).export(terrain, tmp_path / "a.png", Run())
    with Image.open(path) as picture:
        assert picture.size == (64, 64)
        colours = np.asarray(picture.convert("RGB")).astype(int)
    blue = colours[..., 2] - colours[..., 0]
    assert blue[5, 58] > 40
    assert max(blue[5, 5], blue[58, 58], blue[58, 5]) < 20
    content = path.read_bytes()
    assert Preview(sea_level=0.0).export(terrain, path, Run())[0].read_bytes() == content


def test_a_notebook_shows_it():
    with Image.open(io.BytesIO(Heightfield(fractal(64), 10.0)._repr_png_())) as picture:
        assert picture.size == (64, 64)


@pytest.mark.parametrize("side", [513, 1025])
def test_size_on_disk_and_on_screen(tmp_path, side):
    (path,) = Preview(max_kilobytes=400).export(
        Heightfield(fractal(side), 10.0), tmp_path / "a.png", Run()
    )
    assert path.stat().st_size <= 400_000
    with Image.open(path) as picture:
        assert 500 <= max(picture.size) <= 1024
    (path,) = Preview(width=200).export(Heightfield(fractal(side), 10.0), path, Run())
    with Image.open(path) as picture:
        assert picture.size == (200, 200)
        assert picture.mode == "RGB"


def test_oblong_terrain_keeps_its_shape(tmp_path):
    terrain = Heightfield(np.zeros((300, 900)), 10.0)
    with pytest.raises(OutputError, match=r"a.gif: no picture; use .png, .webp"):
        Preview(max_kilobytes=400).export(terrain, tmp_path / "a.gif", Run())
    for name, kind in (("a.webp", "WEBP"), ("a.jpg", "JPEG"), ("a.PNG", "PNG")):
        (path,) = Preview(width=100).export(terrain, tmp_path / name, Run())
        with Image.open(path) as picture:
            assert picture.format == kind
            assert picture.size == (100, 33)


def test_own_colours_need_albedo(tmp_path):
    with pytest.raises(InputError, match="needs the layers albedo_red"):
        Preview(style="colour").export(Heightfield(cone(), 10.0), tmp_path / "a.png", Run())
    red, none = np.ones((65, 65)), np.zeros((65, 65))
    albedo = {"albedo_red": red, "albedo_green": none, "albedo_blue": none}
    terrain = Heightfield(np.zeros((65, 65)), 10.0, layers=albedo)
    (path,) = Preview(style="colour").export(terrain, tmp_path / "a.png", Run())
    with Image.open(path) as picture:
        assert picture.convert("RGB").getpixel((30, 30)) == (255, 0, 0)


def test_a_block_in_perspective_shows_its_water(tmp_path):
    terrain = Heightfield(cone(), 10.0)
    flat = terrain.with_layers(water_depth=np.maximum(0, 150 - terrain.elevation))
    pictures = {}
    for name, surface, settings in (
        ("map", terrain, {}),
        ("dry", terrain, {"view": "perspective"}),
        ("lake", flat, {"view": "perspective"}),
        ("sea", terrain, {"view": "perspective", "sea_level": 150.0}),
        ("east", terrain, {"view": "perspective", "view_direction": 90.0}),
    ):
        out = tmp_path / f"{name}.png"
        Preview(width=180, **settings).export(surface, out, Run())
        with Image.open(out) as picture:
            pictures[name] = np.asarray(picture.convert("RGB")).astype(int)
    assert pictures["map"].shape == (65, 65, 3)
    assert pictures["dry"].shape == pictures["lake"].shape == (100, 180, 3)
    wet, dry = (
        (pictures[name][..., 2] > pictures[name][..., 0] + 20).mean() for name in ("lake", "dry")
    )
    assert wet > dry + 0.2
    assert np.array_equal(pictures["sea"], pictures["lake"])
    assert not np.array_equal(pictures["dry"], pictures["east"])
