"""Volcanoes, craters, hills, ranges, fjords and islands: they are what their names say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from terrakit import Grid, Run
from terrakit.operators import Generator
from terrakit_generators.landforms.archipelago import Archipelago
from terrakit_generators.landforms.atoll import Atoll
from terrakit_generators.landforms.caldera import Caldera
from terrakit_generators.landforms.cone import Cone
from terrakit_generators.landforms.crater import Crater
from terrakit_generators.landforms.fjord import Fjord
from terrakit_generators.landforms.island import Island
from terrakit_generators.landforms.lone_hill import LoneHill
from terrakit_generators.landforms.maar import Maar
from terrakit_generators.landforms.mountain_range import MountainRange
from terrakit_generators.landforms.shield_volcano import ShieldVolcano
from terrakit_generators.landforms.stratovolcano import Stratovolcano

Heights = NDArray[np.float64]
BARE = {"roughness": 0.0, "irregularity": 0.0}
ALL = (
    Archipelago,
    Atoll,
    Caldera,
    Cone,
    Crater,
    Fjord,
    Island,
    LoneHill,
    Maar,
    MountainRange,
    ShieldVolcano,
    Stratovolcano,
)


def made(
    operator: Generator, size: float, samples: int = 129, seed: int = 1, device: str = "numpy"
) -> Heights:
    """Return heights on a square of this many metres a side, with the landform in its middle."""
    grid = Grid((samples, samples), size / (samples - 1))
    return operator.generate(grid, Run(seed, device)).elevation.astype(np.float64)


def distance(size: float, samples: int) -> Heights:
    """Return metres from the middle of that square."""
    along = (np.arange(samples) / (samples - 1) - 0.5) * size
    return np.hypot(along[None, :], along[:, None])


def profile(operator: Generator, reach: float, samples: int = 201) -> Heights:
    """Return heights from the middle to the east."""
    grid = Grid((1, samples), reach / (samples - 1), (0.0, 0.0))
    run = Run(1, "numpy", world=Grid((3, 3), reach, (-reach, reach)))
    return operator.generate(grid, run).elevation[0].astype(np.float64)


@pytest.mark.parametrize(
    ("operator", "size", "volume"),
    [
        (
            LoneHill(summit_height=120.0, radius=400.0, **BARE),
            1000.0,
            math.pi * 400.0**2 * 120.0 / 3,
        ),
        (Cone(summit_height=900.0, radius=2500.0, **BARE), 5500.0, math.pi * 2500.0**2 * 900.0 / 3),
        (
            ShieldVolcano(crater_radius=0.0, elongation=1.4, direction=30.0, **BARE),
            36000.0,
            math.pi * 12000.0**2 * 1.4 * 1300.0 * 1.5 / 3.5,
        ),
        *(
            (
                Island(
                    profile_exponent=power,
                    noise_strength=0.0,
                    crater_level=1.0,
                    shelf_depth=0.0,
                    depth=0.0,
                    **BARE,
                ),
                10000.0,
                math.pi * 5000.0**2 * 1400.0 * power / (power + 2),
            )
            for power in (0.5, 1.0, 2.0, 6.0)
        ),
    ],
)
def test_volume_is_the_closed_form(operator: Generator, size: float, volume: float) -> None:
    height = made(operator, size, 401)
    assert height.sum() * (size / 400) ** 2 == pytest.approx(volume, rel=1e-3)


def test_volume_of_a_stratovolcano_counts_its_crater() -> None:
    height, radius, crater, depth = 2000.0, 9000.0, 1500.0, 600.0
    operator = Stratovolcano(
        summit_height=height, radius=radius, crater_radius=crater, crater_depth=depth, **BARE
    )
    size, samples = 90000.0, 601
    fall = (radius - crater) / 3
    volume = 2 * math.pi * height * (fall**2 + crater * fall)
    volume += math.pi * crater**2 * (height - depth / 2)
    heights = made(operator, size, samples)
    assert heights.sum() * (size / (samples - 1)) ** 2 == pytest.approx(volume, rel=2e-3)


def test_ejecta_fall_with_the_cube_of_the_distance_and_weigh_what_they_should() -> None:
    operator = Crater(radius=600.0, rim_height=48.0, depth=240.0, **BARE)
    size, samples = 12000.0, 601
    heights, r = made(operator, size, samples), distance(size, samples)
    cell = (size / (samples - 1)) ** 2
    bowl = heights[r < 600.0].sum() * cell
    blanket = heights[(r >= 600.0) & (r < 6000.0)].sum() * cell
    assert bowl == pytest.approx(math.pi * 600.0**2 * (48.0 - 120.0), rel=1e-2)
    assert blanket == pytest.approx(2 * math.pi * 48.0 * 600.0**2 * (1 - 0.1), rel=1e-2)
    outside = (r > 900.0) & (r < 5000.0)
    slope = np.polyfit(np.log(r[outside]), np.log(heights[outside]), 1)[0]
    assert slope == pytest.approx(-3.0, abs=1e-3)


def test_craters_grow_a_peak_and_become_shallow_with_size() -> None:
    shapes = [Crater(radius=radius).shape() for radius in (200.0, 1400.0, 3000.0, 12000.0)]
    shares = [
        depth / (2 * radius)
        for (depth, _, _), radius in zip(shapes, (200.0, 1400.0, 3000.0, 12000.0), strict=True)
    ]
    assert shares[0] == pytest.approx(0.2) == shares[1]
    assert 0.2 > shares[2] > shares[3] > 0.03
    simple = profile(Crater(radius=600.0, **BARE), 600.0)
    large = profile(Crater(radius=9000.0, **BARE), 9000.0)
    assert simple[0] == simple.min()
    moat = int(large.argmin())
    depth = Crater(radius=9000.0).shape()[0]
    assert 0.2 < moat / 200 < 0.6
    assert 0.2 * depth < large[0] - large[moat] < 0.6 * depth


def test_island_without_noise_is_radially_symmetric() -> None:
    operator = Island(noise_strength=0.0, **BARE)
    height = made(operator, 12000.0, 121)
    relief = np.ptp(height)
    for other in (np.rot90(height), np.fliplr(height), height.T):
        assert np.abs(height - other).max() < 1e-6 * relief
    # 3, 4, 5: as far from the middle along an axis as aslant
    middle = 60
    for k in range(1, 12):
        aslant = height[middle - 4 * k, middle + 3 * k]
        assert abs(height[middle, middle + 5 * k] - aslant) < 1e-6 * relief


def test_crater_of_the_island_is_folded_down_from_its_level() -> None:
    level, top, shelf = 0.7, 1400.0, 60.0
    settings: dict[str, Any] = {"noise_strength": 0.0, "crater_level": level, **BARE}
    knife = profile(Island(rim_rounding=0.0, **settings), 5000.0)
    assert knife.max() == pytest.approx(level * top - shelf, abs=5.0)
    assert knife[0] == pytest.approx((2 * level - 1) * top - shelf, abs=0.01)
    rim = int(knife.argmax())
    assert rim == pytest.approx((1 - level) * 200, abs=1)
    round_rim = profile(Island(rim_rounding=0.05, **settings), 5000.0)
    bend = [np.abs(np.diff(z, 2)).max() for z in (knife, round_rim)]
    assert bend[1] < 0.5 * bend[0]
    assert round_rim[-1] == pytest.approx(-shelf, abs=1e-3)


def test_island_stands_on_a_shelf_in_the_deep_sea() -> None:
    operator = Island(radius=5000.0, shelf_width=1000.0, shelf_depth=60.0, depth=1200.0, **BARE)
    height = profile(operator, 60000.0, 601)
    assert height[50:60] == pytest.approx(-60.0, abs=1e-3)
    assert np.all(np.diff(height[61:]) < 0)
    assert -1200.0 < height[-1] < -1000.0


def test_noise_bends_the_cone_and_never_turns_it_over() -> None:
    for strength in (0.3, 0.9):
        operator = Island(noise_strength=strength, crater_level=1.0, **BARE)
        height, r = made(operator, 12000.0), distance(12000.0, 129)
        assert height.max() <= 1400.0 - 60.0
        assert height[r < 5000.0].min() >= -60.0 - 1e-3
        ring = height[(r > 2400.0) & (r < 2600.0)]
        assert ring.std() > 20.0 * strength


def test_stratovolcano_is_concave_with_a_pit_in_its_top() -> None:
    operator = Stratovolcano(crater_radius=600.0, crater_depth=250.0)
    size, samples = 22000.0, 301
    bare = profile(Stratovolcano(crater_radius=600.0, crater_depth=250.0, **BARE), 12000.0, 601)
    rim = int(bare.argmax())
    assert rim * 20.0 == pytest.approx(600.0, abs=40.0)
    assert bare[rim] == pytest.approx(2500.0, rel=0.01)
    assert bare[0] == pytest.approx(2250.0, abs=1.0)
    assert np.all(np.diff(bare[rim + 12 :], 2) > -1e-3)  # float32 steps of 2e-4 m
    height, r = made(operator, size, samples), distance(size, samples)
    pit = np.where(r < 1200.0, height, np.inf)
    low = pit[r < 500.0].min()
    assert lowest_way_out(height, r < 150.0) > low + 100.0


def test_gullies_run_down_the_flanks() -> None:
    height = made(Stratovolcano(irregularity=0.0), 22000.0, 401)
    angle = np.linspace(0, 2 * np.pi, 2000)

    def ring(radius: float) -> Heights:
        at = 200 + radius / 55.0 * np.array([np.cos(angle), np.sin(angle)])
        sampled: Heights = ndimage.map_coordinates(height, at, order=1)
        return sampled - sampled.mean()

    near, far = ring(3800.0), ring(4200.0)
    assert near.std() > 15.0
    assert np.corrcoef(near, far)[0, 1] > 0.6  # along the slope alike
    assert abs(np.corrcoef(near, np.roll(far, 60))[0, 1]) < 0.5  # across it not


def test_shield_is_gentle_and_points_where_it_is_told() -> None:
    for direction in (0.0, 50.0, 120.0):
        height = made(ShieldVolcano(direction=direction, elongation=2.0), 54000.0, 129)
        assert axis_of(height) == pytest.approx(direction, abs=8.0)
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(height, 54000.0 / 128))))
    assert np.quantile(slope, 0.98) < 15.0
    bare = profile(ShieldVolcano(direction=0.0, **BARE), 16000.0)
    assert bare[0] == pytest.approx(1300.0 * (1 - (1500.0 / 12000.0) ** 1.5) - 160.0, abs=0.1)
    assert bare.max() > bare[0] + 150.0


def test_floor_of_a_maar_is_flat_and_below_grade_behind_a_low_ring() -> None:
    bare = profile(Maar(radius=400.0, depth=120.0, rim_height=20.0, **BARE), 1200.0)
    r = np.linspace(0.0, 1200.0, 201)
    assert bare[r < 240.0] == pytest.approx(-120.0)
    assert bare.max() == pytest.approx(20.0, abs=0.8)
    assert r[bare.argmax()] == pytest.approx(400.0, abs=7.0)
    assert 0.0 <= bare[-1] < 2.5
    for seed in range(3):
        height, r2 = made(Maar(), 2000.0, 201, seed), distance(2000.0, 201)
        assert height[r2 < 150.0].max() < -100.0
        assert lowest_way_out(height, r2 < 50.0) > 0.0  # a lake up to the plain
        assert 5.0 < lowest_way_out(height, r2 < 50.0) < 20.0 + 10.0


def test_caldera_has_walls_around_a_floor_with_a_dome() -> None:
    settings: dict[str, Any] = {"radius": 4000.0, "rim_height": 800.0, "depth": 650.0}
    bare = profile(Caldera(dome_height=0.0, **settings, **BARE), 14000.0, 281)
    assert bare.max() == pytest.approx(800.0, rel=0.01)
    assert bare.argmax() * 50.0 == pytest.approx(4000.0, abs=60.0)
    assert bare[:45] == pytest.approx(150.0)
    assert np.diff(bare)[50:82].max() > 3.0 * -np.diff(bare).min()  # the wall over the flank
    domed = profile(Caldera(dome_height=260.0, **settings, **BARE), 14000.0, 281)
    assert domed[0] - bare[0] == pytest.approx(260.0, abs=0.01)
    for seed in range(3):
        height, r = made(Caldera(), 20000.0, 201, seed), distance(20000.0, 201)
        assert lowest_way_out(height, r < 300.0) > np.median(height[r < 2000.0]) + 250.0


def test_hill_and_cone_rise_to_their_tops_and_end_at_their_feet() -> None:
    for operator, radius, top in (
        (LoneHill(summit_height=120.0, radius=400.0), 400.0, 120.0),
        (Cone(summit_height=1200.0, radius=3000.0), 3000.0, 1200.0),
    ):
        size = 4.0 * radius
        height, r = made(operator, size, 161), distance(size, 161)
        assert height.max() == pytest.approx(top, rel=0.12)
        assert r.flat[height.argmax()] < 0.35 * radius
        assert np.abs(height[r > 1.6 * radius]).max() < 0.06 * top
        assert height[r < 0.5 * radius].mean() > 3.0 * height[r > radius].mean()


def test_range_follows_its_axis_and_ends() -> None:
    for direction in (0.0, 62.0, 135.0):
        operator = MountainRange(
            direction=direction, winding=0.0, length=40000.0, range_width=14000.0
        )
        height = made(operator, 70000.0, 141)
        assert axis_of(height) == pytest.approx(direction, abs=6.0)
        assert 0.7 * 2600.0 < height.max() < 1.6 * 2600.0
    height = made(MountainRange(direction=0.0, winding=0.0, roughness=0.0), 90000.0, 181)
    east = np.abs(np.arange(181) - 90) * 500.0
    assert height[90, 90] == pytest.approx(2600.0, rel=1e-3)
    assert np.all(height[:, east > 16000.0] < 0.03 * 2600.0)
    assert np.all(height[np.abs(np.arange(181) - 90) * 500.0 > 25000.0] < 0.01)


def test_fjord_is_a_deep_trough_behind_a_sill() -> None:
    bare = Fjord(
        direction=0.0, winding=0.0, branches=0, roughness=0.0, depth=480.0, sill_depth=70.0
    )
    height = made(bare, 44000.0, 441)
    floor = height[:, 220]  # from the sea in the north to the head in the south
    north = (220 - np.arange(441)) * 100.0
    mouth, inner = np.abs(north - 11000.0) < 60.0, np.abs(north) < 6000.0
    assert floor[inner].min() == pytest.approx(-480.0, abs=1.0)
    assert floor[mouth] == pytest.approx(-70.0, abs=15.0)
    outer = floor[(north > 13000.0) & (north < 16000.0)]
    assert outer.max() < -100.0
    section = height[220]
    water = (section < 0.0).sum() * 100.0
    assert water == pytest.approx(1900.0, rel=0.15)
    steepest = np.degrees(np.arctan(np.abs(np.diff(section)).max() / 100.0))
    assert 40.0 < steepest < 75.0
    assert height[220, 20] > 600.0


def test_side_fjords_join_the_main_one() -> None:
    for seed in range(3):
        operator = Fjord(direction=90.0, branches=3)
        height = made(operator, 34000.0, 241, seed)
        alone = made(Fjord(direction=90.0, branches=0), 34000.0, 241, seed)
        waters, _ = ndimage.label(height < 0.0)
        main = np.bincount(waters[(alone < -300.0)]).argmax()
        arms, count = ndimage.label((height < -20.0) & (alone > 0.0))
        long = [
            number
            for number in range(1, count + 1)
            if (arms == number).sum() * (34.0 / 240) ** 2 > 0.4  # square kilometres
        ]
        assert len(long) >= 2
        assert all((waters[arms == number] == main).all() for number in long)


def test_lagoon_is_closed_until_a_pass_is_cut() -> None:
    size, samples = 22000.0, 221
    r = distance(size, samples)
    for seed in range(3):
        for passes, is_closed in ((0, True), (3, False)):
            height = made(Atoll(passes=passes), size, samples, seed)
            waters, _ = ndimage.label(height < -6.0)
            assert (waters[110, 110] != waters[0, 0]) == is_closed
        assert height[r < 4000.0].mean() == pytest.approx(-50.0, abs=12.0)
        islets = height > 0.5
        assert 0.002 < islets.mean() < 0.1
        assert r[islets].min() > 3500.0
        assert height.max() < 12.0
        assert height[0, 0] < -1000.0


def test_outer_side_of_a_reef_is_as_steep_as_it_is_told() -> None:
    operator = Atoll(outer_slope=38.0, depth=1500.0, radius=7000.0, passes=0, **BARE)
    height = profile(operator, 14000.0, 1401)
    steepest = np.degrees(np.arctan(-np.diff(height).min() / 10.0))
    assert steepest == pytest.approx(38.0, abs=0.5)
    assert height[680:700].max() < 5.0
    assert height[0] == pytest.approx(-51.0, abs=1.0)
    assert height[-1] < -1400.0


def test_archipelago_has_many_islands_of_all_sizes() -> None:
    for seed in range(2):
        height = made(Archipelago(), 80000.0, 257, seed)
        islands, count = ndimage.label(height > 0.0)
        areas = np.sort(ndimage.sum_labels(height > 0.0, islands, range(1, count + 1)))
        assert count > 40
        assert areas[-1] > 15 * np.median(areas)
        assert areas[-1] < 0.5 * areas.sum()
        border = np.concatenate([height[0], height[-1]])
        assert border.max() < -300.0
        shelf = (height < 0.0) & (height > -90.0)
        assert shelf.sum() > 0.5 * (height > 0.0).sum()


@pytest.mark.parametrize("kind", ALL)
def test_doubled_samples_refine(kind: type[Generator]) -> None:
    size = kind.portrait
    assert size is not None
    settings = {name: 0.0 for name in BARE if name in kind.model_fields}
    if kind is Island:
        settings["noise_strength"] = 0.0
    exact = 1e-6 if kind is Archipelago else 0.0  # its cells are noise, whose lattice is rounded
    for operator, tolerance in ((kind(**settings), exact), (kind(), 1e-4)):
        coarse, fine = made(operator, size, 33), made(operator, size, 65)
        assert np.abs(fine[::2, ::2] - coarse).max() <= tolerance * np.ptp(coarse)


@pytest.mark.parametrize("kind", ALL)
def test_center_moves_it(kind: type[Generator]) -> None:
    assert kind.portrait is not None
    step = kind.portrait / 64
    settings: dict[str, Any] = {name: 0.0 for name in BARE if name in kind.model_fields}
    if kind is Archipelago:  # its islands lie where their cells do, and only the area moves
        pytest.skip("islands stay in the world's cells")
    if kind is Island:
        settings["noise_strength"] = 0.0
    grid = Grid((65, 65), step, (0.0, 0.0))
    moved = Grid((65, 65), step, (6 * step, -4 * step))
    operator = kind(center=[20.0 * step, -30.0 * step], **settings)
    same = kind(center=[26.0 * step, -34.0 * step], **settings)
    first = operator.generate(grid, Run(1, "numpy")).elevation
    second = same.generate(moved, Run(1, "numpy")).elevation
    assert np.ptp(first) > 1.0
    assert first == pytest.approx(second, abs=1e-3 * float(np.ptp(first)))


@pytest.mark.parametrize("kind", ALL)
def test_presets_and_extremes_are_finite(kind: type[Generator]) -> None:
    assert kind.presets
    assert kind.portrait is not None
    for settings in ({}, *({"preset": name} for name in kind.presets)):
        for extreme in ({}, {"roughness": 10.0, "offset": -500.0}):
            operator = kind.from_settings({**settings, **extreme}, "test")
            assert np.isfinite(made(operator, kind.portrait, 17)).all()


@pytest.mark.parametrize(
    "operator",
    [Crater(radius=6000.0), Stratovolcano(crater_radius=0.0), Island(crater_level=1.0)],
    ids=["complex crater", "no crater", "island without a crater"],
)
def test_branches_of_the_formula_are_the_same_in_opencl(operator: Generator) -> None:
    run = Run(1)
    if run.device is None:
        pytest.skip("there is no OpenCL device here")
    grid = Grid((33, 47), 300.0, (1e5, -2e5))
    reference = operator.generate(grid, Run(1, "numpy")).elevation
    assert operator.generate(grid, run).elevation.tobytes() == reference.tobytes()


def axis_of(height: Heights) -> float:
    """Return where the longest extent of the high ground points, degrees from north, 0 to 180."""
    weight = np.maximum(height - 0.25 * height.max(), 0.0)
    north, east = np.indices(height.shape)
    north = -north
    x, y = (
        (axis - (axis * weight).sum() / weight.sum()).astype(np.float64) for axis in (east, north)
    )
    xx, yy, xy = ((weight * a * b).sum() for a, b in ((x, x), (y, y), (x, y)))
    from_east = 0.5 * math.atan2(2 * xy, xx - yy)
    angle = (90.0 - math.degrees(from_east)) % 180.0
    return angle if angle < 172.0 else angle - 180.0


def lowest_way_out(height: Heights, inside: NDArray[np.bool_]) -> float:
    """Return to what height water within can rise before it flows off the map."""
    low, high = float(height[inside].min()), float(height.max())
    for _ in range(18):
        middle = (low + high) / 2
        low, high = (low, middle) if _reaches_border(height, inside, middle) else (middle, high)
    return high


def _reaches_border(height: Heights, inside: NDArray[np.bool_], level: float) -> bool:
    waters, _ = ndimage.label(height < level)
    wet = np.unique(waters[inside & (height < level)])
    border = np.concatenate([waters[0], waters[-1], waters[:, 0], waters[:, -1]])
    return bool(np.isin(wet[wet > 0], border).any())
