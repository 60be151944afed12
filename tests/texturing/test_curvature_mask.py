"""Curvature is that of the ground, in 1/m, whatever the spacing."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, Run
from terrakit.execute import execute
from terrakit_texturing.curvature_mask import CurvatureMask, curvature


@pytest.mark.parametrize("spacing", [5.0, 10.0, 20.0])
def test_a_ball_is_as_curved_as_one_over_its_radius(spacing: float) -> None:
    n = int(800 / spacing) + 1
    y, x = (np.indices((n, n)) - (n - 1) / 2) * spacing
    ball = np.sqrt(4000.0**2 - x**2 - y**2)
    bent = curvature(ball.astype(np.float32), spacing, 50.0, Run())
    assert float(bent[n // 2, n // 2]) == pytest.approx(1 / 4000.0, rel=0.01)


def test_planes_are_not_curved_even_at_their_edge() -> None:
    row, col = np.indices((40, 50))
    plane = 3000 + 7.0 * row - 3.0 * col
    assert np.abs(curvature(plane.astype(np.float32), 10.0, 40.0, Run())).max() < 1e-9


@pytest.mark.parametrize("axis", [0, 1])
def test_waves_are_damped_as_a_bell_says(axis: int) -> None:
    spacing, length, deviation = 5.0, 200.0, 30.0
    k = 2 * np.pi / length
    along = np.arange(161) * spacing
    wave = np.broadcast_to(10.0 * np.cos(k * along), (161, 161))
    bent = curvature((wave if axis else wave.T).astype(np.float32), spacing, deviation, Run())
    expected = 0.5 * 10.0 * k**2 * np.exp(-0.5 * (k * deviation) ** 2)
    assert float(bent[80, 80]) == pytest.approx(expected, rel=0.02)


def test_ridges_and_valleys_are_told_apart() -> None:
    x = np.arange(101) * 10.0
    wave = np.tile(30.0 * np.cos(2 * np.pi * x / 500.0), (41, 1))  # tops at 0, 500, 1000 m
    masks = {
        form: execute(
            CurvatureMask(form=form, radius=60.0, curvature_blend=0.001),
            Heightfield(wave, 10.0),
            Run(),
        ).layer("mask_curvature")[20]
        for form in ("convex", "concave")
    }
    assert masks["convex"][50] == masks["concave"][25] == masks["concave"][75] == 1.0
    assert masks["convex"][25] == masks["concave"][50] == 0.0
    assert not (masks["convex"] * masks["concave"]).any()


def test_the_same_ridges_at_twice_the_samples() -> None:
    masks = []
    for spacing, step in ((20.0, 1), (10.0, 2)):
        n = int(1200 / spacing) + 1
        y, x = np.indices((n, n)) * spacing
        z = 60 * np.sin(x / 90 + 1) * np.sin(y / 70) + 40 * np.cos((x + y) / 130)
        mask = execute(CurvatureMask(radius=100.0), Heightfield(z, spacing), Run())
        masks.append(mask.layer("mask_curvature")[::step, ::step][8:-8, 8:-8])
    assert np.abs(masks[0] - masks[1]).max() < 0.08
    assert 0.1 < masks[0].mean() < 0.9
