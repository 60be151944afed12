"""Generators: terrain from world coordinates, a seed and parameters."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Generator


@hookimpl
def terrakit_generators() -> list[type[Generator]]:
    """Return the generators of this package."""
    from terrakit_generators.fbm import Fbm

    return [Fbm]
