"""The vocabulary of layers: one entry a name, with its unit and meaning.

A layer is a float32 field of the surface's own shape. Operators declare which layers they read
and write with these names, so that two plugins that never met mean the same thing by them.
A family (``material_``) stands for every name that begins with it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LayerKind:
    """What one layer, or one family of layers, holds."""

    name: str
    unit: str
    meaning: str
    family: bool = False


VOCABULARY: dict[str, LayerKind] = {
    kind.name: kind
    for kind in (
        LayerKind("elevation", "m", "Height of the ground above the datum."),
        LayerKind("sediment", "m", "Thickness of loose material on the bedrock."),
        LayerKind("erosion", "m", "Ground removed since the start of the run; never negative."),
        LayerKind("deposition", "m", "Material laid down since the start of the run."),
        LayerKind("drainage_area", "m2", "Area of land whose water passes through this point."),
        LayerKind("water_depth", "m", "Standing water above the ground."),
        LayerKind(
            "discharge", "m2/s", "Water that passes a metre of width, the mean over the run."
        ),
        LayerKind("flow_speed", "m/s", "How fast the water runs, at the end."),
        LayerKind("wetness", "1", "How often the ground is wet, 0 never to 1 always."),
        LayerKind("slope", "deg", "Steepness of the ground."),
        LayerKind("hardness", "1", "Resistance to erosion, 0 soft to 1 immovable."),
        LayerKind("strata_datum", "m", "Height of the top of the uppermost bed of the strata."),
        LayerKind("uplift", "m/yr", "Rise of the ground through tectonics."),
        LayerKind("plate", "1", "Number of the tectonic plate, whole and below 2^24."),
        LayerKind("plate_type", "1", "0 where the plate is oceanic, 1 where continental."),
        LayerKind("motion_east", "m/yr", "Motion of the plate to the east."),
        LayerKind("motion_north", "m/yr", "Motion of the plate to the north."),
        LayerKind("boundary_distance", "m", "Distance to the nearest border of the plate."),
        LayerKind("convergence", "m/yr", "How fast the two nearest plates close; < 0: they part."),
        LayerKind("shear", "m/yr", "How fast the two nearest plates slide along each other."),
        LayerKind(
            "boundary_class",
            "1",
            "0 none, 1 collision, 2 subduction, 3 rift, 4 ridge, 5 transform.",
        ),
        LayerKind("rain", "m/yr", "Precipitation."),
        LayerKind("valid", "1", "1 where the source has data, 0 where it was filled."),
        LayerKind("albedo_red", "1", "Red part of the base colour, linear light."),
        LayerKind("albedo_green", "1", "Green part of the base colour, linear light."),
        LayerKind("albedo_blue", "1", "Blue part of the base colour, linear light."),
        LayerKind("material_", "1", "Weight of one ground material; all sum to 1.", family=True),
        LayerKind("mask_", "1", "A user's mask, 0 to 1: vertex group, picture, painting.", True),
    )
}

ALBEDO = ("albedo_red", "albedo_green", "albedo_blue")


def layer_kind(name: str) -> LayerKind | None:
    """Return the vocabulary's entry for ``name``, or None where the vocabulary has none."""
    if name in VOCABULARY and not VOCABULARY[name].family:
        return VOCABULARY[name]
    for kind in VOCABULARY.values():
        if kind.family and name.startswith(kind.name) and len(name) > len(kind.name):
            return kind
    return None


def covers(declared: tuple[str, ...], name: str) -> bool:
    """Return whether ``name`` is one of the declared layers or belongs to a declared family."""
    kind = layer_kind(name)
    return name in declared or (kind is not None and kind.family and kind.name in declared)
