"""A USD stage with one terrain: mesh, masks, material. The only file that touches pxr."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.atomic import explain_os_error
from terrakit.errors import OutputError, ParameterError
from terrakit.layers import layer_kind
from terrakit_usd.geometry import Geometry

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdGeom, UsdShade

RESERVED = ("st", "normals", "displayColor", "displayOpacity")
"""Primvars with a meaning of their own; a layer of that name is called ``layer_<name>``."""


@dataclass(frozen=True)
class Look:
    """How the terrain is shaded: by a texture, by colours of the vertices, or not at all."""

    roughness: float
    texture: str | None
    vertex_color: NDArray[np.float32] | None


def identifier(name: str) -> str:
    """Return ``name`` as USD takes it for prims and primvars."""
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))


def author(
    root_name: str,
    geometry: Geometry,
    up: Literal["z", "y"],
    layers: Mapping[str, NDArray[np.float32]],
    look: Look,
    record: Mapping[str, Any],
) -> Usd.Stage:
    """Return a stage in memory.

    Parameters
    ----------
    root_name
        Name of the default prim, a valid identifier.
    geometry
        The arrays, already in the stage's axes.
    up
        The stage's up axis.
    layers
        Values of every vertex by layer name; they become float primvars.
    look
        The shading.
    record
        Where the terrain comes from, for people and pipelines.

    Raises
    ------
    ParameterError
        If two layers would get the same primvar name.
    """
    from pxr import Gf, Kind, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if up == "z" else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)

    # The component that others reference, where the world wants it
    root = UsdGeom.Xform.Define(stage, f"/{root_name}")
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    if any(geometry.shift):
        root.AddTranslateOp().Set(Gf.Vec3d(*geometry.shift))

    # Provenance travels with the file and with every reference to the prim
    custom = {"terrakit": _plain(record)}
    stage.GetRootLayer().customLayerData = custom
    root.GetPrim().SetCustomData(custom)

    mesh = _define_mesh(stage, root.GetPath().AppendChild(root_name), geometry)
    _add_layers(mesh, layers)
    if look.vertex_color is not None:
        from pxr import Vt

        shown = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
        shown.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(look.vertex_color)))
    if look.texture is not None or look.vertex_color is not None:
        _bind_material(stage, root.GetPath().AppendChild(f"{root_name}_ground"), mesh, look)
    return stage


def save(stage: Usd.Stage, target: Path, shown: Path) -> None:
    """Write a stage as the extension of ``target`` says; errors speak of ``shown``.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from pxr import Tf

    try:
        written = stage.GetRootLayer().Export(str(target))
    except Tf.ErrorException as error:
        reason = re.search(r" : '(?:Error occurred writing file: )?(.*?)'\s*$", str(error), re.M)
        text = reason[1] if reason else "USD gave no reason"
        if os.strerror(errno.ENOSPC) in text:
            raise explain_os_error(OSError(errno.ENOSPC, text), shown) from None
        raise OutputError(f"{shown}: cannot be written ({text})") from None
    if not written:
        raise OutputError(f"{shown}: cannot be written (USD gave no reason)")


def _define_mesh(stage: Usd.Stage, path: Sdf.Path, geometry: Geometry) -> UsdGeom.Mesh:
    from pxr import Sdf, UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)  # the default would round the terrain
    mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(geometry.points)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(geometry.counts))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(geometry.indices))
    corners = np.stack((geometry.points.min(axis=0), geometry.points.max(axis=0)))
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(corners))
    if geometry.normals is not None:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(geometry.normals)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if geometry.st is not None:
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        st.Set(Vt.Vec2fArray.FromNumpy(geometry.st))
    return mesh


def _add_layers(mesh: UsdGeom.Mesh, layers: Mapping[str, NDArray[np.float32]]) -> None:
    from pxr import Sdf, UsdGeom, Vt

    taken: dict[str, str] = {}
    for name, values in layers.items():
        primvar_name = identifier(f"layer_{name}" if name in RESERVED else name)
        if primvar_name in taken:
            raise ParameterError(
                f"usd: layers {taken[primvar_name]!r} and {name!r} would both be called "
                f"{primvar_name} in USD; rename one"
            )
        taken[primvar_name] = name
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            primvar_name, Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(values)))
        kind = layer_kind(name)
        if kind is not None:
            unit = f" Unit: {kind.unit}." if kind.unit != "1" else ""
            primvar.GetAttr().SetDocumentation(kind.meaning + unit)


def _bind_material(stage: Usd.Stage, path: Sdf.Path, mesh: UsdGeom.Mesh, look: Look) -> None:
    from pxr import Sdf, UsdShade

    # Without a scope around it, Blender imports one object rather than two empties and a mesh
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, path.AppendChild("Surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(look.roughness)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    diffuse = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)

    if look.texture is None:
        color = _primvar_reader(stage, path, "displayColor", Sdf.ValueTypeNames.Float3)
        diffuse.ConnectToSource(color)
    else:
        texture = UsdShade.Shader.Define(stage, path.AppendChild("Color"))
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(look.texture))
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        for axis in ("wrapS", "wrapT"):
            texture.CreateInput(axis, Sdf.ValueTypeNames.Token).Set("clamp")
        st = _primvar_reader(stage, path, "st", Sdf.ValueTypeNames.Float2)
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
        diffuse.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))

    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _primvar_reader(
    stage: Usd.Stage, material: Sdf.Path, primvar: str, kind: Sdf.ValueTypeName
) -> UsdShade.Output:
    from pxr import Sdf, UsdShade

    reader = UsdShade.Shader.Define(stage, material.AppendChild(f"Read_{primvar}"))
    reader.CreateIdAttr(f"UsdPrimvarReader_{kind}")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
    return reader.CreateOutput("result", kind)


def _plain(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``record`` with sequences as USD's own vectors."""
    from pxr import Gf

    plain = dict(record)
    if "origin" in plain:
        plain["origin"] = Gf.Vec3d(*plain["origin"])
    if "samples" in plain:
        plain["samples"] = Gf.Vec2i(*plain["samples"])
    return plain
