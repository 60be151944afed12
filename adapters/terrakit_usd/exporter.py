"""The exporter ``usd``: what a user chooses, and which files are written."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path
from typing import Any, ClassVar, Literal

from terrakit import color
from terrakit.atomic import staged_folder, writable_target, write_bytes
from terrakit.errors import OutputError, ParameterError
from terrakit.heightfield import Heightfield
from terrakit.layers import ALBEDO
from terrakit.mesh import TriMesh
from terrakit.operators import Exporter, Surface
from terrakit.parameters import parameter, suggestion
from terrakit.provenance import terrakit_version
from terrakit.running import Run
from terrakit_usd.geometry import Geometry, geometry_of

SUFFIXES = (".usdc", ".usda", ".usdz", ".usd")

FARTHEST = 100_000.0
"""Metres from the world's origin beyond which viewports lose the terrain or shake."""


class Usd(Exporter):
    """Write an OpenUSD stage for Blender, Houdini, Maya, Omniverse and everything else."""

    name: ClassVar[str] = "usd"
    surfaces: ClassVar[tuple[type, ...]] = (Heightfield, TriMesh)
    uses: ClassVar[tuple[str, ...]] = ALBEDO
    fields: ClassVar[int] = 40
    suffix: ClassVar[str] = ".usdc"
    suffixes: ClassVar[tuple[str, ...]] = SUFFIXES

    up: Literal["z", "y"] = parameter("z", "Axis that points up in the stage.")
    layers: list[str] | None = parameter(
        None, "Layers to carry as float primvars; by default all but the colour."
    )
    normals: bool = parameter(
        True, "Store smooth normals; without them some programs show facets, sculpting is easier."
    )
    texture: bool = parameter(True, "Write the colour as a picture and bind a material to it.")
    roughness: float = parameter(
        0.9, "Roughness of the material, 0 mirror to 1 chalk.", ge=0.0, le=1.0
    )
    placement: Literal["auto", "world", "local"] = parameter(
        "auto",
        "Leave the terrain at its world coordinates, move its corner to the origin and only record "
        "the way back, or do so only beyond 100 km.",
    )

    def export(self, surface: Surface, path: Path, run: Run) -> list[Path]:
        """Write the stage, and its texture beside it or, for ``.usdz``, inside it.

        Raises
        ------
        OutputError
            If the place cannot be written, or the extension is none of USD's.
        ParameterError
            If a layer is asked for that the terrain does not have.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix not in SUFFIXES:
            raise OutputError(f"{path.name}: no USD extension; use {', '.join(SUFFIXES[:-1])}")
        if importlib.util.find_spec("pxr") is None:
            raise OutputError("usd: OpenUSD is not installed; run: pip install usd-core")
        from terrakit_usd import package, stage

        layers = self._chosen_layers(surface)
        geometry = geometry_of(surface, self.normals, self.placement == "local")
        root_name = stage.identifier(path.stem)
        stem = root_name if suffix == ".usdz" else path.stem
        texture_name = f"{stem}_color.png"
        geometry, record = self._placed(geometry, surface, run)
        run.check()

        # Author everything in memory; only then touch the disk
        has_texture = self.texture and isinstance(surface, Heightfield)
        picture: bytes | None = None
        if self.texture and isinstance(surface, Heightfield):
            picture = color.png_bytes(color.texture_picture(surface, run.sea_level))
        authored = stage.author(
            root_name,
            geometry,
            self.up,
            {name: surface.layer(name).reshape(-1) for name in layers},
            stage.Look(
                self.roughness,
                f"./{texture_name}" if has_texture else None,
                color.linear_color(surface, run.sea_level)
                if self.texture and not has_texture
                else None,
            ),
            record,
        )
        run.check()

        if path.parent.exists():
            for name in (path.name, *([texture_name] if has_texture else [])):
                writable_target(path.with_name(name))
        with staged_folder(path.parent) as folder:
            files = [folder / path.name]
            if suffix == ".usdz":
                inner = folder / f"{stem}.usdc"
                stage.save(authored, inner, path)
                members = [(inner.name, inner.read_bytes())]
                inner.unlink()
                if picture is not None:
                    members.append((texture_name, picture))
                package.write_usdz(files[0], members)
            else:
                stage.save(authored, files[0], path)
                if picture is not None:
                    files.append(write_bytes(folder / texture_name, picture))
        return [path.parent / file.name for file in files]

    def _chosen_layers(self, surface: Surface) -> list[str]:
        if self.layers is None:
            return [name for name in surface if name != "elevation" and name not in ALBEDO]
        for name in self.layers:
            if name not in surface:
                known = suggestion(name, list(surface))
                raise ParameterError(
                    f"usd: layers = {name!r}: the terrain has no such layer{known}"
                )
        return list(dict.fromkeys(self.layers))

    def _placed(
        self, geometry: Geometry, surface: Surface, run: Run
    ) -> tuple[Geometry, dict[str, Any]]:
        """Return the geometry where ``placement`` wants it, and the provenance to record."""
        record: dict[str, Any] = {"version": terrakit_version(), "seed": str(run.seed)}
        if isinstance(surface, Heightfield):
            record["spacing"] = surface.spacing
            record["samples"] = list(surface.shape)
            if surface.crs:
                record["crs"] = surface.crs
        distance = max(abs(value) for value in geometry.shift)
        if self.placement == "local" or (self.placement == "auto" and distance > FARTHEST):
            record["origin"] = geometry.shift
            geometry = dataclasses.replace(geometry, shift=(0.0, 0.0, 0.0))
        return (geometry.y_up() if self.up == "y" else geometry), record
