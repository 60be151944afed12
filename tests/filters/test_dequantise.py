"""Terraces go, and every height still rounds to what was stored."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Heightfield, InputError, Run
from terrakit.execute import execute
from terrakit_filters.dequantise import Dequantise, step_of

Heights = NDArray[np.float64]


@pytest.fixture(scope="module")
def truth() -> Heights:
    """Gentle hills of 25 m relief, ten metres apart, wavy down to 80 m."""
    random = np.random.default_rng(9)
    y, x = np.indices((300, 300)) * 10.0
    height = np.zeros(x.shape)
    for length in np.geomspace(2000.0, 80.0, 24):
        angle, phase = random.uniform(0.0, 2 * np.pi, 2)
        along = np.cos(angle) * x + np.sin(angle) * y
        height += length**0.95 * np.sin(2 * np.pi * along / length + phase)
    height -= height.mean()
    result: Heights = height / np.ptp(height) * 25.0
    return result


def smoothed(z: Any, spacing: float = 10.0, device: Any = None, **settings: Any) -> Heightfield:
    return execute(Dequantise(**settings), Heightfield(z, spacing), Run(1, device))


def steepness(z: Heights) -> Heights:
    down, across = np.gradient(z)
    return np.hypot(down, across)


@pytest.mark.parametrize("step", [1.0, 0.25, 3.0])
def test_every_height_rounds_back(truth: Heights, step: float) -> None:
    stored = np.rint(truth / step)
    result = smoothed(stored * step).elevation.astype(np.float64)
    assert np.array_equal(np.rint(result / step), stored)
    assert np.abs(result - stored * step).max() > 0.4 * step


def test_terraces_become_slopes(truth: Heights) -> None:
    stored = np.rint(truth)
    result = smoothed(stored).elevation.astype(np.float64)
    level = [float((steepness(z) < 0.02).mean()) for z in (truth, stored, result)]
    assert level[1] > 0.3
    assert level[2] < 0.05
    # Nearer to the truth, in height and above all in how the ground bends
    assert (result - truth).std() < 0.65 * (stored - truth).std()
    bend = [float(np.diff(z, 2, axis=0).std()) for z in (truth, stored, result)]
    assert bend[1] > 2.0 * bend[0]
    assert bend[2] < 0.8 * bend[0]


def test_steep_ground_is_left_alone() -> None:
    random = np.random.default_rng(2)
    cliffs = np.cumsum(random.integers(5, 40, (60, 50)), axis=0).astype(np.float32)
    assert np.array_equal(smoothed(cliffs, step=1.0).elevation, cliffs)


def test_a_lake_stays_level_in_its_middle(truth: Heights) -> None:
    from scipy.ndimage import distance_transform_edt

    stored = np.maximum(np.rint(truth), 0.0)
    lake = distance_transform_edt(stored == 0.0) > 20
    assert lake.sum() > 500
    result = smoothed(stored, terrace_width=80.0).elevation
    assert np.abs(result[lake]).max() < 0.05


def test_ramp_of_steps_becomes_the_ramp() -> None:
    row, col = np.indices((80, 96))
    ramp = 0.11 * row + 0.07 * col
    result = smoothed(np.rint(ramp)).elevation
    inner = slice(12, -12)
    error = (result - ramp)[inner, inner]
    assert error.std() < 0.5 * (np.rint(ramp) - ramp)[inner, inner].std()


def test_wide_terraces_need_the_width() -> None:
    col = np.indices((40, 400))[1]
    ramp = 0.02 * col  # a terrace is 50 samples wide
    level = []
    for width in (100.0, 1000.0):
        result = smoothed(np.rint(ramp), terrace_width=width).elevation
        level.append(float((np.abs(np.diff(result[20].astype(np.float64))) < 0.002).mean()))
    assert level[0] > 0.15
    assert level[1] < 0.3 * level[0]


@pytest.mark.parametrize("step", [1.0, 3.2941, 0.01, 120.0])
@pytest.mark.parametrize("base", [0.0, 236.7, -4000.0])
def test_the_step_is_found(truth: Heights, step: float, base: float) -> None:
    z = (base + np.rint(truth / np.ptp(truth) * 255) * step).astype(np.float32)
    assert step_of(z) == pytest.approx(step, rel=2e-3 if step == 0.01 else 1e-5)


def test_gaps_between_the_levels_do_not_mislead() -> None:
    levels = np.array([0, 2, 3, 7, 11, 12, 20, 26], dtype=np.float32) * 2.5
    assert step_of(levels.reshape(2, 4)) == 2.5


def test_flat_ground_comes_back_as_it_is() -> None:
    flat = np.full((9, 9), 7.0, dtype=np.float32)
    assert np.array_equal(smoothed(flat).elevation, flat)


def test_ground_without_steps_is_refused(truth: Heights) -> None:
    with pytest.raises(InputError, match=r"no multiples of one step.*give step"):
        smoothed(truth)
    assert np.abs(smoothed(truth, step=1.0).elevation - truth).max() < 0.5


@pytest.mark.parametrize("shape", [(3, 3), (1, 40), (33, 64), (70, 17)])
@pytest.mark.parametrize("width", [0.0, 90.0, 5000.0])
def test_reference_and_device_agree(truth: Heights, shape: tuple[int, int], width: float) -> None:
    z = np.rint(truth[: shape[0], : shape[1]] / 0.5) * 0.5
    results = [
        smoothed(z, device=device, step=0.5, terrace_width=width).elevation.tobytes()
        for device in (None, "numpy")
    ]
    assert results[0] == results[1]


def test_it_stops_where_it_is_asked_to() -> None:
    terrain = Heightfield(np.rint(np.indices((20, 20))[0] / 3.0), 10.0)
    run = Run(1)
    run.finish_now()
    assert Grid((20, 20), 10.0).shape == execute(Dequantise(), terrain, run).shape
