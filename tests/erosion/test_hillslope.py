"""Creep of hillslopes: the heat equation, Roering's profile, and nothing lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, ParameterError, Run
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.strata import Bed, Strata
from terrakit.testing import awkward_terrains, difference, rough_terrain, smooth_terrain
from terrakit_erosion import hillslope
from terrakit_erosion.hillslope import Hillslope


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def crept(surface: Heightfield, device: Any = None, **settings: Any) -> tuple[Heightfield, Run]:
    run = Run(device=device).for_step("hillslope")
    return execute(Hillslope(**settings), surface, run), run


def relative(first: np.ndarray, second: np.ndarray) -> float:
    """Return the root mean square of the gap, relative to the second."""
    a, b = first.astype(np.float64), second.astype(np.float64)
    return float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean()))


@pytest.mark.parametrize("critical", [None, 89.0])
def test_a_hill_spreads_like_heat(device: Any, critical: float | None) -> None:
    x = (np.arange(65) - 32) * 20.0
    square = x[:, None] ** 2 + x[None, :] ** 2
    width, rate, years = 120.0**2, 0.05, 5e4
    hill = Heightfield(20.0 * np.exp(-square / (2 * width)), 20.0)
    result, _ = crept(hill, device, creep_rate=rate, duration=years, critical_slope=critical)
    wide = width + 2 * rate * years
    exact = 20.0 * width / wide * np.exp(-square / (2 * wide))
    assert np.abs(result.elevation - exact).max() < 0.003 * exact.max()
    height = result.elevation.astype(np.float64)
    variance = (height * square).sum() / height.sum()
    assert variance - 2 * width == pytest.approx(4 * rate * years, rel=0.02)


def test_roerings_hill_comes_down_evenly() -> None:
    """On the profile that balances uplift every point sinks by the uplift."""
    rate, critical, years = 0.01, 1.0, 100.0
    half, spacing = 100, 1.0
    x = (np.arange(2 * half + 1) - half) * spacing
    steep = 0.85  # at the foot, of the critical slope
    uplift = rate * critical * steep / (1 - steep**2) / (half * spacing)
    root = np.sqrt(1 + (2 * uplift * x / (rate * critical)) ** 2)
    profile = rate * critical**2 / (2 * uplift) * (np.log(0.5 * (root + 1)) - root + 1)
    assert np.abs(np.gradient(profile, spacing)).max() == pytest.approx(steep, rel=0.02)
    hill = Heightfield(profile * np.ones((15, 1)), spacing)
    result, _ = crept(
        hill, None, creep_rate=rate, duration=years, critical_slope=45.0, border="closed"
    )
    sunk = (hill.elevation - result.elevation)[7].astype(np.float64)
    inside = np.abs(x) < 70
    assert sunk[inside] == pytest.approx(uplift * years, rel=0.01)
    linear, _ = crept(hill, None, creep_rate=rate, duration=years)
    assert (hill.elevation - linear.elevation)[7][inside].std() > 0.1 * uplift * years


def test_a_chequerboard_fades(device: Any) -> None:
    row, col = np.indices((33, 33))
    board = Heightfield(10.0 * ((row + col) % 2), 10.0)
    for settings in ({}, {"critical_slope": 40.0}):
        result, _ = crept(board, device, duration=2e4, **settings)
        assert np.abs(np.diff(result.elevation)).max() < 0.05
        assert result.elevation.mean(dtype=np.float64) == pytest.approx(
            board.elevation.mean(dtype=np.float64), abs=1e-4
        )


@pytest.mark.parametrize("border", ["closed", "open", "fixed"])
@pytest.mark.parametrize("settings", [{}, {"critical_slope": 40.0}, {"soil_only": True}])
def test_volume_is_exact(device: Any, border: str, settings: dict[str, Any]) -> None:
    terrain = rough_terrain((33, 20)).with_layers(sediment=np.full((33, 20), 2.0))
    _, run = crept(terrain, device, duration=2e3, border=border, **settings)
    account = run.ledger.accounts["rock"]
    assert account.residual == pytest.approx(0.0, abs=1e-6)
    assert account.moved > 0
    assert bool(account.left) == (border != "closed")


@pytest.mark.parametrize("settings", [{}, {"critical_slope": 40.0}, {"hardness": 0.5}])
def test_there_are_no_new_highs_or_lows(device: Any, settings: dict[str, Any]) -> None:
    for _, terrain in awkward_terrains():
        result, run = crept(terrain, device, duration=1e3, creep_rate=0.1, **settings)
        slack = 1e-6 * float(np.ptp(terrain.elevation)) + 1e-3
        assert np.isfinite(result.elevation).all()
        assert result.elevation.max() <= terrain.elevation.max() + slack
        assert result.elevation.min() >= terrain.elevation.min() - slack
        account = run.ledger.accounts["rock"]
        assert abs(account.residual) <= 1e-9 * max(abs(account.start), account.moved)


@pytest.mark.parametrize("settings", [{}, {"critical_slope": 40.0}, {"hardness": 0.2}])
def test_a_border_that_is_closed_is_a_mirror(device: Any, settings: dict[str, Any]) -> None:
    profile = 40.0 * np.sin(np.arange(40) / 5.0) + np.arange(40)
    ridges = Heightfield(profile * np.ones((7, 1)), 10.0)
    result, _ = crept(ridges, device, duration=5e3, **settings)
    assert (result.elevation == result.elevation[3]).all()
    assert np.abs(result.elevation - ridges.elevation).max() > 1


def test_a_fixed_border_keeps_its_height(device: Any) -> None:
    terrain = rough_terrain((33, 33))
    result, _ = crept(terrain, device, duration=1e4, border="fixed")
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        assert (result.elevation[edge] == terrain.elevation[edge]).all()
    ended, _ = crept(terrain, device, duration=2e5, border="open")
    assert ended.elevation.mean() < terrain.elevation.mean()


def test_a_planar_slope_passes_an_open_border(device: Any) -> None:
    """What leaves below is what comes from above: nothing changes but at the top."""
    ramp = Heightfield(np.arange(33, 0, -1.0) * 5.0 * np.ones((9, 1)), 10.0)
    result, run = crept(ramp, device, duration=2e3, creep_rate=0.02, border="open")
    assert np.abs(result.elevation - ramp.elevation)[:, 12:].max() < 1e-3
    assert set(run.ledger.accounts["rock"].left) == {"border east"}
    through = run.ledger.accounts["rock"].left["border east"]
    assert through == pytest.approx(0.02 * 0.5 * 2e3 * 90.0, rel=0.01)


def test_twice_the_samples_and_half_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"duration": 2e4, "critical_slope": 45.0}
    changes = []
    for samples, spacing in ((65, 20.0), (129, 10.0)):
        terrain = smooth_terrain((samples, samples), spacing)
        change = crept(terrain, None, **settings)[0].elevation - terrain.elevation
        changes.append(change[:: (samples - 1) // 64, :: (samples - 1) // 64])
    assert relative(*changes) < 0.05
    monkeypatch.setattr(hillslope, "MOST_SHARE", hillslope.MOST_SHARE / 2)
    terrain = smooth_terrain((65, 65), 20.0)
    slower = crept(terrain, None, **settings)[0].elevation - terrain.elevation
    assert relative(changes[0], slower) < 0.01


def test_only_soil_creeps_if_told(device: Any) -> None:
    terrain = rough_terrain((33, 33)).with_layers(sediment=np.full((33, 33), 1.0))
    result, _ = crept(terrain, device, duration=1e4, soil_only=True)
    before = terrain.elevation.astype(np.float64) - 1.0
    after = result.elevation.astype(np.float64) - result.layer("sediment")
    assert np.abs(after - before).max() < 1e-4
    assert result.layer("sediment").min() >= 0
    assert np.abs(result.elevation - terrain.elevation).max() > 0.5
    bare, _ = crept(rough_terrain((33, 33)), device, duration=1e4, soil_only=True)
    assert bare.elevation.tobytes() == terrain.elevation.tobytes()


def test_hard_ground_and_hard_beds_creep_less(device: Any) -> None:
    terrain = smooth_terrain((33, 33), 20.0)
    moved = []
    for hardness in (0.0, 0.5, 1.0):
        result, _ = crept(terrain, device, duration=1e4, hardness=hardness)
        moved.append(float(np.abs(result.elevation - terrain.elevation).mean()))
    assert moved[0] > 1.2 * moved[1] > 0
    assert moved[2] == 0
    datum = terrain.with_layers(strata_datum=np.full((33, 33), 1e4))
    shares = []
    for material in ("granite", "mudstone"):
        beds = Strata(beds=(Bed(material=material, thickness=10.0),))
        result, _ = crept(datum.with_strata(beds), device, duration=1e4)
        shares.append(float(np.abs(result.elevation - terrain.elevation).mean()))
    assert shares[0] < 0.7 * shares[1]


def test_half_the_rate_for_twice_the_time() -> None:
    terrain = smooth_terrain((33, 33), 20.0)
    first, _ = crept(terrain, None, creep_rate=0.02, duration=2e4)
    second, _ = crept(terrain, None, creep_rate=0.01, duration=4e4)
    assert not difference(first, second)


@pytest.mark.parametrize("border", ["closed", "open", "fixed"])
@pytest.mark.parametrize(
    "settings", [{}, {"critical_slope": 40.0}, {"soil_only": True, "critical_slope": 40.0}]
)
def test_reference_equals_opencl(border: str, settings: dict[str, Any]) -> None:
    terrain = rough_terrain((40, 33)).with_layers(sediment=rough_terrain((40, 33)).elevation)
    both = [
        crept(terrain, name, duration=500.0, border=border, **settings)[0]
        for name in ("numpy", None)
    ]
    assert not difference(*both)


def test_too_many_sweeps_are_refused() -> None:
    with pytest.raises(ParameterError, match="duration = 1e\\+10: .* at most 1000000; lower"):
        crept(rough_terrain((9, 9)), None, duration=1e10)


def test_the_critical_slope_is_where_slopes_straighten() -> None:
    steep = math.tan(math.radians(40.0))
    ridge = Heightfield(300.0 - 1.6 * np.abs(np.arange(65) - 32) * 5.0 * np.ones((9, 1)), 5.0)
    result, _ = crept(ridge, None, duration=4e3, creep_rate=0.01, critical_slope=40.0)
    slope = np.abs(np.diff(result.elevation[4].astype(np.float64))) / 5.0
    assert slope.max() < 1.6
    assert slope[26] < slope[20] < 1.6  # convex at the top
    assert np.median(slope) > 0.6 * steep
