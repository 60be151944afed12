"""Diamond-square: the classic fractal of game terrains, without its grid-bound habits."""

from __future__ import annotations

from typing import ClassVar

from terrakit_generators.lattice_subdivision import HalfSteps


class DiamondSquare(HalfSteps):
    """Halve a lattice in two turns: centres from corners, then edges from both.

    With s_1 and s_2 of :class:`~terrakit_generators.lattice_subdivision.LatticeSubdivision`::

        diamond:  centre = mean of its 4 corners + s_1(l) g
        square:   edge   = mean of its 2 ends and the 2 centres beside it + s_2(l) g

    Notes
    -----
    The exponent is nominal: measured variograms are up to 0.07 lower (see the README). Guesses are
    no smooth surface, so at large exponents faint creases follow the coarse lattice; use
    square_square where they show.

    References
    ----------
    A. Fournier, D. Fussell and L. Carpenter, "Computer rendering of stochastic models", CACM 1982.
    G. S. P. Miller, "The definition and rendering of terrain maps", SIGGRAPH 1986. R. F. Voss,
    "Fractals in nature", 1988, for the additions.
    """

    name = "diamond_square"
    cites = ("Fournier, Fussell & Carpenter 1982", "Miller 1986", "Voss 1988")
    rule = "diamond_square"

    presets: ClassVar = {
        "hills": {"amplitude": 120.0, "wavelength": 3000.0, "hurst_exponent": 0.95},
        "rugged": {"amplitude": 700.0, "wavelength": 8000.0, "hurst_exponent": 0.65},
    }
