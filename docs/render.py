"""Render a terrain as a model on a table: ``python docs/render.py TERRAIN.usdc PICTURE.webp``.

Needs Blender as a Python module (``pip install bpy pillow``). The USD file is imported with
Blender's default settings; everything else here is table, light and camera.
"""

from __future__ import annotations

import argparse
import io
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray
from PIL import Image

LARGEST_FILE = 400_000
THICKNESS = 0.045
"""Rock below the lowest point, of the terrain's longer side."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Rim:
    """The border of the terrain: edges as pairs of points."""

    start: Points
    end: Points


def main() -> None:
    """Render what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("terrain", type=Path, help="a .usda, .usdc or .usdz file")
    parser.add_argument("picture", type=Path, help="a .webp, .jpg or .png file")
    parser.add_argument("--exaggeration", type=float, default=1.0, help="factor on heights")
    parser.add_argument("--sea-level", type=float, help="height of a sea, metres")
    parser.add_argument("--view", type=float, default=200.0, help="where the camera is, degrees")
    parser.add_argument("--pitch", type=float, default=31.0, help="how far it looks down, degrees")
    parser.add_argument("--zoom", type=float, default=1.0, help="over 1 is closer")
    parser.add_argument("--sun", type=float, default=264.0, help="where the sun is, degrees")
    parser.add_argument("--sun-height", type=float, default=28.0, help="above the horizon, degrees")
    parser.add_argument("--size", type=int, nargs=2, default=(1600, 900), help="pixels")
    parser.add_argument("--samples", type=int, default=48)
    chosen = parser.parse_args()

    bpy.ops.wm.read_factory_settings(use_empty=True)
    points, rims = import_terrain(chosen.terrain, chosen.exaggeration)
    low, high = points.min(axis=0), points.max(axis=0)
    side = max(high[0] - low[0], high[1] - low[1])
    floor = low[2] - THICKNESS * side
    add_walls(rims, floor, side)
    if chosen.sea_level is not None:
        add_sea(rims, chosen.sea_level * chosen.exaggeration, low, high)
    add_table(floor, side)
    add_light(chosen.sun, chosen.sun_height)
    standing = np.concatenate((points, *(rim.start * (1, 1, 0) + (0, 0, floor) for rim in rims)))
    add_camera(standing, chosen.view, chosen.pitch, chosen.zoom, chosen.size)
    save(render(chosen.size, chosen.samples), chosen.picture)


def import_terrain(path: Path, exaggeration: float) -> tuple[Points, list[Rim]]:
    """Import the stage around the world's origin; return its points and its borders."""
    bpy.ops.wm.usd_import(filepath=str(path.resolve()))
    meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
    if not meshes:
        raise SystemExit(f"{path}: there is no mesh in it")
    for thing in meshes:
        placed = Matrix.Diagonal((1.0, 1.0, exaggeration, 1.0)) @ thing.matrix_world
        thing.parent = None
        thing.matrix_world = placed
    bpy.context.view_layer.update()
    everything = np.concatenate([world_points(thing) for thing in meshes])
    low, high = everything.min(axis=0), everything.max(axis=0)

    # Shaders and shadows are exact only near the origin
    middle = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0])
    for thing in meshes:
        thing.matrix_world = Matrix.Translation(-Vector(middle)) @ thing.matrix_world
    bpy.context.view_layer.update()
    for material in bpy.data.materials:
        finish(material)
    return everything - middle, [rim_of(thing) for thing in meshes]


def finish(material: bpy.types.Material) -> None:
    """Give the ground a broken-up sheen and smooth sampling of its texture."""
    for node in material.node_tree.nodes:
        if node.type == "TEX_IMAGE":
            node.interpolation = "Cubic"
        if node.type == "BSDF_PRINCIPLED":
            node.inputs["Specular IOR Level"].default_value = 0.25


def world_points(thing: bpy.types.Object) -> Points:
    """Return the vertices of a mesh in world coordinates."""
    flat = np.empty(3 * len(thing.data.vertices), dtype=np.float32)
    thing.data.attributes["position"].data.foreach_get("vector", flat)
    matrix = np.array(thing.matrix_world)
    return flat.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def rim_of(thing: bpy.types.Object) -> Rim:
    """Return the edges that belong to a single face."""
    mesh = thing.data
    edge_of_corner = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("edge_index", edge_of_corner)
    ends = np.empty(2 * len(mesh.edges), dtype=np.int32)
    mesh.edges.foreach_get("vertices", ends)
    faces = np.bincount(edge_of_corner, minlength=len(mesh.edges))
    chosen = ends.reshape(-1, 2)[faces == 1]
    points = world_points(thing)
    return Rim(points[chosen[:, 0]], points[chosen[:, 1]])


def add_walls(rims: list[Rim], floor: float, side: float) -> None:
    """Make the terrain a solid block: rock from its border down to the table."""
    rock = new_material("Rock", (0.075, 0.062, 0.054), 0.85)
    tree = rock.node_tree
    place = tree.nodes.new("ShaderNodeNewGeometry")
    stretch = tree.nodes.new("ShaderNodeVectorMath")
    stretch.operation = "MULTIPLY"
    stretch.inputs[1].default_value = (3.0 / side, 3.0 / side, 90.0 / side)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.0
    noise.inputs["Detail"].default_value = 5.0
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.35, 0.68
    ramp.color_ramp.elements[0].color = (0.12, 0.095, 0.078, 1.0)
    ramp.color_ramp.elements[1].color = (0.30, 0.245, 0.20, 1.0)
    tree.links.new(place.outputs["Position"], stretch.inputs[0])
    tree.links.new(stretch.outputs[0], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    for rim in rims:
        down_start, down_end = rim.start.copy(), rim.end.copy()
        down_start[:, 2] = down_end[:, 2] = floor
        add_quads("Walls", (rim.start, down_start, down_end, rim.end), rock)


def add_sea(rims: list[Rim], level: float, low: Points, high: Points) -> None:
    """Add clear water between the ground and ``level``, closed at the border."""
    water = new_material("Water", (0.012, 0.07, 0.095), 0.06)
    shader = water.node_tree.nodes["Principled BSDF"]
    shader.inputs["Alpha"].default_value = 0.86
    shader.inputs["IOR"].default_value = 1.33
    corners = [np.array([[x, y, level]]) for x, y in ((low[0], low[1]), (high[0], low[1]))]
    corners += [np.array([[x, y, level]]) for x, y in ((high[0], high[1]), (low[0], high[1]))]
    add_quads("Sea", tuple(corners), water)
    for rim in rims:
        wet = np.minimum(rim.start[:, 2], rim.end[:, 2]) < level
        start, end = rim.start[wet], rim.end[wet]
        top_start, top_end = start.copy(), end.copy()
        top_start[:, 2] = np.maximum(start[:, 2], level)
        top_end[:, 2] = np.maximum(end[:, 2], level)
        add_quads("Shore", (top_start, start, end, top_end), water)


def add_table(floor: float, side: float) -> None:
    """Add a pale table far larger than the picture."""
    table = new_material("Table", (0.72, 0.70, 0.665), 0.75)
    reach = 40.0 * side
    at = [(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)]
    add_quads("Table", tuple(np.array([[x, y, floor]]) for x, y in at), table)


def add_light(azimuth: float, height: float) -> None:
    """Add a warm low sun and the blue sky that belongs to it."""
    scene = bpy.context.scene
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy = 4.6
    lamp.color = (1.0, 0.87, 0.71)
    lamp.angle = math.radians(1.6)
    sun = bpy.data.objects.new("Sun", lamp)
    scene.collection.objects.link(sun)
    sun.rotation_euler = (-direction(azimuth, height)).to_track_quat("-Z", "Y").to_euler()

    world = bpy.data.worlds.new("Sky")
    scene.world = world
    tree = world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "SINGLE_SCATTERING"
    sky.sun_disc = False
    sky.sun_elevation = math.radians(height)
    sky.sun_rotation = math.radians(azimuth)
    background = tree.nodes["Background"]
    background.inputs["Strength"].default_value = 0.16
    pale = tree.nodes.new("ShaderNodeHueSaturation")  # the table bounces less blue than the sky
    pale.inputs["Saturation"].default_value = 0.5
    tree.links.new(sky.outputs[0], pale.inputs["Color"])
    tree.links.new(pale.outputs[0], background.inputs["Color"])


def add_camera(
    points: Points, azimuth: float, pitch: float, zoom: float, size: Sequence[int]
) -> None:
    """Stand back just so far that every point is in the picture."""
    scene = bpy.context.scene
    lens = bpy.data.cameras.new("Camera")
    lens.lens = 62.0
    camera = bpy.data.objects.new("Camera", lens)
    scene.collection.objects.link(camera)
    scene.camera = camera
    turn = direction(azimuth, pitch).to_track_quat("Z", "Y")
    camera.rotation_euler = turn.to_euler()

    # A point at (x, depth z) is in the frame if |x - cx| <= half * (distance - z)
    seen = points @ np.array(turn.to_matrix())
    half = 0.94 * lens.sensor_width / 2.0 / lens.lens
    place, distance = [], 0.0
    for along, share in ((seen[:, 0], half), (seen[:, 1], half * size[1] / size[0])):
        most = float((along + share * seen[:, 2]).max())
        least = float((-along + share * seen[:, 2]).max())
        place.append((most - least) / 2.0)
        distance = max(distance, (most + least) / (2.0 * share))
    camera.location = turn @ Vector((*place, distance))
    lens.lens *= zoom
    lens.clip_start, lens.clip_end = distance / 1000.0, distance * 1000.0


def direction(azimuth: float, height: float) -> Vector:
    """Return the unit vector towards a compass bearing and a height above the horizon."""
    bearing, above = math.radians(azimuth), math.radians(height)
    flat = math.cos(above)
    return Vector((flat * math.sin(bearing), flat * math.cos(bearing), math.sin(above)))


def new_material(
    name: str, color: tuple[float, float, float], roughness: float
) -> bpy.types.Material:
    """Return a plain material."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    return material


def add_quads(name: str, corners: Sequence[Points], material: bpy.types.Material) -> None:
    """Add one mesh of separate quads; ``corners`` are four arrays of equal length."""
    count = len(corners[0])
    if count == 0:
        return
    vertices = np.stack(corners, axis=1).reshape(-1, 3).astype(np.float32)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(4 * count)
    mesh.attributes["position"].data.foreach_set("vector", vertices.ravel())
    mesh.loops.add(4 * count)
    mesh.attributes[".corner_vert"].data.foreach_set("value", np.arange(4 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def render(size: Sequence[int], samples: int) -> Image.Image:
    """Render with Cycles on the processor."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.adaptive_threshold = 0.02
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.max_bounces = 4
    scene.cycles.diffuse_bounces = 2
    scene.cycles.seed = 0
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    scene.view_settings.exposure = 0.2
    scene.render.image_settings.file_format = "PNG"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        with Image.open(scene.render.filepath) as picture:
            return picture.convert("RGB")


def save(picture: Image.Image, path: Path) -> None:
    """Save the picture, at the best quality that keeps it below 400 kB where the format allows."""
    if path.suffix.lower() == ".png":
        picture.save(path, optimize=True)
        return
    for quality in range(92, 20, -6):
        stream = io.BytesIO()
        picture.save(stream, "WEBP" if path.suffix.lower() == ".webp" else "JPEG", quality=quality)
        if stream.tell() < LARGEST_FILE:
            break
    path.write_bytes(stream.getvalue())


if __name__ == "__main__":
    main()
