"""Pictures as masks: reading them safely, and stretching them over samples."""

from __future__ import annotations

import logging
import math
import re
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError

DRIVERS = ("PNG", "JPEG", "BMP", "PNM", "GTiff")
MOST_PIXELS = 2**28
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Share of red, green and blue in the brightness (ITU-R BT.709)."""
CHANNELS = ("red", "green", "blue", "alpha")


def read_picture(path: Path, channel: str) -> NDArray[np.float32]:
    """Return one value from 0 (black) to 1 (white) a pixel; the first row is the north.

    Parameters
    ----------
    path
        A PNG, JPEG, BMP, PGM or TIFF file of 8 or 16 bits or of floats.
    channel
        ``luminance``, which counts transparent pixels as black, or one of the four channels.

    Raises
    ------
    InputError
        If the file is missing, damaged, no picture, too large or lacks the channel.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    if not path.is_file():
        raise InputError(f"picture = {str(path)!r}: no such file; check its name")
    logging.getLogger("rasterio").setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), rasterio.Env(GDAL_PAM_ENABLED="NO"):
            for category in (
                NotGeoreferencedWarning,
                PendingDeprecationWarning,
                DeprecationWarning,
            ):
                warnings.simplefilter("ignore", category)  # about rasterio's own insides
            with rasterio.DatasetReader(path.absolute(), driver=list(DRIVERS)) as dataset:
                if dataset.width * dataset.height > MOST_PIXELS:
                    raise InputError(
                        f"picture = {path.name!r}: {dataset.width}x{dataset.height} pixels > "
                        f"{MOST_PIXELS}; make it smaller"
                    )
                _refuse_cut(path, dataset)
                bands = _bands(dataset)
    except InputError:
        raise
    except (RasterioError, OSError, ValueError) as error:
        raise InputError(
            f"picture = {path.name!r}: is damaged or no picture (PNG, JPEG, BMP, PGM or TIFF)"
        ) from error
    return _mixed(bands, channel, path.name)


def _refuse_cut(path: Path, dataset: Any) -> None:
    """Raise ValueError where a file ends too early or changed on its way.

    GDAL only warns of such PNG and PGM files, and hands out what was in memory for the rest.
    """
    if dataset.driver == "PNG":
        with open(path, "rb") as stream:
            stream.seek(8)
            kind = b""
            while kind != b"IEND":
                head = stream.read(8)
                length, kind = int.from_bytes(head[:4], "big"), head[4:]
                content, check = stream.read(length), stream.read(4)
                if len(check) < 4 or zlib.crc32(kind + content) != int.from_bytes(check, "big"):
                    raise ValueError("is cut short or damaged")
    elif dataset.driver == "PNM":
        size = dataset.width * dataset.height * sum(np.dtype(d).itemsize for d in dataset.dtypes)
        with open(path, "rb") as stream:
            header = re.match(rb"P[56](?:(?:\s|#[^\n]*\n)+\d+){3}\s", stream.read(4096))
        if header is None or path.stat().st_size < header.end() + size:
            raise ValueError("is cut short or damaged")


def _bands(dataset: Any) -> dict[str, NDArray[np.float64]]:
    """Return the channels of an open picture, 0 to 1, by name."""
    kind = np.dtype(dataset.dtypes[0])
    if kind.kind not in "uf":
        raise ValueError(f"values of type {kind}")
    values = dataset.read()
    try:
        table = dataset.colormap(1)
    except ValueError:
        table = None
    if table is not None:
        colours = np.array([table.get(i, (0, 0, 0, 255)) for i in range(256)], dtype=np.uint8)
        values = np.moveaxis(colours[values[0]], -1, 0)
        kind = np.dtype(np.uint8)
    white = float(np.iinfo(kind).max) if kind.kind == "u" else 1.0
    if kind == np.uint8 and dataset.driver == "PNG" and table is None:
        white = _white_of_png(Path(dataset.name))
    share = values.astype(np.float64) / white
    share = np.clip(np.where(np.isfinite(share), share, 0.0), 0.0, 1.0)
    names = {1: ("grey",), 2: ("grey", "alpha"), 3: CHANNELS[:3], 4: CHANNELS}
    if len(share) not in names:
        raise ValueError(f"{len(share)} channels")
    return dict(zip(names[len(share)], share, strict=True))


def _white_of_png(path: Path) -> float:
    """Return the value of white: a PNG of 1, 2 or 4 bits arrives in bytes, not stretched."""
    with open(path, "rb") as stream:
        head = stream.read(26)
    return float(2 ** head[24] - 1) if head[24] < 8 and head[25] == 0 else 255.0


def _mixed(bands: dict[str, NDArray[np.float64]], channel: str, name: str) -> NDArray[np.float32]:
    if channel == "luminance":
        if "grey" in bands:
            grey = bands["grey"]
        else:
            red, green, blue = (bands[c] * w for c, w in zip(CHANNELS, LUMINANCE, strict=False))
            grey = np.minimum(red + green + blue, 1.0)
        return (grey * bands.get("alpha", 1.0)).astype(np.float32)
    if channel not in bands and not (channel != "alpha" and "grey" in bands):
        raise InputError(
            f"channel = {channel!r}: picture {name!r} has only {', '.join(bands)}; "
            'use channel = "luminance"'
        )
    return bands.get(channel, bands.get("grey")).astype(np.float32)  # type: ignore[union-attr]


def stretched(
    picture: NDArray[np.float32],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    bounds: tuple[float, float, float, float],
    spacing: float,
) -> NDArray[np.float32]:
    """Return the picture at samples of the axes ``x`` and ``y``; 0 outside its bounds.

    The middles of its outermost pixels lie on the bounds: west, south, east, north. Between pixels
    it is linear; where samples are further apart than pixels they take the mean around them.
    """
    west, south, east, north = bounds
    rows = _weights((north - y) / (north - south), spacing / (north - south), picture.shape[0])
    cols = _weights((x - west) / (east - west), spacing / (east - west), picture.shape[1])
    across = _gathered(picture.astype(np.float64).T, *cols).T
    return _gathered(across, *rows).astype(np.float32)


def _weights(
    share: NDArray[np.float64], step: float, pixels: int
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return, a sample, the pixels that it sees along one axis and their weights.

    A tent as wide as the greater of one pixel and one sample (P. Heckbert, 1989).
    """
    at = share * (pixels - 1)
    width = max(1.0, round(step * (pixels - 1), 9))
    reach = math.ceil(width)
    if 2 * reach < pixels:
        near = np.floor(at).astype(np.intp)[:, None] + np.arange(-reach + 1, reach + 1)[None, :]
    else:  # every pixel once, in the same order, however small the picture lies in the terrain
        near = np.broadcast_to(np.arange(pixels), (len(at), pixels))
    weight = np.maximum(1.0 - np.abs(near - at[:, None]) / width, 0.0)
    inside = (near >= 0) & (near < pixels)
    weight = np.where(inside, weight, 0.0)
    total = weight.sum(axis=1, keepdims=True)
    outside = (share < -1e-9) | (share > 1 + 1e-9)
    weight = np.where(outside[:, None], 0.0, weight / np.where(total > 0, total, 1.0))
    return np.clip(near, 0, pixels - 1), weight


def _gathered(
    values: NDArray[np.float64], index: NDArray[np.intp], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return weighted sums of rows, one tap after the other: no library decides their order."""
    result = np.zeros((len(index), values.shape[1]))
    for tap in range(index.shape[1]):
        result += weight[:, tap, None] * values[index[:, tap]]
    return result
