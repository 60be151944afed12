"""Blender itself imports the OBJ with its default settings."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from terrakit.heightfield import Heightfield  # noqa: E402
from terrakit.running import Run  # noqa: E402
from terrakit_files.obj import Obj  # noqa: E402


@pytest.fixture(autouse=True)
def _empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def spiked(**grid):
    values = np.zeros((33, 49), np.float32)
    values[0, -1] = 100.0
    colour = np.full(values.shape, 0.25, np.float32)
    colour[:16] = 0.75
    layers = dict.fromkeys(("albedo_red", "albedo_green", "albedo_blue"), colour)
    return Heightfield(values, 4.0, layers=layers, **grid)


def imported(path, **settings):
    bpy.ops.wm.obj_import(filepath=str(path), **settings)
    (found,) = bpy.context.selected_objects
    return found


def world_vertices(found):
    flat = np.empty(len(found.data.vertices) * 3, np.float32)
    found.data.attributes["position"].data.foreach_get("vector", flat)
    matrix = np.array(found.matrix_world)
    return flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


@pytest.mark.parametrize(
    ("up", "settings"), [("y", {}), ("z", {"forward_axis": "Y", "up_axis": "Z"})]
)
def test_spike_is_north_east_and_up(tmp_path, up, settings):
    files = Obj(up=up).export(spiked(), tmp_path / "spike.obj", Run())
    found = imported(files[0], **settings)
    vertices = world_vertices(found)
    assert len(vertices) == 33 * 49
    assert np.allclose(vertices[np.argmax(vertices[:, 2])], (192, 128, 100), atol=1e-3)
    assert np.allclose(vertices[48], (192, 128, 100), atol=1e-3)  # the order is kept
    assert np.allclose(vertices.min(axis=0), 0, atol=1e-3)
    normal = np.array(found.matrix_world)[:3, :3] @ np.mean(
        [polygon.normal for polygon in found.data.polygons], axis=0
    )
    assert normal[2] > 0.9
    assert all(len(polygon.vertices) == 4 for polygon in found.data.polygons)
    assert all(polygon.use_smooth for polygon in found.data.polygons)
    assert not found.data.has_custom_normals


def test_uv_material_and_texture_are_bound(tmp_path):
    files = Obj().export(spiked(), tmp_path / "my hill.obj", Run())
    found = imported(files[0])
    (uv,) = found.data.uv_layers
    spike_corners = [loop.index for loop in found.data.loops if loop.vertex_index == 48]
    assert [tuple(uv.data[i].uv) for i in spike_corners] == [(1.0, 1.0)] * len(spike_corners)

    (slot,) = found.material_slots
    nodes = slot.material.node_tree.nodes
    (shader,) = (node for node in nodes if node.type == "BSDF_PRINCIPLED")
    assert shader.inputs["Roughness"].default_value == pytest.approx(0.9)
    (link,) = shader.inputs["Base Color"].links
    image = link.from_node.image
    assert tuple(image.size) == (48, 32)
    assert image.colorspace_settings.name == "sRGB"
    pixels = np.array(image.pixels[:]).reshape(32, 48, 4)  # the first row is the south
    assert pixels[-1, 0, 0] == pytest.approx(225 / 255, abs=0.01)
    assert pixels[0, 0, 0] == pytest.approx(137 / 255, abs=0.01)


def test_far_terrain_arrives_near_the_origin(tmp_path):
    files = Obj().export(spiked(origin=(5e5, 5.2e6)), tmp_path / "far.obj", Run())
    vertices = world_vertices(imported(files[0]))
    assert np.allclose(vertices[48], (192, 128, 100), atol=1e-3)


def test_mesh_with_vertex_colours(tmp_path):
    files = Obj().export(spiked().to_mesh(), tmp_path / "mesh.obj", Run())
    found = imported(files[0])
    assert np.allclose(world_vertices(found)[48], (192, 128, 100), atol=1e-3)
    colours = found.data.color_attributes["Color"]
    assert colours.data[0].color[0] == pytest.approx(0.75, abs=0.01)
    assert colours.data[33 * 49 - 1].color[0] == pytest.approx(0.25, abs=0.01)
