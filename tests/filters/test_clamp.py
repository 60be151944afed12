"""Nothing lies beyond the limits, and nothing else changes place."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import rough_terrain
from terrakit_filters.clamp import Clamp

GROUND = rough_terrain((65, 48), relief=400.0)
RAMP = Heightfield(np.tile(np.linspace(-500.0, 500.0, 2001), (2, 1)), 1.0)


def clamped(terrain: Heightfield = GROUND, **settings: object) -> np.ndarray:
    return np.asarray(execute(Clamp(**settings), terrain, Run(0, "numpy")).elevation)


def test_hard_limits_are_those_of_numpy() -> None:
    z = GROUND.elevation
    assert np.array_equal(clamped(low=-50.0, high=80.0), np.clip(z, -50, 80))
    assert np.array_equal(clamped(), np.maximum(z, 0))
    assert np.array_equal(clamped(low=None, high=80.0), np.minimum(z, 80))


@pytest.mark.parametrize("transition", [1.0, 40.0, 130.0])
def test_soft_limits_hold_and_keep_the_order(transition: float) -> None:
    z = RAMP.elevation[0].astype(np.float64)
    soft = clamped(RAMP, low=-50.0, high=80.0, transition=transition)[0].astype(np.float64)
    assert soft.min() >= -50.0
    assert soft.max() <= 80.0
    assert (np.diff(soft) >= -1e-4).all()
    assert abs(soft - np.clip(z, -50, 80)).max() == pytest.approx(transition / 6, rel=0.02)
    near = np.minimum(abs(z + 50), abs(z - 80)) < transition
    assert soft[~near] == pytest.approx(np.clip(z, -50, 80)[~near], abs=1e-4)
    bend = np.diff(soft, 2) / 0.25  # half a metre a sample
    assert abs(bend).max() < 1.05 / transition + 0.01  # rounded: no sudden change of slope


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"low": 80.0, "high": -50.0}, "low = 80 is above high = -50"),
        ({"low": 0.0, "high": 50.0, "transition": 60.0}, "at most the 50 m"),
        ({"transition": -1.0}, "transition"),
    ],
)
def test_limits_that_make_no_sense_are_refused(settings: dict[str, float], reason: str) -> None:
    with pytest.raises(ParameterError, match=reason):
        Clamp(**settings)
