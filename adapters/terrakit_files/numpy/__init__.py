"""NumPy arrays in ``.npy`` and ``.npz`` files; nothing pickled is ever run."""

from __future__ import annotations

import io
import json
import lzma
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.layers import layer_kind
from terrakit.parameters import parameter
from terrakit.strata import Strata
from terrakit_files.grid_import import GridImporter, RawGrid

if TYPE_CHECKING:
    from terrakit.running import Run

NPY, ZIP = b"\x93NUMPY", b"PK\x03\x04"
MARK = "terrakit"
SMALL = 1 << 16
DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError),
    *(KeyError, ValueError, RuntimeError, struct.error),
)
"""What Python's readers raise for archives that are not whole."""


class Numpy(GridImporter):
    """Read heights from a .npy or .npz file of any byte order and memory layout."""

    name: ClassVar[str] = "numpy"
    suffixes: ClassVar[tuple[str, ...]] = (".npy", ".npz")

    key: str | None = parameter(
        None, "Array of the .npz that holds the heights; by default elevation, or the only 2-D one."
    )

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the beginning is that of an array, or of an archive of arrays."""
        if head.startswith(NPY):
            return True
        return head.startswith(ZIP) and (
            path.suffix.lower() == ".npz" or b".npy" in head[30 : 30 + 300]
        )

    def load(self, path: Path, run: Run) -> Heightfield:
        """Read the heights, and from a file of terrakit's own its layers and coordinates."""
        path = Path(path)
        try:
            with open(path, "rb") as stream:
                head = stream.read(8)
                stream.seek(0)
                if not head:
                    raise InputError(f"{path.name}: is empty")
                if head.startswith(NPY):
                    values = self._array(path, stream, path.stat().st_size)
                    return self.terrain(path, RawGrid(values))
                if head.startswith(ZIP):
                    with zipfile.ZipFile(stream) as archive:
                        return self._archive(path, archive, run)
        except InputError:
            raise
        except FileNotFoundError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from None
        except DAMAGE as error:
            text = " ".join(str(error).split())[:100]
            raise InputError(f"{path.name}: is cut short or damaged ({text})") from None
        raise InputError(f"{path.name}: is no .npy or .npz file")

    def _archive(self, path: Path, archive: zipfile.ZipFile, run: Run) -> Heightfield:
        members = {
            info.filename.removesuffix(".npy"): info
            for info in archive.infolist()
            if info.filename.endswith(".npy")
        }
        heads = {name: _peek(path, archive, info) for name, info in members.items()}
        chosen = self._chosen(path, heads)
        shape = heads[chosen][0]

        def read(name: str) -> NDArray[Any]:
            run.check()
            with archive.open(members[name]) as stream:
                return self._array(path, stream, members[name].file_size, heads[name][0] == shape)

        spacing = _number(read("spacing")) if _is_scalar(heads, "spacing") else None
        grid = RawGrid(
            read(chosen),
            spacings=None if spacing is None else (spacing, spacing),
            origin=_pair(read("origin")) if heads.get("origin", ((),))[0] == (2,) else None,
            crs=str(read("crs")[()]) if _is_scalar(heads, "crs") else None,
            nodata_known=MARK in heads,
        )
        try:
            terrain = self.terrain(path, grid)
        except InputError as error:
            hint = [f"{n} = {_number(read(n)):g}" for n in ("dx", "dy") if _is_scalar(heads, n)]
            if "how far" in str(error) and hint:
                raise InputError(f"{error}; it holds {' and '.join(hint)}") from None
            raise
        layers = {}
        for name, (its_shape, kind) in heads.items():
            wanted = MARK in heads or layer_kind(name) is not None
            if name != chosen and wanted and its_shape == terrain.shape and kind.kind in "fiub":
                layers[name] = read(name)
        if MARK in heads and _is_scalar(heads, "strata"):
            terrain = terrain.with_strata(_beds(path, str(read("strata")[()])))
        return terrain.with_layers(**layers) if layers else terrain

    def _chosen(self, path: Path, heads: dict[str, tuple[tuple[int, ...], np.dtype[Any]]]) -> str:
        grids = [name for name, (shape, kind) in heads.items() if len(shape) == 2]
        known = ", ".join(sorted(heads)) or "nothing"
        if self.key is not None:
            if self.key not in heads:
                raise InputError(f"{path.name}: has no array {self.key!r}; it has: {known}")
            return self.key
        if "elevation" in grids:
            return "elevation"
        if len(grids) == 1:
            return grids[0]
        if not grids:
            raise InputError(f"{path.name}: has no 2-D array; it has: {known}")
        raise InputError(
            f"{path.name}: has several 2-D arrays ({', '.join(sorted(grids))}); say which: key = "
            f"{grids[0]} (--key)"
        )

    def _array(
        self, path: Path, stream: IO[bytes], size: int, is_grid: bool = True
    ) -> NDArray[Any]:
        shape, kind = _header(path, stream)
        if is_grid:
            if len(shape) != 2 or kind.kind not in "fiub":
                raise InputError(
                    f"{path.name}: needs a 2-D real array, got {kind} of shape {shape}"
                )
            self._check_claim(path, shape, kind, size - stream.tell())
        elif size > SMALL:
            raise InputError(f"{path.name}: is damaged")
        stream.seek(0)
        try:
            values = npy.read_array(stream, allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise InputError(f"{path.name}: is cut short or damaged ({error})") from None
        return values.astype(np.float64) if kind.kind in "iub" and is_grid else values

    def _check_claim(
        self, path: Path, shape: tuple[int, ...], kind: np.dtype[Any], there: int
    ) -> None:
        rows, cols = shape
        claimed = rows * cols * kind.itemsize
        if claimed > there:
            raise InputError(
                f"{path.name}: is cut short: {there:,} of {claimed:,} bytes of {rows} x {cols} "
                "heights"
            )
        self.check_size(path, rows, cols, kind.itemsize)


def _header(path: Path, stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the header of an array; the stream then stands at its first value."""
    try:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"format {version} is not one of plain arrays")
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, kind = read(stream)
    except (ValueError, EOFError, SyntaxError, TypeError, RecursionError) as error:
        text = " ".join(str(error).split())[:100]
        raise InputError(f"{path.name}: is cut short or damaged ({text})") from None
    if kind.hasobject:
        raise InputError(f"{path.name}: holds pickled objects, which are never run; save numbers")
    return shape, kind


def _beds(path: Path, text: str) -> Strata | None:
    """Return the column of beds that an archive of terrakit's own holds."""
    try:
        return Strata.from_dict(json.loads(text))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"{path.name}: strata: are no beds ({reason})") from None


def _peek(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo
) -> tuple[tuple[int, ...], np.dtype[Any]]:
    with archive.open(info) as stream:
        head = io.BytesIO(stream.read(SMALL))
    return _header(path, head)


def _is_scalar(heads: dict[str, tuple[tuple[int, ...], np.dtype[Any]]], name: str) -> bool:
    return name in heads and heads[name][0] == ()


def _number(value: NDArray[Any]) -> float:
    return float(value[()])


def _pair(values: NDArray[Any]) -> tuple[float, float]:
    return float(values[0]), float(values[1])
