"""Landforms of plains, valleys, ridges and dunes: volumes in closed form, signs of curvature."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run
from terrakit_generators.landforms.basin import Basin
from terrakit_generators.landforms.canyon import Canyon
from terrakit_generators.landforms.cuesta import Cuesta
from terrakit_generators.landforms.dunes import Dunes
from terrakit_generators.landforms.gorge import Gorge
from terrakit_generators.landforms.landform import Landform
from terrakit_generators.landforms.meander import Course, Meander
from terrakit_generators.landforms.mesa import Mesa
from terrakit_generators.landforms.plain import Plain
from terrakit_generators.landforms.ridge import Ridge
from terrakit_generators.landforms.thufur import Thufur
from terrakit_generators.landforms.undulating_plain import UndulatingPlain
from terrakit_generators.landforms.valley import Valley

Heights = NDArray[np.float64]
ALL: list[type[Landform]] = [
    Basin,
    Canyon,
    Cuesta,
    Dunes,
    Gorge,
    Meander,
    Mesa,
    Plain,
    Ridge,
    Thufur,
    UndulatingPlain,
    Valley,
]
BARE: dict[str, Any] = {"roughness": 0.0, "seed": 1}


def made(operator: Landform, rows: int, cols: int, spacing: float, **where: Any) -> Heights:
    """Return heights of a grid with its middle sample in the origin, unless told otherwise."""
    corner = where.get("north_west", (-(cols - 1) / 2 * spacing, (rows - 1) / 2 * spacing))
    run = Run(3, where.get("device", "numpy"))
    return operator.generate(Grid((rows, cols), spacing, corner), run).elevation.astype(float)


def across(operator: Landform, reach: float, samples: int = 4001) -> tuple[Heights, Heights]:
    """Return metres east of the origin and the heights along that line."""
    spacing = 2.0 * reach / (samples - 1)
    x = (np.arange(samples) - (samples - 1) / 2) * spacing
    return x, made(operator, 1, samples, spacing)[0]


def area(x: Heights, z: Heights) -> float:
    return float(np.trapezoid(z, x))


def slopes(z: Heights, spacing: float) -> Heights:
    """Return slope angles in degrees."""
    north, east = np.gradient(z, spacing)
    angles: Heights = np.degrees(np.arctan(np.hypot(north, east)))
    return angles


def curvature(z: Heights, direction: float, step: int) -> float:
    """Return the second difference at the middle of a square map along a bearing, metres."""
    middle = z.shape[0] // 2
    turn = math.radians(direction)
    east, north = round(step * math.sin(turn)), round(step * math.cos(turn))
    ends = z[middle - north, middle + east] + z[middle + north, middle - east]
    return float(ends - 2.0 * z[middle, middle])


# --- forms without roughness, in closed form


def test_plain_is_a_plane_that_falls_where_it_says() -> None:
    z = made(Plain(slope=2.0, direction=90.0, channel_depth=5.0, **BARE), 5, 101, 10.0)
    assert z[:, 100] - z[:, 0] == pytest.approx(-1000.0 * math.tan(math.radians(2.0)), rel=1e-5)
    assert np.ptp(z, axis=0).max() < 1e-4


def test_basin_holds_the_volume_of_its_smoothstep() -> None:
    inner, outer, depth = 1000.0, 2400.0, 300.0
    z = made(Basin(radius=outer, floor_radius=inner, depth=depth, **BARE), 501, 501, 10.0)
    wall = outer - inner
    # The integral of t (1 - s(t)) over 0 to 1 is 1/7, that of 1 - s(t) is 1/2
    exact = 2 * math.pi * depth * (inner**2 / 2 + wall * inner / 2 + wall**2 / 7)
    assert -z.sum() * 100.0 == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("roundness", [1.0, 2.0, 4.0])
def test_valley_has_the_section_of_its_exponential(roundness: float) -> None:
    settings = {"depth": 400.0, "valley_width": 2000.0, "floor_width": 0.0}
    valley = Valley(**settings, roundness=roundness, slope=0.0, direction=0.0, winding=0.0, **BARE)
    x, z = across(valley, 20000.0, 20001)
    scale = 1000.0 / math.log(10.0) ** (1 / roundness)
    assert -area(x, z) == pytest.approx(2 * 400.0 * scale * math.gamma(1 + 1 / roundness), rel=1e-3)
    shoulder = z[np.searchsorted(x, 1000.0)]
    assert shoulder == pytest.approx(-40.0, abs=0.5)


def test_gorge_has_the_section_of_a_trapezium() -> None:
    gorge = Gorge(
        depth=200.0,
        gorge_width=50.0,
        wall_angle=70.0,
        shoulder_slope=0.0,
        slope=0.0,
        direction=0.0,
        winding=0.0,
        **BARE,
    )
    x, z = across(gorge, 300.0)
    exact = 200.0 * (50.0 + 200.0 / math.tan(math.radians(70.0)))
    assert -area(x, z) == pytest.approx(exact, rel=1e-3)


def test_canyon_has_the_section_of_its_beds() -> None:
    canyon = Canyon(hardness=1.0, side_canyons=0.0, direction=0.0, winding=0.0, **BARE)
    x, z = across(canyon, 1000.0)
    from terrakit.formula import Place

    widths, heights = canyon.beds(Place(Grid((1, 1), 1.0), Run(3)))
    side = 0.5 * (canyon.canyon_width - canyon.floor_width)
    removed, left = 0.0, 1.0
    for width, height in zip(widths, heights, strict=True):
        debris, cliff = 0.82 * width, 0.18 * width
        # A parabola over the debris, then the straight rise of the cliff
        removed += debris * (left - 0.4 * height / 3) + cliff * (left - 0.7 * height)
        left -= height
    exact = canyon.depth * (canyon.floor_width + 2 * side * removed)
    assert -area(x, z) == pytest.approx(exact, rel=1e-3)


def test_mesa_has_the_volume_of_disc_frustum_and_apron() -> None:
    mesa = Mesa(
        table_height=200.0,
        radius=400.0,
        elongation=1.0,
        cliff_height=80.0,
        wall_angle=75.0,
        talus_angle=35.0,
        **BARE,
    )
    z = made(mesa, 601, 601, 4.0)
    edge = 400.0 + 80.0 / math.tan(math.radians(75.0))
    cliff = math.pi / 3 * 80.0 * (400.0**2 + 400.0 * edge + edge**2)
    rest = 120.0
    apron = 2 * rest / math.tan(math.radians(35.0))
    foot = math.pi * edge**2 * rest + 2 * math.pi * rest * (edge * apron / 3 + apron**2 / 12)
    assert z.sum() * 16.0 == pytest.approx(cliff + foot, rel=1e-3)
    assert z.max() == pytest.approx(200.0)


def test_cuesta_has_the_section_of_a_triangle() -> None:
    cuesta = Cuesta(
        scarp_height=150.0,
        dip=6.0,
        scarp_angle=30.0,
        cliff_height=0.0,
        direction=90.0,
        winding=0.0,
        **BARE,
    )
    x, z = across(cuesta, 2000.0)
    feet = 150.0 / math.tan(math.radians(6.0)) + 150.0 / math.tan(math.radians(30.0))
    assert area(x, z) == pytest.approx(0.5 * 150.0 * feet, rel=1e-3)
    assert x[z.argmax()] == pytest.approx(0.0, abs=1.0)


def test_ridge_has_the_volume_of_its_taper() -> None:
    ridge = Ridge(
        crest_height=500.0, ridge_width=2000.0, length=6000.0, concavity=1.5, winding=0.0, **BARE
    )
    z = made(ridge, 701, 701, 10.0)
    assert z.sum() * 100.0 == pytest.approx(2 / 3 * 500.0 * 2000.0 * 6000.0 / 2.5, rel=1e-3)


def test_undulating_plain_has_half_its_height_in_the_mean() -> None:
    operator = UndulatingPlain(swell_height=20.0, wavelength=400.0, direction=0.0, **BARE)
    z = made(operator, 1, 4000, 1.0)
    assert z.mean() == pytest.approx(10.0, rel=1e-3)
    assert (z.min(), z.max()) == pytest.approx((0.0, 20.0), abs=1e-3)
    swells = ((z[0, 1:-1] > z[0, :-2]) & (z[0, 1:-1] >= z[0, 2:])).sum()
    assert swells == 10


def test_thufur_are_as_many_as_their_spacing_says() -> None:
    z = made(Thufur(spacing=2.0, hummock_height=0.5, **BARE), 401, 401, 0.1)
    assert z.min() >= 0.0
    assert z.max() <= 0.5
    inner = z[1:-1, 1:-1]
    top = inner > 0.1
    for rows, cols in ((0, 1), (1, 0), (1, 2), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2)):
        top &= inner > z[rows : rows + inner.shape[0], cols : cols + inner.shape[1]]
    assert top.sum() == pytest.approx(400, rel=0.15)


# --- dunes


@pytest.mark.parametrize("form", ["transverse", "barchan", "star"])
def test_slip_faces_lie_at_the_angle_of_repose(form: str) -> None:
    spacing, wave = 1.0, 180.0
    height = 16.0 if form == "transverse" else 12.0
    dunes = Dunes(form=form, wavelength=wave, dune_height=height, direction=90.0, talus_angle=32.0)
    z = made(dunes, 500, 500, spacing)
    bare = dunes.model_copy(update={"roughness": 0.0})
    for heights in (z, made(bare, 500, 500, spacing)):
        slope = slopes(heights, spacing)
        east = np.gradient(heights, spacing, axis=1)
        steep = slope > 27.0
        assert steep.mean() > 0.004
        if form != "star":
            assert 30.0 <= np.median(slope[steep]) <= 34.0
            assert (east[steep] < 0).mean() > 0.95  # on the lee, and nowhere else
        assert np.quantile(slope, 0.99) < 35.0


def test_lone_dunes_that_do_not_fit_are_refused() -> None:
    for form in ("barchan", "star"):
        with pytest.raises(ParameterError, match=r"dune_height.*raise wavelength"):
            made(Dunes(form=form, dune_height=150.0), 3, 3, 10.0)
    made(Dunes(form="transverse", dune_height=150.0), 3, 3, 10.0)


def test_barchans_are_not_cut_at_their_cells() -> None:
    most = 0.75 * 200.0 / (5.0 * 1.1 + 1.0 / math.tan(math.radians(32.0)))
    operator = Dunes(form="barchan", wavelength=200.0, dune_height=most, **BARE)
    z = made(operator, 800, 800, 1.0)
    # Windward sides and horns are gentle: a cut through a dune would be a step
    assert max(np.abs(np.diff(z, axis=0)).max(), np.abs(np.diff(z, axis=1)).max()) < 1.2


# --- what the ground looks like, with its roughness


def test_curvature_has_the_signs_of_the_form() -> None:
    def square(operator: Landform, spacing: float) -> Heights:
        return made(operator, 201, 201, spacing)

    low = {"roughness": 0.3, "seed": 1, "direction": 0.0, "winding": 0.0}
    valley = square(Valley(slope=0.0, **low), 20.0)
    assert curvature(valley, 90.0, 60) > 100.0 > abs(curvature(valley, 0.0, 60)) * 1.5
    ridge = square(Ridge(saddles=0.0, **low), 20.0)
    assert curvature(ridge, 90.0, 50) < -300.0
    assert curvature(ridge, 90.0, 50) < 4.0 * curvature(ridge, 0.0, 50)
    basin = square(Basin(roughness=0.3), 100.0)
    assert min(curvature(basin, turn, 95) for turn in (0.0, 45.0, 90.0, 135.0)) > 500.0
    mesa = square(Mesa(roughness=0.3), 18.0)
    assert max(curvature(mesa, turn, 90) for turn in (0.0, 45.0, 90.0, 135.0)) < -200.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_basin_is_closed(seed: int) -> None:
    z = made(Basin(seed=seed), 201, 201, 110.0)
    floor = z[100, 100]
    # Flood from the middle: the water must stand high before it finds the border
    level = floor + 350.0
    wet = np.zeros(z.shape, bool)
    wet[100, 100] = True
    for _ in range(400):
        grown = wet.copy()
        grown[1:] |= wet[:-1]
        grown[:-1] |= wet[1:]
        grown[:, 1:] |= wet[:, :-1]
        grown[:, :-1] |= wet[:, 1:]
        grown &= z < level
        if (grown == wet).all():
            break
        wet = grown
    assert not wet[[0, -1]].any()
    assert not wet[:, [0, -1]].any()
    assert wet.sum() * 110.0**2 > math.pi * 4000.0**2


@pytest.mark.parametrize("preset", ["mountain_gorge", "slot", "breakthrough"])
def test_gorge_walls_are_steeper_than_60_degrees(preset: str) -> None:
    gorge = (
        Gorge(**Gorge.presets[preset], center=[0.0, 0.0], slope=0.0)
        if ("slope" not in Gorge.presets[preset])
        else Gorge(**{**Gorge.presets[preset], "center": [0.0, 0.0], "slope": 0.0})
    )
    spacing = gorge.depth / 150.0
    z = made(gorge, 400, 400, spacing)
    slope = slopes(z, spacing)
    wall = (z > -0.8 * gorge.depth) & (z < -0.35 * gorge.depth)
    assert np.median(slope[wall]) > 60.0
    floor = z < -0.97 * gorge.depth
    assert 0.005 < floor.mean() < 0.4
    assert np.median(slope[floor]) < 25.0


@pytest.mark.parametrize("benches", [2, 5, 7])
def test_canyon_has_as_many_benches_as_it_says(benches: int) -> None:
    canyon = Canyon(benches=benches, direction=0.0, winding=0.0, side_canyons=0.0, **BARE)
    x, z = across(canyon, 900.0, 9001)
    right, up = x[x > 0], z[x > 0]
    inside = (right > 0.5 * canyon.floor_width + 1) & (right < 0.5 * canyon.canyon_width - 1)
    gentle = np.gradient(up, right)[inside] < 0.12 * canyon.depth / 800.0
    starts = (np.diff(gentle.astype(int)) == 1).sum()
    assert starts == benches


def test_canyon_cliffs_and_benches_survive_the_roughness() -> None:
    z = made(Canyon(seed=4), 400, 400, 10.0)
    even = made(Canyon(seed=4, hardness=0.0), 400, 400, 10.0)

    def gathered(heights: Heights) -> float:
        """Return the share of the ground that lies in the fullest fifth of all heights."""
        counts = np.sort(np.histogram(heights, bins=60, range=(-420.0, -30.0))[0])
        return float(counts[-12:].sum() / counts.sum())

    assert gathered(z) > 1.3 * gathered(even)
    assert (z > -20.0).mean() > 0.3  # and a plateau


def test_cuesta_has_a_gentle_side_and_a_steep_one() -> None:
    z = made(Cuesta(direction=90.0, winding=0.3), 300, 300, 10.0)
    crest = z.argmax(axis=1)
    behind, ahead = [], []
    for row, at in enumerate(crest):
        if 45 < at < 200:
            behind.append((z[row, at] - z[row, at - 40]) / 400.0)
            ahead.append((z[row, at] - z[row, at + 80]) / 800.0)
    assert len(behind) > 200
    assert np.mean(behind) > 4.0 * np.mean(ahead) > 0.15


# --- the meander's course


def straight_line(swing: float = 70.0) -> Course:
    return Course.kinoshita(swing, 1000.0, [(0.0, 0.0)] * 6)


def test_meander_is_as_long_as_kinoshita_says() -> None:
    course = straight_line(70.0)
    own = [p for p in course.pieces if -1500.0 <= p[0] < 1500.0 - 1e-6]
    length = sum(math.hypot(p[2], p[3]) for p in own)
    phi = np.linspace(0.0, 2 * math.pi, 20001)[:-1]
    most = math.radians(70.0)
    angle = most * np.sin(phi) + most**3 * (np.cos(3 * phi) / 192 - np.sin(3 * phi) / 32)
    assert length / 3000.0 == pytest.approx(1.0 / np.cos(angle).mean(), rel=5e-3)


def test_meander_pieces_meet_without_a_corner() -> None:
    course = Course.kinoshita(100.0, 700.0, [(0.4, -0.3), (-0.2, 0.5), (0.1, 0.0)] * 2)
    for first, second in zip(course.pieces, course.pieces[1:], strict=False):
        assert (first[0] + first[2], first[1] + first[3]) == pytest.approx(second[:2], abs=1e-6)
        end = math.atan2(first[3] - first[5], first[2] - first[4])
        start = math.atan2(second[3] + second[5], second[2] + second[4])
        assert abs(math.remainder(end - start, 2 * math.pi)) < 0.08


def test_meander_distance_is_the_distance_to_its_course() -> None:
    operator = Meander(direction=90.0, scars=0, slope=0.0, **BARE)
    spacing = 4.0
    z = made(operator, 301, 451, spacing)
    from terrakit.formula import Place

    course = operator._course(Place(Grid((1, 1), 1.0), Run(3)), "river")
    t = np.linspace(0.0, 1.0, 40)[:, None]
    pieces = np.array(course.pieces).T
    a = (pieces[0] + t * pieces[2] + t * (1 - t) * pieces[4]).ravel()
    r = (pieces[1] + t * pieces[3] + t * (1 - t) * pieces[5]).ravel()
    x = (np.arange(451) - 225) * spacing
    y = (150 - np.arange(301)) * spacing  # flowing east, right is south
    wet = z < -1e-4
    nearest = np.array([[np.hypot(a - px, r + py).min() for px in x[::9]] for py in y[::9]])
    half = 0.5 * operator.river_width
    sampled = wet[::9, ::9]
    assert (nearest[sampled] < half + 0.2).all()
    assert (nearest[~sampled] > half - 3.0).all()  # shallow at its very edge


def test_meander_is_deep_and_steep_outside_of_its_bends() -> None:
    operator = Meander(direction=90.0, scars=0, slope=0.0, **BARE)
    half = 0.5 * operator.river_width
    from terrakit.formula import Place
    from terrakit.formula.expression import Formula

    place = Place(Grid((1, 2001), 0.03, (-30.0, 0.0)), Run(3))
    bed = operator._bed(place.around([0.0, 0.0])[0], Formula("constant", data=1.0))
    (z,) = (np.asarray(v)[0] for v in Place(place.grid, Run(3, "numpy")).computed(bed))
    x = -30.0 + 0.03 * np.arange(2001)
    # Turning right, the outer bank is on the left
    assert x[z.argmin()] < -0.25 * half
    assert z.min() == pytest.approx(-operator.depth, rel=1e-3)
    outer = z[100] / (x[100] + half)
    inner = z[-101] / (half - x[-101])
    assert outer < 3.0 * inner < 0.0


# --- every landform


@pytest.mark.parametrize("form", ALL, ids=lambda form: form.name)
def test_centre_moves_it(form: type[Landform]) -> None:
    spacing = float(form.portrait or 1.0) / 64  # type: ignore[arg-type]
    shift = (round(3 * spacing, 6), round(-5 * spacing, 6))
    here = made(form(center=[0.0, 0.0], **BARE), 33, 41, spacing)
    there = made(form(center=list(shift), **BARE), 33, 41, spacing)
    if form is Thufur:  # its noise lies in the world
        assert np.array_equal(here, there)
        return
    assert there[5:, 3:] == pytest.approx(here[:-5, :-3], abs=2e-3 * np.ptp(here))
    assert np.ptp(here) > 0


@pytest.mark.parametrize(
    "form", [f for f in ALL if "direction" in f.model_fields], ids=lambda form: form.name
)
def test_direction_turns_it(form: type[Landform]) -> None:
    spacing = float(form.portrait or 1.0) / 64  # type: ignore[arg-type]
    first = made(form(direction=20.0, center=[0.0, 0.0], **BARE), 41, 41, spacing)
    turned = made(form(direction=110.0, center=[0.0, 0.0], **BARE), 41, 41, spacing)
    assert turned == pytest.approx(np.rot90(first, -1), abs=1e-2 * np.ptp(first))
    assert np.abs(turned - first).max() > 0.05 * np.ptp(first)


@pytest.mark.parametrize("form", ALL, ids=lambda form: form.name)
def test_more_samples_refine_it(form: type[Landform]) -> None:
    spacing = 2.0 ** round(math.log2(float(form.portrait or 1.0) / 64))  # type: ignore[arg-type]
    bare = form(center=[0.0, 0.0], **BARE)
    origin = (-16 * spacing, 16 * spacing)
    coarse = made(bare, 33, 33, spacing, north_west=origin)
    fine = made(bare, 65, 65, spacing / 2, north_west=origin)
    if form is Thufur:  # even bare it is made of noise, whose lattice is rounded per spacing
        assert fine[::2, ::2] == pytest.approx(coarse, abs=1e-4)
    else:
        assert fine[::2, ::2].tobytes() == coarse.tobytes()
    rough = form(center=[0.0, 0.0], seed=1)
    coarse = made(rough, 33, 33, spacing, north_west=origin)
    fine = made(rough, 65, 65, spacing / 2, north_west=origin)
    assert fine[::2, ::2] == pytest.approx(coarse, abs=2e-3 * max(np.ptp(coarse), 0.1))


@pytest.mark.parametrize("form", ALL, ids=lambda form: form.name)
@pytest.mark.parametrize("extreme", [0, 1])
def test_parameters_at_their_bounds_are_survived(form: type[Landform], extreme: int) -> None:
    from terrakit.parameters import bounds_of

    for name, field in form.model_fields.items():
        bounds = bounds_of(field)
        low = bounds.get("minimum", bounds.get("exclusiveMinimum"))
        high = bounds.get("maximum", bounds.get("exclusiveMaximum"))
        value = (low, high)[extreme]
        if value is None:
            continue
        if "exclusiveMinimum" in bounds and extreme == 0:
            value = 0.01
        if "exclusiveMaximum" in bounds and extreme == 1:
            value = 0.99 * value
        value = int(value) if field.annotation is int else float(value)
        if form is Dunes and (name, extreme) in (("dune_height", 1), ("wavelength", 0)):
            value = 100.0  # what does not fit is refused, which another test holds it to
        z = made(form(**{name: value}), 5, 7, 50.0)
        assert np.isfinite(z).all(), f"{name} = {value}"
