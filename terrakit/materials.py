"""What the ground is made of: one table of rocks and loose materials, by name.

The order is measured, the numbers are not: rocks are ranked after their mass strength (Selby 1980)
and after how fast they wear down in water, which falls with the square of their tensile strength
(Sklar & Dietrich 2001). Take them as starting values. Angles of loose material are angles of repose
(Carrigy 1970; Pohlman et al. 2006); those of rock are slopes that cliffs of it hold.

References
----------
M. J. Selby, Zeitschrift fuer Geomorphologie 24, 1980. L. S. Sklar and W. E. Dietrich, Geology 29,
2001. M. A. Carrigy, Sedimentology 14, 1970. N. A. Pohlman et al., Physical Review E 73, 2006.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """How one material takes erosion."""

    name: str
    hardness: float
    """Share of wear by wind, frost and chemistry that it withstands, 0 to 1."""
    repose_angle: float
    """Steepest slope that it holds, degrees."""
    erodibility: float
    """How fast running water cuts it; 1 is what an erosion's own settings say."""
    is_loose: bool = False


MATERIALS: dict[str, Material] = {
    material.name: material
    for material in (
        Material("quartzite", 0.95, 80.0, 0.05),
        Material("granite", 0.9, 75.0, 0.1),
        Material("gneiss", 0.9, 75.0, 0.1),
        Material("basalt", 0.85, 75.0, 0.15),
        Material("dolomite", 0.8, 75.0, 0.2),
        Material("limestone", 0.75, 70.0, 0.25),
        Material("conglomerate", 0.65, 65.0, 0.4),
        Material("sandstone", 0.6, 65.0, 0.5),
        Material("schist", 0.5, 50.0, 0.6),
        Material("tuff", 0.4, 55.0, 0.9),
        Material("chalk", 0.35, 55.0, 1.0),
        Material("siltstone", 0.3, 42.0, 1.2),
        Material("marl", 0.2, 38.0, 1.6),
        Material("shale", 0.15, 36.0, 1.8),
        Material("mudstone", 0.1, 35.0, 2.0),
        Material("scree", 0.0, 36.0, 1.5, is_loose=True),
        Material("gravel", 0.0, 36.0, 2.0, is_loose=True),
        Material("soil", 0.0, 40.0, 2.5, is_loose=True),
        Material("clay", 0.05, 30.0, 2.5, is_loose=True),
        Material("sand", 0.0, 33.0, 3.0, is_loose=True),
        Material("ash", 0.0, 35.0, 4.0, is_loose=True),
        Material("snow", 0.0, 38.0, 5.0, is_loose=True),
    )
}
