"""Opens rasters and pictures through GDAL, with its errors as one line about the file."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from terrakit.errors import InputError, ResourceError


@contextlib.contextmanager
def opened(path: Path, drivers: tuple[str, ...]) -> Iterator[Any]:
    """Yield the dataset in ``path``, which only these drivers may open.

    Raises
    ------
    InputError
        If the file is missing, empty, or not readable by any of them.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if size == 0:
        raise InputError(f"{path.name}: is empty")
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError
    from rasterio.io import MemoryFile

    logging.getLogger("rasterio").setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        for category in (NotGeoreferencedWarning, PendingDeprecationWarning, DeprecationWarning):
            warnings.simplefilter("ignore", category)  # about rasterio's own insides
        stack.enter_context(rasterio.Env(GDAL_PAM_ENABLED="NO"))
        try:
            try:
                str(path).encode()
                dataset: Any = rasterio.DatasetReader(path.absolute(), driver=list(drivers))
            except UnicodeEncodeError:  # a name that is no text: hand over the bytes
                memory = stack.enter_context(MemoryFile(path.read_bytes()))
                dataset = memory.open(driver=list(drivers))
            stack.enter_context(dataset)
        except (RasterioError, OSError, ValueError) as error:
            raise InputError(
                f"{path.name}: cannot be read, it is cut short, damaged or something else "
                f"({_reason(error, path)})"
            ) from None
        yield dataset


def read_band(path: Path, dataset: Any, band: int, masked: bool = True) -> Any:
    """Return one band as it is stored, with missing data masked if ``masked``."""
    from rasterio.errors import RasterioError

    try:
        return dataset.read(band, masked=masked)
    except (RasterioError, OSError, ValueError) as error:
        raise InputError(f"{path.name}: is cut short or damaged ({_reason(error, path)})") from None
    except MemoryError:
        cells = dataset.width * dataset.height
        item = np.dtype(dataset.dtypes[band - 1]).itemsize
        raise ResourceError(
            f"{path.name}: {cells:,} cells need {cells * item / 1e9:.1f} GB, which are not there"
        ) from None


def _reason(error: BaseException, path: Path) -> str:
    cause = error.__cause__ or error.__context__
    text = " ".join(str(cause if cause is not None else error).split())
    return text.replace(str(path.absolute()), path.name)[:160] or type(error).__name__
