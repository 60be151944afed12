"""Generators: terrain from world coordinates, a seed and parameters."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Generator


@hookimpl
def terrakit_generators() -> list[type[Generator]]:
    """Return the generators of this package."""
    from terrakit_generators.diamond_square import DiamondSquare
    from terrakit_generators.expression import Expression
    from terrakit_generators.fractals import fractals
    from terrakit_generators.landforms import landforms
    from terrakit_generators.midpoint_displacement import MidpointDisplacement
    from terrakit_generators.plates import Plates
    from terrakit_generators.spectral import Spectral
    from terrakit_generators.square_square import SquareSquare
    from terrakit_generators.surfaces import Surfaces

    return [
        DiamondSquare,
        Expression,
        MidpointDisplacement,
        Plates,
        Spectral,
        SquareSquare,
        Surfaces,
        *fractals(),
        *landforms(),
    ]
