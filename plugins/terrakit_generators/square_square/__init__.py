"""Square-square: subdivision without creases."""

from __future__ import annotations

from typing import ClassVar

from terrakit_generators.lattice_subdivision import LatticeSubdivision


class SquareSquare(LatticeSubdivision):
    """Put four new points into every cell of a lattice, weighted 9, 3, 3 and 1.

    New points lie at the quarter positions of a cell, and all are displaced alike, with s_1 of
    :class:`~terrakit_generators.lattice_subdivision.LatticeSubdivision`::

        z = (9 a + 3 b + 3 c + 1 d) / 16 + s_1(l) g,   a the nearest corner, d the furthest

    Without displacement this is the subdivision of the biquadratic B-spline, which is also what is
    sampled between the points of the last level: smooth everywhere, so that no crease of a coarse
    level remains. Each level lies a quarter of a step further south-east; samples are taken where
    they are in the world all the same.

    Notes
    -----
    A spline does not pass through its points: no height of a level survives the next one.

    References
    ----------
    G. S. P. Miller, "The definition and rendering of terrain maps", SIGGRAPH 1986.
    """

    name = "square_square"
    cites = ("Miller 1986",)
    rule = "square_square"
    is_shifted = True

    presets: ClassVar = {
        "hills": {"amplitude": 200.0, "wavelength": 3000.0, "hurst_exponent": 0.95},
        "rugged": {"amplitude": 900.0, "wavelength": 8000.0, "hurst_exponent": 0.65},
    }

    @property
    def second_share(self) -> float:
        """0: there is one step a level."""
        return 0.0
