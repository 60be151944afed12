"""Thermal erosion: slopes come to rest, and nothing else happens."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, ParameterError, Run, Schedule, TriMesh
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.testing import rough_terrain, smooth_terrain
from terrakit_erosion.thermal import Thermal

ANGLE = 33.0
TANGENT = math.tan(math.radians(ANGLE))


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


def eroded(surface: Any, device: Any, **settings: Any) -> tuple[Any, Run]:
    run = Run(device=device).for_step("thermal")
    return execute(Thermal(**settings), surface, run), run


def steepest(terrain: Heightfield) -> float:
    """Return the largest slope between a sample and any of its eight neighbours."""
    z = terrain.elevation.astype(np.float64)
    far = math.sqrt(2.0)
    gaps = (
        np.abs(np.diff(z, axis=0)).max(),
        np.abs(np.diff(z, axis=1)).max(),
        np.abs(z[1:, 1:] - z[:-1, :-1]).max() / far,
        np.abs(z[1:, :-1] - z[:-1, 1:]).max() / far,
    )
    return float(max(gaps)) / terrain.spacing


@pytest.mark.parametrize("scheme", ["flux", "proportional"])
def test_slopes_end_at_repose(device: Any, scheme: str) -> None:
    terrain = rough_terrain((17, 17))
    assert steepest(terrain) > 2 * TANGENT
    result, _ = eroded(terrain, device, talus_angle=ANGLE, iterations=3000, scheme=scheme)
    assert steepest(result) <= TANGENT * 1.01


@pytest.mark.parametrize("angle", [20.0, 45.0])
def test_talus_angle_is_what_the_slope_ends_at(device: Any, angle: float) -> None:
    cliff = np.where(np.arange(33) < 16, 200.0, 0.0) * np.ones((5, 1))
    result, _ = eroded(Heightfield(cliff, 10.0), device, talus_angle=angle, iterations=6000)
    drop = -np.diff(result.elevation[2].astype(np.float64)) / 10.0
    middle = drop[drop > 0.5 * drop.max()]
    assert middle.max() == pytest.approx(math.tan(math.radians(angle)), rel=0.01)


def test_column_becomes_a_cone_of_its_volume() -> None:
    size, spacing = 65, 2.0
    column = np.zeros((size, size))
    column[size // 2, size // 2] = 400.0 * 20
    volume = column.sum() * spacing**2
    result, _ = eroded(
        Heightfield(column, spacing), None, talus_angle=ANGLE, iterations=20000, scheme="flux"
    )
    radius = (3 * volume / (math.pi * TANGENT)) ** (1 / 3)
    covered = float((result.elevation > 0.02 * radius).sum()) * spacing**2
    measured = math.sqrt(covered / math.pi) / (1 - 0.02 / TANGENT)
    assert measured == pytest.approx(radius, rel=0.03)


def test_there_are_no_new_highs_or_lows(device: Any) -> None:
    terrain = rough_terrain((33, 33))
    for scheme in ("flux", "proportional"):
        result, _ = eroded(terrain, device, distance=30.0, scheme=scheme)
        quantum = terrain.spacing * 2.0**-17
        assert result.elevation.max() <= terrain.elevation.max() + quantum
        assert result.elevation.min() >= terrain.elevation.min() - quantum


def test_below_repose_every_bit_stays(device: Any) -> None:
    gentle = smooth_terrain((33, 33), 10.0)
    gentle = gentle.with_layers(elevation=gentle.elevation * np.float32(0.1))
    assert steepest(gentle) < TANGENT
    for scheme in ("flux", "proportional"):
        result, run = eroded(gentle, device, talus_angle=ANGLE, scheme=scheme)
        assert result.elevation.tobytes() == gentle.elevation.tobytes()
        assert run.ledger.accounts["rock"].moved == 0


def test_volume_is_exact(device: Any) -> None:
    for border in ("closed", "open"):
        result, run = eroded(rough_terrain((33, 20)), device, distance=50.0, border=border)
        account = run.ledger.accounts["rock"]
        assert account.residual == pytest.approx(0.0, abs=1e-6)
        assert account.moved > 0
        assert bool(account.left) == (border == "open")
        assert result.layer("sediment").min() >= 0


def test_twice_the_samples_give_the_same_slope() -> None:
    changes = []
    for samples, spacing in ((65, 8.0), (129, 4.0)):
        terrain = smooth_terrain((samples, samples), spacing)
        result, _ = eroded(terrain, None, talus_angle=30.0, distance=100.0)
        step = (samples - 1) // 64
        changes.append((result.elevation - terrain.elevation)[::step, ::step].astype(np.float64))
    gap = np.sqrt(((changes[0] - changes[1]) ** 2).mean() / (changes[1] ** 2).mean())
    assert gap < 0.05


def test_schedule_ends_at_its_last_angle(device: Any) -> None:
    schedule = Schedule(at=[0.0, 0.5, 1.0], value=[60.0, ANGLE, ANGLE])
    result, _ = eroded(rough_terrain((17, 17)), device, talus_angle=schedule, iterations=4000)
    assert steepest(result) <= TANGENT * 1.01


def test_steps_that_would_overshoot_are_refused() -> None:
    with pytest.raises(ParameterError, match="relaxation"):
        eroded(rough_terrain(), None, relaxation=0.5)
    with pytest.raises(ParameterError, match="distance"):
        eroded(rough_terrain((5, 5), 0.001), None, distance=1e4)


# --- meshes -----------------------------------------------------------------------------------


def uneven(size: int = 21, spacing: float = 10.0) -> TriMesh:
    mesh = rough_terrain((size, size), spacing).to_mesh()
    vertices = mesh.vertices.copy()
    vertices[:, :2] += np.random.default_rng(3).uniform(-2.5, 2.5, (len(vertices), 2))
    return TriMesh(vertices, mesh.faces)


def signed_volume(mesh: TriMesh) -> float:
    """Return the volume between the surface and z = 0, by prisms on its triangles."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return float((0.5 * area * (a[:, 2] + b[:, 2] + c[:, 2]) / 3).sum())


def test_mesh_volume_is_what_the_ledger_says(device: Any) -> None:
    mesh = uneven()
    result, run = eroded(mesh, device, distance=50.0)
    account = run.ledger.accounts["rock"]
    size = float(mesh.areas.sum() * np.abs(mesh.heights).max())
    assert account.moved > 1e-3 * size
    assert abs(signed_volume(result) - signed_volume(mesh)) < 1e-10 * size
    assert abs(account.end - signed_volume(result)) < 1e-10 * size


def test_order_of_vertices_and_faces_does_not_matter() -> None:
    mesh = uneven()
    random = np.random.default_rng(8)
    order, faces = random.permutation(len(mesh.vertices)), random.permutation(len(mesh.faces))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    turned = np.take_along_axis(  # and every face begins with another corner
        mesh.faces, (random.integers(0, 3, len(mesh.faces))[:, None] + np.arange(3)) % 3, axis=1
    )
    shuffled = TriMesh(mesh.vertices[order], place[turned][faces])
    straight, _ = eroded(mesh, None, distance=50.0)
    result, _ = eroded(shuffled, None, distance=50.0)
    change = np.abs(straight.heights - mesh.heights).max()
    assert np.abs(result.heights[place] - straight.heights).max() < 1e-4 * change


def test_grid_as_a_mesh_moves_about_as_much() -> None:
    terrain = smooth_terrain((33, 33), 10.0)
    _, of_grid = eroded(terrain, None, talus_angle=30.0, distance=300.0)
    _, of_mesh = eroded(terrain.to_mesh(), None, talus_angle=30.0, distance=300.0)
    moved = [run.ledger.accounts["rock"].moved for run in (of_grid, of_mesh)]
    assert moved[1] == pytest.approx(moved[0], rel=0.25)


def test_mesh_comes_to_rest() -> None:
    mesh = uneven(13)
    result, _ = eroded(mesh, None, talus_angle=ANGLE, iterations=12000)
    edges = result.edges
    run_length = np.hypot(*(np.diff(result.vertices[edges][:, :, :2], axis=1)[:, 0].T))
    rise = np.abs(np.diff(result.vertices[edges][:, :, 2], axis=1)[:, 0])
    assert (rise / run_length).max() <= TANGENT * 1.01


def test_loose_vertices_stay(device: Any) -> None:
    mesh = uneven(9)
    loose = TriMesh(np.vstack((mesh.vertices, [[5.0, 5.0, 9e3]])), mesh.faces)
    result, _ = eroded(loose, device, distance=20.0)
    assert (result.vertices[-1] == [5.0, 5.0, 9e3]).all()
