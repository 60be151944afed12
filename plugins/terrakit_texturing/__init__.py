"""Texturing: layers that say what the ground looks like."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Texture


@hookimpl
def terrakit_textures() -> list[type[Texture]]:
    """Return the textures of this package."""
    from terrakit_texturing.slope_height import SlopeHeight

    return [SlopeHeight]
