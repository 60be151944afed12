"""Noise and its sums: fBm, ridges, multifractals, warps."""

from __future__ import annotations

from terrakit.operators import Generator


def fractals() -> list[type[Generator]]:
    """Return the generators of this folder."""
    from terrakit_generators.fractals.billow import Billow
    from terrakit_generators.fractals.domain_warp import DomainWarp
    from terrakit_generators.fractals.fbm import Fbm
    from terrakit_generators.fractals.heterogeneous_terrain import HeterogeneousTerrain
    from terrakit_generators.fractals.hybrid_multifractal import HybridMultifractal
    from terrakit_generators.fractals.jordan import Jordan
    from terrakit_generators.fractals.multifractal import Multifractal
    from terrakit_generators.fractals.noise import Noise
    from terrakit_generators.fractals.ridged_multifractal import RidgedMultifractal
    from terrakit_generators.fractals.slope_damped import SlopeDamped
    from terrakit_generators.fractals.swiss import Swiss
    from terrakit_generators.fractals.turbulence import Turbulence
    from terrakit_generators.fractals.variable_lacunarity import VariableLacunarity

    return [
        Billow,
        DomainWarp,
        Fbm,
        HeterogeneousTerrain,
        HybridMultifractal,
        Jordan,
        Multifractal,
        Noise,
        RidgedMultifractal,
        SlopeDamped,
        Swiss,
        Turbulence,
        VariableLacunarity,
    ]
