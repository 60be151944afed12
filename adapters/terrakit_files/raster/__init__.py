"""GeoTIFF and other rasters with coordinates, read through GDAL."""

from __future__ import annotations

import math
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

DRIVERS = ("GTiff", "AAIGrid", "SRTMHGT", "GSAG", "GSBG", "GS7BG", "USGSDEM", "BT", "DTED")
"""No VRT and nothing of the network: a raster never opens another file."""

SIGNATURES = (
    b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"DSAA", b"DSBB", b"DSRB",
    b"binterr1", b"UHL1",
)  # fmt: skip
HGT_BYTES = {2 * 1201 * 1201, 2 * 3601 * 3601, 2 * 1801 * 3601}

FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937
FEET = {
    **dict.fromkeys(("ft", "foot", "feet"), FOOT),
    **dict.fromkeys(("us survey foot", "us-ft", "ftus"), SURVEY_FOOT),
}
METRES = {"", "m", "metre", "meter", "metres", "meters"}


class Raster(GridImporter):
    """Read heights from GeoTIFF, ESRI ASCII grid, SRTM and other rasters."""

    name: ClassVar[str] = "raster"
    suffixes: ClassVar[tuple[str, ...]] = (".tif", ".tiff", ".asc", ".hgt", ".grd", ".dem")

    band: int = parameter(1, "Which band holds the heights, from 1.", ge=1)

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the beginning is that of a raster with coordinates."""
        if head.startswith(SIGNATURES):
            return True
        if head[:200].lstrip().lower().startswith((b"ncols", b"nrows")):
            return True
        return path.suffix.lower() == ".hgt" and path.stat().st_size in HGT_BYTES

    def load(self, path: Path, run: Run) -> Heightfield:
        """Read one band as metres, north first, in the coordinates of the file."""
        path = Path(path)
        with opened(path, DRIVERS) as dataset:
            self._check(path, dataset)
            run.check()
            values = read_band(path, dataset, self.band)
            grid = self._grid(path, dataset, values)
        run.check()
        return self.terrain(path, grid)

    def _check(self, path: Path, dataset: Any) -> None:
        if dataset.count < 1:
            raise InputError(f"{path.name}: has no band")
        if self.band > dataset.count:
            raise InputError(f"{path.name}: band = {self.band}: the file has {dataset.count}")
        kind = dataset.dtypes[self.band - 1]
        if "complex" in kind:
            raise InputError(f"{path.name}: needs a 2-D real array, got {kind}")
        self.check_size(path, dataset.height, dataset.width, np.dtype(kind).itemsize)
        if dataset.count in (3, 4) and kind == "uint8":
            warnings.warn(
                f"{path.name}: {dataset.count} bands of 8 bits are a picture, not heights; using "
                f"band {self.band}",
                stacklevel=2,
            )
        pages = len(dataset.subdatasets)
        if pages > 1:
            warnings.warn(f"{path.name}: {pages} pages, using the first", stacklevel=2)

    def _grid(self, path: Path, dataset: Any, band: np.ma.MaskedArray[Any, Any]) -> RawGrid:
        name = path.name
        values, missing = np.ma.getdata(band), np.ma.getmaskarray(band)
        values = self._metres(name, dataset, values)
        known = dataset.nodatavals[self.band - 1] is not None

        # Rows from north to south, columns from west to east
        world_from_pixel = dataset.transform
        if abs(world_from_pixel.b) + abs(world_from_pixel.d) > 1e-9 * abs(world_from_pixel.a):
            raise InputError(f"{name}: is rotated; make it north-up first: gdalwarp {name} out.tif")
        across, down = world_from_pixel.a, -world_from_pixel.e
        placed = dataset.crs is not None or not world_from_pixel.is_identity
        if not placed:
            return RawGrid(values, missing, nodata_known=known)
        west, north = world_from_pixel.c, world_from_pixel.f
        if down < 0:
            values, missing, north = values[::-1], missing[::-1], north - dataset.height * down
            down = -down
        if across < 0:
            values, missing = values[:, ::-1], missing[:, ::-1]
            west, across = west + dataset.width * across, -across
        # GDAL gives the outer corner of the first pixel, whatever AREA_OR_POINT says.
        west, north = west + across / 2.0, north - down / 2.0
        crs = dataset.crs
        if crs is not None and crs.is_geographic:
            middle = north - (dataset.height - 1) * down / 2.0
            per_north, per_east = metres_a_degree(middle)
            down, across = down * per_north, across * per_east
            if self.spacing is None:
                raise InputError(
                    f"{name}: cells are in degrees (about {across:.1f} x {down:.1f} m at latitude "
                    f"{middle:.2f}); say spacing = {min(across, down):.0f} (--spacing) to resample "
                    "to metres, or reproject it first"
                )
            return RawGrid(values, missing, (down, across), nodata_known=known)
        text = None if crs is None else _crs_text(crs)
        factor = 1.0
        if crs is not None and crs.is_projected:
            unit, factor = crs.linear_units_factor
            if abs(factor - 1.0) > 1e-12:
                warnings.warn(
                    f"{name}: coordinates are in {unit}; converted to metres, the coordinate "
                    "system is dropped",
                    stacklevel=2,
                )
                text = None
            else:
                factor = 1.0
        spacings = (down * factor, across * factor)
        return RawGrid(values, missing, spacings, (west * factor, north * factor), text, known)

    def _metres(self, name: str, dataset: Any, values: NDArray[np.generic]) -> NDArray[np.floating]:
        """Apply scale, offset and the unit of the heights."""
        index = self.band - 1
        scale, offset = dataset.scales[index], dataset.offsets[index]
        unit = (dataset.units[index] or "").strip().lower()
        factor = 1.0
        if unit in FEET:
            factor = FEET[unit]
            warnings.warn(f"{name}: heights are in {unit}; converted to metres", stacklevel=2)
        elif unit not in METRES:
            warnings.warn(f"{name}: unit of heights {unit!r} taken for metres", stacklevel=2)
        if values.dtype.kind == "f" and (scale, offset, factor) == (1.0, 0.0, 1.0):
            return np.asarray(values)
        heights: NDArray[np.float64] = (values.astype(np.float64) * scale + offset) * factor
        return heights


def metres_a_degree(latitude: float) -> tuple[float, float]:
    """Return metres a degree to the north and to the east, on the WGS 84 ellipsoid."""
    angle = math.radians(latitude)
    squared = 0.00669437999014
    root = 1.0 - squared * math.sin(angle) ** 2
    north = 6378137.0 * (1.0 - squared) / root**1.5
    east = 6378137.0 * math.cos(angle) / math.sqrt(root)
    return math.radians(north), math.radians(east)


def _crs_text(crs: Any) -> str:
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else str(crs.to_wkt())
