"""Droplets: they run, carry and lay down as they should, and no grid shows in what they leave."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Grid, Heightfield, ParameterError, Run, Schedule
from terrakit.analysis.texture import spike_fraction
from terrakit.compute import Device, choose_device
from terrakit.execute import execute
from terrakit.quanta import Quanta
from terrakit.routing import accumulate, filled, route
from terrakit.strata import Bed, Strata
from terrakit.testing import rough_terrain
from terrakit_erosion.droplet import Droplet, numpy_model, reference
from terrakit_erosion.droplet.plan import COUNTS
from terrakit_generators.fractals.fbm import Fbm

GRAVITY = 9.81
QUICK = {"drops_a_cell": 0.5, "longest_path": 300.0, "drops_at_once": 0.0625}
BARE: dict[str, Any] = {
    "bank_angle": None,
    "levelling": 0.0,
    "drying_length": 1e8,
    "longest_path": 1e5,
    "drops_a_cell": 0.0625,
    "drops_at_once": 0.0625,
}
"""Nothing but the drops, one batch."""


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def eroded(
    surface: Heightfield, device: Any = None, sea_level: float | None = None, **settings: Any
) -> tuple[Heightfield, Run]:
    run = Run(7, device, sea_level=sea_level).for_step("droplet")
    return execute(Droplet(**settings), surface, run), run


def smooth_noise(size: int, hurst: float = 0.85, seed: int = 0) -> np.ndarray:
    """Return fractal noise of deviation 1 whose waves are those of a coarse grid."""
    frequency = np.fft.fftfreq(2 * size)
    wave = np.hypot(frequency[:, None], frequency[None, :])
    wave[0, 0] = np.inf
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal(wave.shape))
    fractal = np.fft.ifft2(noise * wave ** -(1 + hurst)).real[:size, :size]
    return np.asarray(fractal / fractal.std())


def reference_slope(size: int = 193) -> Heightfield:
    """Return samples of 1 m: a slope of 0.3 with 2 m of fractal, Hurst exponent 0.85."""
    return Heightfield(2 * smooth_noise(size) + 0.3 * np.arange(size)[:, None], 1.0)


def plane(slope: float = 0.3, shape: tuple[int, int] = (65, 33), spacing: float = 2.0) -> Any:
    """Return ground that falls to the south."""
    fall = np.arange(shape[0])[::-1, None] * slope * spacing
    return Heightfield(np.broadcast_to(fall, shape).copy(), spacing)


def left(run: Run, sink: str) -> float:
    return float(run.ledger.accounts["rock"].left.get(sink, 0.0))


# --- one answer ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"lakes": "end", "border": "closed", "inertia": 0.9},
        {"ending": "laid_down", "bank_angle": None, "levelling": 0.0, "brush_radius": 1.0},
        {"hardness": 0.5, "rain_depth": Schedule(at=[0.0, 1.0], value=[100.0, 10.0])},
        {"hardness": "mask_hard", "rain_depth": "mask_rain", "brush_radius": 60.0},
    ],
)
@pytest.mark.parametrize("sea_level", [None, 0.0])
def test_numpy_and_opencl_agree_to_the_bit(settings: Any, sea_level: float | None) -> None:
    if not choose_device(None).is_opencl:
        pytest.skip("no OpenCL device")
    terrain = rough_terrain((33, 41), 10.0)
    ramp = np.linspace(0.0, 1.0, terrain.elevation.size).reshape(terrain.shape)
    terrain = terrain.with_layers(
        mask_hard=ramp, mask_rain=100.0 * ramp[::-1], sediment=np.maximum(0.0, 9.0 * ramp - 4.0)
    )
    both = [
        eroded(terrain, device, sea_level, **{**QUICK, **settings}) for device in ("numpy", None)
    ]
    for layer in both[0][0]:
        assert both[0][0].layer(layer).tobytes() == both[1][0].layer(layer).tobytes(), layer
    assert both[0][1].ledger.to_dict() == both[1][1].ledger.to_dict()
    assert both[0][1].ledger.accounts["rock"].residual == 0.0
    assert both[0][1].ledger.accounts["rock"].moved > 0


def test_work_groups_do_not_matter() -> None:
    if not choose_device(None).is_opencl:
        pytest.skip("no OpenCL device")
    terrain = rough_terrain((48, 65), 10.0)
    results = {
        execute(Droplet(**QUICK), terrain, Run(7, work_group=size)).elevation.tobytes()
        for size in (1, 64, 256)
    }
    assert len(results) == 1


def test_beds_are_the_same_on_both_and_the_hard_one_stands_out() -> None:
    terrain = plane(0.5, (65, 49), 10.0)
    hard = Strata(
        beds=(
            Bed(material="soft", thickness=100.0, hardness=0.2),
            Bed(material="hard", thickness=100.0, hardness=0.9),
            Bed(material="base", thickness=100.0, hardness=0.2),
        )
    )
    top = np.full(terrain.shape, float(terrain.elevation.max()))
    layered = terrain.with_layers(strata_datum=top).with_strata(hard)
    settings = {**QUICK, "drops_a_cell": 2.0, "rain_depth": 20.0}
    result, run = eroded(layered, None, **settings)
    again, _ = eroded(layered, "numpy", **settings)
    assert result.elevation.tobytes() == again.elevation.tobytes()
    loss = (terrain.elevation - result.elevation)[:, 8:-8].mean(1)
    depth = top[:, 0] - terrain.elevation[:, 0]
    inside = (depth > 130) & (depth < 170)
    assert loss[inside].mean() < 0.5 * loss[(depth > 40) & (depth < 80)].mean()
    assert run.ledger.accounts["rock"].residual == 0.0


def test_drops_are_functions_of_seed_and_number() -> None:
    """Twice the drops in twice the batches begin with the same batches."""
    terrain = rough_terrain((48, 48), 10.0)
    settings = {"drops_at_once": 0.0625, "longest_path": 200.0, "levelling": 0.0}
    few, _ = eroded(terrain, None, drops_a_cell=0.25, rain_depth=50.0, **settings)
    run = Run(7).for_step("droplet")

    def stop(progress: Any) -> None:
        if progress.done == 3:
            run.finish_now()

    run.on_progress = stop
    operator = Droplet(drops_a_cell=0.5, rain_depth=100.0, **settings)
    many = execute(operator, terrain, run)
    assert few.elevation.tobytes() == many.elevation.tobytes()
    other = execute(operator, terrain, Run(8))
    assert other.elevation.tobytes() != many.elevation.tobytes()


# --- one drop -----------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 10.0, 22.5, 37.0, 45.0, 90.0, 200.0])
def test_a_drop_on_a_plane_walks_straight(angle: float) -> None:
    size = 65
    row, col = np.indices((size, size))
    east, south = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    height = np.rint(-1e5 * (east * col + south * row)).astype(np.int32)
    ground = reference.Ground(height, None, None, np.float32(0.3), -(2**30), True, 1000)
    drops = reference.begin((1, 2), 0, (1, 1), (size, size))
    drops.row[:], drops.col[:] = size // 2, size // 2
    drops.down[:], drops.right[:] = 0.25, 0.75
    for number in range(1, 25):
        reference.step(drops, ground)
        x = float(drops.col[0] + drops.right[0]) - (size // 2 + 0.75)
        y = float(drops.row[0] + drops.down[0]) - (size // 2 + 0.25)
        assert math.hypot(x - number * east, y - number * south) < 1e-3
        assert float(drops.rise[0]) == pytest.approx(-1e5, rel=1e-3)


@pytest.mark.parametrize("start_speed", [0.0, 10.0])
def test_speed_without_friction_is_that_of_free_fall(device: Any, start_speed: float) -> None:
    """What leaves is the capacity at the border: slope times v, v^2 = v0^2 + 2 g dh.

    The other sign, with which drops brake downhill, leaves a third of it at most.
    """
    slope, shape, spacing, rain, capacity = 0.3, (65, 33), 2.0, 0.01, 1e-4
    _, run = eroded(
        plane(slope, shape, spacing),
        device,
        friction=0.0,
        pickup_length=1e-3,
        settling_length=1e-3,
        start_speed=start_speed,
        capacity=capacity,
        rain_depth=rain,
        inertia=0.0,
        lakes="end",
        **BARE,
    )
    length, width = (shape[0] - 1) * spacing, (shape[1] - 1) * spacing
    way = np.linspace(0.0, length, 10001)
    speed = np.sqrt(start_speed**2 + 2 * GRAVITY * slope * way).mean()
    expected = capacity * slope * speed * rain * length * width
    assert left(run, "border south") == pytest.approx(expected, rel=0.04)


def test_speed_with_friction_comes_to_an_end() -> None:
    slope, shape, spacing, rain, capacity, friction = 0.3, (257, 33), 2.0, 0.01, 1e-4, 0.2
    _, run = eroded(
        plane(slope, shape, spacing),
        None,
        friction=friction,
        pickup_length=1e-3,
        settling_length=1e-3,
        capacity=capacity,
        rain_depth=rain,
        inertia=0.0,
        **BARE,
    )
    area = (shape[0] - 1) * (shape[1] - 1) * spacing**2
    terminal = math.sqrt(GRAVITY * slope / friction)
    expected = capacity * slope * terminal * rain * area
    assert left(run, "border south") == pytest.approx(expected, rel=0.03)


# --- what they leave ----------------------------------------------------------------------------


def gully_width(change: np.ndarray, spacing: float) -> float:
    """Return at which distance across the slope the change is half as much alike, metres."""
    across = change - change.mean(axis=1, keepdims=True)
    size = across.shape[1]
    alike = np.array([(across[:, : size - k] * across[:, k:]).mean() for k in range(size // 4)])
    alike = alike / alike[0]
    below = int(np.argmax(alike < 0.5))
    part = (alike[below - 1] - 0.5) / (alike[below - 1] - alike[below])
    return float((below - 1 + part) * spacing)


def test_width_of_gullies_does_not_depend_on_the_samples() -> None:
    size = 65
    coarse = smooth_noise(size, 1.5, 3) * 0.3
    widths = []
    for finer in (1, 2, 3):
        at = np.arange((size - 1) * finer + 1) / finer
        low = np.minimum(at.astype(int), size - 2)
        share = at - low
        rows = coarse[low] * (1 - share)[:, None] + coarse[low + 1] * share[:, None]
        height = rows[:, low] * (1 - share) + rows[:, low + 1] * share
        terrain = Heightfield(height + 0.4 * at[::-1, None], 1.0 / finer)
        result, _ = eroded(
            terrain,
            None,
            brush_radius=4.0,
            rain_depth=2.0,
            pickup_length=50.0,
            settling_length=3.0,
            levelling=0.0,
            bank_angle=None,
            drops_a_cell=4.0,
        )
        change = (result.elevation - terrain.elevation).astype(np.float64)
        widths.append(
            gully_width(change[8 * finer : -8 * finer, 8 * finer : -8 * finer], 1 / finer)
        )
    assert max(widths) / min(widths) < 1.15, widths


def test_no_direction_is_preferred_on_a_cone() -> None:
    size, spacing = 129, 8.0
    row, col = np.indices((size, size)) - size // 2
    radius = np.hypot(row, col)
    terrain = Heightfield((size - radius) * spacing * 0.5, spacing)
    result, _ = eroded(
        terrain, None, rain_depth=2.0, drops_a_cell=8.0, bank_angle=None, levelling=0.0
    )
    change = (result.elevation - terrain.elevation).astype(np.float64)
    ring = (radius > 20) & (radius < 50)
    angle = np.arctan2(row, col)[ring]
    weight = -change[ring]
    assert weight.mean() > 0.1
    for harmonic, bound in ((1, 0.02), (2, 0.02), (4, 0.03), (8, 0.03)):
        share = abs(np.sum(weight * np.exp(1j * harmonic * angle))) / np.abs(weight).sum()
        assert share < bound, (harmonic, share)


def test_visits_are_shared_among_those_who_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many drops at once do not dig deeper than the slope allows; without the guard they do."""
    row, col = np.indices((49, 49))
    funnel = 0.4 * np.hypot(row - 24, col - 24) * 2.0
    terrain = Heightfield(funnel + 0.3 * smooth_noise(49), 2.0)
    relief = float(np.ptp(terrain.elevation))
    settings = {
        "brush_radius": 2.4,
        "rain_depth": 300.0,
        "pickup_length": 3.0,
        "drops_at_once": 0.25,
        "bank_angle": None,
        "levelling": 0.0,
        "lakes": "end",
    }
    ranges = []
    for density in (2.0, 4.0):
        result, _ = eroded(terrain, "numpy", drops_a_cell=density, **settings)
        ranges.append(float(np.ptp(result.elevation)))
    assert max(ranges) < 1.5 * relief

    def unguarded(visits: Any, weights: Any) -> Any:
        return np.full(visits.shape, int(COUNTS), dtype=np.int32)

    monkeypatch.setattr(numpy_model.reference, "smooth", unguarded)
    result, _ = eroded(terrain, "numpy", drops_a_cell=4.0, **settings)
    assert float(np.ptp(result.elevation)) > 3 * relief


def valley_incision(terrain: Heightfield) -> float:
    """Return how far channels lie below the mean of 7 x 7 samples around, depressions filled."""
    quanta = Quanta.fitting(terrain.elevation, terrain.spacing)
    height = quanta.count(terrain.elevation)
    outlet = np.zeros(terrain.shape, dtype=np.uint8)
    outlet[[0, -1]] = 1
    outlet[:, [0, -1]] = 1
    routing = route(height, outlet)
    surface = quanta.metres(filled(routing, height)).astype(np.float64)
    area = accumulate(routing, np.ones_like(height))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(surface, 3, mode="reflect"), (7, 7))
    return float((around.mean((2, 3)) - surface)[area > 100].mean())


def test_valleys_cut_in_and_nothing_sticks_out() -> None:
    terrain = reference_slope()
    result, run = eroded(
        terrain, None, brush_radius=2.5, levelling=3.0, pickup_length=125.0, settling_length=6.0
    )
    assert valley_incision(result) > 1.8 * valley_incision(terrain)
    assert spike_fraction(result.elevation.astype(np.float64)) < 0.002
    assert run.ledger.accounts["rock"].residual == 0.0


def test_banks_slump_to_their_angle() -> None:
    cliff = np.where(np.arange(33) < 16, 100.0, 0.0) * np.ones((33, 1))
    terrain = Heightfield(cliff, 10.0)
    settings = {"rain_depth": 1e-6, "drops_a_cell": 3.0, "drops_at_once": 0.01, "levelling": 0.0}
    result, _ = eroded(terrain, None, bank_angle=45.0, border="closed", **settings)
    fall = np.abs(np.diff(result.elevation[16].astype(np.float64))) / 10.0
    assert fall.max() == pytest.approx(1.0, rel=0.03)
    stands, _ = eroded(terrain, None, bank_angle=None, border="closed", **settings)
    assert np.abs(np.diff(stands.elevation[16])).max() == pytest.approx(100.0, abs=1e-2)


# --- hard ground, borders, sea and lakes ---------------------------------------------------------


def test_immovable_ground_stays(device: Any) -> None:
    terrain = rough_terrain((40, 40), 10.0)
    hard = np.zeros(terrain.shape)
    hard[:, 20:] = 1.0
    result, run = eroded(terrain.with_layers(mask_hard=hard), device, hardness="mask_hard", **QUICK)
    bedrock = result.elevation - result.layer("sediment")
    loss = (terrain.elevation - bedrock)[1:-1, 1:-1]
    assert loss[:, 19:].max() < 1e-3
    assert loss[:, :19].max() > 1.0
    assert run.ledger.accounts["rock"].residual == 0.0


def test_hardness_slows_erosion() -> None:
    terrain = plane(0.5, (49, 49), 10.0)
    losses = [
        left(eroded(terrain, None, hardness=h, rain_depth=1.0, **QUICK)[1], "border south")
        for h in (0.0, 0.5, 1.0)
    ]
    assert losses[1] == pytest.approx(0.5 * losses[0], rel=0.1)
    assert losses[2] == 0.0


def test_closed_borders_let_nothing_out_and_open_ones_stand(device: Any) -> None:
    terrain = rough_terrain((40, 33), 10.0)
    for ending in ("carried_out", "laid_down"):
        result, run = eroded(terrain, device, border="closed", ending=ending, **QUICK)
        sinks = set(run.ledger.accounts["rock"].left)
        assert sinks <= ({"wash load"} if ending == "carried_out" else set())
        assert run.ledger.accounts["rock"].residual == 0.0
    result, run = eroded(terrain, device, border="open", **QUICK)
    assert {"border north", "border south"} <= set(run.ledger.accounts["rock"].left)
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        assert result.elevation[edge].tobytes() == terrain.elevation[edge].tobytes()


def test_deltas_grow_into_the_sea_and_not_out_of_it(device: Any) -> None:
    terrain = plane(0.2, (49, 33), 10.0)
    sea = 48.0
    result, run = eroded(
        terrain, device, sea, rain_depth=50.0, drops_a_cell=1.0, drops_at_once=0.0625
    )
    grown = (result.elevation - terrain.elevation)[1:-1, 1:-1]
    was_sea = (terrain.elevation < sea)[1:-1, 1:-1]
    assert grown[was_sea].sum() > 0.3 * -grown[~was_sea].sum()
    assert result.elevation[1:-1, 1:-1][was_sea].max() < sea + 1.5
    assert run.ledger.accounts["rock"].residual == 0.0


def test_water_crosses_a_hollow_and_cuts_its_rim() -> None:
    row, col = np.indices((49, 33))
    dam = 12.0 * np.exp(-0.5 * ((row - 30) / 2.0) ** 2)
    valley = 0.15 * (col - 16) ** 2
    terrain = Heightfield(0.5 * (48 - row) + dam + valley, 8.0)
    settings = {"rain_depth": 60.0, "drops_a_cell": 2.0, "drops_at_once": 0.0625, "levelling": 0.0}
    crossed, _ = eroded(terrain, None, lakes="cross", **settings)
    ended, _ = eroded(terrain, None, lakes="end", **settings)
    rims = [terrain.elevation[30, 16], ended.elevation[30].min(), crossed.elevation[30].min()]
    assert rims[2] < rims[1] - 1.0
    assert rims[2] < rims[0] - 3.0


# --- limits -------------------------------------------------------------------------------------


def test_memory_does_not_depend_on_the_number_of_drops(monkeypatch: pytest.MonkeyPatch) -> None:
    if not choose_device(None).is_opencl:
        pytest.skip("no OpenCL device")
    terrain = rough_terrain((65, 65), 10.0)
    held: list[int] = []
    allocate = Device.empty

    def counted(self: Device, *arguments: Any, **named: Any) -> Any:
        array = allocate(self, *arguments, **named)
        held[-1] += array.nbytes
        return array

    monkeypatch.setattr(Device, "empty", counted)
    for density in (0.25, 20.0):
        held.append(0)
        eroded(terrain, None, drops_a_cell=density, lakes="end", longest_path=50.0, rain_depth=0.1)
    assert held[0] == held[1]
    assert held[0] < 24 * terrain.elevation.size + 20000


def test_no_rain_changes_nothing_and_few_samples_do() -> None:
    terrain = rough_terrain((33, 33), 10.0)
    result, _ = eroded(terrain, None, rain_depth=0.0)
    assert result.elevation.tobytes() == terrain.elevation.tobytes()
    for shape in ((3, 3), (3, 17), (17, 3)):
        small = Heightfield(np.arange(float(np.prod(shape))).reshape(shape), 10.0)
        result, run = eroded(small, None)
        assert np.isfinite(result.elevation).all()
        assert run.ledger.accounts["rock"].residual == 0.0


@pytest.mark.parametrize("spacing", [0.01, 5000.0])
def test_extreme_spacings_stay_finite(spacing: float) -> None:
    rough = rough_terrain((24, 24)).elevation
    for relief in (0.01, 1e6):
        terrain = Heightfield(rough / np.abs(rough).max() * relief, spacing)
        result, run = eroded(terrain, None, **QUICK)
        assert np.isfinite(result.elevation).all()
        assert result.elevation.max() <= terrain.elevation.max() + 0.2 * relief
        account = run.ledger.accounts["rock"]
        assert abs(account.residual) <= 1e-9 * max(abs(account.start), account.moved)


def test_presets_run_and_bad_values_are_refused() -> None:
    terrain = rough_terrain((24, 24), 8.0)
    for name in Droplet.presets:
        operator = Droplet.from_settings({"preset": name, "drops_a_cell": 0.25}, "test")
        assert np.isfinite(execute(operator, terrain, Run(7)).elevation).all()
    for wrong in ({"hardness": 1.5}, {"brush_radius": 0.0}, {"drops_a_cell": -1.0}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            Droplet(**wrong)


def test_drops_that_have_ended_stay_off_a_large_map() -> None:
    if not choose_device(None).is_opencl:
        pytest.skip("no OpenCL device")
    # Idle drops that walked on read far outside the map, which only a large one lets crash
    grid = Grid((2048, 2048), 8.0)
    ground = execute(Fbm(amplitude=600.0, wavelength=4000.0), grid, Run(1))
    result = execute(Droplet(drops_a_cell=1 / 16, lakes="end"), ground, Run(1))
    assert np.isfinite(result.elevation).all()
