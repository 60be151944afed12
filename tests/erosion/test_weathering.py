"""Weathering: laws of production, exposure, beds, and debris that falls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, Run
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.strata import Bed, Strata
from terrakit.testing import awkward_terrains, difference, rough_terrain
from terrakit_erosion import weathering
from terrakit_erosion.weathering import Weathering

FLAT = Heightfield(np.full((9, 9), 100.0), 10.0)
STAYS = {"distance": 0.0}


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def weathered(surface: Heightfield, device: Any = None, **settings: Any) -> tuple[Heightfield, Run]:
    run = Run(device=device).for_step("weathering")
    return execute(Weathering(**settings), surface, run), run


def bedrock(terrain: Heightfield) -> np.ndarray:
    return terrain.elevation.astype(np.float64) - terrain.layer("sediment")


@pytest.mark.parametrize("years", [1e3, 1e4, 1e6])
def test_cover_grows_with_the_logarithm_of_time(device: Any, years: float) -> None:
    result, _ = weathered(FLAT, device, duration=years, cover_depth=0.4, **STAYS)
    expected = 0.4 * math.log(1 + 1e-4 * years / 0.4)
    assert result.layer("sediment") == pytest.approx(expected, rel=2e-3)
    assert result.elevation.tobytes() == FLAT.elevation.tobytes()


def test_the_number_of_steps_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    few, _ = weathered(FLAT, None, duration=1e5, **STAYS)
    monkeypatch.setattr(weathering, "FEWEST_STEPS", 4 * weathering.FEWEST_STEPS)
    many, _ = weathered(FLAT, None, duration=1e5, **STAYS)
    assert few.layer("sediment") == pytest.approx(many.layer("sediment"), rel=2e-3)


def test_cover_that_is_there_shields() -> None:
    covered = FLAT.with_layers(sediment=np.full((9, 9), 1.0))
    bare, _ = weathered(FLAT, None, duration=100.0, **STAYS)
    under, _ = weathered(covered, None, duration=100.0, **STAYS)
    gained = under.layer("sediment") - 1.0
    assert gained / bare.layer("sediment") == pytest.approx(math.exp(-2.0), rel=0.03)


@pytest.mark.parametrize("bare", [0.0, 0.3, 1.0])
def test_the_humped_law_peaks_under_cover(device: Any, bare: float) -> None:
    """Rates at several covers, from short runs, against the formula."""
    cover = np.linspace(0.0, 3.0, 9).astype(np.float32) * np.ones((9, 1), dtype=np.float32)
    terrain = FLAT.with_layers(sediment=cover)
    result, _ = weathered(
        terrain, device, duration=2000.0, law="humped", bare_share=bare, cover_depth=50.0, **STAYS
    )
    rate = (result.layer("sediment") - cover)[4] / (2000.0 * 1e-4)
    b = 0.5 * (1 + math.sqrt(1 - bare))
    y = np.exp(-(cover[4] + 0.5 * rate * 0.2) / 50.0)
    assert rate == pytest.approx(4 * b * y * (1 - b * y), rel=0.03, abs=0.01)


def test_debris_takes_more_room(device: Any) -> None:
    terrain = rough_terrain((17, 17))
    result, run = weathered(terrain, device, duration=2e4, expansion=1.5, **STAYS)
    rise = result.elevation.astype(np.float64) - terrain.elevation
    lowered = terrain.elevation - bedrock(result)
    assert lowered.min() > 0
    assert rise == pytest.approx(0.5 * lowered, rel=1e-3, abs=1e-3)
    account = run.ledger.accounts["rock"]
    assert account.came["expansion"] == pytest.approx(rise.sum() * 100.0, rel=1e-3)
    assert account.residual == pytest.approx(0.0, abs=1e-6)


def test_steep_faces_weather_across() -> None:
    """Bare rock of 60 degrees comes down twice as fast as flat rock, as its face retreats."""
    ramp = Heightfield(np.arange(33) * 10.0 * math.sqrt(3.0) * np.ones((9, 1)), 10.0)
    settings = {"duration": 10.0, "rounding": 0.0, **STAYS}
    steep, _ = weathered(ramp, None, **settings)
    flat, _ = weathered(FLAT, None, **settings)
    ratio = steep.layer("sediment")[4, 5:-5] / flat.layer("sediment")[4, 4]
    assert ratio == pytest.approx(2.0, rel=0.02)


def test_corners_weather_faster_than_edges_and_edges_than_faces(device: Any) -> None:
    block = np.zeros((33, 33))
    block[8:25, 8:25] = 20.0
    terrain = Heightfield(block, 10.0)
    settings = {"duration": 100.0, "weathering_rate": 1e-3, **STAYS}
    made = weathered(terrain, device, rounding=2.0, **settings)[0].layer("sediment")
    assert made[8, 8] > 1.1 * made[8, 16] > 1.21 * made[16, 16]
    plain = weathered(terrain, device, rounding=0.0, **settings)[0].layer("sediment")
    assert plain[8, 16] < made[8, 16]
    assert plain[16, 16] == made[16, 16]


def test_cliffs_retreat_and_stand_in_their_talus(device: Any) -> None:
    profile = np.where(np.arange(64) < 32, 120.0, 0.0)
    cliff = Heightfield(profile * np.ones((7, 1)), 10.0)
    result, run = weathered(cliff, device, duration=1e5, weathering_rate=3e-4, distance=150.0)
    loose, z = result.layer("sediment")[3], result.elevation[3].astype(np.float64)
    assert z[31] < 115.0
    assert loose[33] > 5.0
    talus = np.abs(np.diff(z))[33:] / 10.0
    assert talus.max() <= math.tan(math.radians(36.0)) * 1.12  # it is still moving
    assert run.ledger.accounts["rock"].residual == pytest.approx(0.0, abs=1e-6)
    assert (result.elevation == result.elevation[3]).all()


def test_soft_beds_recede_beneath_hard_ones(device: Any) -> None:
    ramp = Heightfield(np.arange(65)[::-1] * 12.0 * np.ones((7, 1)), 10.0)
    beds = Strata(
        beds=(
            Bed(material="quartzite", thickness=120.0),
            Bed(material="mudstone", thickness=120.0),
        ),
        repeated=True,
    )
    terrain = ramp.with_layers(strata_datum=np.full(ramp.shape, 1e3)).with_strata(beds)
    result, _ = weathered(terrain, device, duration=5e4, rounding=0.0, distance=30.0)
    lowered = (terrain.elevation - bedrock(result))[3]
    slope = np.abs(np.diff(bedrock(result)[3])) / 10.0
    depth = (1e3 - terrain.elevation[3]) % 240.0
    hard, soft = (depth > 30) & (depth < 90), (depth > 150) & (depth < 210)
    inside = (np.arange(65) > 5) & (np.arange(65) < 45)
    assert np.median(lowered[soft & inside]) > 3 * np.median(lowered[hard & inside])
    assert slope[5:45].max() > 1.3 > 1.2 > slope[5:45].min()  # ledges


def test_hardness_and_rate_may_be_layers(device: Any) -> None:
    ramp = np.linspace(0, 1, 81, dtype=np.float32).reshape(9, 9)
    terrain = FLAT.with_layers(mask_hard=ramp)
    result, _ = weathered(terrain, device, duration=1e3, hardness="mask_hard", **STAYS)
    made = result.layer("sediment")
    assert (np.diff(made.ravel()) < 0).all()
    assert made[8, 8] == 0


def test_nothing_is_lost_and_nothing_overflows(device: Any) -> None:
    for what, terrain in awkward_terrains():
        result, run = (
            weathered(
                terrain, device, duration=1e10, weathering_rate=1.0, expansion=2.0, distance=0.0
            )
            if what == "a spike"
            else weathered(terrain, device, duration=1e5, distance=10.0)
        )
        account = run.ledger.accounts["rock"]
        for name in result:
            assert np.isfinite(result.layer(name)).all(), what
        assert result.layer("sediment").min() >= 0
        assert abs(account.residual) <= 1e-9 * max(abs(account.start), account.moved, 1.0), what


def test_no_time_no_change() -> None:
    terrain = rough_terrain((17, 17))
    for settings in ({"duration": 0.0}, {"weathering_rate": 0.0}):
        result, run = weathered(terrain, None, **settings)
        assert result.elevation.tobytes() == terrain.elevation.tobytes()
        assert run.ledger.is_closed


def test_a_border_that_is_open_lets_debris_go(device: Any) -> None:
    ramp = Heightfield(np.arange(33)[::-1] * 15.0 * np.ones((9, 1)), 10.0)
    for border in ("closed", "open"):
        _, run = weathered(ramp, device, duration=2e4, border=border, distance=50.0)
        left = run.ledger.accounts["rock"].left
        assert set(left) == ({"border east"} if border == "open" else set())


@pytest.mark.parametrize(
    "settings", [{}, {"law": "humped", "expansion": 1.3}, {"border": "open", "hardness": 0.3}]
)
def test_reference_equals_opencl(settings: dict[str, Any]) -> None:
    both = [
        weathered(rough_terrain((40, 33)), name, duration=2e4, distance=20.0, **settings)[0]
        for name in ("numpy", None)
    ]
    assert not difference(*both)
