"""The JSON beside a RAW: everything that Unity's import dialog asks for, and a recipe to follow."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

FORMAT, VERSION = "terrakit_unity_raw", 1
CHANNELS = "RGBA"


@dataclass(frozen=True)
class Scale:
    """How heights become numbers: ``height = offset + value / 65536 * range``."""

    offset: float
    range: float


@dataclass(frozen=True)
class Splat:
    """One ground material and where its weight is."""

    layer: str
    file: str
    channel: int


def sidecar(
    raw_name: str,
    values: NDArray[Any],
    scale: Scale,
    size: tuple[float, float],
    corner: tuple[float, float],
    splats: list[Splat],
    tile_size: float,
    about: dict[str, Any],
) -> str:
    """Return the sidecar; ``values`` are the numbers of the RAW, south row first."""
    side = values.shape[0]
    described = {
        "format": FORMAT,
        "version": VERSION,
        "about": about,
        "heightmap": {
            "file": raw_name,
            "resolution": side,
            "depth": "Bit16",
            "byteOrder": "Windows",
            "flipVertically": False,
            "rowOrder": "south first, then west to east",
            "encoding": "height = heightOffset + value / 65536 * terrainSize.y",
        },
        "terrainSize": {"x": size[0], "y": scale.range, "z": size[1]},
        "heightOffset": scale.offset,
        "position": {"x": 0.0, "y": scale.offset, "z": 0.0},
        "worldSouthWest": {"east": corner[0], "north": corner[1]},
        "axes": "Unity x is east, y is up, z is north",
        "corners": {
            name: {"value": int(value), "height": scale.offset + int(value) / 65536 * scale.range}
            for name, value in (
                ("southWest", values[0, 0]),
                ("southEast", values[0, -1]),
                ("northWest", values[-1, 0]),
                ("northEast", values[-1, -1]),
            )
        },
        "alphamaps": {
            "resolution": side - 1 if splats else 0,
            "files": list(dict.fromkeys(splat.file for splat in splats)),
            "rowOrder": "PNG north up: Texture2D.GetPixels begins in the south, as SetAlphamaps",
            "sum": 255,
        },
        "layers": [
            {
                "name": splat.layer.removeprefix("material_"),
                "layer": splat.layer,
                "file": splat.file,
                "channel": CHANNELS[splat.channel],
                "index": index,
                "tileSize": {"x": tile_size, "y": tile_size},
            }
            for index, splat in enumerate(splats)
        ],
        "importRecipe": recipe(raw_name, side, scale, size, splats),
    }
    return json.dumps(described, indent=2, ensure_ascii=False) + "\n"


def recipe(
    raw_name: str, side: int, scale: Scale, size: tuple[float, float], splats: list[Splat]
) -> list[str]:
    """Return the steps in Unity's editor, one a line."""
    lines = [
        "GameObject > 3D Object > Terrain, then Terrain Settings (the cog).",
        f"Heightmap Resolution: {side} x {side}. Set it before anything else.",
        f"Import Raw...: {raw_name}, Depth Bit 16, Resolution {side}, Byte Order Windows, Flip "
        f"Vertically off, Terrain Size X {size[0]:.9g}, Y {scale.range:.9g}, Z {size[1]:.9g}.",
        f"Transform > Position Y: {scale.offset:.9g}, so that heights are those of the source.",
        "Check the corners: x grows to the east and z to the north; compare with corners above.",
    ]
    if splats:
        lines.append(
            f"Control Texture Resolution: {side - 1}. Import the splat PNGs with sRGB off, no "
            "compression, Read/Write on; channel i of file j is layer 4 j + i."
        )
    return lines
