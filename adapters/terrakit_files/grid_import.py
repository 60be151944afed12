"""What every importer of grids asks and checks: size, nodata, cells, heights."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.operators import Importer
from terrakit.parameters import parameter
from terrakit_files.resampling import resampled, samples_after

HIGHEST = 1e7
"""Heights beyond this are no heights, metres."""

SUSPICIOUS = (-9999.0, -99999.0, -32768.0, -32767.0)
"""Minima that stand for missing data when a file does not say so."""

PLAUSIBLE_RATIO = 5000.0
"""No format packs real heights tighter than this."""


@dataclass(frozen=True)
class RawGrid:
    """Values as a file has them, north first, with what it says about them."""

    values: NDArray[np.floating]
    missing: NDArray[np.bool_] | None = None
    spacings: tuple[float, float] | None = None
    """Distance between rows and between columns, metres; None where the file does not say."""
    origin: tuple[float, float] | None = None
    crs: str | None = None
    nodata_known: bool = False
    """Whether the file says which value stands for missing data."""


class GridImporter(Importer):
    """Parameters and checks that all importers of grids share."""

    spacing: float | None = parameter(
        None,
        "Distance between samples: declares it where the file does not say, resamples to it where "
        "the file says otherwise.",
        unit="m",
        gt=0.0,
        le=1e9,
    )
    nodata: float | None = parameter(
        None, "Value that stands for missing data, besides the one that the file names."
    )
    fill: Literal["none", "nearest", "min", "value"] = parameter(
        "none", "What to put where data are missing; none refuses such files."
    )
    fill_value: float = parameter(0.0, "Height for fill = value.", unit="m")
    max_cells: int = parameter(
        2**28, "Largest grid that is read, against damaged and hostile files.", ge=1, advanced=True
    )

    fields: ClassVar[int] = 6

    def check_size(self, path: Path, rows: int, cols: int, item: int, packed: bool = True) -> None:
        """Raise InputError before memory is taken for what a file claims to hold.

        Parameters
        ----------
        path
            The file.
        rows, cols, item
            Its grid, and bytes a cell.
        packed
            Whether the format may be compressed.
        """
        if rows < 1 or cols < 1:
            raise InputError(f"{path.name}: size {cols} x {rows} is not possible; file damaged")
        cells = rows * cols
        there = path.stat().st_size
        if cells * item > max(1 << 20, there * (PLAUSIBLE_RATIO if packed else 1.0)):
            raise InputError(
                f"{path.name}: claims {cols} x {rows} cells ({_size(cells * item)}) but the file "
                f"has {_size(there)}; it is cut short or damaged"
            )
        if cells > self.max_cells:
            raise InputError(
                f"{path.name}: {cells:,} cells > limit {self.max_cells:,}; raise max_cells "
                "(--max-cells) if that is intended"
            )

    def terrain(self, path: Path, grid: RawGrid) -> Heightfield:
        """Return the terrain after all checks; ``path`` begins the messages."""
        name = path.name
        values, missing = self._missing(name, grid)
        check_heights(name, values, missing, self.nodata is not None or grid.nodata_known)
        layers = {}
        if missing.any():
            values = self._filled(name, values, missing)
            layers["valid"] = (~missing).astype(np.float32)
        spacing, resample = self._spacing(name, grid)
        if resample:
            assert grid.spacings is not None
            rows, cols = (
                samples_after(n, old, spacing)
                for n, old in zip(values.shape, grid.spacings, strict=True)
            )
            if rows * cols > self.max_cells:
                raise InputError(
                    f"{name}: spacing {spacing:g} m makes {rows * cols:,} cells > limit "
                    f"{self.max_cells:,}; use a larger spacing or raise max_cells"
                )
            values = resampled(values, grid.spacings, spacing)
            layers = {
                key: (resampled(layer, grid.spacings, spacing) > 0.999).astype(np.float32)
                for key, layer in layers.items()
            }
        return Heightfield(values, spacing, grid.origin, grid.crs, layers)

    def _missing(self, name: str, grid: RawGrid) -> tuple[NDArray[np.floating], NDArray[np.bool_]]:
        values = grid.values
        missing = np.zeros(values.shape, bool) if grid.missing is None else grid.missing
        missing = missing | ~np.isfinite(values)
        if self.nodata is not None:
            with np.errstate(all="ignore"):
                missing = missing | (values == self.nodata)
        if missing.all():
            raise InputError(f"{name}: no valid cell: all {values.size:,} are missing data")
        return values, missing

    def _filled(
        self, name: str, values: NDArray[np.floating], missing: NDArray[np.bool_]
    ) -> NDArray[np.floating]:
        row, col = (int(i) for i in np.argwhere(missing)[0])
        count = (
            f"{int(missing.sum()):,} of {missing.size:,} cells have no height "
            f"(first at row {row}, column {col})"
        )
        if self.fill == "none":
            raise InputError(
                f"{name}: {count}; fill them: fill = nearest, min or value (--fill nearest)"
            )
        warnings.warn(f"{name}: {count}; filled: {self.fill}", stacklevel=2)
        filled = np.array(values)
        if self.fill == "nearest":
            return nearest_filled(filled, missing)
        filled[missing] = filled[~missing].min() if self.fill == "min" else self.fill_value
        return filled

    def _spacing(self, name: str, grid: RawGrid) -> tuple[float, bool]:
        """Return the spacing, and whether it takes resampling to get there."""
        if grid.spacings is None:
            if self.spacing is None:
                raise InputError(
                    f"{name}: does not say how far its samples are apart; say spacing = metres "
                    "(--spacing)"
                )
            return self.spacing, False
        down, across = grid.spacings
        if not all(np.isfinite(s) and 1e-9 <= s <= 1e9 for s in grid.spacings):
            raise InputError(f"{name}: cells of {across:g} x {down:g} m; must be > 0")
        square = abs(down - across) <= 1e-4 * across
        if self.spacing is None:
            if not square:
                raise InputError(
                    f"{name}: cells are {across:g} x {down:g} m, not square; say spacing = "
                    f"{min(across, down):g} (--spacing) to resample"
                )
            return (across + down) / 2.0 if across != down else across, False
        same = square and abs(self.spacing - across) <= 1e-4 * across
        return self.spacing, not same


def check_heights(
    name: str, values: NDArray[np.floating], missing: NDArray[np.bool_], nodata_known: bool
) -> None:
    """Raise InputError for values that cannot be heights in metres."""
    good = values[~missing] if missing.any() else values
    low, high = float(good.min()), float(good.max())
    worst = low if -low > high else high
    if abs(worst) > HIGHEST:
        raise InputError(
            f"{name}: heights reach {worst:g} m, more than {HIGHEST:g}; if that stands for "
            f"missing data say nodata = {worst:.9g} (--nodata)"
        )
    if not nodata_known and low in SUSPICIOUS and low < high:
        count = int((good == low).sum())
        raise InputError(
            f"{name}: minimum {low:g} ({count:,} cells) looks like nodata; say nodata = {low:g} "
            "(--nodata), or any other number if these are heights"
        )
    step = float(np.spacing(np.float32(abs(worst))))
    if high > low and step > (high - low) / 200.0:
        warnings.warn(
            f"{name}: float32 steps are {step:g} m at {worst:g} m, heights span {high - low:g} m; "
            "shift the heights towards 0 before the import",
            stacklevel=3,
        )


def nearest_filled(
    values: NDArray[np.floating], missing: NDArray[np.bool_]
) -> NDArray[np.floating]:
    """Return ``values`` with every missing cell given the height of a nearest valid one.

    Jump flooding (Rong & Tan 2006): cells hand on the valid cell that they know, over halving
    distances.
    """
    rows, cols = values.shape
    own = np.arange(rows * cols, dtype=np.int64).reshape(rows, cols)
    known = np.where(missing, -1, own)
    row, col = np.arange(rows)[:, None], np.arange(cols)[None]
    far = np.iinfo(np.int64).max
    distance = np.where(missing, far, 0)
    halvings = max(1, int(max(rows, cols) - 1).bit_length())
    for step in (*(1 << k for k in reversed(range(halvings))), 2, 1):
        before = known.copy()
        for down in (-step, 0, step):
            for right in (-step, 0, step):
                if (down, right) == (0, 0) or abs(down) >= rows or abs(right) >= cols:
                    continue
                target = (_span(rows, down), _span(cols, right))
                source = (_span(rows, -down), _span(cols, -right))
                offered = before[source]
                there_row, there_col = offered // cols, offered % cols
                square = (there_row - row[target[0]]) ** 2 + (there_col - col[:, target[1]]) ** 2
                closer = (offered >= 0) & (square < distance[target])
                known[target] = np.where(closer, offered, known[target])
                distance[target] = np.where(closer, square, distance[target])
    return values.ravel()[known]


def _span(count: int, shift: int) -> slice:
    """Return the cells that have a neighbour ``shift`` further on."""
    return slice(max(0, -shift), count - max(0, shift))


def _size(count: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000 or unit == "GB":
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.1f} {unit}"
        count /= 1000
    raise AssertionError
