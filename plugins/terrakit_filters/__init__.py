"""Filters: reshape a terrain by rule, brush or transform."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Filter


@hookimpl
def terrakit_filters() -> list[type[Filter]]:
    """Return the filters of this package."""
    from terrakit_filters.amplify import Amplify
    from terrakit_filters.blend import Blend
    from terrakit_filters.brush import Brush
    from terrakit_filters.clamp import Clamp
    from terrakit_filters.crop import Crop
    from terrakit_filters.dequantise import Dequantise
    from terrakit_filters.flip import Flip
    from terrakit_filters.height_curve import HeightCurve
    from terrakit_filters.join import Join
    from terrakit_filters.normalise import Normalise
    from terrakit_filters.resample import Resample
    from terrakit_filters.reshape import Reshape
    from terrakit_filters.rotate import Rotate
    from terrakit_filters.stamp import Stamp
    from terrakit_filters.subdivide import Subdivide
    from terrakit_filters.terrace import Terrace

    return [
        Amplify,
        Blend,
        Brush,
        Clamp,
        Crop,
        Dequantise,
        Flip,
        HeightCurve,
        Join,
        Normalise,
        Resample,
        Reshape,
        Rotate,
        Stamp,
        Subdivide,
        Terrace,
    ]
