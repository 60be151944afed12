"""Erosion: operators that move material and account for every cubic metre."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Erosion


@hookimpl
def terrakit_erosions() -> list[type[Erosion]]:
    """Return the erosions of this package."""
    from terrakit_erosion.automaton import Automaton
    from terrakit_erosion.droplet import Droplet
    from terrakit_erosion.hillslope import Hillslope
    from terrakit_erosion.hydraulic import Hydraulic
    from terrakit_erosion.multiscale import Multiscale
    from terrakit_erosion.repeat import Repeat
    from terrakit_erosion.stream_power import StreamPower
    from terrakit_erosion.thermal import Thermal
    from terrakit_erosion.weathering import Weathering
    from terrakit_erosion.wind import Wind

    return [
        Automaton,
        Droplet,
        Hillslope,
        Hydraulic,
        Multiscale,
        Repeat,
        StreamPower,
        Thermal,
        Weathering,
        Wind,
    ]
