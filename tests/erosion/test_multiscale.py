"""From coarse to fine: nothing is lost on the way, no grid shows, and wide forms come sooner."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from terrakit import (
    Cancelled,
    Erosion,
    Filter,
    Grid,
    Heightfield,
    InputError,
    Maskable,
    ParameterError,
    Run,
    Schedule,
    parameter,
)
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.passes import rounding_of, volume_under
from terrakit.running import Progress
from terrakit.strata import Bed, Strata
from terrakit.testing import awkward_terrains, rough_terrain, smooth_terrain
from terrakit_erosion.multiscale import Multiscale, scales
from terrakit_erosion.repeat import Repeat
from terrakit_erosion.stream_power import StreamPower
from terrakit_erosion.thermal import Thermal

TERRAIN = rough_terrain((65, 65))
CREEP = Thermal(distance=40.0)
SHAPES = [(33, 33), (32, 32), (31, 47), (40, 29), (64, 17), (13, 101)]


class Bump(Erosion):
    """Raise a smooth hill in the middle of the world, and note the grid and the words."""

    name = "bump"
    high: Maskable = parameter(10.0, "Height of the hill.", unit="m", ge=-1e4, le=1e4)
    wide: float = parameter(150.0, "Width of the hill.", unit="m", gt=0)
    lasting: float = parameter(1.0, "How long.", ge=0)
    often: Maskable = parameter(1.0, "How often.", ge=0, le=1e6)
    lasts = {"lasting": 1.0, "often": 1.0}

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the surface with the hill on it."""
        NOTED.append((surface.grid, run.words("bump"), self.lasting, surface))
        assert run.world is not None
        width, height = run.world.size
        x = surface.origin[0] + np.arange(surface.shape[1]) * surface.spacing - width / 2
        y = surface.origin[1] - np.arange(surface.shape[0]) * surface.spacing - height / 2
        x -= run.world.north_west[0]
        y -= run.world.north_west[1] - height
        hill = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / self.wide**2)
        run.ledger.open("rock", volume_under(surface))
        for step in run.steps(2):
            high = np.asarray(self.value("high", surface, step / 2), dtype=np.float64) / 2
            added = (self.lasting * high * hill).astype(np.float32)
            now = surface.with_layers(elevation=surface.elevation + added)
            run.ledger.came("rock", "bump", volume_under(now) - volume_under(surface))
            surface = now
            run.offer(lambda now=now: now)  # type: ignore[misc]
        run.ledger.close("rock", volume_under(surface), 0.0)
        return surface


class Shift(Filter):
    """Lift all ground alike."""

    name = "shift"
    by: Maskable = parameter(1.0, "By how much.", unit="m", ge=-1e4, le=1e4)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return lifted ground."""
        by = np.asarray(self.value("by", surface), dtype=np.float32)
        return surface.with_layers(elevation=surface.elevation + by)


NOTED: list[tuple[Grid, tuple[int, int], float, Heightfield]] = []


@pytest.fixture(autouse=True)
def _forget() -> None:
    NOTED.clear()


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def eroded(operator: Any, surface: Any, device: Any = "numpy", **how: Any) -> tuple[Any, Run]:
    run = Run(how.pop("seed", 5), device, **how).for_step(operator.name)
    return execute(operator, surface, run), run


def bits(surface: Any) -> dict[str, bytes]:
    return {name: surface.layer(name).tobytes() for name in surface}


def tilted(shape: tuple[int, int], spacing: float = 10.0) -> Heightfield:
    row, col = np.indices(shape)
    return Heightfield(1000.0 + 0.5 * spacing * row - 0.25 * spacing * col, spacing)


# --- down and up ------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
def test_coarser_grids_are_centred_on_the_same_ground(shape: tuple[int, int]) -> None:
    grid = Grid(shape, 10.0, (500.0, 900.0))
    for _ in range(3):
        coarse = scales.coarser(grid)
        middle = [
            (g.north_west[0] + g.size[0] / 2, g.north_west[1] - g.size[1] / 2)
            for g in (grid, coarse)
        ]
        assert middle[0] == pytest.approx(middle[1], abs=1e-9)
        assert coarse.spacing == 2 * grid.spacing
        assert coarse.shape == tuple(math.ceil(n / 2) for n in grid.shape)
        grid = coarse


@pytest.mark.parametrize("shape", SHAPES)
def test_means_keep_volume_and_range(shape: tuple[int, int]) -> None:
    terrain = rough_terrain(shape).with_layers(sediment=np.random.default_rng(1).random(shape))
    coarse = scales.restricted(terrain)
    # The cells at an edge with an odd number of samples lie half beyond it
    area = [np.full(n, 1.0) for n in coarse.shape]
    for along, count in zip(area, shape, strict=True):
        if count % 2:
            along[[0, -1]] = 0.75
    for name in ("elevation", "sediment"):
        fine, means = terrain.layer(name), coarse.layer(name)
        kept = 4 * (means * area[0][:, None] * area[1][None, :]).sum(dtype=np.float64)
        assert kept == pytest.approx(float(fine.sum(dtype=np.float64)), abs=1e-5 * fine.size)
        assert fine.min() <= means.min() <= means.max() <= fine.max()


@pytest.mark.parametrize("shape", SHAPES)
def test_inclined_planes_stay_planes_inside(shape: tuple[int, int]) -> None:
    plane = tilted(shape)
    coarse = scales.restricted(plane)
    west, north = coarse.origin
    col = (west + np.arange(coarse.shape[1]) * coarse.spacing - plane.origin[0]) / 10.0
    row = (plane.origin[1] - north + np.arange(coarse.shape[0]) * coarse.spacing) / 10.0
    expected = 1000.0 + 5.0 * row[:, None] - 2.5 * col[None, :]
    assert np.allclose(coarse.elevation[1:-1, 1:-1], expected[1:-1, 1:-1], atol=1e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_change_goes_up_whole_and_within_its_range(shape: tuple[int, int]) -> None:
    coarse = scales.coarser(Grid(shape, 10.0)).shape
    change = np.random.default_rng(2).integers(-1000, 1000, coarse)
    fine = scales.prolonged(change, shape)
    assert fine.dtype == change.dtype
    assert fine.shape == shape
    assert 64 * change.min() <= fine.min() <= fine.max() <= 64 * change.max()
    one = np.zeros(coarse, dtype=np.int64)
    one[coarse[0] // 2, coarse[1] // 2] = 1
    assert scales.prolonged(one, shape).sum() == 4 * 64  # four fine cells in a coarse one
    flat = scales.prolonged(np.full(coarse, 7), shape)
    assert (flat == 7 * 64).all()


def test_no_grid_shows_in_what_goes_up() -> None:
    """Curvature is spread alike on and between the lines of the coarse samples; no chequers."""
    for count in (17, 16):
        row, col = np.indices((count, count))  # waves four to six coarse samples long
        fine = np.sin(1.55 * col + 0.3 * row) + np.sin(1.1 * col - 0.9 * row) + np.sin(1.4 * row)
        sizes = [count]
        for _ in range(3):
            sizes.append(2 * sizes[-1] - sizes[-1] % 2)
            fine = scales.prolonged(fine, (sizes[-1], sizes[-1])) / 64
        bend = np.abs(np.diff(fine, 2, axis=1))[16:-16, 16:-16]
        phase = np.array([bend[:, k::8].mean() for k in range(8)])
        assert phase.max() / phase.min() < 1.5  # a linear one bends on every eighth line alone
        one = np.zeros((count, count), dtype=np.int64)
        one[7, 7] = 1
        spread = scales.prolonged(one, (sizes[1], sizes[1]))
        shares = {int(spread[r::2, c::2].sum()) for r in range(2) for c in range(2)}
        assert len(shares) == 1  # even and odd rows and columns get as much: no chequers


def test_raised_ground_keeps_the_mean_change_and_untouched_bits() -> None:
    for shape in SHAPES:
        fine = rough_terrain(shape)
        coarse = scales.coarser(fine.grid).shape
        change = np.random.default_rng(4).standard_normal(coarse)
        change[: coarse[0] // 2] = 0.0
        after = scales.raised(fine, change)
        gained = after.astype(np.float64) - fine.elevation
        assert gained.mean() == pytest.approx(change.mean(), abs=1e-5)
        still = shape[0] // 2 - 4
        assert after[:still].tobytes() == fine.elevation[:still].tobytes()
        assert (gained[still + 8 :] != 0).mean() > 0.95
        level = scales.raised(fine, np.full(coarse, 3.0)).astype(np.float64)
        assert np.allclose(level - fine.elevation, 3.0, atol=1e-4)  # no more at the edge


def test_layers_go_along_each_in_its_way() -> None:
    shape = (33, 32)
    rng = np.random.default_rng(5)
    plates = (rng.random(shape) * 9).astype(int).astype(np.float32)
    fine = rough_terrain(shape).with_layers(plate=plates, valid=(plates > 4), wetness=plates / 9)
    coarse = scales.restricted(fine)
    assert set(np.unique(coarse.layer("plate"))) <= set(np.unique(plates))
    assert set(np.unique(coarse.layer("valid"))) == {0.0, 1.0}
    wet = coarse.layer("wetness")
    soaked = scales.added("wetness", fine.layer("wetness"), wet, wet * 0 + 1, shape)
    assert soaked.max() == 1.0
    assert (soaked >= fine.layer("wetness")).all()
    assert soaked.mean() > 0.8
    same = scales.added("wetness", fine.layer("wetness"), wet, wet, shape)
    assert same.tobytes() == fine.layer("wetness").tobytes()
    new = scales.added("water_depth", None, None, np.full((17, 16), 2.0, np.float32), shape)
    assert (new == 2.0).all()
    drained = scales.added("sediment", fine.layer("wetness"), wet, wet * 0, shape)
    assert drained.min() == 0.0  # never below nothing


# --- the operator -----------------------------------------------------------------------------


def test_one_level_is_the_plain_steps(device: Any) -> None:
    for alone in (
        Multiscale(steps=CREEP, coarsest_spacing=10.0),
        Multiscale(steps=CREEP, coarsest_spacing=19.9),
        Multiscale(steps=CREEP, coarsest_spacing=160.0, coarse_share=0.0),
    ):
        result, run = eroded(alone, TERRAIN, device)
        plain, other = eroded(CREEP, TERRAIN, device)
        assert bits(result) == bits(plain)
        assert run.ledger.to_dict() == other.ledger.to_dict()


def test_same_bytes_with_and_without_a_device() -> None:
    info = choose_device(None)
    if not info.is_opencl:
        pytest.skip("no OpenCL device")
    for shape in ((65, 65), (64, 50), (37, 41)):
        terrain = rough_terrain(shape).with_layers(sediment=np.full(shape, 0.5))
        loop = Multiscale(steps=CREEP, coarsest_spacing=80.0)
        assert bits(eroded(loop, terrain, info)[0]) == bits(eroded(loop, terrain)[0])


@pytest.mark.parametrize("shape", SHAPES)
def test_where_nothing_happens_nothing_changes(shape: tuple[int, int]) -> None:
    plane = tilted(shape).with_layers(sediment=np.full(shape, 0.3))  # 29 degrees: at rest
    result, run = eroded(Multiscale(steps=CREEP, coarsest_spacing=40.0), plane)
    assert result.elevation.tobytes() == plane.elevation.tobytes()
    assert result.layer("sediment").tobytes() == plane.layer("sediment").tobytes()
    account = run.ledger.accounts["rock"]
    assert (account.residual, account.moved, account.came, account.left) == (0.0, 0.0, {}, {})


def test_levels_halve_until_they_are_coarse_enough() -> None:
    def spacings(coarsest: float, shape: tuple[int, int] = (65, 65)) -> list[float]:
        levels = Multiscale(steps=CREEP, coarsest_spacing=coarsest).levels(Grid(shape, 10.0))
        return [grid.spacing for grid in levels]

    assert spacings(9.0) == [10.0]
    assert spacings(40.0) == spacings(79.0) == [10.0, 20.0, 40.0]
    assert spacings(1e6) == [10.0, 20.0, 40.0, 80.0, 160.0]  # 5 samples a side are the least
    assert spacings(1e6, (65, 9)) == [10.0, 20.0]
    assert spacings(1e6, (3, 3)) == [10.0]


def test_levels_share_the_time_and_draw_their_own_numbers() -> None:
    def seen(**settings: Any) -> list[tuple[float, float]]:
        NOTED.clear()
        eroded(Multiscale(steps=Bump(lasting=8.0), coarsest_spacing=40.0, **settings), TERRAIN)
        return [(grid.spacing, lasting) for grid, _, lasting, _ in NOTED]

    assert seen() == [(40.0, 4.0), (20.0, 2.0), (10.0, 2.0)]
    words = [word for _, word, _, _ in NOTED]
    assert len(set(words)) == 3
    assert words[-1] == Run(5).words("bump")
    assert seen(coarse_share=0.75) == [(40.0, 6.0), (20.0, 1.5), (10.0, 0.5)]
    assert seen(coarse_share=1.0) == [(40.0, 8.0)]
    assert seen(coarse_share=0.0) == [(10.0, 8.0)]
    assert seen(split="whole") == [(40.0, 8.0), (20.0, 8.0), (10.0, 8.0)]
    finer = rough_terrain((129, 129), 5.0)  # adds a level at the fine end alone
    NOTED.clear()
    eroded(Multiscale(steps=Bump(lasting=8.0), coarsest_spacing=40.0), finer)
    assert [n[2] for n in NOTED] == [4.0, 2.0, 1.0, 1.0]


def test_erosions_are_cut_down_by_what_they_declare() -> None:
    half = Thermal(distance=100.0).portion(0.25, 0.75)
    assert half.distance == pytest.approx(100.0 * math.sqrt(0.5))
    parts = [Thermal(iterations=7).portion(a, b).iterations for a, b in ((0, 0.4), (0.4, 1))]
    assert sum(parts) == 7  # type: ignore[arg-type]
    assert StreamPower(duration=1e6).portion(0.5, 1.0).duration == 5e5
    loop = Repeat(times=3, steps=[Bump(lasting=4.0), Shift()]).portion(0.0, 0.5)
    assert loop.times == 3
    assert loop.steps.operators[0].lasting == 2.0
    inner = Multiscale(steps=Bump(lasting=4.0)).portion(0.0, 0.5)
    assert inner.steps.operators[0].lasting == 2.0

    class Silent(Bump):
        """Declare no time."""

        name = "silent"
        lasts = {}

    eroded(Multiscale(steps=Silent(), coarsest_spacing=40.0), TERRAIN)
    assert [n[2] for n in NOTED] == [1.0, 1.0, 1.0]  # does all of it, every time


def test_layers_and_schedules_are_shared_out_too() -> None:
    mask = np.linspace(0.0, 8.0, 65 * 65, dtype=np.float32).reshape(65, 65)
    terrain = TERRAIN.with_layers(mask_often=mask)
    for given in (
        "mask_often",
        {"layer": "mask_often", "at": [0.0, 4.0], "low": 1.0, "high": 3.0},
        {"at": [0.0, 1.0], "value": [2.0, 4.0]},
        6,
    ):
        whole = Bump(often=given)
        parts = [whole.portion(*part) for part in ((0.0, 0.5), (0.5, 0.75), (0.75, 1.0))]
        values = [np.asarray(bump.value("often", terrain, 0.5)) for bump in (whole, *parts)]
        assert np.allclose(sum(values[1:]), values[0], rtol=1e-6, atol=1e-6)
        assert np.allclose(values[1], 0.5 * values[0], rtol=1e-6, atol=1e-6)
    nested = Multiscale(steps=[CREEP, Bump(often={"use": "fbm"})], coarsest_spacing=40.0)
    with pytest.raises(ParameterError, match=r"steps\[2\] bump: often = 'fbm': cannot be shared"):
        eroded(nested, TERRAIN)
    eroded(Multiscale(steps=Bump(often={"use": "fbm"}), split="whole"), TERRAIN)


def test_schedules_go_on_from_level_to_level() -> None:
    """The hill of a schedule that starts at its end belongs to the finest level alone."""
    flat = Heightfield(np.zeros((65, 65)), 10.0)
    late = Schedule(at=[0.0, 0.74, 0.75, 1.0], value=[0.0, 0.0, 8.0, 8.0])
    result, _ = eroded(Multiscale(steps=Bump(high=late), coarsest_spacing=40.0), flat)
    direct, _ = eroded(Bump(high=8.0, lasting=0.25), flat)
    assert bits(result) == bits(direct)


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_done_on_any_level_is_done(shape: tuple[int, int]) -> None:
    """A hill raised partly on each level is the hill, and its volume is that in the ledger."""
    flat = Heightfield(np.full(shape, 321.0), 10.0)
    hill = Bump(high=16.0, wide=120.0)
    direct, _ = eroded(hill, flat)
    result, run = eroded(Multiscale(steps=hill, coarsest_spacing=40.0), flat)
    # Three coarse samples wide: splines lower the top, and on 9 samples edges count for much
    assert np.abs(result.elevation - direct.elevation).max() < 0.12 * 16.0
    account = run.ledger.accounts["rock"]
    slack = rounding_of(result)
    assert account.start == pytest.approx(volume_under(flat), abs=slack)
    assert account.end == pytest.approx(volume_under(result), abs=slack)
    assert abs(account.residual) < 1e-9 * account.start
    assert account.came["bump"] == pytest.approx(account.end - account.start, rel=1e-5)


def test_a_closed_terrain_keeps_its_volume(device: Any) -> None:
    for shape in ((65, 65), (64, 64), (37, 58)):
        terrain = rough_terrain(shape)
        result, run = eroded(Multiscale(steps=CREEP, coarsest_spacing=80.0), terrain, device)
        account = run.ledger.accounts["rock"]
        assert account.moved > 0
        assert abs(account.end - account.start) < 1e-6 * account.moved
        assert abs(account.residual) < 1e-9 * account.moved
        assert set(account.came) | set(account.left) <= {"change of scale", "rounding"}
        assert volume_under(result) == pytest.approx(account.end, abs=rounding_of(result))


def test_rivers_and_uplift_are_booked_over_all_levels() -> None:
    rivers = StreamPower(duration=2e5, time_step=2e4, uplift_rate=1e-3)
    result, run = eroded(Multiscale(steps=rivers, coarsest_spacing=40.0), TERRAIN)
    account = run.ledger.accounts["rock"]
    area = TERRAIN.elevation.size * TERRAIN.cell_area
    # Uplift is that of all the years once, but for the outlets, which are held
    assert account.came["uplift"] == pytest.approx(1e-3 * 2e5 * area, rel=0.02)
    scale = account.came.get("change of scale", 0.0) + account.left.get("change of scale", 0.0)
    assert scale < 1e-4 * account.moved
    assert abs(account.residual) < 1e-9 * account.moved
    assert account.end == pytest.approx(volume_under(result), abs=rounding_of(result))
    assert (result.layer("drainage_area") > 0).all()
    assert result.layer("erosion").min() >= 0


def test_filters_inside_are_booked_too() -> None:
    steps = [Shift(by=2.0), CREEP]
    result, run = eroded(Multiscale(steps=steps, coarsest_spacing=40.0), TERRAIN)
    account = run.ledger.accounts["rock"]
    area = TERRAIN.elevation.size * TERRAIN.cell_area
    assert account.came["filter shift"] == pytest.approx(3 * 2.0 * area, rel=1e-4)
    mean = float(result.elevation.mean(dtype=np.float64))
    assert mean == pytest.approx(float(TERRAIN.elevation.mean(dtype=np.float64)) + 6.0, abs=1e-3)
    assert abs(account.residual) < 1e-9 * max(account.moved, abs(account.start))


def test_wide_slopes_come_to_rest_with_a_fraction_of_the_fine_sweeps() -> None:
    """A cone of 45 degrees, 800 m wide, falls as it does on fine samples in 8 times the sweeps."""
    size = 129
    row, col = np.indices((size, size)) - size // 2
    cone = Heightfield(np.maximum(0.0, 400.0 - 10.0 * np.hypot(row, col)), 10.0)
    slide = Thermal(talus_angle=30.0, distance=200.0)
    sweeps: list[int] = []
    relax = Thermal._sweeps

    def counted(self: Thermal, spacing: float) -> tuple[int, float]:
        found = relax(self, spacing)
        sweeps.append(found[0] if spacing == 10.0 else 0)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Thermal, "_sweeps", counted)
        plain, _ = eroded(slide, cone)
        fine_alone = sum(sweeps)
        sweeps.clear()
        result, _ = eroded(Multiscale(steps=slide, coarsest_spacing=40.0), cone)
        fine_last = sum(sweeps)
        sweeps.clear()
        cheap, _ = eroded(Thermal(talus_angle=30.0, distance=200.0 * math.sqrt(0.25)), cone)
        assert sum(sweeps) == pytest.approx(fine_last, abs=1)
    assert fine_last <= 0.26 * fine_alone
    change = plain.elevation.astype(np.float64) - cone.elevation
    gaps = [
        float(np.sqrt(((other.elevation - plain.elevation) ** 2).mean() / (change**2).mean()))
        for other in (result, cheap)
    ]
    assert gaps[0] < 0.1  # the same landform
    assert gaps[1] > 3 * gaps[0]  # which as many fine sweeps alone do not make


def test_details_of_the_fine_terrain_stay() -> None:
    """What is finer than the coarse samples and at rest is there afterwards, bit by bit or so."""
    smooth = smooth_terrain((129, 129), 10.0)
    grain = 0.2 * (-1.0) ** np.indices((129, 129)).sum(axis=0)
    rough = smooth.with_layers(elevation=smooth.elevation + grain.astype(np.float32))
    coarse_only = Multiscale(steps=Bump(), coarsest_spacing=40.0, coarse_share=1.0)
    changes = [eroded(coarse_only, t)[0].elevation - t.elevation for t in (smooth, rough)]
    assert np.abs(changes[0] - changes[1]).max() < 1e-3


def test_no_pattern_of_the_coarse_samples_is_left() -> None:
    """Steps on the coarsest level alone leave no peak in the spectrum at its samples."""
    terrain = smooth_terrain((128, 128), 10.0)
    steep = terrain.with_layers(elevation=terrain.elevation * np.float32(2))
    slide = Thermal(talus_angle=20.0, distance=60.0)
    coarse = Multiscale(steps=slide, coarsest_spacing=40.0, coarse_share=1.0)
    result, _ = eroded(coarse, steep)
    change = result.elevation.astype(np.float64) - steep.elevation
    window = np.hanning(128)
    spectrum = np.abs(np.fft.rfft2(change * window[:, None] * window[None, :])) ** 2
    along = spectrum[:8].sum(axis=0)  # power along rows, of what is wide across them
    images = along[[32, 64]]  # periods of 4 and 2 fine samples: the coarse lattice
    assert (images < 1e-6 * along.max()).all()
    assert images[0] < 3 * np.median(along[24:41])


def test_beds_masks_and_steps_lie_right_on_every_level() -> None:
    shape = (65, 65)
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 65, dtype=np.float32), shape)
    beds = Strata(beds=(Bed(material="clay", thickness=1e4, hardness=0.5, repose_angle=50.0,
                            erodibility=0.0),))  # fmt: skip
    terrain = TERRAIN.with_layers(mask_ramp=ramp, strata_datum=np.full(shape, 5000.0))
    terrain = terrain.with_strata(beds)
    other = Heightfield.on_grid(TERRAIN.grid, 30.0 + 5.0 * ramp)
    for given in ("mask_ramp", {"layer": "other.elevation", "at": [30.0, 35.0], "low": 0.0,
                                "high": 1.0}):  # fmt: skip
        NOTED.clear()
        loop = Multiscale(steps=Bump(high=given), coarsest_spacing=40.0)
        result, _ = eroded(loop, terrain, earlier={"other": other})
        assert result.strata is beds
        raised = result.elevation - terrain.elevation
        assert raised[32, 40] > raised[32, 24] > 0
        assert raised[32, 40] == pytest.approx(raised[24, 32] * ramp[0, 40] / 0.5, rel=0.02)
        for grid, _, _, seen in NOTED:
            assert seen.strata is beds
            assert (seen.layer("strata_datum") == 5000.0).all()
            assert seen.layer("mask_ramp").shape == grid.shape
    elsewhere = Heightfield(np.zeros((5, 5)), 10.0)
    loop = Multiscale(steps=[CREEP, Bump(high="other.elevation")], coarsest_spacing=40.0)
    with pytest.raises(ParameterError, match=r"steps\[2\] bump: high = 'other.elevation': lies on"):
        eroded(loop, terrain, earlier={"other": elsewhere})


def test_a_chain_is_made_where_the_level_lies() -> None:
    noise = {"use": "fbm", "amplitude": 4.0, "offset": 33.0, "wavelength": 300.0}
    masked = Thermal(talus_angle=noise, distance=40.0)
    result, _ = eroded(Multiscale(steps=masked, coarsest_spacing=40.0), TERRAIN)
    plain, _ = eroded(Multiscale(steps=CREEP, coarsest_spacing=40.0), TERRAIN)
    assert bits(result) != bits(plain)


def test_every_awkward_terrain_is_survived_by_rivers_on_many_levels() -> None:
    rivers = StreamPower(duration=1e5, time_step=5e4, uplift_rate=0.0)
    for what, terrain in awkward_terrains((20, 23)):
        result, run = eroded(Multiscale(steps=rivers, coarsest_spacing=1e6), terrain)
        account = run.ledger.accounts["rock"]
        assert np.isfinite(result.elevation).all(), what
        allowed = 1e-9 * max(abs(account.start), account.moved, sum(account.left.values()))
        assert abs(account.residual) <= allowed, what


# --- one piece of work ------------------------------------------------------------------------


def test_progress_cancel_and_finish_reach_over_the_levels() -> None:
    loop = Multiscale(steps=[CREEP, Bump()], coarsest_spacing=40.0)
    told: list[Progress] = []
    eroded(loop, TERRAIN, on_progress=told.append)
    fractions = [progress.fraction for progress in told]
    assert fractions == sorted(set(fractions))
    assert fractions[-1] == 1.0
    assert {progress.step for progress in told} == {"multiscale"}
    run = Run(5, "numpy")
    run.on_progress = lambda progress: run.cancel() if progress.fraction > 0.1 else None
    with pytest.raises(Cancelled):
        execute(loop, TERRAIN, run)


def test_finished_after_the_coarsest_level_its_change_is_on_the_fine_samples() -> None:
    NOTED.clear()
    run = Run(5, "numpy").for_step("multiscale")
    run.on_progress = lambda told: run.finish_now() if told.fraction > 0.01 else None
    loop = Multiscale(steps=Bump(high=8.0), coarsest_spacing=40.0)
    early = execute(loop, TERRAIN, run)
    assert [grid.spacing for grid, *_ in NOTED] == [40.0]
    raised = early.elevation - TERRAIN.elevation
    assert early.shape == TERRAIN.shape
    assert 1.5 < raised.max() < 4.5
    account = run.ledger.accounts["rock"]
    assert abs(account.residual) < 1e-9 * max(abs(account.start), account.came["bump"])
    assert account.end == pytest.approx(volume_under(early), abs=rounding_of(early))


def test_previews_are_as_fine_as_the_terrain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terrakit.running.PREVIEW_SECONDS", 0.0)
    seen: list[Any] = []
    loop = Multiscale(steps=Bump(high=8.0), coarsest_spacing=40.0)
    eroded(loop, TERRAIN, on_preview=seen.append)
    assert len(seen) == 3 * 2
    assert all(surface.grid == TERRAIN.grid for surface in seen)
    heights = [float(surface.elevation.mean()) for surface in seen]
    assert heights == sorted(heights)


def test_it_stands_in_loops_and_loops_in_it() -> None:
    turns = Repeat(times=2, steps=Multiscale(steps=CREEP, coarsest_spacing=40.0))
    inside = Multiscale(steps=Repeat(times=2, steps=CREEP), coarsest_spacing=40.0)
    for loop in (turns, inside):
        result, run = eroded(loop, TERRAIN)
        account = run.ledger.accounts["rock"]
        assert account.moved > 0
        assert abs(account.residual) < 1e-9 * account.moved
        assert loop == type(loop)(**json.loads(json.dumps(loop.model_dump(mode="json"))))
        assert bits(result) != bits(TERRAIN)
    words = Repeat(times=2, steps=Multiscale(steps=Bump(), coarsest_spacing=40.0))
    NOTED.clear()
    eroded(words, TERRAIN)
    assert len({word for _, word, _, _ in NOTED}) == len(NOTED) == 6


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"steps": []}, "multiscale: steps: a list of 0 operators"),
        ({"steps": [{"use": "fbm"}]}, r"steps\[1\] fbm: would discard the terrain"),
        ({"steps": [{"use": "crop"}]}, r"steps\[1\] crop: "),
        ({"steps": [{"use": "npz"}]}, r"steps\[1\] npz: an exporter cannot stand inside"),
        ({}, "multiscale: steps is missing"),
        ({"steps": CREEP, "coarsest_spacing": 0}, "coarsest_spacing = 0: must be 0 < coarsest"),
        ({"steps": CREEP, "coarse_share": 1.5}, "coarse_share = 1.5: must be 0 <= coarse_share"),
        ({"steps": CREEP, "split": "half"}, "split = 'half': must be one of shared, whole"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Multiscale(**settings)
    assert "\n" not in str(caught.value)


def test_meshes_have_no_levels() -> None:
    with pytest.raises(InputError, match="multiscale: works on a Heightfield, not a TriMesh"):
        eroded(Multiscale(steps=CREEP), rough_terrain((9, 9)).to_mesh())
