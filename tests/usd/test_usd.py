"""Stages are valid, stand the right way round, carry every mask, and appear whole or not at all."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from terrakit.errors import InputError, OutputError, ParameterError
from terrakit.heightfield import Heightfield
from terrakit.mesh import TriMesh
from terrakit.running import Run

pytest.importorskip("pxr")

from pxr import Usd as PxrUsd
from pxr import UsdGeom, UsdShade, UsdUtils

from terrakit_usd import Usd, terrakit_exporters

ROWS, COLS, SPACING = 9, 13, 2.0
SUFFIXES = ("usda", "usdc", "usdz")


def spiked(**settings) -> Heightfield:
    """A plain with a spike in the north-east corner, a mask and colours that vary."""
    elevation = np.zeros((ROWS, COLS))
    elevation[0, -1] = 30.0
    row, col = np.mgrid[:ROWS, :COLS]
    layers = {
        "mask_rock": row / ROWS + col / 100,
        "drainage_area": np.arange(ROWS * COLS).reshape(ROWS, COLS),
        "albedo_red": col / COLS,
        "albedo_green": row / ROWS,
        "albedo_blue": np.full((ROWS, COLS), 0.25),
    }
    return Heightfield(elevation, SPACING, layers=layers, **settings)


def surface_of(kind: str):
    terrain = spiked()
    if kind == "heightfield":
        return terrain
    mesh = terrain.to_mesh()
    if kind == "quads":
        return mesh
    if kind == "triangles":
        return TriMesh(mesh.vertices, mesh.faces, dict(mesh.layers))
    corners = [[0, 0, 0], [2, 0, 1], [3, 2, 0], [1, 3, 0], [-1, 2, 0], [9, 9, 9]]
    return TriMesh.from_polygons(corners, [5], [0, 1, 2, 3, 4], {"mask_rock": np.arange(6.0)})


def written(folder: Path, surface, name: str = "alps.usda", **settings) -> PxrUsd.Stage:
    files = Usd(**settings).export(surface, folder / name, Run(seed=7))
    stage = PxrUsd.Stage.Open(str(files[0]))
    stage.Reload()  # USD remembers files by path
    return stage


def mesh_of(stage: PxrUsd.Stage) -> UsdGeom.Mesh:
    (mesh,) = [UsdGeom.Mesh(p) for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
    return mesh


def world_points(stage: PxrUsd.Stage) -> np.ndarray:
    mesh = mesh_of(stage)
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim()))
    points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
    return points @ matrix[:3, :3] + matrix[3, :3]


def face_normals(stage: PxrUsd.Stage) -> np.ndarray:
    mesh = mesh_of(stage)
    points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    starts = np.cumsum(counts) - counts
    a, b, c = (points[indices[starts + k]] for k in range(3))
    return np.cross(b - a, c - a)


def problems(path: Path) -> list[str]:
    """Return everything that OpenUSD's own validators find wrong."""
    try:
        from pxr import UsdValidation
    except ImportError:
        checker = UsdUtils.ComplianceChecker()
        checker.CheckCompliance(str(path))
        return [*checker.GetErrors(), *checker.GetFailedChecks()]
    stage = PxrUsd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    return [error.GetErrorAsString() for error in found]


@pytest.mark.parametrize("kind", ["heightfield", "quads", "triangles", "pentagon"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_stage_is_valid(tmp_path, kind, suffix):
    path = tmp_path / f"alps.{suffix}"
    Usd().export(surface_of(kind), path, Run())
    assert problems(path) == []
    stage = PxrUsd.Stage.Open(str(path))
    mesh = mesh_of(stage)
    arrays = (
        mesh.GetFaceVertexIndicesAttr().Get(),
        mesh.GetFaceVertexCountsAttr().Get(),
        len(mesh.GetPointsAttr().Get()),
    )
    good, why = UsdGeom.Mesh.ValidateTopology(*arrays)
    assert good, why


def test_validators_would_complain(tmp_path):
    path = tmp_path / "bad.usda"
    stage = PxrUsd.Stage.CreateNew(str(path))
    UsdGeom.Mesh.Define(stage, "/A")
    stage.Save()
    assert problems(path)


@pytest.mark.parametrize("up", ["z", "y"])
def test_stage_says_what_a_program_must_know(tmp_path, up):
    stage = written(tmp_path, spiked(), up=up)
    root = stage.GetDefaultPrim()
    assert root.GetName() == "alps"
    assert root.IsA(UsdGeom.Xform)
    assert PxrUsd.ModelAPI(root).GetKind() == "component"
    assert UsdGeom.GetStageUpAxis(stage) == up.upper()
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    mesh = mesh_of(stage)
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert mesh.GetOrientationAttr().Get() == "rightHanded"
    points = np.array(mesh.GetPointsAttr().Get())
    np.testing.assert_array_equal(mesh.GetExtentAttr().Get(), [points.min(0), points.max(0)])


@pytest.mark.parametrize("kind", ["heightfield", "quads", "triangles"])
def test_spike_stands_in_the_north_east(tmp_path, kind):
    points = world_points(written(tmp_path, surface_of(kind)))
    east, north = (COLS - 1) * SPACING, (ROWS - 1) * SPACING
    np.testing.assert_array_equal(points[points[:, 2].argmax()], [east, north, 30.0])
    np.testing.assert_array_equal(points[:, :2].min(axis=0), [0.0, 0.0])


def test_y_up_turns_north_to_minus_z(tmp_path):
    stage = written(tmp_path, spiked(), up="y")
    points = world_points(stage)
    spike = points[points[:, 1].argmax()]
    np.testing.assert_array_equal(spike, [(COLS - 1) * SPACING, 30.0, -(ROWS - 1) * SPACING])
    assert (face_normals(stage)[:, 1] > 0).all()
    assert np.array(mesh_of(stage).GetNormalsAttr().Get())[:, 1].min() > 0


@pytest.mark.parametrize("kind", ["heightfield", "quads", "triangles", "pentagon"])
def test_faces_and_normals_look_up(tmp_path, kind):
    stage = written(tmp_path, surface_of(kind))
    assert (face_normals(stage)[:, 2] > 0).all()
    normals = np.array(mesh_of(stage).GetNormalsAttr().Get())
    assert mesh_of(stage).GetNormalsInterpolation() == "vertex"
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert normals[:, 2].min() > 0


@pytest.mark.parametrize("as_mesh", [False, True])
def test_normals_of_a_plane_are_exact(tmp_path, as_mesh):
    row, col = np.mgrid[:ROWS, :COLS]
    plane = Heightfield(3.0 * col - 1.0 * row, SPACING)  # rises 1.5 to the east, 0.5 to the north
    stage = written(tmp_path, plane.to_mesh() if as_mesh else plane)
    normal = np.array([-1.5, -0.5, 1.0]) / np.sqrt(3.5)
    normals = np.array(mesh_of(stage).GetNormalsAttr().Get())
    np.testing.assert_allclose(normals, np.broadcast_to(normal, normals.shape), atol=1e-6)


def test_normals_can_be_left_out(tmp_path):
    stage = written(tmp_path, spiked(), normals=False)
    assert not mesh_of(stage).GetNormalsAttr().HasValue()


def test_polygons_are_kept(tmp_path):
    counts = {}
    for kind in ("heightfield", "quads", "triangles", "pentagon"):
        stage = written(tmp_path, surface_of(kind))
        counts[kind] = set(mesh_of(stage).GetFaceVertexCountsAttr().Get())
    assert counts == {"heightfield": {4}, "quads": {4}, "triangles": {3}, "pentagon": {5}}


@pytest.mark.parametrize("kind", ["heightfield", "quads"])
def test_texture_coordinates_have_v_1_in_the_north(tmp_path, kind):
    stage = written(tmp_path, surface_of(kind))
    primvar = UsdGeom.PrimvarsAPI(mesh_of(stage)).GetPrimvar("st")
    assert primvar.GetInterpolation() == "vertex"
    assert primvar.GetTypeName() == "texCoord2f[]"
    expected = world_points(stage)[:, :2] / [(COLS - 1) * SPACING, (ROWS - 1) * SPACING]
    np.testing.assert_allclose(primvar.Get(), expected, atol=1e-6)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", ["heightfield", "quads"])
def test_primvars_hold_the_layers(tmp_path, kind, suffix):
    surface = surface_of(kind)
    stage = written(tmp_path, surface, f"alps.{suffix}")
    primvars = UsdGeom.PrimvarsAPI(mesh_of(stage))
    names = {p.GetPrimvarName() for p in primvars.GetAuthoredPrimvars()} - {"st", "displayColor"}
    assert names == {"mask_rock", "drainage_area"}
    for name in names:
        primvar = primvars.GetPrimvar(name)
        assert (primvar.GetTypeName(), primvar.GetInterpolation()) == ("float[]", "vertex")
        np.testing.assert_array_equal(primvar.Get(), surface.layer(name).ravel())


def test_layers_can_be_chosen(tmp_path):
    stage = written(tmp_path, spiked(), layers=["elevation", "mask_rock", "mask_rock"])
    names = {p.GetPrimvarName() for p in UsdGeom.PrimvarsAPI(mesh_of(stage)).GetAuthoredPrimvars()}
    assert names == {"st", "elevation", "mask_rock"}
    with pytest.raises(ParameterError, match=r"no such layer \(did you mean mask_rock\?\)"):
        Usd(layers=["mask_rok"]).export(spiked(), tmp_path / "b.usda", Run())


def test_layer_names_become_valid_and_stay_apart(tmp_path):
    field = np.ones((ROWS, COLS))
    terrain = Heightfield(field, 1.0, layers={"st": field * 2, "my mask": field * 3})
    stage = written(tmp_path, terrain)
    primvars = UsdGeom.PrimvarsAPI(mesh_of(stage))
    assert primvars.GetPrimvar("layer_st").Get()[0] == 2
    assert primvars.GetPrimvar("my_mask").Get()[0] == 3
    clash = terrain.with_layers(**{"my_mask": field})
    with pytest.raises(ParameterError, match="'my mask' and 'my_mask' would both be called"):
        Usd().export(clash, tmp_path / "clash.usda", Run())
    assert not (tmp_path / "clash.usda").exists()


def shaders(stage: PxrUsd.Stage) -> dict[str, UsdShade.Shader]:
    found = [UsdShade.Shader(p) for p in stage.Traverse() if p.IsA(UsdShade.Shader)]
    return {str(shader.GetShaderId()): shader for shader in found}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_texture_is_bound_and_found(tmp_path, suffix):
    stage = written(tmp_path, spiked(), f"alps.{suffix}")
    prim = mesh_of(stage).GetPrim()
    assert prim.HasAPI(UsdShade.MaterialBindingAPI)
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    surface = material.ComputeSurfaceSource()
    surface = surface[0] if isinstance(surface, tuple) else surface
    assert surface.GetShaderId() == "UsdPreviewSurface"
    texture = shaders(stage)["UsdUVTexture"]
    assert texture.GetInput("file").Get().path == "./alps_color.png"
    assert texture.GetInput("file").Get().resolvedPath
    assert texture.GetInput("sourceColorSpace").Get() == "sRGB"
    assert texture.GetInput("wrapS").Get() == texture.GetInput("wrapT").Get() == "clamp"


def test_texture_shows_the_albedo(tmp_path):
    from PIL import Image

    Usd().export(spiked(), tmp_path / "alps.usdc", Run())
    with Image.open(tmp_path / "alps_color.png") as picture:
        pixels = np.array(picture)
    assert pixels.shape == (ROWS - 1, COLS - 1, 3)  # a pixel a cell: the mean of its corners
    corners = spiked().layer("albedo_red").astype(np.float64)
    light = (corners[:-1, :-1] + corners[:-1, 1:] + corners[1:, :-1] + corners[1:, 1:]) / 4
    encoded = np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(pixels[..., 0], np.rint(encoded * 255))
    np.testing.assert_array_equal(pixels[..., 2], 137)


def test_terrain_without_colours_is_tinted_by_height(tmp_path):
    from PIL import Image

    bare = spiked().without_layers("albedo_red")
    Usd().export(bare, tmp_path / "bare.usdc", Run())
    with Image.open(tmp_path / "bare_color.png") as picture:
        pixels = np.array(picture)
    assert pixels.shape == (ROWS - 1, COLS - 1, 3)
    assert (pixels[0, -1] != pixels[-1, 0]).any()


def test_mesh_is_coloured_by_its_vertices(tmp_path):
    mesh = surface_of("triangles")
    stage = written(tmp_path, mesh)
    shown = mesh_of(stage).GetDisplayColorPrimvar()
    assert shown.GetInterpolation() == "vertex"
    np.testing.assert_array_equal(np.array(shown.Get())[:, 0], mesh.layer("albedo_red"))
    assert shaders(stage)["UsdPrimvarReader_float3"].GetInput("varname").Get() == "displayColor"
    assert list(tmp_path.iterdir()) == [tmp_path / "alps.usda"]


def test_texture_can_be_left_out(tmp_path):
    stage = written(tmp_path, spiked(), texture=False)
    assert list(tmp_path.iterdir()) == [tmp_path / "alps.usda"]
    assert shaders(stage) == {}
    assert problems(tmp_path / "alps.usda") == []


@pytest.mark.parametrize("as_mesh", [False, True])
def test_far_terrain_keeps_its_digits(tmp_path, as_mesh):
    far = spiked(origin=(60_000.3, 41_000.7))
    expected = far.to_mesh().vertices
    stage = written(tmp_path, far.to_mesh() if as_mesh else far)
    np.testing.assert_allclose(world_points(stage), expected, atol=1e-5, rtol=0)
    assert np.abs(mesh_of(stage).GetPointsAttr().Get()).max() < 100


def test_utm_terrain_lands_at_the_origin_and_says_so(tmp_path):
    utm = spiked(origin=(500_000.25, 4_100_016.5), crs="EPSG:32632")
    stage = written(tmp_path, utm)
    np.testing.assert_array_equal(world_points(stage)[:, :2].min(axis=0), [0.0, 0.0])
    about = stage.GetDefaultPrim().GetCustomData()["terrakit"]
    assert tuple(about["origin"]) == (500_000.25, 4_100_000.5, 0.0)
    assert about["crs"] == "EPSG:32632"

    there = written(tmp_path, utm, "there.usda", placement="world")
    expected = utm.to_mesh().vertices
    np.testing.assert_allclose(world_points(there), expected, atol=1e-6, rtol=0)
    there = written(tmp_path, utm, "there.usda", placement="world", up="y")
    x, y, z = expected.T
    np.testing.assert_allclose(world_points(there), np.stack((x, z, -y), -1), atol=1e-6, rtol=0)


def test_centred_terrain_moves_only_if_asked(tmp_path):
    centred = spiked(origin=(-12.0, 8.0))
    assert world_points(written(tmp_path, centred))[:, :2].min() == -12.0
    stage = written(tmp_path, centred, placement="local")
    np.testing.assert_array_equal(world_points(stage)[:, :2].min(axis=0), [0.0, 0.0])
    assert tuple(stage.GetDefaultPrim().GetCustomData()["terrakit"]["origin"]) == (-12, -8, 0)


def test_planet_keeps_its_centre_and_looks_outwards(tmp_path):
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    planet = TriMesh(corners * 1000.0, faces, up="radial")
    stage = written(tmp_path, planet)
    np.testing.assert_array_equal(world_points(stage), planet.vertices)
    np.testing.assert_allclose(mesh_of(stage).GetNormalsAttr().Get(), corners, atol=1e-6)
    assert not UsdGeom.PrimvarsAPI(mesh_of(stage)).HasPrimvar("st")
    assert problems(tmp_path / "alps.usda") == []


def test_provenance_is_recorded(tmp_path):
    stage = written(tmp_path, spiked())
    about = stage.GetRootLayer().customLayerData["terrakit"]
    assert about == stage.GetDefaultPrim().GetCustomData()["terrakit"]
    assert about["seed"] == "7"
    assert about["spacing"] == SPACING
    assert tuple(about["samples"]) == (ROWS, COLS)
    assert about["version"]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", ["heightfield", "quads"])
def test_bytes_are_equal_twice(tmp_path, kind, suffix, monkeypatch):
    contents = []
    for folder, now in (("a", 1_000_000_000), ("b", 1_700_000_000)):
        monkeypatch.setattr("time.time", lambda now=now: now)
        files = Usd().export(surface_of(kind), tmp_path / folder / f"alps.{suffix}", Run(seed=7))
        contents.append([file.read_bytes() for file in files])
    assert contents[0] == contents[1]


def test_package_is_stored_aligned_with_the_stage_first(tmp_path):
    path = tmp_path / "höhe 1.usdz"
    assert Usd().export(spiked(), path, Run()) == [path]
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        assert archive.testzip() is None
    assert [Path(e.filename).suffix for e in entries] == [".usdc", ".png"]
    raw = path.read_bytes()
    for entry in entries:
        assert entry.filename.isascii()
        assert entry.compress_type == zipfile.ZIP_STORED
        name, extra = (
            int.from_bytes(raw[entry.header_offset + k :][:2], "little") for k in (26, 28)
        )
        assert (entry.header_offset + 30 + name + extra) % 64 == 0
    stage = PxrUsd.Stage.Open(str(path))
    assert shaders(stage)["UsdUVTexture"].GetInput("file").Get().resolvedPath


@pytest.mark.parametrize("name", ["7 höhe@[1] $x.usda", "a.b.usdc", "Weiß.USDA"])
def test_odd_names_work(tmp_path, name):
    path = tmp_path / name
    files = Usd().export(spiked(), path, Run())
    assert sorted(tmp_path.iterdir()) == sorted(files)
    stage = PxrUsd.Stage.Open(str(path))
    assert len(world_points(stage)) == ROWS * COLS
    assert shaders(stage)["UsdUVTexture"].GetInput("file").Get().resolvedPath


def test_another_export_to_the_same_path_replaces_an_open_stage(tmp_path):
    first = written(tmp_path, spiked(), "alps.usdc")
    higher = Heightfield(np.full((3, 3), 5.0), 1.0)
    Usd().export(higher, tmp_path / "alps.usdc", Run())
    first.Reload()
    assert len(mesh_of(first).GetPointsAttr().Get()) == 9


def test_wrong_extension_is_refused(tmp_path):
    with pytest.raises(OutputError, match=r"alps\.obj: no USD extension; use \.usdc"):
        Usd().export(spiked(), tmp_path / "alps.obj", Run())


def test_single_row_is_refused(tmp_path):
    with pytest.raises(InputError, match="needs at least 2x2 samples"):
        Usd().export(Heightfield(np.zeros((1, 5)), 1.0), tmp_path / "line.usda", Run())


def test_missing_library_is_one_line(tmp_path, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match="pip install usd-core"):
        Usd().export(spiked(), tmp_path / "alps.usda", Run())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_full_disk_leaves_nothing(tmp_path, suffix):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    big = Heightfield(np.random.default_rng(0).random((120, 120)), 1.0)
    (tmp_path / f"alps.{suffix}").write_text("old")
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot be written") as caught:
            Usd().export(big, tmp_path / f"alps.{suffix}", Run())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == [f"alps.{suffix}"]
    assert (tmp_path / f"alps.{suffix}").read_text() == "old"


def test_folder_in_the_way_leaves_nothing(tmp_path):
    (tmp_path / "alps_color.png").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        Usd().export(spiked(), tmp_path / "alps.usdc", Run())
    assert [p.name for p in tmp_path.iterdir()] == ["alps_color.png"]


def test_package_past_4_gb_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("terrakit_usd.package.LARGEST", 1000)
    with pytest.raises(OutputError, match=r"4 GB of usdz; use \.usdc"):
        Usd().export(spiked(), tmp_path / "alps.usdz", Run())
    assert list(tmp_path.iterdir()) == []


def test_plugin_offers_the_exporter():
    assert terrakit_exporters() == [Usd]
