"""Another generator, seen through noise that moves every place."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, FormulaGenerator, Place, fbm
from terrakit.parameters import Maskable, Seed, parameter
from terrakit.sources import Chain, Source
from terrakit_generators.fractals.fbm import Fbm
from terrakit_generators.fractals.octaves import Basis


class DomainWarp(FormulaGenerator):
    """Bend another generator's terrain: every place takes the height of a place nearby.

    The displacement is fractal noise, itself taken at a displaced place, ``nesting`` times::

        p_(k+1) = p_0 + strength (a_k(p_k), b_k(p_k)),  z(p_0) = source(p_nesting)

    What is there as samples (an earlier step) is interpolated by Catmull-Rom splines; beyond its
    border, the heights there are repeated.

    References
    ----------
    I. Quilez, "Domain warping", 2002. D. S. Ebert et al., "Texturing and Modeling", 1994.
    """

    name = "domain_warp"
    cites = ("Quilez 2002", "Ebert et al. 1994")
    fields = 3
    portrait: ClassVar[float] = 12000.0

    source: Source = parameter(
        Chain(operators=(Fbm(),)),
        "The terrain that is bent: noise, a landform, an earlier step, another domain_warp.",
    )
    strength: Maskable = parameter(
        3000.0, "Farthest that a place is moved.", unit="m", ge=0, le=1e6
    )
    wavelength: float = parameter(
        4000.0, "Distance between the largest bends.", unit="m", gt=0, le=1e8
    )
    octaves: int = parameter(
        5, "Layers of ever finer detail; each is finer by the lacunarity.", ge=1, le=24
    )
    nesting: int = parameter(2, "How often the warp is warped itself.", ge=1, le=8)
    basis: Basis = parameter("gradient", "The noise that is summed.", advanced=True)
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    presets: ClassVar = {
        "marble": {"strength": 5000.0, "nesting": 3},
        "breeze": {"strength": 1000.0, "nesting": 1, "octaves": 3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the source at the displaced place."""
        strength = place.value(self, "strength")
        at = place
        for bend in range(self.nesting):
            east, north = (self._bend(at, f"{axis} {bend}") for axis in ("east", "north"))
            at = place.displaced(east * strength, north * strength)
        return at.terrain(self.source, "source")

    def _bend(self, place: Place, stream: str) -> Formula:
        words = place.words(f"{self.name} {stream}", self.seed)
        return fbm(place.octaves(self.basis, self.wavelength, self.octaves, words))
