"""What lands in an OBJ is read back by a parser that shares nothing with the writer."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from terrakit.errors import InputError, OutputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.running import Run
from terrakit_files.obj import Obj
from terrakit_files.obj.text import decimals, joined


def parse(path: Path) -> dict[str, list]:
    """Read an OBJ line by line, in float64."""
    found: dict[str, list] = {k: [] for k in ("v", "vt", "vn", "f", "g", "#", "mtllib", "usemtl")}
    for line in path.read_text(encoding="utf-8").split("\n"):
        word, _, rest = line.partition(" ")
        if word in ("v", "vt", "vn"):
            found[word].append([float(number) for number in rest.split(" ")])
        elif word == "f":
            found["f"].append([[int(i) for i in c.split("/")] for c in rest.split(" ")])
        elif word:
            found.setdefault(word, []).append(rest)
    return found


def rough(rows: int, cols: int, **grid) -> Heightfield:
    rng = np.random.default_rng(3)
    return Heightfield(rng.normal(0, 300, (rows, cols)), **{"spacing": 2.5, **grid})


@pytest.mark.parametrize(
    "scale", [0.0, 1e-30, 1e-8, 1e-5, 1e-4, 1e-2, 1.0, 10.0, 1e3, 1e5, 1e6, 1e7, 1e12, 3e37]
)
def test_decimals_read_back_as_the_same_float32(scale):
    rng = np.random.default_rng(1)
    values = (rng.standard_normal(5000) * scale).astype(np.float32)
    edges = [0, -0.0, 1, 0.1, 99999.995, 0.99999999, 9999999.5, 1e-4, 9.9999997e-5, 1e7, 123456.7]
    values = np.concatenate((values, np.float32(edges), -np.float32(edges)))
    ended = np.concatenate((decimals(values), np.full((values.size, 1), 32, np.uint8)), axis=1)
    words = joined(ended).split()
    assert len(words) == values.size
    assert np.array_equal(np.array([float(w) for w in words], np.float32), values)
    assert all(re.fullmatch(rb"-?\d+(\.\d*[1-9])?(e[-+]\d+)?", word) for word in words)


def test_decimals_are_nine_digits_of_printf():
    values = np.float32([1234.5678, -0.1, 3.14159274, 65536.5, 0.001])
    assert joined(np.pad(decimals(values), ((0, 0), (0, 1)), constant_values=32)).split() == [
        b"%.9g" % float(value) for value in values
    ]


def test_every_coordinate_is_float32_exact_and_y_up(tmp_path):
    terrain = rough(37, 23)
    obj = parse(Obj().export(terrain, tmp_path / "a.obj", Run())[0])
    x, y, z = np.array(obj["v"], np.float32).T
    row, col = np.divmod(np.arange(37 * 23), 23)
    assert np.array_equal(x, (col * 2.5).astype(np.float32))
    assert np.array_equal(y, terrain.elevation.ravel())
    assert np.array_equal(z, -((36 - row) * 2.5).astype(np.float32))


def test_z_up_keeps_east_and_north(tmp_path):
    terrain = rough(5, 4)
    obj = parse(Obj(up="z").export(terrain, tmp_path / "a.obj", Run())[0])
    x, y, z = np.array(obj["v"], np.float32).T
    assert np.array_equal(z, terrain.elevation.ravel())
    assert (x[3], y[3]) == (7.5, 10.0)
    assert any("Forward Axis Y" in note for note in obj["#"])


def test_faces_are_quads_counter_clockwise_from_above(tmp_path):
    terrain = rough(4, 3)
    obj = parse(Obj(up="z").export(terrain, tmp_path / "a.obj", Run())[0])
    vertices = np.array(obj["v"])
    faces = np.array(obj["f"])
    assert faces.shape == (6, 4, 2)
    assert np.array_equal(faces[..., 0], faces[..., 1])
    corner = vertices[faces[..., 0] - 1][..., :2]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 1]
    assert (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] > 0).all()
    assert len({tuple(sorted(face[:, 0])) for face in faces}) == 6


@pytest.mark.parametrize("cols", [9, 10, 99, 317])
def test_faces_stay_right_where_indices_grow_a_digit(tmp_path, cols):
    terrain = Heightfield(np.zeros((340, cols)), 1.0)
    obj = parse(Obj().export(terrain, tmp_path / "a.obj", Run())[0])
    faces = np.array(obj["f"])[..., 0] - 1
    row, col = np.divmod(np.arange(339 * (cols - 1)), cols - 1)
    north_west = row * cols + col
    assert np.array_equal(
        faces,
        np.stack((north_west, north_west + cols, north_west + cols + 1, north_west + 1), axis=1),
    )


def test_texture_coordinates_and_material(tmp_path):
    terrain = rough(5, 3)
    files = Obj().export(terrain, tmp_path / "my hill.obj", Run())
    assert [f.name for f in files] == ["my hill.obj", "my_hill.mtl", "my_hill_color.png"]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(f.name for f in files)
    obj = parse(files[0])
    u, v = np.array(obj["vt"]).T
    assert (u[0], v[0]) == (0.0, 1.0)
    assert (u[2], v[2]) == (1.0, 1.0)
    assert (u[-3], v[-3]) == (0.0, 0.0)
    assert obj["mtllib"] == ["my_hill.mtl"]
    assert not obj["vn"]
    assert not obj["g"]
    material = files[1].read_text()
    assert "map_Kd my_hill_color.png" in material
    assert "Pr 0.9" in material
    with Image.open(files[2]) as picture:
        assert picture.size == (2, 4)


def test_albedo_spike_is_in_the_same_corner_of_texture_and_mesh(tmp_path):
    flat = np.zeros((33, 33), np.float32)
    spike, red = flat.copy(), flat.copy()
    spike[0, -1] = 100.0
    red[:8, -8:] = 1.0
    terrain = Heightfield(
        spike, 4.0, layers={"albedo_red": red, "albedo_green": flat, "albedo_blue": flat}
    )
    files = Obj().export(terrain, tmp_path / "a.obj", Run())
    obj = parse(files[0])
    top = int(np.argmax(np.array(obj["v"])[:, 1]))
    assert obj["v"][top] == [128.0, 100.0, -128.0]
    assert obj["vt"][top] == [1.0, 1.0]
    with Image.open(files[2]) as picture:
        assert picture.getpixel((31, 0)) == (255, 0, 0)
        assert picture.getpixel((0, 31)) == (0, 0, 0)
        assert picture.getpixel((0, 0)) == (0, 0, 0)


def test_far_terrain_moves_to_the_origin_and_says_so(tmp_path):
    terrain = rough(5, 5, spacing=0.25, origin=(412345.25, 5412001.0), crs="EPSG:32632")
    obj = parse(Obj().export(terrain, tmp_path / "a.obj", Run())[0])
    vertices = np.array(obj["v"])
    assert np.array_equal(vertices[0, [0, 2]], [0.0, -1.0])
    notes = " ".join(obj["#"])
    assert "add 412345.25 to east and 5412000 to north" in notes
    assert "EPSG:32632" in notes
    stays = parse(Obj(placement="world").export(terrain, tmp_path / "b.obj", Run())[0])
    assert stays["v"][0][0] == np.float32(412345.25)
    near = rough(5, 5, origin=(100.0, 200.0))
    assert parse(Obj().export(near, tmp_path / "c.obj", Run())[0])["v"][0][0] == 100.0
    moved = Obj(placement="local").export(near, tmp_path / "d.obj", Run())
    assert parse(moved[0])["v"][0][0] == 0.0


def test_mesh_keeps_its_polygons_and_colours(tmp_path):
    points = np.array([[0, 0, 0], [2, 0, 1.1], [2, 2, 2], [0, 2, 3], [1, 3, 4], [3, 1, 5.5]])
    counts, indices = [4, 3, 3], [0, 1, 2, 3, 3, 2, 4, 1, 5, 2]
    colour = np.linspace(0, 1, 6)
    mesh = TriMesh.from_polygons(
        points,
        counts,
        indices,
        {"albedo_red": colour, "albedo_green": colour, "albedo_blue": colour},
    )
    files = Obj(up="z").export(mesh, tmp_path / "m.obj", Run())
    assert [f.name for f in files] == ["m.obj", "m.mtl"]
    obj = parse(files[0])
    assert [[c[0] - 1 for c in face] for face in obj["f"]] == [[0, 1, 2, 3], [3, 2, 4], [1, 5, 2]]
    read = np.array(obj["v"])
    assert np.array_equal(read[:, :3].astype(np.float32), points.astype(np.float32))
    assert np.allclose(read[:, 3], [0, 0.4845, 0.6652, 0.7977, 0.9063, 1], atol=0.003)
    bare = parse(Obj(texture=False).export(mesh, tmp_path / "n.obj", Run())[0])
    assert len(bare["v"][0]) == 3
    assert bare["v"][1] == pytest.approx([2, 1.1, 0])


def test_mesh_of_triangles_in_many_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr("terrakit_files.obj.BLOCK", 7)
    mesh = rough(6, 5).to_mesh()
    bare = TriMesh(mesh.vertices, mesh.faces)
    for surface, corners in ((mesh, mesh.polygons.indices.reshape(-1, 4)), (bare, mesh.faces)):
        obj = parse(Obj().export(surface, tmp_path / "m.obj", Run())[0])
        faces = np.array(obj["f"])[..., 0] - 1
        assert np.array_equal(faces, corners)
    grid = parse(Obj().export(rough(6, 5), tmp_path / "g.obj", Run())[0])
    assert np.array_equal(np.array(grid["f"])[..., 0] - 1, mesh.polygons.indices.reshape(-1, 4))


def test_same_bytes_twice(tmp_path):
    terrain = rough(40, 50)
    one = Obj().export(terrain, tmp_path / "a.obj", Run(seed=7))
    first = [file.read_bytes() for file in one]
    assert b"seed 7" in first[0]
    assert [f.read_bytes() for f in Obj().export(terrain, tmp_path / "a.obj", Run(seed=7))] == first


def test_refusals(tmp_path):
    with pytest.raises(InputError, match="at least 2x2"):
        Obj().export(Heightfield(np.zeros((1, 5)), 1.0), tmp_path / "a.obj", Run())
    with pytest.raises(InputError, match="2,500,000,000 vertices >"):
        Obj().check(Grid((50_000, 50_000), 1.0))
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        Obj().export(rough(3, 3), tmp_path / "folder.obj", Run())
    assert [p.name for p in tmp_path.iterdir()] == ["folder.obj"]


def test_cancel_leaves_nothing(tmp_path):
    from terrakit.errors import Cancelled

    run = Run()
    run.cancel()
    with pytest.raises(Cancelled):
        Obj().export(rough(9, 9), tmp_path / "a.obj", run)
    assert not list(tmp_path.iterdir())


def test_a_million_vertices_take_seconds_not_minutes(tmp_path):
    terrain = rough(1025, 1025)
    started = time.process_time()
    Obj(texture=False).export(terrain, tmp_path / "a.obj", Run())
    assert time.process_time() - started < 5.0
