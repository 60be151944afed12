"""Wavefront OBJ with a material and a colour texture."""

from __future__ import annotations

import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.atomic import staged_folder, writable_target
from terrakit.color import linear_color, png_bytes, srgb_from_linear, texture_picture
from terrakit.errors import InputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.layers import ALBEDO
from terrakit.mesh import TriMesh
from terrakit.operators import Exporter
from terrakit.parameters import parameter
from terrakit.provenance import terrakit_version
from terrakit_files.obj.text import Bytes, decimals, joined, whole_numbers

if TYPE_CHECKING:
    from terrakit.running import Run

BLOCK = 1 << 16
"""Vertices or faces written at a time; bounds the memory."""

MOST = 2**31 - 1
"""Vertices that readers of OBJ can count."""

FARTHEST = 100_000.0
"""Metres from the world's origin beyond which single precision loses centimetres."""


class Obj(Exporter):
    """Write a Wavefront OBJ with MTL and colour texture; Blender's default import fits."""

    name: ClassVar[str] = "obj"
    surfaces: ClassVar[tuple[type, ...]] = (Heightfield, TriMesh)
    uses: ClassVar[tuple[str, ...]] = ALBEDO
    suffix: ClassVar[str] = ".obj"
    fields: ClassVar[int] = 12
    bytes_a_sample: ClassVar[float] = 125.0

    up: Literal["y", "z"] = parameter(
        "y", "Axis that points up: y is what importers expect, z keeps x east and y north."
    )
    placement: Literal["auto", "world", "local"] = parameter(
        "auto",
        "Leave the terrain at its world coordinates, move its south-west corner to the origin and "
        "note the way back, or do so only beyond 100 km.",
    )
    texture: bool = parameter(
        True, "Write the colour: as a picture for grids, as vertex colours for meshes."
    )

    def check(self, grid: Grid) -> None:
        """Raise InputError if there are too few samples for a face or too many for an OBJ."""
        rows, cols = grid.shape
        if min(rows, cols) < 2:
            raise InputError(f"obj: the terrain has {rows}x{cols} samples, needs at least 2x2")
        if rows * cols > MOST:
            raise InputError(f"obj: {rows * cols:,} vertices > {MOST:,}; write usd or npz instead")

    def export(self, surface: Heightfield | TriMesh, path: Path, run: Run) -> list[Path]:
        """Write ``surface`` as OBJ, MTL and, for a coloured grid, a texture beside it."""
        path = Path(path)
        if isinstance(surface, Heightfield):
            self.check(surface.grid)
        word = re.sub(r"[^\w.-]+", "_", path.stem) or "terrain"
        material, texture = f"{word}.mtl", f"{word}_color.png"
        textured = surface if self.texture and isinstance(surface, Heightfield) else None
        with staged_folder(path.parent) as stage, ThreadPoolExecutor(1) as worker:
            writable_target(path)
            drawn = None
            if textured is not None:
                drawn = worker.submit(_draw, textured, run.sea_level, stage / texture)
            with open(stage / path.name, "wb") as stream:
                stream.write(self._header(surface, word, material, run))
                for block in self._blocks(surface, run.sea_level):
                    run.check()
                    stream.write(block)
            described = _material(texture if textured else None)
            (stage / material).write_text(described, encoding="utf-8", newline="\n")
            if drawn is not None:
                drawn.result()
        names = [path.name, material, *([texture] if textured else [])]
        return [path.parent / name for name in names]

    def shift(self, surface: Heightfield | TriMesh) -> tuple[float, float]:
        """Return what is taken off world x and y, metres."""
        if isinstance(surface, Heightfield):
            (west, north), (width, height) = surface.origin, surface.grid.size
            low, high = np.array((west, north - height)), np.array((west + width, north))
        else:
            low, high = surface.vertices[:, :2].min(axis=0), surface.vertices[:, :2].max(axis=0)
        furthest = float(np.maximum(np.abs(low), np.abs(high)).max())
        moved = self.placement == "local" or (self.placement == "auto" and furthest > FARTHEST)
        return (float(low[0]), float(low[1])) if moved else (0.0, 0.0)

    def _header(self, surface: Heightfield | TriMesh, word: str, material: str, run: Run) -> bytes:
        east, north = self.shift(surface)
        axes = "x east, y up, -z north" if self.up == "y" else "x east, y north, z up"
        lines = [
            f"# terrakit {terrakit_version()}, seed {run.seed}",
            f"# metres; {axes}",
        ]
        if self.up == "z":
            lines.append("# Blender: import with Forward Axis Y, Up Axis Z")
        if (east, north) != (0.0, 0.0):
            lines.append(f"# origin shift: add {east:.12g} to east and {north:.12g} to north")
        crs = surface.crs if isinstance(surface, Heightfield) else None
        if crs and len(crs) < 40:
            lines.append(f"# crs {crs}")
        lines += [f"mtllib {material}", f"o {word}"]
        text = "\n".join(" ".join(line.split()) for line in lines)
        return text.encode("utf-8", "replace") + b"\n"

    def _blocks(self, surface: Heightfield | TriMesh, sea_level: float | None) -> Iterator[bytes]:
        if isinstance(surface, Heightfield):
            return self._grid(surface)
        return self._mesh(surface, sea_level)

    def _grid(self, terrain: Heightfield) -> Iterator[bytes]:
        rows, cols = terrain.shape
        west, north = terrain.origin
        shift_east, shift_north = self.shift(terrain)
        east = west - shift_east + np.arange(cols) * terrain.spacing
        y = north - shift_north - np.arange(rows) * terrain.spacing
        high = max(1, BLOCK // cols)
        blocks = [(first, min(first + high, rows)) for first in range(0, rows, high)]

        # x is the same down a column and y along a row: only the heights are new text.
        east_text = _trimmed(decimals(east))[None]
        y_text = _trimmed(decimals(-y if self.up == "y" else y))[:, None]
        for first, last in blocks:
            heights = decimals(terrain.elevation[first:last]).reshape(last - first, cols, -1)
            parts: list[bytes | Bytes] = [
                b"v ",
                east_text,
                b" ",
                heights,
                b" ",
                y_text[first:last],
                b"\n",
            ]
            if self.up == "z":
                parts[3], parts[5] = parts[5], parts[3]
            yield _lines((last - first, cols), parts)
        if self.texture:
            u = _trimmed(_fraction(np.arange(cols), cols - 1))[None]
            v = _trimmed(_fraction(np.arange(rows)[::-1], rows - 1))[:, None]
            for first, last in blocks:
                yield _lines((last - first, cols), [b"vt ", u, b" ", v[first:last], b"\n"])

        yield b"usemtl terrain\ns 1\n"
        width = len(str(rows * cols))
        for first, last in blocks:
            last = min(last, rows - 1)
            if last <= first:
                continue
            number = np.arange(first * cols + 1, (last + 1) * cols + 1, dtype=np.uint64)
            index = whole_numbers(number)[:, -width:].reshape(last - first + 1, cols, width)
            corner: list[bytes | Bytes] = (
                [b" ", index, b"/", index] if self.texture else [b" ", index]
            )
            token = _filled(index.shape[:2], corner)
            north_west, south_west = token[:-1, :-1], token[1:, :-1]
            south_east, north_east = token[1:, 1:], token[:-1, 1:]
            yield _lines(
                north_west.shape[:2],
                [b"f", north_west, south_west, south_east, north_east, b"\n"],
            )

    def _mesh(self, mesh: TriMesh, sea_level: float | None) -> Iterator[bytes]:
        shift = np.array((*self.shift(mesh), 0.0))
        colours = linear_color(mesh, sea_level) if self.texture else None
        for first in range(0, len(mesh.vertices), BLOCK):
            x, y, z = (mesh.vertices[first : first + BLOCK] - shift).T
            places = (x, z, -y) if self.up == "y" else (x, y, z)
            words: list[bytes | Bytes] = [b"v"]
            for values in places:
                words += [b" ", decimals(values)]
            if colours is not None:
                for channel in srgb_from_linear(colours[first : first + BLOCK]).T:
                    words += [b" ", _fraction(channel, 255)]
            yield _lines((len(x),), [*words, b"\n"])

        yield b"usemtl terrain\ns 1"
        if mesh.polygons is None:
            counts = np.full(len(mesh.faces), 3)
            indices = mesh.faces.ravel()
        else:
            counts, indices = mesh.polygons.counts, mesh.polygons.indices
        begins = np.zeros(len(indices), dtype=bool)
        begins[np.cumsum(counts) - counts] = True
        for first in range(0, len(indices), BLOCK):
            chosen = slice(first, first + BLOCK)
            number = whole_numbers(indices[chosen].astype(np.uint64) + np.uint64(1))
            opening = np.frombuffer(b"\0\0\nf", np.uint8).reshape(2, 2)
            yield _lines((len(number),), [opening[begins[chosen].astype(int)], b" ", number])
        yield b"\n"


def _material(texture: str | None) -> str:
    lines = [
        "# terrakit",
        "newmtl terrain",
        "Kd 1 1 1" if texture else "Kd 0.6 0.6 0.6",
        "Ks 0 0 0",
        "Pr 0.9",
        *([f"map_Kd {texture}"] if texture else []),
    ]
    return "\n".join(lines) + "\n"


def _lines(shape: tuple[int, ...], parts: list[bytes | Bytes]) -> bytes:
    return joined(_filled(shape, parts))


def _filled(shape: tuple[int, ...], parts: list[bytes | Bytes]) -> Bytes:
    """Return the parts side by side, each repeated to ``shape`` where it is smaller."""
    fields = [np.frombuffer(p, np.uint8) if isinstance(p, bytes) else p for p in parts]
    text = np.empty((*shape, sum(field.shape[-1] for field in fields)), np.uint8)
    at = 0
    for field in fields:
        text[..., at : at + field.shape[-1]] = field
        at += field.shape[-1]
    return text


def _trimmed(rows: Bytes) -> Bytes:
    """Return rows without the columns that are padding in all of them."""
    return np.ascontiguousarray(rows[:, rows.any(axis=0)])


def _fraction(numerator: NDArray[np.integer], denominator: int) -> Bytes:
    """Return ``numerator / denominator`` with 7 digits after the point."""
    share = np.round(np.asarray(numerator, np.float64) / denominator, 7)
    words = [b"%.7g" % value for value in share.tolist()]
    return np.array(words, dtype="S10").view(np.uint8).reshape(len(words), 10)


def _draw(terrain: Heightfield, sea_level: float | None, file: Path) -> None:
    file.write_bytes(png_bytes(texture_picture(terrain, sea_level)))
