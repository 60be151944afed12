"""Files of every kind: rasters, pictures, NumPy arrays, OBJ, and a picture to look at."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Exporter, Importer
from terrakit_files.image import Image
from terrakit_files.npz import Npz
from terrakit_files.numpy import Numpy
from terrakit_files.obj import Obj
from terrakit_files.preview import Preview
from terrakit_files.raster import Raster


@hookimpl
def terrakit_importers() -> list[type[Importer]]:
    """Return the importers of pictures, arrays and rasters."""
    return [Image, Numpy, Raster]


@hookimpl
def terrakit_exporters() -> list[type[Exporter]]:
    """Return the exporters of archives, OBJ and pictures."""
    return [Npz, Obj, Preview]
