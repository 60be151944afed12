"""Texturing: layers that say what the ground looks like, and masks that other steps follow."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Texture


@hookimpl
def terrakit_textures() -> list[type[Texture]]:
    """Return the textures of this package."""
    from terrakit_texturing.aspect_mask import AspectMask
    from terrakit_texturing.curvature_mask import CurvatureMask
    from terrakit_texturing.distance_mask import DistanceMask
    from terrakit_texturing.height_mask import HeightMask
    from terrakit_texturing.image_mask import ImageMask
    from terrakit_texturing.noise_mask import NoiseMask
    from terrakit_texturing.outcrop import Outcrop
    from terrakit_texturing.polygon_mask import PolygonMask
    from terrakit_texturing.slope_height import SlopeHeight
    from terrakit_texturing.slope_mask import SlopeMask
    from terrakit_texturing.strata import LayStrata

    return [
        AspectMask,
        CurvatureMask,
        DistanceMask,
        HeightMask,
        ImageMask,
        LayStrata,
        NoiseMask,
        Outcrop,
        PolygonMask,
        SlopeHeight,
        SlopeMask,
    ]
