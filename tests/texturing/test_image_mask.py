"""Pictures lie north up, keep their values where they fit, and are refused where they are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from terrakit import Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit_texturing.image_mask import ImageMask


def saved(path: Path, values: np.ndarray) -> str:
    Image.fromarray(values).save(path)
    return str(path)


def mask(picture: str, shape: tuple[int, int] = (9, 13), **settings: Any) -> np.ndarray:
    terrain = Heightfield(np.zeros(shape), 10.0)
    result = execute(ImageMask(picture=picture, **settings), terrain, Run())
    return result.layer("mask_image").astype(np.float64)


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_a_pixel_a_sample_is_taken_as_it_is(tmp_path: Path, depth: type) -> None:
    white = np.iinfo(depth).max
    values = np.random.default_rng(1).integers(0, white, (9, 13), endpoint=True).astype(depth)
    told = mask(saved(tmp_path / "a.png", values), fit="exact")
    assert np.array_equal(told.astype(np.float32), (values / float(white)).astype(np.float32))


def test_the_top_left_is_the_north_west(tmp_path: Path) -> None:
    values = np.zeros((5, 5), np.uint8)
    values[0, 0], values[0, -1], values[-1, -1] = 255, 200, 100
    told = mask(saved(tmp_path / "a.png", values))
    assert told[0, 0] == 1.0
    assert told[0, -1] == pytest.approx(200 / 255)
    assert told[-1, -1] == pytest.approx(100 / 255)
    assert told[-1, 0] == 0.0


@pytest.mark.parametrize("pixels", [(3, 4), (9, 13), (70, 31), (401, 401)])
def test_a_ramp_of_any_size_is_the_same_ramp(tmp_path: Path, pixels: tuple[int, int]) -> None:
    ramp = np.linspace(0, 65535, pixels[1]).round().astype(np.uint16)
    told = mask(saved(tmp_path / "a.png", np.tile(ramp, (pixels[0], 1))))
    middle = slice(1, -1)  # a mean at the very edge sees one side only
    assert np.allclose(told[:, middle], np.linspace(0, 1, 13)[middle], atol=1e-3)


def test_fine_patterns_are_averaged(tmp_path: Path) -> None:
    checks = np.indices((400, 400)).sum(axis=0) % 2 * 255
    told = mask(saved(tmp_path / "a.png", checks.astype(np.uint8)))
    assert np.abs(told - 0.5).max() < 0.02


def test_bounds_place_the_picture_in_the_world(tmp_path: Path) -> None:
    picture = saved(tmp_path / "a.png", np.full((4, 4), 255, np.uint8))
    told = mask(picture, bounds=[20.0, 30.0, 60.0, 70.0])
    inside = np.zeros((9, 13), bool)
    inside[8 - 7 : 8 - 3 + 1, 2:7] = True
    assert np.array_equal(told == 1.0, inside)
    assert not told[~inside].any()


def test_colours_count_by_luminance_and_alpha(tmp_path: Path) -> None:
    colours = np.zeros((3, 3, 4), np.uint8)
    colours[...] = (255, 0, 0, 255)
    colours[1] = (0, 255, 0, 128)
    picture = saved(tmp_path / "a.png", colours)
    told = mask(picture, (3, 3))
    assert told[0, 0] == pytest.approx(0.2126)
    assert told[1, 0] == pytest.approx(0.7152 * 128 / 255)
    assert mask(picture, (3, 3), channel="alpha")[1, 1] == pytest.approx(128 / 255)
    assert mask(picture, (3, 3), channel="red")[0, 0] == 1.0


def test_what_is_no_picture_is_refused_in_one_line(tmp_path: Path) -> None:
    grey = saved(tmp_path / "grey.png", np.full((4, 5), 9, np.uint8))
    black = saved(tmp_path / "b.png", np.zeros((4, 4), np.uint8))
    (tmp_path / "text.png").write_text("no picture")
    content = Path(grey).read_bytes()
    (tmp_path / "cut.png").write_bytes(content[: len(content) // 2])
    for settings, message in (
        ({"picture": str(tmp_path / "none.png")}, "no such file"),
        ({"picture": str(tmp_path)}, "no such file"),
        ({"picture": str(tmp_path / "text.png")}, "damaged or no picture"),
        ({"picture": str(tmp_path / "cut.png")}, "damaged or no picture"),
        (
            {"picture": grey, "channel": "alpha"},
            "channel = 'alpha': .*grey.png' has only grey",
        ),
        ({"picture": grey, "fit": "exact"}, "5x4 pixels, the terrain 13x9 samples; set fit"),
        ({"picture": black}, "is black in luminance"),
    ):
        with pytest.raises(InputError, match=message) as told:
            mask(**settings)
        assert "\n" not in str(told.value)
    with pytest.raises(ParameterError, match="bounds.*west < east"):
        ImageMask(picture=grey, bounds=[3.0, 0.0, 1.0, 2.0])
    for bounds in ([0.0, 0.0, 1e-300, 1e-300], [0.0, 0.0, 1e300, 1.0]):
        with pytest.raises(ParameterError, match=r"bounds.*at least 0\.001 m apart"):
            ImageMask(picture=grey, bounds=bounds)


@pytest.mark.parametrize("ending", ["png", "pgm", "jpg", "bmp", "tif"])
def test_a_picture_that_is_cut_short_or_changed_is_refused(tmp_path: Path, ending: str) -> None:
    values = np.random.default_rng(3).integers(1, 255, (64, 64)).astype(np.uint8)
    whole = Path(saved(tmp_path / f"whole.{ending}", values)).read_bytes()
    broken = [whole[: len(whole) * share // 4] for share in (2, 3)] + [whole[:-30]]
    if ending == "png":
        broken.append(whole[:900] + bytes([whole[900] ^ 1]) + whole[901:])
    for number, content in enumerate(broken):
        cut = tmp_path / f"{number}.{ending}"
        cut.write_bytes(content)
        with pytest.raises(InputError, match="damaged or no picture"):
            mask(str(cut))
    assert mask(saved(tmp_path / f"good.{ending}", values)).any()


def test_a_large_picture_on_a_small_place_takes_little_memory(tmp_path: Path) -> None:
    picture = saved(tmp_path / "a.png", np.full((2, 300), 255, np.uint8))
    told = mask(picture, bounds=[39.999, 39.999, 40.001, 40.001])
    assert told[4, 4] == 1.0
    assert told.sum() == 1.0
