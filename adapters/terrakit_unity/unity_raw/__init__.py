"""Unity's RAW heightmap with alphamaps and a sidecar."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.atomic import staged_folder, writable_target
from terrakit.errors import InputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Exporter
from terrakit.parameters import parameter
from terrakit.provenance import terrakit_version
from terrakit_unity.unity_raw.alphamaps import CHANNELS, bytes_of, cell_weights, splat_png
from terrakit_unity.unity_raw.sidecar import Scale, Splat, sidecar

if TYPE_CHECKING:
    from terrakit.running import Run

SIDES = tuple(2**k + 1 for k in range(5, 13))
"""Samples a side that Unity takes: 33 to 4097."""

STEPS, TOP = 65536, 65535
"""Unity reads ``value / 65536``, and the highest value of 16 bits is 65535."""


class UnityRaw(Exporter):
    """Write a 16-bit RAW heightmap for Unity, alphamaps of the materials, and a JSON sidecar."""

    name: ClassVar[str] = "unity_raw"
    uses: ClassVar[tuple[str, ...]] = ("material_",)
    suffix: ClassVar[str] = ".raw"
    fields: ClassVar[int] = 24
    bytes_a_sample: ClassVar[float] = 6.0

    height_min: float | None = parameter(
        None, "Height of the value 0; the lowest of the terrain where none is given.", unit="m"
    )
    height_max: float | None = parameter(
        None, "Height of the value 65536; fits the highest where none is given.", unit="m"
    )
    resample: bool = parameter(
        False, "Bring the terrain to the nearest size that Unity takes (2^k + 1, 33 to 4097)."
    )
    tile_size: float = parameter(
        10.0, "Suggested size of a ground texture's tile.", unit="m", gt=0.0
    )

    def check(self, grid: Grid) -> None:
        """Raise InputError if Unity does not take this size and nothing may be resampled."""
        rows, cols = grid.shape
        if min(rows, cols) < 2:
            raise InputError(f"unity_raw: the terrain has {rows}x{cols} samples, needs 2x2")
        if self.resample or (rows == cols and rows in SIDES):
            return
        near = [side for side in SIDES if side <= max(rows, cols)][-1:]
        near += [side for side in SIDES if side > max(rows, cols)][:1]
        raise InputError(
            f"unity_raw: the terrain has {rows}x{cols} samples; Unity takes squares of 2^k + 1 "
            f"from 33 to 4097, the nearest are {' and '.join(map(str, near))}: make it that size, "
            "or say resample = true"
        )

    def export(self, surface: Heightfield, path: Path, run: Run) -> list[Path]:
        """Write the RAW, its sidecar ``NAME.json`` and ``NAME_splat0.png``, ..."""
        path = Path(path)
        self.check(surface.grid)
        if path.suffix.lower() == ".json" or path.stem == "run":
            raise InputError(
                f"{path.name}: its sidecar would be {path.stem}.json, which is taken; use another "
                "name that ends in .raw"
            )
        side = _nearest_side(max(surface.shape))
        scale = self.scale(surface.elevation)
        values = encode(resized(surface.elevation, side), scale)
        run.check()

        names = [name for name in surface if name.startswith("material_")]
        word = re.sub(r"[^\w.-]+", "_", path.stem) or "terrain"
        splats = [
            Splat(name, f"{word}_splat{i // CHANNELS}.png", i % CHANNELS)
            for i, name in enumerate(names)
        ]
        files = dict.fromkeys(splat.file for splat in splats)
        west, north = surface.origin
        width, height = surface.grid.size
        text = sidecar(
            path.name,
            values,
            scale,
            (width, height),
            (west, north - height),
            splats,
            self.tile_size,
            {"terrakit": terrakit_version(), "seed": str(run.seed), "crs": surface.crs or ""},
        )
        with staged_folder(path.parent) as stage:
            writable_target(path)
            (stage / path.name).write_bytes(values.astype("<u2").tobytes())
            (stage / f"{path.stem}.json").write_text(text, encoding="utf-8", newline="\n")
            if names:
                weights = bytes_of(cell_weights([resized(surface.layer(n), side) for n in names]))
                for index, file in enumerate(files):
                    run.check()
                    chosen = weights[index * CHANNELS : (index + 1) * CHANNELS]
                    (stage / file).write_bytes(splat_png(chosen))
        return [path.parent / name for name in (path.name, f"{path.stem}.json", *files)]

    def scale(self, elevation: NDArray[np.float32]) -> Scale:
        """Return offset and range: fitted, so that lowest is 0 and highest 65535, or as given.

        Raises
        ------
        InputError
            If the terrain leaves the heights that were given.
        """
        lowest, highest = float(elevation.min()), float(elevation.max())
        low = lowest if self.height_min is None else self.height_min
        fitted = (highest - low) * STEPS / TOP
        span = fitted if self.height_max is None else self.height_max - low
        if self.height_max is not None and span <= 0:
            raise InputError(
                f"unity_raw: height_max = {self.height_max:g} must be above height_min = {low:g}"
            )
        if lowest < low or (self.height_max is not None and highest > self.height_max):
            raise InputError(
                f"unity_raw: heights run from {lowest:g} to {highest:g} m and leave height_min = "
                f"{low:g} to height_max = {low + span:g}; widen them, or leave them out to fit "
                "the terrain"
            )
        if highest == lowest:
            warnings.warn("unity_raw: the terrain is flat", stacklevel=2)
        return Scale(low, span if span > 0 else 1.0)


def encode(elevation: NDArray[np.floating], scale: Scale) -> NDArray[np.uint16]:
    """Return heights as Unity's numbers, south row first."""
    share = (np.asarray(elevation, np.float64)[::-1] - scale.offset) / scale.range
    return np.clip(np.floor(share * STEPS + 0.5), 0, TOP).astype(np.uint16)


def resized(field: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Return a square of ``side`` samples between the same edges, linear between the old ones."""
    for axis in (0, 1):
        count = field.shape[axis]
        if count == side:
            continue
        place = np.arange(side) * ((count - 1) / (side - 1))
        before = np.minimum(place.astype(np.intp), count - 2)
        shape = (-1, 1) if axis == 0 else (1, -1)
        share = (place - before).astype(np.float32).reshape(shape)
        near, far = np.take(field, before, axis), np.take(field, before + 1, axis)
        field = near + (far - near) * share
    return field


def _nearest_side(samples: int) -> int:
    gaps = [(abs(side - samples), -side, side) for side in SIDES]
    nearest: int = min(gaps)[2]
    return nearest
