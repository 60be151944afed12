"""Midpoint displacement: the founding fractal terrain, creases and all."""

from __future__ import annotations

from typing import ClassVar

from terrakit_generators.lattice_subdivision import HalfSteps


class MidpointDisplacement(HalfSteps):
    """Halve the edges of a lattice, each from its own two ends.

    With s_1 and s_2 of :class:`~terrakit_generators.lattice_subdivision.LatticeSubdivision`::

        edge   = mean of its 2 ends + s_2(l) g
        centre = mean of its 4 corners + s_1(l) g

    An edge knows nothing of the land beside it. So two patches that share an edge fit whatever
    else they do, and so every edge of a coarse level stays visible as a straight crease; that is
    the difference to diamond_square, whose edges listen to the centres on both sides.

    Notes
    -----
    The exponent is nominal; see the README for what is measured.

    References
    ----------
    A. Fournier, D. Fussell and L. Carpenter, "Computer rendering of stochastic models", CACM 1982.
    R. F. Voss, "Fractals in nature", 1988, for the additions.
    """

    name = "midpoint_displacement"
    cites = ("Fournier, Fussell & Carpenter 1982", "Voss 1988")
    rule = "midpoint"

    presets: ClassVar = {
        "hills": {"amplitude": 120.0, "wavelength": 3000.0, "hurst_exponent": 0.95},
        "facets": {"amplitude": 500.0, "wavelength": 6000.0, "hurst_exponent": 0.98},
    }
