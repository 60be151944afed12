"""Beds of rock: what crops out, in both languages, and what erosion makes of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from terrakit import Grid, Heightfield, Run
from terrakit.compute import choose_device
from terrakit.errors import InputError, ParameterError
from terrakit.execute import execute
from terrakit.quanta import Quanta
from terrakit.registry import default_registry
from terrakit.results import ResultCache
from terrakit.strata import Bed, Exposure, Strata
from terrakit.testing import rough_terrain

GRID = Grid((65, 65), 20.0)
HARD_ON_SOFT = Strata(
    beds=(
        Bed(material="cap", thickness=20.0, hardness=0.95),
        Bed(material="base", thickness=500.0, hardness=0.1),
    )
)


def operator(name: str, **settings: object) -> object:
    return default_registry().get(name)(**settings)


def layered(terrain: Heightfield, strata: Strata, top: float = 0.0) -> Heightfield:
    datum = np.full(terrain.shape, top, dtype=np.float32)
    return terrain.with_layers(strata_datum=datum).with_strata(strata)


def slab(height: float = 100.0) -> Heightfield:
    """Return a plain that one notch drains."""
    ground = np.full(GRID.shape, height, dtype=np.float32)
    ground += np.random.default_rng(2).uniform(0, 0.5, GRID.shape).astype(np.float32)
    ground[-1, 32] = 0.0
    return Heightfield.on_grid(GRID, ground)


@pytest.mark.parametrize("repeated", [False, True])
@pytest.mark.parametrize("factor", [2.5, "field"])
def test_both_languages_find_the_same_bed(repeated: bool, factor: float | str) -> None:
    random = np.random.default_rng(5)
    terrain = rough_terrain((37, 41), 8.0)
    beds = tuple(
        Bed(material=f"bed {k}", thickness=float(random.uniform(0.1, 9.0)), hardness=k / 10)
        for k in range(9)
    )
    surface = layered(terrain, Strata(beds=beds, repeated=repeated), top=33.25)
    quanta = Quanta.fitting(terrain.elevation, terrain.spacing)
    bedrock = quanta.count(terrain.elevation)
    scale = random.uniform(0, 3, terrain.shape).astype(np.float32) if factor == "field" else factor
    on_host, on_device = Run(device="numpy"), Run(device=choose_device(None))
    assert on_device.device is not None
    exposures = [Exposure(surface, quanta, run) for run in (on_host, on_device)]
    for rise in (0, -7_000_000, 12_345, random.integers(-9999, 9999, terrain.shape, np.int32)):
        found = []
        for exposure, run in zip(exposures, (on_host, on_device), strict=True):
            exposure.rise(rise)
            here = bedrock if run.device is None else run.device.upload(bedrock)
            by = scale
            if run.device is not None and isinstance(scale, np.ndarray):
                by = run.device.upload(scale)
            for name in ("erodibility", "softness", "hardness", "repose"):
                field = exposure.field(name, here, by)
                found.append(field if isinstance(field, np.ndarray) else field.download())
        for first, second in zip(found[:4], found[4:], strict=True):
            np.testing.assert_array_equal(first.view(np.int32), second.view(np.int32))
        if np.ndim(rise) == 0 and rise == 0:
            assert len(np.unique(found[0] / scale)) > 3


def test_the_column_is_read_from_the_top_down_and_begins_again() -> None:
    beds = (
        Bed(material="a", thickness=2.0, hardness=0.1),
        Bed(material="b", thickness=3.0, hardness=0.2),
    )
    heights = np.array([[1.0, -0.5, -2.5, -4.5, -5.5, -8.0, -11.0]], dtype=np.float32)
    terrain = Heightfield(np.repeat(heights, 3, axis=0), 1.0)
    quanta = Quanta.fitting(terrain.elevation, 1.0)
    counts = quanta.count(terrain.elevation)

    def bed(strata: Strata) -> list[int]:
        exposure = Exposure(layered(terrain, strata), quanta, Run(device="numpy"))
        return exposure.bed(counts)[0].tolist()

    assert bed(Strata(beds=beds)) == [0, 0, 1, 1, 1, 1, 1]
    assert bed(Strata(beds=beds, repeated=True)) == [1, 0, 1, 1, 0, 1, 0]


def test_what_a_bed_does_not_say_comes_from_its_material() -> None:
    granite = Bed(material="granite", thickness=1.0).properties
    assert (granite.hardness, granite.erodibility) == (0.9, 0.1)
    soft = Bed(material="granite", thickness=1.0, erodibility=3.0).properties
    assert (soft.hardness, soft.erodibility) == (0.9, 3.0)
    own = Bed(material="my rock", thickness=1.0, hardness=0.25).properties
    assert own.erodibility == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("beds", "message"),
    [
        ([{"material": "granit", "thickness": 1.0}], "did you mean granite"),
        (
            [{"material": "granite", "thickness": 0.0}],
            "beds[1].thickness = 0.0: must be greater than 0",
        ),
        (
            [{"material": "x", "thickness": 1.0, "hardness": 2.0}],
            "beds[1].hardness = 2.0: must be less than or equal to 1",
        ),
        ([{"material": "granite"}], "beds[1].thickness is missing"),
        (
            [{"material": "granite", "thickness": 1.0, "colour": "red"}],
            "beds[1].colour = 'red': is no such key",
        ),
        ([], "must be 1 to 64"),
        ([{"material": "granite", "thickness": 1.0}] * 65, "must be 1 to 64"),
    ],
)
def test_bad_beds_are_refused_in_one_line(beds: list[dict[str, object]], message: str) -> None:
    with pytest.raises(ParameterError, match=r"^strata: ") as refusal:
        execute(
            default_registry().get("strata").from_settings({"beds": beds}, "strata"),
            slab(),
            Run(device="numpy"),
        )
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_outcrop_without_beds_says_what_to_do() -> None:
    terrain = slab().with_layers(strata_datum=np.zeros(GRID.shape, dtype=np.float32))
    with pytest.raises(InputError, match='outcrop: the terrain has no beds.*use = "strata"'):
        execute(operator("outcrop"), terrain, Run(device="numpy"))


def test_beds_alike_are_as_no_beds() -> None:
    terrain = rough_terrain((33, 33), 50.0)
    alike = Strata(
        beds=tuple(
            Bed(material="same", thickness=5.0, hardness=0.5, erodibility=1.0) for _ in range(4)
        ),
        repeated=True,
    )
    erosion = operator("stream_power", duration=1e5)
    plain = execute(erosion, terrain, Run(3))
    beds = execute(erosion, layered(terrain, alike), Run(3))
    np.testing.assert_array_equal(plain.elevation, beds.elevation)


def test_a_hard_cap_keeps_the_plateau_and_ends_in_a_scarp() -> None:
    erosion = operator("stream_power", duration=3e5, uplift_rate=0.0, erodibility=2e-5)
    plain = execute(erosion, slab(), Run(3))
    capped = execute(erosion, layered(slab(), HARD_ON_SOFT, top=100.0), Run(3))
    stands = (capped.elevation > 85.0).mean()
    assert stands > 0.5
    assert stands > 1.4 * (plain.elevation > 85.0).mean()
    # below the cap the ground is steeper than anywhere on it
    south, east = np.gradient(capped.elevation.astype(np.float64), GRID.spacing)
    slope = np.hypot(south, east)
    below = (capped.elevation < 80.0) & (capped.elevation > 40.0)
    assert np.median(slope[below]) > 5 * np.median(slope[capped.elevation > 85.0])


def test_beds_rise_with_the_land() -> None:
    rising = operator("stream_power", duration=1e5, uplift_rate=1e-3, erodibility=0.0)
    before = layered(slab(), HARD_ON_SOFT, top=60.0)
    after = execute(rising, before, Run(3))
    np.testing.assert_allclose(after.layer("strata_datum"), 160.0, atol=0.01)
    # ... so what crops out far from the outlets is what did before
    inside = after.elevation[5:-5, 5:-5] - after.layer("strata_datum")[5:-5, 5:-5]
    assert (inside > 30.0).all()


def test_dip_goes_down_where_it_says() -> None:
    tilted = operator("strata", dip=45.0, dip_direction=90.0, warp_amplitude=0.0, top=10.0)
    datum = execute(tilted, slab(), Run(device="numpy")).layer("strata_datum")
    east = np.diff(datum.astype(np.float64), axis=1)
    np.testing.assert_allclose(east, -20.0, atol=1e-2)
    np.testing.assert_allclose(np.diff(datum, axis=0), 0.0, atol=1e-3)
    assert datum[32, 32] == pytest.approx(10.0, abs=1e-3)


def test_folds_and_faults_have_their_size() -> None:
    folded = operator("strata", fold_amplitude=50.0, fold_wavelength=400.0, warp_amplitude=0.0)
    datum = execute(folded, slab(), Run(device="numpy")).layer("strata_datum")
    assert datum.max() == pytest.approx(50.0, abs=0.5)
    np.testing.assert_allclose(datum[:, 20:], datum[:, :-20], atol=0.01)  # 20 samples of 20 m
    broken = operator("strata", fault_throw=30.0, fault_spacing=500.0, warp_amplitude=0.0)
    steps = np.unique(execute(broken, slab(), Run(device="numpy")).layer("strata_datum"))
    assert len(steps) >= 3
    np.testing.assert_allclose(np.diff(steps), 30.0, atol=1e-3)


def test_beds_survive_filters_archives_and_the_cache(tmp_path: Path) -> None:
    terrain = execute(operator("strata"), slab(), Run(device="numpy"))
    assert terrain.strata is not None
    part = execute(operator("crop", bounds=[100.0, 100.0, 700.0, 700.0]), terrain, Run())
    assert part.strata == terrain.strata
    assert part.to_mesh().strata == terrain.strata

    cache = ResultCache(tmp_path / "kept")
    cache.store("key", terrain, {})
    kept = cache.load("key")
    assert kept is not None
    assert kept[0].strata == terrain.strata

    (path,) = execute(operator("npz"), (terrain, tmp_path / "beds.npz"), Run())
    again = execute(operator("numpy"), path, Run())
    assert again.strata == terrain.strata
    np.testing.assert_array_equal(again.layer("strata_datum"), terrain.layer("strata_datum"))


@pytest.mark.parametrize("text", ["{", "[]", json.dumps({"beds": [{}], "repeated": False})])
def test_an_archive_with_spoilt_beds_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "spoilt.npz"
    np.savez(
        path,
        terrakit=np.array("1"),
        elevation=slab().elevation,
        spacing=np.array(20.0),
        strata=np.array(text),
    )
    with pytest.raises(InputError, match=r"spoilt\.npz: strata: are no beds"):
        execute(operator("numpy"), path, Run())


def test_outcrop_shows_beds_and_what_hides_them() -> None:
    terrain = rough_terrain((33, 33), 20.0)
    soil = np.zeros(terrain.shape, dtype=np.float32)
    soil[:10] = 5.0
    column = Strata(
        beds=(Bed(material="chalk", thickness=4.0), Bed(material="basalt", thickness=7.0)),
        repeated=True,
    )
    painted = execute(
        operator("outcrop"), layered(terrain.with_layers(sediment=soil), column), Run()
    )
    chalk, basalt = painted.layer("material_chalk"), painted.layer("material_basalt")
    assert painted.layer("material_sediment")[:10].min() == 1.0
    assert 0.2 < chalk[10:].mean() < 0.6
    assert (chalk + basalt)[10:].min() == 1.0
    bright = painted.layer("albedo_red")
    assert bright[chalk == 1].min() > 5 * bright[basalt == 1].max()
    assert painted.layer("hardness")[basalt == 1].min() == pytest.approx(0.85)
