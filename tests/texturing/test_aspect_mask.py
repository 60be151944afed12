"""Slopes are chosen by where they face: clockwise from north, downhill."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, Run
from terrakit.execute import execute
from terrakit_texturing.aspect_mask import AspectMask


def cone(size: int = 65, spacing: float = 10.0, slope: float = 0.5) -> Heightfield:
    half = (size - 1) / 2
    row, col = np.indices((size, size))
    return Heightfield(1000 - slope * spacing * np.hypot(row - half, col - half), spacing)


def at(mask: np.ndarray, bearing: float, share: float = 0.7) -> float:
    """Return the mask on the flank of the cone that faces ``bearing``."""
    half = (len(mask) - 1) / 2
    turn = np.radians(bearing)
    row = round(half - share * half * np.cos(turn))
    col = round(half + share * half * np.sin(turn))
    return float(mask[row, col])


@pytest.mark.parametrize("bearing", [0.0, 90.0, 180.0, 270.0, 45.0, -30.0])
def test_the_flank_that_faces_there_is_selected(bearing: float) -> None:
    settings = {"direction": bearing, "direction_width": 60.0, "direction_blend": 20.0}
    mask = execute(AspectMask(**settings), cone(), Run()).layer("mask_aspect")
    for off in (-25, 0, 25):
        assert at(mask, bearing + off) > 0.99, off
    for off in (-55, 55, 90, 180):
        assert at(mask, bearing + off) < 0.01, off
    assert 0.3 < at(mask, bearing + 40) < 0.7
    assert 0.3 < at(mask, bearing - 40) < 0.7


def test_flat_ground_faces_nowhere() -> None:
    for width in (90.0, 360.0):
        how = AspectMask(direction_width=width, allow_empty=True)
        flat = execute(how, Heightfield(np.full((9, 9), 7.0), 10.0), Run())
        assert not flat.layer("mask_aspect").any()


def test_all_directions_select_every_slope() -> None:
    mask = execute(AspectMask(direction_width=360.0), cone(), Run()).layer("mask_aspect")
    assert (np.delete(mask.ravel(), mask.size // 2) == 1.0).all()
