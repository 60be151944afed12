"""Thermal erosion of rock and the loose material on it: who moves, how far, and what stays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, Run
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.materials import MATERIALS
from terrakit.strata import Bed, Strata
from terrakit.testing import difference, rough_terrain, smooth_terrain
from terrakit_erosion.thermal import Thermal

QUANTUM = 2.0**-15
"""Of samples 10 m apart."""


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def eroded(surface: Any, device: Any = None, **settings: Any) -> Any:
    return execute(Thermal(**settings), surface, Run(device=device))


def bedrock(terrain: Any) -> np.ndarray:
    return terrain.elevation.astype(np.float64) - terrain.layer("sediment")


def covered(shape: tuple[int, int] = (33, 33), thickness: float = 4.0) -> Heightfield:
    terrain = rough_terrain(shape)
    return terrain.with_layers(sediment=np.full(shape, thickness, dtype=np.float32))


def cliff(height: float = 150.0, spacing: float = 10.0) -> Heightfield:
    profile = np.where(np.arange(65) < 32, height, 0.0)
    return Heightfield(profile * np.ones((7, 1)), spacing)


# --- what publications got wrong ----------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
def test_talus_is_an_angle_and_amounts_are_heights(device: Any, scheme: str) -> None:
    """Twice as large in all three directions, the same thing happens, bit for bit."""
    small = rough_terrain((33, 20), 8.0)
    large = Heightfield(2 * small.elevation, 16.0)
    first, second = (eroded(t, device, iterations=40, scheme=scheme) for t in (small, large))
    assert np.array_equal(2 * first.elevation, second.elevation)
    assert not np.array_equal(first.elevation, small.elevation)


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
def test_heights_above_the_datum_do_not_matter(scheme: str) -> None:
    """Shares follow the drops, not the heights themselves."""
    low = rough_terrain((33, 20), 8.0)
    low = low.with_layers(elevation=np.rint(low.elevation * 64) / 64)
    high = low.with_layers(elevation=low.elevation + np.float32(2048))
    first, second = (eroded(t, iterations=40, scheme=scheme) for t in (low, high))
    change = first.elevation - low.elevation
    assert np.abs(second.elevation - high.elevation - change).max() < 3e-4  # float32 at 2 km
    assert np.abs(change).max() > 1


@pytest.mark.parametrize("form", ["cone", "dome"])
def test_the_grid_hardly_shows_in_what_is_round(form: str) -> None:
    """Less than 2 % of the relief; a slope at rest all over is 8 % steeper between directions."""
    x = np.arange(-48, 49) * 4.0
    far = np.hypot(x[:, None], x[None, :])
    height = {"cone": np.maximum(140 - far, 0) * 0.84, "dome": 100.0 * np.exp(-((far / 70) ** 2))}
    hill = Heightfield(height[form], 4.0)
    change = eroded(hill, talus_angle=33.0, distance=25.0).elevation - hill.elevation
    assert np.abs(change).max() > 5
    angle = np.arctan2(x[:, None], x[None, :])
    for radius in (20.0, 40.0, 60.0, 90.0):
        ring = np.abs(far - radius) < 3
        for waves in (4, 8):
            harmonic = 2 * np.abs((change[ring] * np.exp(1j * waves * angle[ring])).mean())
            assert harmonic < 0.02 * np.ptp(hill.elevation)


def test_half_the_share_changes_little() -> None:
    terrain = smooth_terrain((65, 65), 10.0)
    changes = [
        eroded(terrain, talus_angle=25.0, distance=60.0, relaxation=share).elevation
        - terrain.elevation
        for share in (0.15, 0.075)
    ]
    gap = np.sqrt(((changes[0] - changes[1]) ** 2).mean() / (changes[1] ** 2).mean())
    assert gap < 0.05


# --- borders --------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
@pytest.mark.parametrize("layered", [False, True])
def test_a_slope_falls_as_fast_along_the_border(device: Any, scheme: str, layered: bool) -> None:
    settings: dict[str, Any] = {"bedrock_angle": 45.0} if layered else {}
    result = eroded(cliff(), device, scheme=scheme, iterations=60, **settings)
    assert (result.elevation == result.elevation[3]).all()


def test_open_borders_pass_what_slides_over_them_alone(device: Any) -> None:
    ramp = Heightfield(np.arange(33, 0, -1.0) * 12.0 * np.ones((17, 1)), 10.0)
    run = Run(device=device).for_step("thermal")
    execute(Thermal(talus_angle=33.0, iterations=40, border="open"), ramp, run)
    assert set(run.ledger.accounts["rock"].left) == {"border east"}
    closed = eroded(ramp, device, talus_angle=33.0, iterations=40)
    opened = eroded(ramp, device, talus_angle=33.0, iterations=40, border="open")
    assert (opened.elevation == opened.elevation[8]).all()
    assert opened.elevation[8, -1] < closed.elevation[8, -1]
    assert opened.elevation[8, 0] == pytest.approx(closed.elevation[8, 0])


# --- rock and what lies on it --------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
def test_with_debris_alone_bedrock_never_moves(device: Any, scheme: str) -> None:
    terrain = covered()
    result = eroded(terrain, device, supply="debris", distance=60.0, scheme=scheme)
    assert np.abs(bedrock(result) - bedrock(terrain)).max() < 1e-4
    assert result.layer("sediment").min() >= 0
    assert np.abs(result.elevation - terrain.elevation).max() > 2
    bare = terrain.with_layers(sediment=np.zeros(terrain.shape))
    still = eroded(bare, device, supply="debris", distance=60.0, scheme=scheme)
    assert still.elevation.tobytes() == terrain.elevation.tobytes()


def test_debris_leaves_cliffs_and_rests_at_their_foot() -> None:
    terrain = cliff()
    terrain = terrain.with_layers(sediment=np.full(terrain.shape, 20.0))
    result = eroded(terrain, talus_angle=35.0, supply="debris", iterations=1500)
    profile, loose = result.elevation[3].astype(np.float64), result.layer("sediment")[3]
    assert np.abs(np.diff(profile[32:])).max() / 10.0 <= math.tan(math.radians(35.0)) * 1.01
    assert loose[31] == pytest.approx(0.0, abs=1e-2)  # the edge is swept
    assert loose[32] > 30  # and stands in its talus
    assert loose.sum(dtype=np.float64) == pytest.approx(20.0 * 65, rel=1e-5)


@pytest.mark.parametrize("settings", [{}, {"hardness": 0.3}])
def test_what_arrives_is_loose_and_what_leaves_was_loose_first(
    device: Any, settings: dict[str, Any]
) -> None:
    terrain = covered(thickness=2.0)
    result = eroded(terrain, device, distance=100.0, **settings)
    gained = result.elevation.astype(np.float64) - terrain.elevation
    loose = result.layer("sediment").astype(np.float64)
    assert (loose >= np.maximum(2.0 + gained, 0) - 1e-4).all()
    assert (bedrock(result) <= bedrock(terrain) + 1e-4).all()
    # Rock that broke and was buried later: a sum at the end would not know of it
    assert (loose > np.maximum(2.0 + gained, 0) + 0.1).any()
    assert np.allclose(result.layer("erosion"), np.maximum(-gained, 0), atol=1e-3)
    assert np.allclose(result.layer("deposition"), np.maximum(gained, 0), atol=1e-3)


def test_rock_stands_steeper_than_its_scree(device: Any) -> None:
    result = eroded(cliff(120.0), device, talus_angle=33.0, bedrock_angle=65.0, iterations=1500)
    profile, loose = result.elevation[3].astype(np.float64), result.layer("sediment")[3]
    slope = np.abs(np.diff(profile)) / 10.0
    bare = (loose[:-1] < 0.01) & (loose[1:] < 0.01)
    assert slope.max() <= math.tan(math.radians(65.0)) * 1.01
    assert slope[bare].max() > math.tan(math.radians(60.0))
    on_scree = np.flatnonzero(loose > 0.5)
    assert slope[on_scree[1] : on_scree[-1]].max() <= math.tan(math.radians(33.0)) * 1.02


def test_equal_angles_are_the_plain_scheme(device: Any) -> None:
    for scheme in ("flux", "proportional"):
        terrain = covered()
        plain, layered = (
            eroded(terrain, device, talus_angle=33.0, scheme=scheme, distance=30.0, **settings)
            for settings in ({}, {"bedrock_angle": 33.0})
        )
        assert not difference(plain, layered)


def test_hard_ground_stays(device: Any) -> None:
    terrain = rough_terrain((33, 33))
    immovable = eroded(terrain, device, hardness=1.0, distance=50.0)
    assert immovable.elevation.tobytes() == terrain.elevation.tobytes()
    half = np.zeros(terrain.shape, dtype=np.float32)
    half[:, 17:] = 1.0
    part = eroded(terrain.with_layers(mask_hard=half), device, hardness="mask_hard", distance=50.0)
    moved = np.abs(part.elevation - terrain.elevation)
    assert (part.elevation[:, 17:] >= terrain.elevation[:, 17:]).all()  # it only takes
    assert moved[:, :16].max() > 10


def test_every_bed_has_its_own_angle(device: Any) -> None:
    hard, soft = Bed(material="limestone", thickness=60.0), Bed(material="shale", thickness=500.0)
    profile = np.interp(np.arange(65), [20, 30], [160.0, 0.0])
    terrain = Heightfield(
        profile * np.ones((7, 1)),
        10.0,
        layers={"strata_datum": np.full((7, 65), 165.0)},
        strata=Strata(beds=(hard, soft)),
    )
    result = eroded(terrain, device, talus_angle=33.0, iterations=1200)
    # 58 degrees: limestone holds that, shale does not; the cap is undermined, and breaks above
    slope = np.abs(np.diff(result.elevation[3].astype(np.float64))) / 10.0
    bare = result.layer("sediment")[3] < 0.01
    rock = bedrock(result)[3]
    cap = bare[:-1] & bare[1:] & (rock[1:] > 105.0)
    below = bare[:-1] & bare[1:] & (rock[:-1] < 105.0)
    assert slope[cap].max() > math.tan(math.radians(50.0))
    assert slope[below].max() <= math.tan(math.radians(36.0)) * 1.02
    both_soft = eroded(terrain.with_strata(Strata(beds=(soft,))), device, iterations=1200)
    gone = terrain.elevation[3] - both_soft.elevation[3]
    assert gone[20:24].max() > (terrain.elevation[3] - result.elevation[3])[20:24].max()


def test_every_material_is_a_preset() -> None:
    assert set(Thermal.presets) == set(MATERIALS)
    for name, material in MATERIALS.items():
        made = Thermal.from_settings({"preset": name}, name)
        angle = made.talus_angle if material.is_loose else made.bedrock_angle
        assert angle == material.repose_angle
    assert Thermal.presets["sand"]["talus_angle"] < Thermal.presets["soil"]["talus_angle"]


def test_on_a_mesh_rock_and_debris_are_told_apart(device: Any) -> None:
    mesh = rough_terrain((17, 17)).to_mesh()
    loose = np.full(len(mesh.vertices), 3.0, dtype=np.float32)
    mesh = mesh.with_layers(sediment=loose)
    result = eroded(mesh, device, supply="debris", distance=60.0)
    rock = result.heights - result.layer("sediment")
    assert np.abs(rock - (mesh.heights - 3.0)).max() < 0.01
    assert np.abs(result.heights - mesh.heights).max() > 1
    standing = eroded(mesh, device, bedrock_angle=70.0, distance=60.0)
    falling = eroded(mesh, device, distance=60.0)
    assert np.ptp(standing.heights) > np.ptp(falling.heights)


@pytest.mark.parametrize("settings", [{"supply": "debris"}, {"bedrock_angle": 50.0}])
@pytest.mark.parametrize("scheme", ["flux", "proportional"])
@pytest.mark.parametrize("border", ["closed", "open"])
def test_reference_equals_opencl(settings: dict[str, Any], scheme: str, border: str) -> None:
    both = [
        eroded(covered((40, 33)), name, iterations=12, scheme=scheme, border=border, **settings)
        for name in ("numpy", None)
    ]
    assert not difference(*both)


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
@pytest.mark.parametrize("border", ["closed", "open"])
def test_reference_equals_opencl_without_rock(scheme: str, border: str) -> None:
    both = [
        eroded(rough_terrain((40, 33)), name, iterations=12, scheme=scheme, border=border)
        for name in ("numpy", None)
    ]
    assert not difference(*both)
