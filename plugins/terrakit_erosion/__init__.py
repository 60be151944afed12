"""Erosion: operators that move material and account for every cubic metre."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Erosion


@hookimpl
def terrakit_erosions() -> list[type[Erosion]]:
    """Return the erosions of this package."""
    from terrakit_erosion.stream_power import StreamPower
    from terrakit_erosion.thermal import Thermal

    return [StreamPower, Thermal]
