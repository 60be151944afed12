"""A real Blender opens the stage with its default settings and nothing needs to be put right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit_usd import Usd

bpy = pytest.importorskip("bpy")
pytest.importorskip("pxr")

ROWS, COLS, SPACING = 9, 13, 2.0
EAST, NORTH = (COLS - 1) * SPACING, (ROWS - 1) * SPACING


def spiked(**settings) -> Heightfield:
    elevation = np.zeros((ROWS, COLS))
    elevation[0, -1] = 30.0
    row, col = np.mgrid[:ROWS, :COLS]
    layers = {
        "mask_rock": row / ROWS + col / 100,
        "albedo_red": col / COLS,
        "albedo_green": row / ROWS,
        "albedo_blue": np.full((ROWS, COLS), 0.25),
    }
    return Heightfield(elevation, SPACING, layers=layers, **settings)


def imported(folder: Path, surface, name: str, **settings):
    """Return the one object that Blender makes of the file."""
    path = Usd(**settings).export(surface, folder / name, Run())[0]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.ops.wm.usd_import(filepath=str(path)) == {"FINISHED"}
    (thing,) = bpy.data.objects
    return thing


def world_positions(thing) -> np.ndarray:
    matrix = np.array(thing.matrix_world)
    local = np.array([vertex.co for vertex in thing.data.vertices], dtype=np.float64)
    return local @ matrix[:3, :3].T + matrix[:3, 3]


CASES = [
    ("alps.usdc", {}),
    ("alps.usda", {}),
    ("alps.usdz", {}),
    ("alps.usdc", {"up": "y"}),
    ("alps.usdc", {"normals": False}),
]


@pytest.mark.parametrize(("name", "settings"), CASES)
@pytest.mark.parametrize("as_mesh", [False, True])
def test_spike_and_faces_stand_right(tmp_path, name, settings, as_mesh):
    surface = spiked().to_mesh() if as_mesh else spiked()
    thing = imported(tmp_path, surface, name, **settings)
    assert thing.type == "MESH"
    assert thing.name == "alps"
    where = world_positions(thing)
    np.testing.assert_allclose(where[where[:, 2].argmax()], [EAST, NORTH, 30.0], atol=1e-5)
    np.testing.assert_allclose(where.min(axis=0), [0.0, 0.0, 0.0], atol=1e-5)

    turn = np.array(thing.matrix_world)[:3, :3]
    normals = np.array([polygon.normal for polygon in thing.data.polygons]) @ turn.T
    assert normals[:, 2].min() > 0
    shading = np.array([corner.vector for corner in thing.data.corner_normals]) @ turn.T
    assert shading[:, 2].min() > 0
    assert {len(polygon.vertices) for polygon in thing.data.polygons} == {4}
    assert not thing.data.validate()


def test_uv_runs_from_south_west_to_north_east(tmp_path):
    thing = imported(tmp_path, spiked(), "alps.usdc")
    (layer,) = thing.data.uv_layers
    where = world_positions(thing)
    for loop, uv in zip(thing.data.loops, layer.uv, strict=True):
        x, y, _ = where[loop.vertex_index]
        np.testing.assert_allclose(uv.vector, [x / EAST, y / NORTH], atol=1e-6)


@pytest.mark.parametrize("name", ["alps.usdc", "alps.usdz"])
def test_material_shows_the_texture(tmp_path, name):
    thing = imported(tmp_path, spiked(), name)
    (material,) = thing.data.materials
    nodes = {node.type: node for node in material.node_tree.nodes}
    image = nodes["TEX_IMAGE"].image
    assert image.has_data or image.packed_file or Path(bpy.path.abspath(image.filepath)).exists()
    assert tuple(image.size) == (COLS - 1, ROWS - 1)  # a pixel a cell
    assert image.colorspace_settings.name == "sRGB"
    assert nodes["TEX_IMAGE"].extension == "EXTEND"
    assert nodes["UVMAP"].uv_map == thing.data.uv_layers[0].name
    principled = nodes["BSDF_PRINCIPLED"].inputs
    assert principled["Base Color"].links[0].from_node == nodes["TEX_IMAGE"]
    assert principled["Roughness"].default_value == pytest.approx(0.9)

    # Blender counts rows of pixels from the bottom: the last is the north
    pixels = np.array(image.pixels[:]).reshape(ROWS - 1, COLS - 1, 4)
    assert pixels[0, 0, 1] > pixels[-1, 0, 1] + 0.1  # green falls northwards
    assert pixels[0, -1, 0] > pixels[0, 0, 0] + 0.1  # red rises eastwards


def test_mesh_shows_the_colours_of_its_vertices(tmp_path):
    mesh = spiked().to_mesh()
    thing = imported(tmp_path, mesh, "alps.usdc")
    (material,) = thing.data.materials
    nodes = {node.type: node for node in material.node_tree.nodes}
    color = nodes["BSDF_PRINCIPLED"].inputs["Base Color"].links[0].from_node
    assert color.attribute_name == "displayColor"
    found = np.array([item.color for item in thing.data.attributes["displayColor"].data])
    np.testing.assert_allclose(found[:, 0], mesh.layer("albedo_red"), atol=1e-6)


@pytest.mark.parametrize("as_mesh", [False, True])
def test_mask_is_a_float_attribute(tmp_path, as_mesh):
    surface = spiked().to_mesh() if as_mesh else spiked()
    thing = imported(tmp_path, surface, "alps.usdc")
    attribute = thing.data.attributes["mask_rock"]
    assert (attribute.data_type, attribute.domain) == ("FLOAT", "POINT")
    found = np.zeros(ROWS * COLS, dtype=np.float32)
    attribute.data.foreach_get("value", found)
    np.testing.assert_array_equal(found, surface.layer("mask_rock").ravel())


def test_utm_terrain_is_in_view(tmp_path):
    utm = spiked(origin=(500_000.0, 4_100_000.0), crs="EPSG:32632")
    where = world_positions(imported(tmp_path, utm, "alps.usdc"))
    np.testing.assert_allclose(where[where[:, 2].argmax()], [EAST, NORTH, 30.0], atol=1e-5)


def test_tile_keeps_its_place(tmp_path):
    tile = spiked(origin=(20_000.0, 30_000.0))
    where = world_positions(imported(tmp_path, tile, "alps.usdc"))
    spike = where[where[:, 2].argmax()]
    np.testing.assert_allclose(spike, [20_000.0 + EAST, 30_000.0, 30.0], atol=1e-2)
