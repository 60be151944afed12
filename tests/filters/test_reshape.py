"""New heights are what the formula makes of the old ones and of the layers beside them."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import ParameterError, Run
from terrakit.errors import InputError
from terrakit.execute import execute
from terrakit.testing.subjects import rough_terrain
from terrakit_filters.blend import Blend
from terrakit_filters.reshape import Reshape

GROUND = rough_terrain((33, 47), relief=300.0)


def reshaped(formula: str, device: str | None = "numpy", **settings: object) -> np.ndarray:
    mask = np.tile(np.linspace(0.0, 1.0, 47, dtype=np.float32), (33, 1))
    ground = GROUND.with_layers(mask_here=mask, sediment=2 * mask)
    result = execute(Reshape(formula=formula, **settings), ground, Run(1, device))
    assert result.layers["sediment"] is ground.layers["sediment"]
    return np.asarray(result.elevation)


def test_z_is_the_height() -> None:
    z = GROUND.elevation
    assert np.array_equal(reshaped("z"), z)
    assert np.array_equal(reshaped("-elevation"), -z)
    assert np.array_equal(reshaped("z if z > 0 else 0"), np.maximum(z, 0))


def test_layers_go_by_their_names() -> None:
    share = np.linspace(0.0, 1.0, 47)
    expected = GROUND.elevation.astype(float) + 10 * share + 2 * share
    assert reshaped("z + 10*mask_here + k", define={"k": "sediment"}) == pytest.approx(
        expected, abs=1e-3
    )


def test_places_are_measured_from_the_middle_of_the_world() -> None:
    assert reshaped("x")[0].tolist() == pytest.approx(10.0 * (np.arange(47) - 23.0))
    assert reshaped("north")[:, 0].tolist() == pytest.approx(10.0 * np.arange(32, -1, -1))
    assert reshaped("r").min() == 0.0
    assert np.abs(reshaped("theta")).max() <= 3.1416


def test_devices_agree() -> None:
    text = "z*0.7 + 30*sin(z/40)*mask_here + 5*fbm(100, 3)"
    assert np.array_equal(reshaped(text), reshaped(text, None))


def test_what_cannot_be_is_refused_in_one_line() -> None:
    with pytest.raises(ParameterError, match="^reshape: formula = 'import os': is no arithmetic"):
        Reshape(formula="import os")
    with pytest.raises(ParameterError, match="formula is missing"):
        Reshape()
    with pytest.raises(ParameterError, match="no such name"):
        Reshape(formula="zz")
    with pytest.raises(InputError, match="mask_there"):
        reshaped("z*mask_there")
    with pytest.raises(ParameterError, match=r"reshape: formula = 'log\(z\)': .* not finite"):
        reshaped("log(z)")


def test_layers_are_not_at_hand_inside_of_another_step() -> None:
    from terrakit.registry import default_registry

    fbm = default_registry().get("fbm")()
    with pytest.raises(ParameterError, match="make it a step of its own"):
        execute(Blend(other=[fbm, Reshape(formula="z*mask_here")]), GROUND, Run(1, "numpy"))
