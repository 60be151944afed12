"""The script that draws the README's sheet draws what it is asked for."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

SCRIPT = Path(__file__).parents[2] / "docs" / "gallery.py"


def test_a_sheet_shows_generators_and_their_presets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = importlib.util.spec_from_file_location("gallery", SCRIPT)
    assert found is not None
    assert found.loader is not None
    gallery = importlib.util.module_from_spec(found)
    found.loader.exec_module(gallery)
    monkeypatch.setattr(gallery, "SAMPLES", 96)
    out = tmp_path / "sheet.webp"
    words = ["gallery.py", str(out), "--only", "lone_hill", "noise", "--presets", "--width", "600"]
    monkeypatch.setattr(sys, "argv", words)
    gallery.main()
    with Image.open(out) as sheet:
        assert sheet.width == 600
        pixels = np.asarray(sheet.convert("L")).astype(float)
    presets = 2 + sum(len(k.presets) for k in map(kind_of, ("lone_hill", "noise")))
    assert presets > 4
    # Every picture has relief in it
    side = (600 - 8 * (min(8, presets) + 1)) // min(8, presets)
    for index in range(min(8, presets)):
        left = 8 + index * (side + 8)
        assert pixels[8 : 8 + side, left : left + side].std() > 3.0


def kind_of(name: str):
    from terrakit.registry import default_registry

    return default_registry().get(name)
