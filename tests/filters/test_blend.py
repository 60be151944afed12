"""Blends are the arithmetic that they say, in metres, everywhere or under a mask."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit.operators import Operator
from terrakit.testing.subjects import rough_terrain
from terrakit_filters.blend import Blend
from terrakit_filters.terrace import Terrace

Field = NDArray[np.float32]
GROUND = rough_terrain((65, 48), relief=400.0)
OTHER = rough_terrain((65, 48), relief=150.0).with_layers(
    elevation=np.flipud(rough_terrain((65, 48), relief=150.0).elevation)
)


def blended(
    device: str | None = "numpy", ground: Heightfield = GROUND, **settings: object
) -> Field:
    run = Run(5, device, earlier={"other": OTHER})
    result = execute(Blend(**{"other": "other"} | settings), ground, run)
    values: Field = result.elevation
    return values


def generators() -> tuple[Operator, Operator]:
    from terrakit.registry import default_registry

    registry = default_registry()
    fbm = registry.get("fbm")(amplitude=300.0, wavelength=400.0, octaves=4)
    return fbm, Terrace(bench_height=30.0, wavelength=300.0, undulation=10.0)


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("replace", lambda z, o: o),
        ("add", lambda z, o: z + o),
        ("subtract", lambda z, o: z - o),
        ("difference", lambda z, o: abs(z - o)),
        ("average", lambda z, o: (z + o) / 2),
        ("maximum", np.maximum),
        ("minimum", np.minimum),
        ("multiply", lambda z, o: 50 + (z - 50) * o / 200),
        (
            "power",
            lambda z, o: np.where(
                z > 50, 50 + 200 * (np.maximum(z - 50, 0) / 200) ** np.maximum(0.1, 1 + o / 200), z
            ),
        ),
    ],
)
def test_modes(mode: str, expected: object) -> None:
    assert callable(expected)
    z, o = (t.elevation.astype(np.float64) for t in (GROUND, OTHER))
    result = blended(mode=mode, base_height=50.0, unit_height=200.0)
    assert result == pytest.approx(expected(z, o), rel=2e-5, abs=2e-3)


def test_units_stay_metres() -> None:
    """Twice every length in height gives twice the result, whatever the mode."""
    double = GROUND.with_layers(elevation=2 * GROUND.elevation)
    for mode in ("multiply", "power", "maximum"):
        once = Blend(other=150.0, mode=mode, base_height=20.0, unit_height=300.0, transition=40.0)
        twice = Blend(other=300.0, mode=mode, base_height=40.0, unit_height=600.0, transition=80.0)
        one, two = (
            execute(operator, terrain, Run(0, "numpy")).elevation
            for operator, terrain in ((once, GROUND), (twice, double))
        )
        assert two == pytest.approx(2 * one, rel=1e-4, abs=1e-2)


def test_neutral_heights_leave_the_ground() -> None:
    for mode, other in (("add", 0.0), ("subtract", 0.0), ("multiply", 250.0), ("power", 0.0)):
        result = blended(other=other, mode=mode, unit_height=250.0)
        assert result == pytest.approx(GROUND.elevation, abs=1e-2), mode


def test_power_bends_but_keeps_foot_and_unit() -> None:
    grid = Grid((3, 101), 10.0)
    ramp = Heightfield.on_grid(grid, np.tile(np.linspace(-100.0, 900.0, 101), (3, 1)))
    bent = blended(ground=ramp, other=300.0, mode="power", unit_height=500.0)[1]
    z = ramp.elevation[1]
    assert np.array_equal(bent[z <= 0], z[z <= 0])
    assert bent[60] == pytest.approx(500.0, rel=1e-5)
    assert (bent[(z > 0) & (z < 500)] < z[(z > 0) & (z < 500)]).all()
    assert (np.diff(bent) > 0).all()


def test_transition_rounds_within_its_width_only() -> None:
    z, o = GROUND.elevation, OTHER.elevation
    for mode, sign, hard in (("maximum", 1, np.maximum(z, o)), ("minimum", -1, np.minimum(z, o))):
        soft = blended(mode=mode, transition=60.0)
        extra = sign * (soft.astype(np.float64) - hard)
        assert extra.min() >= -1e-3
        assert extra.max() == pytest.approx(10.0, rel=0.05)  # a sixth of the width where equal
        far = abs(z - o) > 60.0
        assert np.array_equal(soft[far], hard[far])


def test_share_is_exact_at_both_ends_and_straight_between() -> None:
    mask = np.tile(np.linspace(0.0, 1.0, 48, dtype=np.float32), (65, 1))
    mask[:, :10], mask[:, -10:] = 0.0, 1.0
    ground = GROUND.with_layers(mask_here=mask)
    result = blended(ground=ground, mode="replace", share="mask_here")
    assert np.array_equal(result[:, :10], GROUND.elevation[:, :10])
    assert np.array_equal(result[:, -10:], OTHER.elevation[:, -10:])
    z, o = (t.elevation.astype(np.float64) for t in (GROUND, OTHER))
    assert result == pytest.approx(z + (o - z) * mask, abs=1e-3)


@pytest.mark.parametrize("device", ["numpy", None])
def test_a_chain_is_its_steps_bit_for_bit(device: str | None) -> None:
    fbm, terrace = generators()
    nested = execute(Blend(other=[fbm, terrace]), GROUND, Run(5, device))
    made = execute(terrace, execute(fbm, GROUND.grid, Run(5, device)), Run(5, device))
    apart = execute(Blend(other="made"), GROUND, Run(5, device, earlier={"made": made}))
    assert np.array_equal(nested.elevation.view(np.int32), apart.elevation.view(np.int32))


def test_a_mask_inside_of_a_chain_is_the_chains_own() -> None:
    fbm, _ = generators()
    terrace = Terrace(share="mask_here")
    ground = GROUND.with_layers(mask_here=np.zeros(GROUND.shape, np.float32))
    with pytest.raises(ParameterError, match="share"):
        execute(Blend(other=[fbm, terrace]), ground, Run(5, "numpy"))


def test_devices_agree_in_every_mode() -> None:
    for mode in ("power", "multiply", "maximum"):
        settings = {"mode": mode, "transition": 30.0, "share": 0.7, "unit_height": 150.0}
        one, two = (blended(device, **settings) for device in ("numpy", None))
        assert np.array_equal(one.view(np.int32), two.view(np.int32))


def test_powers_never_leave_the_numbers() -> None:
    high = Heightfield(np.full((4, 4), 1e6), 10.0)
    result = blended(ground=high, other=1e6, mode="power", unit_height=0.001)
    assert np.isfinite(result).all()


def test_wrong_others_are_refused_in_one_line() -> None:
    with pytest.raises(ParameterError, match="other is missing"):
        Blend()
    with pytest.raises(ParameterError, match="other.*no step 'othr'.*did you mean other"):
        blended(other="othr")
    smaller = rough_terrain((33, 33))
    with pytest.raises((ParameterError, InputError), match="resample"):
        blended(ground=smaller)
    with pytest.raises(ParameterError, match="mode"):
        Blend(other=1.0, mode="screen")
