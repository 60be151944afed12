"""Heightmaps: grey pictures, of which none of the 16 bits is lost."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit_files.gdal import opened, read_band
from terrakit_files.grid_import import GridImporter, RawGrid

if TYPE_CHECKING:
    from terrakit.running import Run

PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
SIGNATURES = {PNG: "PNG", JPEG: "JPEG", b"BM": "BMP", b"P5": "PNM"}


class Image(GridImporter):
    """Read a heightmap from a grey PNG, PGM, BMP or JPEG."""

    name: ClassVar[str] = "image"
    suffixes: ClassVar[tuple[str, ...]] = (".png", ".pgm", ".bmp", ".jpg", ".jpeg")

    height_min: float = parameter(0.0, "Height of black.", unit="m")
    height_max: float | None = parameter(
        None, "Height of white: the value 65535 of 16 bits, 255 of 8.", unit="m"
    )

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the beginning is that of a picture."""
        del path
        return head.startswith(tuple(SIGNATURES))

    def load(self, path: Path, run: Run) -> Heightfield:
        """Read grey values and stretch them to metres; alpha and gamma are ignored."""
        path = Path(path)
        if self.height_max is None or self.spacing is None:
            raise InputError(
                f"{path.name}: a picture has no scale; say height_max = metres of white "
                "(--height-max) and spacing = metres a pixel (--spacing)"
            )
        with opened(path, ("PNG", "JPEG", "BMP", "PNM")) as dataset:
            kind = np.dtype(dataset.dtypes[0])
            self.check_size(path, dataset.height, dataset.width, kind.itemsize)
            grey = _grey(path, dataset)
            white = _white(path, kind)
            driver = dataset.driver
        run.check()
        if driver == "JPEG":
            warnings.warn(f"{path.name}: is a JPEG: lossy, 8 bits; expect terraces", stacklevel=2)
        elif white <= 255:
            warnings.warn(
                f"{path.name}: {white + 1} grey values over "
                f"{self.height_max - self.height_min:g} m make terraces; 16 bits are better",
                stacklevel=2,
            )
        share = grey.astype(np.float64) / white
        heights = self.height_min + share * (self.height_max - self.height_min)
        return self.terrain(path, RawGrid(heights, nodata_known=True))


def _grey(path: Path, dataset: Any) -> NDArray[np.generic]:
    """Return the grey values: of colour pictures and palettes only if they are grey."""
    first: NDArray[np.generic] = read_band(path, dataset, 1, masked=False)
    if _is_palette(dataset):
        table = np.array([dataset.colormap(1).get(i, (0, 0, 0, 255)) for i in range(256)])
        if (table[:, 0] != table[:, 1]).any() or (table[:, 0] != table[:, 2]).any():
            raise InputError(f"{path.name}: has a colour palette; a heightmap must be grey")
        return np.take(table[:, 0].astype(np.uint8), first.astype(np.intp))
    if dataset.count >= 3:
        for band in (2, 3):
            if not np.array_equal(first, read_band(path, dataset, band, masked=False)):
                raise InputError(f"{path.name}: is a colour picture; a heightmap must be grey")
    return first


def _is_palette(dataset: Any) -> bool:
    try:
        dataset.colormap(1)
    except ValueError:
        return False
    return True


def _white(path: Path, kind: np.dtype[Any]) -> int:
    """Return the value of white: a PNG of 1, 2 or 4 bits arrives in bytes, not stretched."""
    with open(path, "rb") as stream:
        head = stream.read(32)
    if head.startswith(PNG) and len(head) > 25 and head[24] < 8 and head[25] == 0:
        return int(2 ** head[24] - 1)
    return int(np.iinfo(kind).max)
