"""Soil creep keeps terrakit's contract, and solves the equation that it names."""

from __future__ import annotations

import numpy as np
from terrakit_creep import Creep

from terrakit import Heightfield
from terrakit.testing import OperatorContract


class TestCreep(OperatorContract):
    operator = Creep


def test_wave_decays_as_the_equation_says() -> None:
    samples, spacing = 64, 10.0
    length = samples * spacing
    x = (np.arange(samples) + 0.5) * spacing  # closed borders lie half a sample outside
    wave = np.cos(2 * np.pi * x / length)
    terrain = Heightfield(np.tile(100 * wave, (9, 1)), spacing)
    after = Creep(diffusivity=0.02, duration=2e5)(terrain)
    decay = np.exp(-0.02 * 2e5 * (2 * np.pi / length) ** 2)
    assert np.allclose(after.elevation, 100 * decay * wave, atol=0.1)
