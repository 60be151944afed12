"""The script that draws the erosions' sheets draws what it is asked for, and draws it right."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from terrakit import Heightfield

SCRIPT = Path(__file__).parents[2] / "docs" / "erosion_sheet.py"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    found = importlib.util.spec_from_file_location("erosion_sheet", SCRIPT)
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    sys.modules[found.name] = module  # its dataclasses look themselves up
    found.loader.exec_module(module)
    return module


def draw(script: ModuleType, monkeypatch: pytest.MonkeyPatch, out: Path, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["erosion_sheet.py", str(out), "--samples", "97", *words])
    script.main()


def test_a_sheet_has_maps_and_views_of_each_operator(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "sheet.webp"
    words = ["--operator", "thermal", "stream_power", "--set", "border=closed", "--width", "640"]
    with pytest.raises(SystemExit):  # rivers have no such parameter
        draw(script, monkeypatch, out, *words)
    assert not out.exists()
    draw(script, monkeypatch, out, "--operator", "thermal", "stream_power", "--width", "640")
    assert out.stat().st_size < script.LARGEST_FILE
    with Image.open(out) as sheet:
        assert sheet.format == "WEBP"
        assert sheet.width == 640
        pixels = np.asarray(sheet.convert("L")).astype(float)
    half = len(pixels) // 2
    for part in (pixels[:half], pixels[half:]):
        side = (640 - 32) // 3
        for column in range(3):
            left = 8 + column * (side + 8)
            assert part[40 : 20 + side, left : left + side].std() > 5.0
        views = part[-150:]
        assert views[:, 8:312].std() > 10.0
        assert views[:, 328:632].std() > 10.0


def test_a_recipe_is_shown_from_its_first_erosion_on(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = tmp_path / "worn.toml"
    recipe.write_text(
        'title = "Worn"\nsize = 2000.0\nspacing = 50.0\n'
        '[[step]]\nuse = "fbm"\namplitude = 900.0\nwavelength = 1000.0\n'
        '[[step]]\nuse = "thermal"\ndistance = 50.0\n[[step]]\nuse = "slope_height"\n'
    )
    pair = script.made_by_recipe(str(recipe), None, None)
    assert pair.before.shape == pair.after.shape == (41, 41)
    assert pair.title == "Worn"
    assert "sediment" not in pair.before
    assert "sediment" in pair.after
    assert pair.before.elevation.std() > pair.after.elevation.std() > 0
    recipe.write_text('size = 2000.0\nspacing = 50.0\n[[step]]\nuse = "fbm"\n')
    with pytest.raises(SystemExit):
        monkeypatch.setattr(sys, "argv", ["x", str(tmp_path / "x.webp"), "--recipe", str(recipe)])
        script.main()


def test_what_is_lost_and_gained_differs_in_hue_on_one_scale(script: ModuleType) -> None:
    before = np.zeros((9, 9), np.float32)
    after = before.copy()
    after[2, 2], after[6, 6] = -3.0, 1.5
    pair = script.Pair("x", Heightfield(before, 10.0), Heightfield(after, 10.0))
    picture, words = script.difference(pair)
    red, blue = picture[..., 0].astype(int), picture[..., 2].astype(int)
    assert red[2, 2] > blue[2, 2] + 30
    assert blue[6, 6] > red[6, 6] + 30
    assert abs(red[4, 0] - blue[4, 0]) < 20
    assert "±5 m (from -3 to +1.5 m)" in words
    # The same change either way is as strong
    size = np.abs(script.diverging(np.array([-0.5, 0.5])) - script.diverging(np.zeros(1))).sum(1)
    assert size.min() > 0.5 * size.max()


def test_scales_are_round_and_not_too_small(script: ModuleType) -> None:
    for value in (0.013, 0.2, 0.21, 1.0, 7.0, 4999.0):
        scale = script.rounded(value)
        assert value <= scale <= 2.5 * value
    assert script.rounded(0.21) == 0.5
    assert script.rounded(0.0) == 1.0
