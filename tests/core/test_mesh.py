"""Meshes: areas, widths, polygons and neighbours, against geometry that is known."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, InputError, TriMesh
from terrakit.testing import irregular_mesh, rough_terrain

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def disc(rings: int = 4) -> TriMesh:
    """Return a triangulated hexagon with uneven triangles and one interior centre."""
    points, faces = [[0.0, 0.0]], []
    for ring in range(1, rings + 1):
        turn = 0.3 * ring
        angle = 2 * np.pi * np.arange(12) / 12 + turn
        points += (ring * np.stack((np.cos(angle), np.sin(angle)), -1)).tolist()
    faces += [[0, 1 + k, 1 + (k + 1) % 12] for k in range(12)]
    for ring in range(1, rings):
        for k in range(12):
            a, b = 1 + 12 * (ring - 1) + k, 1 + 12 * (ring - 1) + (k + 1) % 12
            faces += [[a, a + 12, b], [b, a + 12, b + 12]]
    return TriMesh(np.column_stack((points, np.zeros(len(points)))), faces)


def test_areas_share_the_projected_area_out() -> None:
    mesh = rough_terrain((9, 7), 10.0).to_mesh()
    assert mesh.areas.sum() == pytest.approx(80.0 * 60.0)
    assert mesh.areas.min() > 0
    tilted = TriMesh(mesh.vertices[:, [2, 0, 1]], mesh.faces, up=(1, 0, 0))
    assert np.allclose(tilted.areas, mesh.areas)
    assert np.allclose(tilted.heights, mesh.heights)


def test_volume_changes_by_areas_times_lift() -> None:
    mesh = irregular_mesh()
    lift = np.random.default_rng(1).uniform(-1, 1, len(mesh.vertices))
    assert mesh.raised(lift).volume - mesh.volume == pytest.approx((mesh.areas * lift).sum())


def test_edges_of_a_square() -> None:
    mesh = TriMesh(SQUARE, [[0, 1, 2], [0, 2, 3]])
    assert mesh.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    assert mesh.is_boundary.all()
    graph = mesh.graph
    assert graph.start.tolist() == [0, 3, 5, 8, 10]
    assert graph.neighbor.tolist() == [1, 2, 3, 0, 2, 0, 1, 3, 0, 2]
    assert graph.length[1] == pytest.approx(np.sqrt(2))


def test_graph_is_symmetric() -> None:
    mesh = irregular_mesh()
    graph = mesh.graph
    owner = np.repeat(np.arange(len(mesh.vertices)), np.diff(graph.start))
    there = {(a, b): k for k, (a, b) in enumerate(zip(owner, graph.neighbor, strict=True))}
    for (a, b), k in there.items():
        back = there[b, a]
        assert graph.length[k] == graph.length[back]
        assert graph.width[k] == graph.width[back]
        assert graph.edge[k] == graph.edge[back]


def test_widths_are_exact_for_linear_functions() -> None:
    mesh = disc()
    graph = mesh.graph
    slope = 3.0 * mesh.vertices[:, 0] - 2.0 * mesh.vertices[:, 1]
    owner = np.repeat(np.arange(len(mesh.vertices)), np.diff(graph.start))
    flow = graph.width / graph.length * (slope[graph.neighbor] - slope[owner])
    net = np.bincount(owner, flow, len(mesh.vertices))
    clamped = np.bincount(owner, graph.width < 0.051 * graph.length, len(mesh.vertices)) > 0
    exact = ~mesh.is_boundary & ~clamped
    assert exact.sum() > 12
    assert np.abs(net[exact]).max() < 1e-9


def test_widths_are_positive_on_slivers() -> None:
    sliver = TriMesh([[0, 0, 0], [1, 1e-4, 0], [2, 0, 0], [1, -1, 0]], [[0, 2, 1], [0, 3, 2]])
    assert (sliver.graph.width > 0).all()
    assert np.isfinite(sliver.graph.width).all()


def test_components_and_loose_vertices() -> None:
    two = TriMesh(np.vstack((SQUARE, SQUARE + 5, [[9, 9, 9]])), [[0, 1, 2], [4, 5, 6]])
    assert two.components.tolist() == [0, 0, 0, 1, 2, 2, 2, 3, 4]
    assert two.areas[[3, 7, 8]].tolist() == [0, 0, 0]
    ring = irregular_mesh(9)
    assert ring.components.max() == 1  # the ground, and the vertex in the middle of its hole


@pytest.mark.parametrize("first", range(4))
def test_concave_quad_keeps_its_area(first: int) -> None:
    dart = np.array([[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0]], dtype=float)
    corners = np.roll(np.arange(4), first)
    mesh = TriMesh.from_polygons(dart, [4], corners)
    assert mesh._projected_face_areas().min() > 0
    assert mesh.areas.sum() == pytest.approx(4.0)
    assert mesh.polygons is not None
    assert mesh.polygons.indices.tolist() == corners.tolist()


@pytest.mark.parametrize("sides", [3, 5, 8])
def test_polygons_are_cut_in_order_and_kept(sides: int) -> None:
    angle = 2 * np.pi * np.arange(sides) / sides
    points = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    mesh = TriMesh.from_polygons(
        np.vstack((points, points + np.array([5.0, 0.0, 0.0]))),
        [sides, sides],
        np.arange(2 * sides),
    )
    assert len(mesh.faces) == 2 * (sides - 2)
    assert mesh.faces[: sides - 2].max() < sides <= mesh.faces[sides - 2 :].min()
    assert mesh.areas.sum() == pytest.approx(sides * np.sin(2 * np.pi / sides))


def test_planet_is_as_large_as_a_planet() -> None:
    size = 24
    sphere = _sphere(size)
    mesh = TriMesh(sphere, _sphere_faces(sphere), up="radial")
    assert mesh.areas.sum() == pytest.approx(4 * np.pi, rel=0.03)
    assert not mesh.is_boundary.any()
    assert np.allclose(mesh.heights, 1.0)
    higher = mesh.raised(np.full(len(sphere), 0.5))
    assert np.allclose(higher.heights, 1.5)
    assert higher.areas.sum() == pytest.approx(1.5**2 * mesh.areas.sum())


def _sphere(size: int) -> np.ndarray:
    """Return points of an octahedron, refined and pushed out."""
    points = {
        (i, j, k)
        for i in range(-size, size + 1)
        for j in range(-size, size + 1)
        for k in (size - abs(i) - abs(j), abs(i) + abs(j) - size)
        if abs(i) + abs(j) <= size
    }
    array = np.array(sorted(points), dtype=float)
    return array / np.linalg.norm(array, axis=1, keepdims=True)


def _sphere_faces(points: np.ndarray) -> np.ndarray:
    scipy = pytest.importorskip("scipy.spatial")
    hull = scipy.ConvexHull(points)
    faces = hull.simplices
    normal = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    inward = (normal * points[faces].mean(axis=1)).sum(axis=1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


def test_heightfield_as_mesh_keeps_place_layers_and_quads() -> None:
    terrain = Heightfield(
        np.arange(6.0).reshape(2, 3), 10.0, (100.0, 50.0), layers={"rain": np.ones((2, 3))}
    )
    mesh = terrain.to_mesh()
    assert mesh.vertices[0].tolist() == [100.0, 50.0, 0.0]
    assert mesh.vertices[-1].tolist() == [120.0, 40.0, 5.0]
    assert mesh.layer("rain").tolist() == [1.0] * 6
    assert mesh.polygons is not None
    assert mesh.polygons.counts.tolist() == [4, 4]
    assert mesh._projected_face_areas().min() > 0


def test_meshes_share_what_did_not_change() -> None:
    mesh = irregular_mesh()
    _ = mesh.graph, mesh.areas
    painted = mesh.with_layers(wetness=np.zeros(len(mesh.vertices)))
    assert painted.graph is mesh.graph
    assert "wetness" not in mesh
    lifted = mesh.raised(np.ones(len(mesh.vertices)))
    assert lifted.areas is mesh.areas
    assert np.allclose(lifted.elevation, mesh.elevation + 1)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 0


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (SQUARE[:, :2], [[0, 1, 2]], "shape"),
        (SQUARE * np.nan, [[0, 1, 2]], "vertex 0"),
        (SQUARE, [[0, 1, 4]], "vertex 4 of 4"),
        (SQUARE, [[0, 1, -1]], "vertex -1 of 4"),
        (SQUARE, np.zeros((0, 3), int), "no faces"),
        (SQUARE, [[0.0, 1.0, 2.0]], "integer"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices: object, faces: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        TriMesh(vertices, faces)  # type: ignore[arg-type]


def test_up_needs_a_direction() -> None:
    for up in ((0, 0, 0), (np.nan, 0, 1), (1, 0)):
        with pytest.raises(InputError, match="up"):
            TriMesh(SQUARE, [[0, 1, 2]], up=up)  # type: ignore[arg-type]


def test_elevation_is_no_layer_to_set() -> None:
    mesh = TriMesh(SQUARE, [[0, 1, 2]])
    with pytest.raises(InputError, match="raised"):
        mesh.with_layers(elevation=np.zeros(4))
    with pytest.raises(InputError, match="4 vertices"):
        mesh.with_layers(rain=np.zeros(3))
