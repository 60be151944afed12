"""Subdivision: no gaps, nothing moved that should stay, the same whatever the order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Heightfield, ParameterError, Run, TriMesh
from terrakit.errors import ResourceError
from terrakit.testing import irregular_mesh, rough_terrain
from terrakit_filters.subdivide import Subdivide


def cut(mesh: TriMesh, device: str | None = None, seed: int = 3, **settings: Any) -> TriMesh:
    return Subdivide(**settings).apply(mesh, Run(seed, device))


def octahedron(radius: float = 1000.0) -> TriMesh:
    points = radius * np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float
    )
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    return TriMesh(points, np.array(faces), up="radial")


def euler(mesh: TriMesh) -> int:
    return len(mesh.vertices) - len(mesh.edges) + len(mesh.faces)


def faces_at_edges(mesh: TriMesh) -> NDArray[np.int64]:
    pairs = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)[1]


def triangles(mesh: TriMesh) -> NDArray[np.float64]:
    """Return the corners of every face in an order that says nothing of numbering."""
    corners = mesh.vertices[mesh.faces]
    flat = np.stack([np.roll(corners, -k, axis=1).reshape(-1, 9) for k in range(3)], axis=1)
    first = np.array([min(range(3), key=lambda k, f=f: tuple(f[k])) for f in flat])
    flat = flat[np.arange(len(flat)), first]
    return flat[np.lexsort(flat.T[::-1])]


MESHES = {
    "uneven": irregular_mesh,
    "octahedron": octahedron,
    "grid": lambda: rough_terrain((9, 12)).to_mesh(),
}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("smoothing", ["linear", "butterfly"])
def test_four_faces_for_one_and_no_gaps(mesh: Any, smoothing: str) -> None:
    before = mesh()
    after = cut(before, levels=2, amplitude=50.0, smoothing=smoothing)
    assert len(after.faces) == 16 * len(before.faces)
    assert euler(after) == euler(before)
    assert faces_at_edges(after).max() == faces_at_edges(before).max()
    assert (faces_at_edges(after) == 1).sum() == 4 * (faces_at_edges(before) == 1).sum()
    assert np.array_equal(after.vertices[: len(before.vertices)], before.vertices)
    used = np.bincount(after.faces.ravel(), minlength=len(after.vertices)) > 0
    assert (~used).sum() == (np.bincount(before.faces.ravel()) == 0).sum() + max(
        0, len(before.vertices) - 1 - before.faces.max()
    )


@pytest.mark.parametrize("settings", [{"levels": 3}, {"edge_length": 4.0}])
def test_without_amplitude_the_surface_stays(settings: dict[str, Any]) -> None:
    before = irregular_mesh()
    after = cut(before, **settings)
    assert len(after.faces) > 4 * len(before.faces)
    assert after.volume == pytest.approx(before.volume, rel=1e-12)
    corner = after.vertices[after.faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    whole = before.vertices[before.faces]
    total = np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0])
    # The area in space, not only in plan: the pieces are flat
    areas = [np.linalg.norm(c, axis=1).sum() for c in (cross, total)]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)
    assert (cross[:, 2] > 0).all()


@pytest.mark.parametrize(
    "settings",
    [
        {"levels": 2, "smoothing": "butterfly", "amplitude": 40.0},
        {"edge_length": 6.0, "smoothing": "butterfly", "amplitude": 40.0},
    ],
)
def test_shuffled_meshes_give_the_same_surface(settings: dict[str, Any]) -> None:
    mesh = irregular_mesh()
    random = np.random.default_rng(8)
    order = random.permutation(len(mesh.vertices))  # new number -> old number
    number = np.argsort(order)
    faces = number[mesh.faces][random.permutation(len(mesh.faces))]
    shuffled = TriMesh(mesh.vertices[order], faces)
    one, other = (triangles(cut(m, **settings)) for m in (mesh, shuffled))
    assert one.shape == other.shape
    assert np.abs(one - other).max() < 1e-9


def test_two_meshes_with_a_common_edge_get_the_same_middle() -> None:
    points = np.array([[0, 0, 5], [100, 0, 9], [50, 80, 2], [50, -80, 30]], dtype=float)
    upper = TriMesh(points, np.array([[0, 1, 2]]))
    lower = TriMesh(points[[3, 1, 0]], np.array([[0, 1, 2]]))
    settings = {"levels": 3, "amplitude": 200.0}
    on_edge = [
        {tuple(p) for p in cut(m, **settings).vertices if abs(p[1]) < 1e-9} for m in (upper, lower)
    ]
    assert len(on_edge[0]) == 9
    assert on_edge[0] == on_edge[1]


def test_butterfly_keeps_planes_and_outlines() -> None:
    uneven = irregular_mesh()
    flat = uneven.vertices.copy()
    flat[:, 2] = 0.7 * flat[:, 0] - 1.3 * flat[:, 1] + 50.0
    after = cut(TriMesh(flat, uneven.faces), levels=3, smoothing="butterfly")
    x, y, z = after.vertices.T
    assert np.abs(z - (0.7 * x - 1.3 * y + 50.0)).max() < 1e-9
    square = rough_terrain((6, 6)).to_mesh()
    bent = cut(square, levels=3, smoothing="butterfly")
    assert np.array_equal(bent.vertices[:, :2].min(0), square.vertices[:, :2].min(0))
    assert np.array_equal(bent.vertices[:, :2].max(0), square.vertices[:, :2].max(0))
    assert bent.areas.sum() == pytest.approx(square.areas.sum(), rel=1e-12)


def test_butterfly_rounds_what_linear_leaves_faceted() -> None:
    # A paraboloid on an even triangle mesh: the smooth middle errs far less than the flat one
    row, col = np.mgrid[0:12, 0:12]
    x, y = 100.0 * (col + 0.5 * row), 86.6 * row
    z = 1e-3 * ((x - 800) ** 2 + 0.5 * (y - 470) ** 2)
    i = np.arange(132).reshape(11, 12)[:, :-1].ravel()
    faces = np.concatenate(
        (np.stack((i, i + 1, i + 12), -1), np.stack((i + 1, i + 13, i + 12), -1))
    )
    mesh = TriMesh(np.stack((x, y, z), -1).reshape(-1, 3), faces)
    errors = []
    for smoothing in ("linear", "butterfly"):
        px, py, pz = cut(mesh, smoothing=smoothing).vertices.T
        inner = (px > 600) & (px < 1100) & (py > 250) & (py < 700)
        exact = 1e-3 * ((px - 800) ** 2 + 0.5 * (py - 470) ** 2)
        errors.append(np.abs(pz - exact)[inner].max())
    assert errors[0] > 1.0
    assert errors[1] < 1e-9  # eight points reproduce quadratics


def test_quads_stay_quads() -> None:
    mesh = rough_terrain((5, 7)).to_mesh()
    after = cut(mesh, levels=2, amplitude=10.0)
    assert after.polygons is not None
    assert (after.polygons.counts == 4).all()
    assert len(after.polygons.counts) == 16 * 24
    # Every quad is made of its two faces, in turn
    quads = after.polygons.indices.reshape(-1, 4)
    assert np.array_equal(
        np.sort(quads, axis=1), np.array([np.unique(f) for f in after.faces.reshape(-1, 6)])
    )
    x, y = after.vertices[quads][..., 0], after.vertices[quads][..., 1]
    area = 0.5 * (x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1)
    assert area == pytest.approx(np.full(len(quads), 100.0 / 16))


def test_polygons_of_all_kinds_survive() -> None:
    points = np.array(
        [[0, 0, 0], [2, 0, 1], [2, 2, 0], [0, 2, 3], [4, 0, 0], [5, 1, 2], [4, 2, 0], [1, 4, 0]],
        dtype=float,
    )
    mesh = TriMesh.from_polygons(points, [4, 5, 3], [0, 1, 2, 3, 1, 4, 5, 6, 2, 3, 2, 7])
    after = cut(cut(mesh))
    assert after.polygons is not None
    assert sorted(set(after.polygons.counts.tolist())) == [3, 4]
    assert (after.polygons.counts == 4).sum() == 16
    assert int((after.polygons.counts - 2).sum()) == len(after.faces) == 16 * len(mesh.faces)
    assert after.volume == pytest.approx(mesh.volume)
    again = TriMesh.from_polygons(after.vertices, after.polygons.counts, after.polygons.indices)
    assert again.volume == pytest.approx(mesh.volume, rel=0.2)


def test_layers_are_interpolated() -> None:
    terrain = rough_terrain((6, 6))
    east = np.broadcast_to(np.arange(6, dtype=np.float32) * 10, (6, 6))
    mesh = terrain.with_layers(mask_east=east).to_mesh()
    for settings in ({"levels": 2}, {"edge_length": 3.0}):
        after = cut(mesh, amplitude=30.0, **settings)
        assert after.layer("mask_east") == pytest.approx(after.vertices[:, 0], abs=1e-5)


def test_adaptive_cuts_only_what_is_long() -> None:
    mesh = irregular_mesh()
    angles = []
    for m in (mesh, after := cut(mesh, edge_length=7.0)):
        p = m.vertices[m.faces]
        sides = [p[:, (k + 1) % 3] - p[:, k] for k in range(3)]
        unit = [s / np.linalg.norm(s, axis=1, keepdims=True) for s in sides]
        cosines = [-(unit[k] * unit[k - 1]).sum(axis=1) for k in range(3)]
        angles.append(np.degrees(np.arccos(np.clip(np.max(cosines, axis=0), -1, 1))).min())
    edge = after.vertices[after.edges]
    assert np.linalg.norm(edge[:, 1] - edge[:, 0], axis=1).max() <= 7.0
    assert euler(after) == euler(mesh)
    assert faces_at_edges(after).max() == 2
    assert angles[1] > 0.5 * angles[0]
    untouched = cut(mesh, edge_length=1e4)
    assert untouched is mesh


def test_amplitude_scales_the_same_detail() -> None:
    mesh = rough_terrain((6, 6)).to_mesh()
    flat, low, high = (cut(mesh, levels=3, amplitude=a) for a in (0.0, 10.0, 20.0))
    rise = [m.vertices[:, 2] - flat.vertices[:, 2] for m in (low, high)]
    assert rise[1] == pytest.approx(2 * rise[0], abs=1e-4)
    assert np.array_equal(flat.vertices[:, :2], high.vertices[:, :2])


def test_detail_goes_with_the_length_of_the_edge() -> None:
    # One level on flat squares of 1000 m: middles have the deviation that was asked for
    flat = Heightfield(np.zeros((60, 60)), 1000.0).to_mesh()
    after = cut(flat, amplitude=50.0, hurst_exponent=0.5)
    new = after.vertices[3600:, 2]
    axial = np.isin(after.vertices[3600:, :2] % 1000, 0).any(axis=1)
    assert new[axial].std() == pytest.approx(50.0, rel=0.03)
    assert new[~axial].std() == pytest.approx(50.0 * 2**0.25, rel=0.03)
    assert abs(new.mean()) < 1.5


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_own_roughness_is_continued(hurst: float) -> None:
    # A coarse fractal, refined with the amplitude that the note gives, stays a fractal
    slopes = []
    for seed in range(3):
        start = _fractal(hurst, seed)
        step = np.sqrt(0.5 * sum((np.diff(start, axis=k) ** 2).mean() for k in (0, 1)))
        mesh = cut(
            Heightfield(start, 16.0).to_mesh(),
            levels=4,
            amplitude=float(step * np.sqrt((4.0**-hurst - 0.25) / 2)),
            reference_length=16.0,
            hurst_exponent=hurst,
            seed=seed,
        )
        z = np.zeros((257, 257))
        col, row = np.rint(mesh.vertices[:, :2]).astype(int).T
        z[row, col] = mesh.vertices[:, 2]
        lags = (1, 2, 4, 8, 16)
        means = [
            ((z[k:] - z[:-k]) ** 2).mean() + ((z[:, k:] - z[:, :-k]) ** 2).mean() for k in lags
        ]
        slopes.append(0.5 * np.polyfit(np.log(lags), np.log(means), 1)[0])
    assert float(np.mean(slopes)) == pytest.approx(hurst, abs=0.1)


def _fractal(hurst: float, seed: int) -> NDArray[np.float64]:
    """Return a part of random ground with a power law for a spectrum, by Fourier's series."""
    size = 256
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    k[0, 0] = np.inf
    white = np.fft.fft2(np.random.default_rng(seed).standard_normal((size, size)))
    return np.fft.ifft2(white * k ** (-hurst - 1)).real[:17, :17]


def test_planets_are_displaced_along_the_radius() -> None:
    globe = octahedron()
    flat, rough = (cut(globe, levels=1, amplitude=a) for a in (0.0, 1.0))
    shift = rough.vertices - flat.vertices
    outward = flat.vertices / np.linalg.norm(flat.vertices, axis=1, keepdims=True)
    sideways = shift - (shift * outward).sum(axis=1, keepdims=True) * outward
    assert np.abs(shift).max() > 0.1
    assert np.linalg.norm(sideways, axis=1).max() < 1e-9


def test_flipped_and_fanned_faces_do_no_harm() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate((rng.uniform(0, 100, (30, 3)), [[50.0, 50.0, 200.0]]))
    faces = np.unique(rng.permuted(np.tile(np.arange(31), (80, 1)), axis=1)[:, :3], axis=0)
    once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    faces = faces[once]  # a tangle
    mesh = TriMesh(points, faces)
    after = cut(mesh, levels=2, smoothing="butterfly", amplitude=5.0)
    assert np.isfinite(after.vertices).all()
    assert euler(after) == euler(mesh)
    ring = np.stack((np.cos(np.linspace(0, 6.2, 100)), np.sin(np.linspace(0, 6.2, 100))), -1)
    fan = TriMesh(
        np.concatenate(([[0, 0, 10]], np.concatenate((50 * ring, np.zeros((100, 1))), axis=1))),
        np.stack((np.zeros(99, int), np.arange(1, 100), np.arange(2, 101)), -1),
    )
    assert np.isfinite(cut(fan, levels=1, smoothing="butterfly").vertices).all()


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_devices_agree_to_the_bit(mesh: Any) -> None:
    for settings in ({"levels": 2}, {"edge_length": 300.0 if mesh is octahedron else 8.0}):
        one, other = (
            cut(mesh(), d, amplitude=70.0, hurst_exponent=0.63, smoothing="butterfly", **settings)
            for d in ("numpy", None)
        )
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert np.array_equal(one.faces, other.faces)


def test_too_many_triangles_are_refused_before_they_are_made() -> None:
    mesh = rough_terrain((129, 129)).to_mesh()
    with pytest.raises((ParameterError, ResourceError), match=r"levels = 12: .*use fewer levels"):
        cut(mesh, levels=12)
    with pytest.raises((ParameterError, ResourceError), match="use longer edges"):
        cut(mesh, edge_length=1e-4)
