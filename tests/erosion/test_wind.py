"""Wind: dunes of the right shape, slope, speed and direction; lees, yardangs, an exact ledger."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Heightfield, ParameterError, Run
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.strata import Bed, Strata
from terrakit.testing import rough_terrain
from terrakit_erosion.wind import Wind
from terrakit_erosion.wind.plan import moving_sand, patches


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def blown(surface: Heightfield, device: Any = None, **settings: Any) -> tuple[Heightfield, Run]:
    run = Run(5, device).for_step("wind")
    return execute(Wind.from_settings(settings, "test"), surface, run), run


def plain(shape: tuple[int, int], spacing: float = 4.0, **layers: Any) -> Heightfield:
    return Heightfield(np.zeros(shape), spacing, layers=layers)


def heap(height: float, shape: tuple[int, int], spacing: float = 2.0) -> Heightfield:
    """Return a heap of sand on a plain, eight times as wide as high."""
    rows, cols = shape
    row, col = np.indices(shape)
    far = np.hypot(row - rows // 2, col - cols // 3) * spacing / (4 * height)
    sand = height * np.clip(1.2 * np.exp(-0.5 * far**2) - 0.2, 0.0, None)
    return Heightfield(sand, spacing, layers={"sediment": sand})


def lie_of_crests(terrain: Heightfield) -> float:
    """Return the direction across the crests, degrees clockwise from north, 0 to 180."""
    to_south, to_east = np.gradient(terrain.elevation.astype(np.float64))
    double = math.atan2(
        float((-2 * to_south * to_east).sum()), float((to_south**2 - to_east**2).sum())
    )
    return math.degrees(0.5 * double) % 180.0


def middle(terrain: Heightfield) -> float:
    """Return how far east the heap lies, metres, on a map that goes around."""
    sand = terrain.elevation.astype(np.float64)
    angle = 2j * np.pi * np.arange(terrain.shape[1]) / terrain.shape[1]
    turn = np.angle((sand * np.exp(angle)).sum()) / (2 * np.pi)
    return float(turn % 1.0) * terrain.shape[1] * terrain.spacing


# --- dunes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [270.0, 300.0])
def test_crests_lie_across_the_wind(direction: float) -> None:
    result, _ = blown(
        plain((112, 112)),
        wind_direction=direction,
        sand_depth=4.0,
        duration=0.8,
        border="periodic",
    )
    assert result.elevation.std() > 1.0
    gap = (lie_of_crests(result) - direction + 90.0) % 180.0 - 90.0
    assert abs(gap) < 15.0


def test_two_winds_make_crests_along_their_mean() -> None:
    """Seif dunes: winds 110 degrees apart; the mean comes from the west."""
    result, _ = blown(
        plain((112, 112)),
        winds=[[215.0, 1.0], [325.0, 1.0]],
        wind_cycle=0.3,
        sand_depth=2.0,
        patchiness=0.05,
        duration=5.0,
        border="periodic",
    )
    assert result.elevation.std() > 0.7
    across = lie_of_crests(result)
    assert min(across, 180.0 - across) < 25.0  # leaning to the wind that blew last


def test_slip_faces_hold_the_angle_of_repose() -> None:
    result, _ = blown(
        plain((12, 192), 2.0), sand_depth=4.0, duration=0.6, border="periodic", talus_angle=33.0
    )
    fall = -np.diff(result.elevation.astype(np.float64), axis=1) / 2.0
    assert 30.0 < math.degrees(math.atan(np.percentile(fall, 97))) < 34.5
    rise = -fall
    assert np.percentile(rise, 99) < 0.8 * np.percentile(fall, 97)  # the windward side is gentler


def test_heap_becomes_a_barchan() -> None:
    """Its horns run ahead of its middle, and behind its crest it is steep."""
    result, _ = blown(
        heap(9.0, (100, 140)), sand_depth=0.0, duration=0.8, border="periodic", hop_length=2.0
    )
    sand = np.roll(result.elevation, -int(middle(result) / 2.0) + 70, axis=1)
    rows = np.flatnonzero(sand.max(axis=1) > 0.6)
    front = [int(np.flatnonzero(sand[row] > 0.5).max()) for row in rows]
    quarter = len(rows) // 6
    horns = 0.5 * (max(front[:quarter]) + max(front[-quarter:]))
    assert horns > front[len(rows) // 2] + 2
    profile = sand[rows[len(rows) // 2]].astype(np.float64)
    crest, toe = int(profile.argmax()), int(np.flatnonzero(profile > 0.3).min())
    assert -np.diff(profile).min() / 2.0 > 0.5
    assert profile[crest] / (2.0 * (crest - toe)) < 0.3


@pytest.mark.parametrize(("direction", "sign"), [(270.0, 1), (90.0, -1)])
def test_dunes_wander_downwind(device: Any, direction: float, sign: int) -> None:
    start = heap(3.0, (48, 64))
    result, _ = blown(
        start, device, wind_direction=direction, sand_depth=0.0, duration=0.03, border="periodic"
    )
    assert sign * (middle(result) - middle(start)) > 1.0


def test_small_dunes_are_faster() -> None:
    """Speed goes with 1 / height: the sand over the crest builds up the whole slip face."""
    speeds = []
    for height in (6.0, 12.0):
        settings = {"sand_depth": 0.0, "border": "periodic", "hop_length": 4.0}
        first, _ = blown(heap(height, (72, 140), 4.0), duration=0.4, **settings)
        later, _ = blown(first, duration=0.3, **settings)
        length = 140 * 4.0
        speeds.append(((middle(later) - middle(first)) % length) / 0.3)
    assert 1.4 < speeds[0] / speeds[1] < 3.0


def test_twice_the_samples_give_the_same_dune() -> None:
    moved, heights = [], []
    for spacing, size in ((4.0, 56), (2.0, 112)):
        start = heap(10.0, (size, size * 3 // 2), spacing)
        result, _ = blown(start, sand_depth=0.0, duration=0.3, border="periodic", hop_length=8.0)
        moved.append(middle(result) - middle(start))
        heights.append(float(result.elevation.max()))
    assert moved[0] == pytest.approx(moved[1], rel=0.3)
    assert heights[0] == pytest.approx(heights[1], rel=0.15)


# --- lee, plants, height ------------------------------------------------------------------------


def test_nothing_leaves_the_lee(device: Any) -> None:
    wall = np.zeros((12, 80))
    wall[:, 10:14] = 20.0
    sand = np.ones_like(wall)
    terrain = Heightfield(wall + sand, 2.0, layers={"sediment": sand})
    result, _ = blown(terrain, device, sand_depth=0.0, sand_inflow=0.0, duration=0.02)
    lost = sand - result.layer("sediment")
    lee = int(20.0 / math.tan(math.radians(15.0)) / 2.0)  # 75 m, in samples
    assert lost[:, 16 : 14 + int(0.7 * lee)].max() < 1e-3
    assert lost[:, 14 + int(1.3 * lee) :].max() > 0.05


def test_plants_hold_the_sand(device: Any) -> None:
    plants = np.zeros((24, 48), np.float32)
    plants[8:16, 16:32] = 0.9
    result, _ = blown(
        plain((24, 48), mask_plants=plants),
        device,
        vegetation="mask_plants",
        sand_depth=0.5,
        patchiness=0.0,
        duration=0.1,
    )
    sand = result.layer("sediment")
    assert sand[8:16, 16:32].mean() > 1.5 * sand[:, 34:][:8].mean()


def test_high_ground_feels_more_wind() -> None:
    """Two terraces along the wind: with a speed-up the upper one loses more."""
    ground = np.where(np.arange(48) < 24, 0.0, 10.0)[:, None] * np.ones((48, 48))
    ratio = []
    for speed_up in (0.0, 0.03):
        result, _ = blown(
            Heightfield(ground, 4.0),
            sand_depth=1.0,
            patchiness=0.0,
            sand_inflow=0.0,
            speed_up=speed_up,
            duration=0.02,
        )
        lost = 1.0 - result.layer("sediment").astype(np.float64)
        ratio.append(lost[30:44, :10].mean() / lost[4:18, :10].mean())
    assert ratio[0] == pytest.approx(1.0, abs=0.1)
    assert ratio[1] > 1.5


def test_hills_turn_the_wind_aside() -> None:
    """Sand that would cross a hill beside its middle is turned further to that side."""
    row, col = np.indices((60, 60))
    hill = 30.0 * np.exp(-((row - 30) ** 2 + (col - 30) ** 2) / (2 * 8.0**2))
    strip = np.zeros((60, 60), np.float32)
    strip[22:27, 5:15] = 2.0
    where = []
    for deflection in (0.0, 2.0):
        terrain = Heightfield(hill + strip, 4.0, layers={"sediment": strip})
        result, _ = blown(
            terrain, sand_depth=0.0, sand_inflow=0.0, deflection=deflection, duration=0.1
        )
        sand = result.layer("sediment")[:, 20:].sum(axis=1, dtype=np.float64)
        where.append(float((sand * np.arange(60)).sum() / sand.sum()))
    assert where[1] < where[0] - 0.5


# --- rock ---------------------------------------------------------------------------------------


def test_only_bare_rock_wears(device: Any) -> None:
    sand = np.zeros((24, 48), np.float32)
    sand[:12] = 3.0
    terrain = Heightfield(sand, 4.0, layers={"sediment": sand})
    result, run = blown(
        terrain, device, sand_depth=0.0, sand_inflow=1.0, abrasion=5.0, duration=0.1
    )
    worn = -(result.elevation - result.layer("sediment"))
    assert np.abs(worn[:10, 12:-12]).max() < 1e-4
    assert worn[15:, 12:-12].min() > 0.05
    assert run.ledger.accounts["rock"].left["dust"] > 0


def test_hard_rock_wears_less(device: Any) -> None:
    hard = np.zeros((24, 48), np.float32)
    hard[:12] = 0.75
    terrain = plain((24, 48), hardness=hard)
    settings = {
        "sand_depth": 0.0,
        "sand_inflow": 1.0,
        "abrasion": 5.0,
        "dust": 1.0,
        "duration": 0.03,
    }
    result, _ = blown(terrain, device, hardness="hardness", **settings)
    worn = -(result.elevation - result.layer("sediment"))[:, 12:-12].astype(np.float64)
    assert worn[:10].mean() == pytest.approx(0.25 * worn[14:].mean(), rel=0.1)


def test_hard_beds_stand_out(device: Any) -> None:
    strata = Strata(
        beds=(
            Bed(material="marl", thickness=10.0, hardness=0.1),
            Bed(material="granite", thickness=100.0, hardness=0.9),
        )
    )
    datum = np.where(np.arange(24) < 12, 5.0, 15.0)[:, None] * np.ones((24, 48))
    terrain = plain((24, 48), strata_datum=datum).with_strata(strata)
    settings = {"sand_depth": 0.0, "sand_inflow": 1.0, "abrasion": 5.0, "duration": 0.05}
    result, _ = blown(terrain, device, **settings)
    worn = -(result.elevation - result.layer("sediment"))[:, 12:-12].astype(np.float64)
    assert worn[:10].mean() > 4 * worn[14:].mean() > 0


def test_yardangs_lie_along_the_wind() -> None:
    terrain = rough_terrain((64, 64), 4.0, relief=8.0)
    result, _ = blown(
        terrain,
        sand_depth=0.1,
        border="periodic",
        hop_length=8.0,
        wind_speed=10.0,
        abrasion=20.0,
        dust=1.0,
        duration=0.4,
    )
    worn = Heightfield(result.elevation - terrain.elevation, 4.0)
    across = lie_of_crests(worn)
    assert min(across, 180.0 - across) < 25.0  # the wind is from the west


# --- accounts and limits ------------------------------------------------------------------------

VARIANTS: dict[str, dict[str, Any]] = {
    "open": {"abrasion": 5.0, "wind_direction": 30.0},
    "periodic": {"border": "periodic", "winds": [[30.0, 1.0], [200.0, 2.0]]},
    "deflected": {"deflection": 2.0, "speed_up": 0.01, "abrasion": 1.0},
    "planted": {"vegetation": "mask_plants", "deflection": 1.0, "border": "periodic"},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_sand_is_exact_and_twins_agree(variant: str) -> None:
    plants = np.linspace(0, 1, 33 * 20, dtype=np.float32).reshape(33, 20)
    terrain = rough_terrain((33, 20), relief=15.0).with_layers(mask_plants=plants)
    settings = {"duration": 0.15, "sand_depth": 2.0, **VARIANTS[variant]}
    results = []
    for name in ("numpy", None):
        result, run = blown(terrain, choose_device(name), **settings)
        account = run.ledger.accounts["rock"]
        assert account.residual == pytest.approx(0.0, abs=1e-6)
        assert account.moved > 0
        assert account.came["sand laid"] > 0
        leaves = {name for name in account.left if name.startswith("border")}
        assert bool(leaves) == (settings.get("border") != "periodic")
        assert result.layer("sediment").min() >= 0
        results.append(result)
    for layer in ("elevation", "sediment", "erosion", "deposition"):
        assert results[0].layer(layer).tobytes() == results[1].layer(layer).tobytes()


def test_below_the_threshold_no_sand_moves(device: Any) -> None:
    sand = np.tile(np.linspace(0.0, 3.0, 32), (16, 1))
    terrain = Heightfield(sand, 4.0, layers={"sediment": sand})
    result, _ = blown(terrain, device, wind_speed=2.0, sand_depth=0.0, duration=10.0)
    assert result.elevation.tobytes() == terrain.elevation.tobytes()


def test_no_years_change_nothing(device: Any) -> None:
    terrain = rough_terrain((17, 17))
    result, run = blown(terrain, device, duration=0.0, sand_depth=5.0)
    assert result.elevation.tobytes() == terrain.elevation.tobytes()
    assert run.ledger.accounts["rock"].came == {}


@pytest.mark.parametrize("stop", [0, 1, 20, 40])
def test_finished_early_every_grain_lies(stop: int) -> None:
    run = Run(5).for_step("wind")

    def watch(progress: Any) -> None:
        if progress.done >= stop:
            run.finish_now()

    run.on_progress = watch
    wind = Wind(duration=0.3, sand_depth=1.0, abrasion=1.0)
    result = execute(wind, rough_terrain((24, 24)), run)
    account = run.ledger.accounts["rock"]
    assert np.isfinite(result.elevation).all()
    assert account.residual == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("height", "spacing"), [(1e6, 1.0), (0.01, 5e6), (-1e5, 0.01), (3000.0, 90.0)]
)
def test_extremes_are_survived(device: Any, height: float, spacing: float) -> None:
    ground = rough_terrain((9, 11)).elevation / 100.0
    ground[4, 5] += height
    duration = 1e-3 * min(1.0, spacing**2 / 100.0)
    for border in ("open", "periodic"):
        terrain = Heightfield(ground, spacing)
        result, run = blown(
            terrain, device, duration=duration, wind_speed=60.0, border=border, abrasion=100.0
        )
        account = run.ledger.accounts["rock"]
        assert np.isfinite(result.elevation).all()
        assert result.layer("sediment").min() >= 0
        assert abs(account.residual) <= 1e-9 * max(abs(account.start), account.moved, 1.0)


def test_sand_follows_a_schedule(device: Any) -> None:
    depth = {"at": [0.0, 1.0], "value": [0.0, 4.0]}
    _, run = blown(plain((24, 24)), device, sand_depth=depth, duration=0.3, border="periodic")
    laid = run.ledger.accounts["rock"].came["sand laid"] / (24 * 24 * 16.0)
    assert 2.5 < laid < 5.5


def test_sand_is_laid_once_in_a_loop() -> None:
    from terrakit_erosion.repeat import Repeat

    steps = [{"use": "wind", "duration": 0.05, "sand_depth": 1.0, "border": "periodic"}]
    once, three = (Run(5).for_step("repeat") for _ in range(2))
    execute(Repeat(times=1, steps=steps), plain((24, 24)), once)
    execute(Repeat(times=3, steps=steps), plain((24, 24)), three)
    laid = [run.ledger.accounts["rock"].came["sand laid"] for run in (once, three)]
    assert laid[0] == pytest.approx(laid[1], rel=1e-6)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"winds: number 1 is \[270\.0\]"):
        Wind(winds=[[270.0]])
    with pytest.raises(ParameterError, match="winds: number 2"):
        Wind(winds=[[270.0, 1.0], [90.0, 0.0]])
    with pytest.raises(ParameterError, match="duration = 1e\\+06: takes .* gusts"):
        blown(plain((9, 9), 1.0), duration=1e6)


def test_moving_sand_follows_lettau() -> None:
    assert moving_sand(5.5) == 0.0
    assert moving_sand(2.0) == 0.0
    assert 100.0 < moving_sand(8.0) < 300.0
    assert moving_sand(8.0, 4.0) == pytest.approx(moving_sand(16.0))


def test_first_sand_is_fixed_in_the_world() -> None:
    whole = plain((40, 50)).grid
    x, y = whole.north_west
    part = Heightfield(np.zeros((12, 20)), 4.0, (x + 10 * 4.0, y - 8 * 4.0)).grid
    field: NDArray[np.float32] = patches(whole, 60.0, (1, 2))
    assert field[8:20, 10:30] == pytest.approx(patches(part, 60.0, (1, 2)), abs=1e-5)
    assert np.abs(field).max() > 0.3
