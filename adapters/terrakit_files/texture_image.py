"""The colour texture of a terrain: one pixel a cell, north up, without any light in it."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from terrakit.color import linear_color, srgb_from_linear
from terrakit.heightfield import Heightfield


def colour_texture(terrain: Heightfield, sea_level: float | None = 0.0) -> NDArray[np.uint8]:
    """Return the texture of shape (rows - 1, cols - 1, 3), sRGB.

    A pixel is the mean of the four samples at the corners of its cell. So texture coordinates
    that run from 0 to 1 between the outermost samples fit exactly, and 2**k + 1 samples make a
    texture of 2**k pixels.
    """
    colours = linear_color(terrain, sea_level)
    west_east = colours[:, :-1] + colours[:, 1:]
    return srgb_from_linear((west_east[:-1] + west_east[1:]) * np.float32(0.25))


def texture_png(picture: NDArray[np.uint8]) -> bytes:
    """Return a texture as PNG that says it is sRGB; packed lightly, because it is packed often."""
    from PIL import Image, PngImagePlugin

    about = PngImagePlugin.PngInfo()
    about.add(b"sRGB", b"\0")
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", pnginfo=about, compress_level=2)
    return stream.getvalue()
