"""The colour of a terrain as eight-bit sRGB, for textures and vertex colours.

Layers hold linear light; pictures hold sRGB (IEC 61966-2-1). The two meet here, in one place.
"""

from __future__ import annotations

import io
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrakit.layers import ALBEDO

if TYPE_CHECKING:
    from terrakit.heightfield import Heightfield
    from terrakit.operators import Surface


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.uint8]:
    """Encode linear light as sRGB in eight bits.

    Values are compared with the 255 lights at which the code changes, so that no power function
    of the platform decides a byte. Values below 0 give 0 and values above 1 give 255.

    Parameters
    ----------
    linear
        Light of any shape, 0 black to 1 full.

    Returns
    -------
    ndarray of uint8
        Codes of the same shape, rounded to the nearest.

    Examples
    --------
    >>> srgb_from_linear([0.0, 0.5, 1.0]).tolist()
    [0, 188, 255]
    """
    light = np.asarray(linear, dtype=np.float32)
    return np.searchsorted(_ends_of_codes(), light, side="right").astype(np.uint8)


def linear_color(surface: Surface, sea_level: float | None = None) -> NDArray[np.float32]:
    """Return the base colour of every sample or vertex, linear light.

    The albedo layers if all three are there, else a tint by height.

    Parameters
    ----------
    surface
        A heightfield or a mesh.
    sea_level
        Height below which the tint is water, metres; None for a world without.

    Returns
    -------
    ndarray of float32
        Red, green and blue, of shape (rows, cols, 3) or (vertices, 3).
    """
    if all(name in surface for name in ALBEDO):
        return np.stack([surface.layer(name) for name in ALBEDO], axis=-1)
    from terrakit.shading import hypsometric

    elevation = surface.elevation
    grid = elevation if elevation.ndim == 2 else elevation[:, None]
    return hypsometric(grid, sea_level).reshape(*elevation.shape, 3)


def texture_picture(terrain: Heightfield, sea_level: float | None = None) -> NDArray[np.uint8]:
    """Return the texture of a terrain as sRGB of shape (rows - 1, cols - 1, 3), north up.

    A pixel is the mean of the four samples at the corners of its cell. So texture coordinates that
    run from 0 to 1 between the outermost samples fit exactly, and 2**k + 1 samples make a texture
    of 2**k pixels.
    """
    colors = linear_color(terrain, sea_level)
    west_east = colors[:, :-1] + colors[:, 1:]
    return srgb_from_linear((west_east[:-1] + west_east[1:]) * np.float32(0.25))


def png_bytes(color: NDArray[np.uint8]) -> bytes:
    """Return an sRGB picture of shape (rows, cols, 3), row 0 at the top, as a PNG that says so.

    Packed lightly: textures are written often and read once.
    """
    from PIL import Image, PngImagePlugin

    about = PngImagePlugin.PngInfo()
    about.add(b"sRGB", b"\0")
    stream = io.BytesIO()
    Image.fromarray(color).save(stream, "PNG", pnginfo=about, compress_level=2)
    return stream.getvalue()


@cache
def _ends_of_codes() -> NDArray[np.float32]:
    """Return the light at which code 0, 1, ... 254 ends and the next begins."""
    ends = []
    for code in range(255):
        encoded = (code + 0.5) / 255.0
        low = encoded <= 0.04045
        ends.append(encoded / 12.92 if low else ((encoded + 0.055) / 1.055) ** 2.4)
    return np.array(ends, dtype=np.float32)
