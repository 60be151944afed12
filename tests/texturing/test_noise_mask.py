"""Patches: as many as the threshold says, the same in a tile, soft where they are asked to be."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, InputError, Run
from terrakit.execute import execute
from terrakit_texturing.noise_mask import NoiseMask

FLAT = Heightfield(np.zeros((257, 257)), 20.0)


def mask(**settings: object) -> np.ndarray:
    made = execute(NoiseMask(wavelength=300.0, **settings), FLAT, Run(3))
    return made.layer("mask_noise").astype(np.float64)


def test_half_of_the_ground_is_above_the_middle() -> None:
    selected = mask(softness=0.01)
    assert selected.mean() == pytest.approx(0.5, abs=0.05)
    assert ((selected == 0.0) | (selected == 1.0)).mean() > 0.95


def test_a_higher_threshold_selects_less_of_the_same_patches() -> None:
    less, more = mask(threshold=0.15, softness=0.05), mask(threshold=-0.15, softness=0.05)
    assert (less <= more).all()
    assert less.mean() < 0.5 * more.mean()


def test_softness_is_over_noise() -> None:
    soft = mask(softness=1.0)
    assert ((soft > 0.0) & (soft < 1.0)).mean() > 0.9


def test_a_mask_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="lower threshold"):
        mask(threshold=1.0, softness=0.01)
