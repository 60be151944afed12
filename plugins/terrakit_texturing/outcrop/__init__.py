"""Which bed shows at the surface: colours and weights of the rock that erosion has laid bare."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.layers import ALBEDO
from terrakit.operators import Texture
from terrakit.parameters import parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure

F = np.float32
Field = NDArray[np.float32]

COLOURS: dict[str, tuple[float, float, float]] = {
    "quartzite": (0.46, 0.41, 0.38),
    "granite": (0.33, 0.28, 0.26),
    "gneiss": (0.25, 0.24, 0.24),
    "basalt": (0.06, 0.06, 0.065),
    "dolomite": (0.50, 0.45, 0.37),
    "limestone": (0.52, 0.48, 0.40),
    "conglomerate": (0.31, 0.22, 0.16),
    "sandstone": (0.46, 0.21, 0.11),
    "schist": (0.20, 0.20, 0.19),
    "tuff": (0.40, 0.33, 0.26),
    "chalk": (0.75, 0.74, 0.68),
    "siltstone": (0.33, 0.20, 0.14),
    "marl": (0.42, 0.40, 0.33),
    "shale": (0.18, 0.15, 0.14),
    "mudstone": (0.30, 0.16, 0.12),
    "scree": (0.26, 0.24, 0.21),
    "gravel": (0.28, 0.26, 0.23),
    "soil": (0.10, 0.075, 0.05),
    "clay": (0.31, 0.19, 0.12),
    "sand": (0.49, 0.40, 0.26),
    "ash": (0.10, 0.095, 0.09),
    "snow": (0.80, 0.83, 0.87),
}
"""Base colours in linear light, by the names of :data:`terrakit.materials.MATERIALS`."""
UNKNOWN = (0.30, 0.28, 0.26)
LOOSE = (0.24, 0.20, 0.15)


class Outcrop(Texture):
    """Paint the bed that crops out at every point, and what lies loose on top of it.

    Weights are 1 for the bed that is there and 0 for the others; loose material hides the rock as
    it gets thicker, all of it at ``cover_thickness``. Use it after erosion: bands of rock run along
    the cliffs that the beds have made.

    References
    ----------
    B. Benes and R. Forsbach, "Layered data representation for visual simulation of terrain
    erosion", 2001.
    """

    name = "outcrop"
    reads = ("elevation", "strata_datum")
    uses = ("sediment",)
    writes = ("hardness", "material_", *ALBEDO)
    cites = ("Benes & Forsbach 2001",)
    locality = "pointwise"
    fields = 12

    cover_thickness: float = parameter(
        1.0, "Thickness of loose material that hides the rock.", unit="m", gt=0, le=1e4
    )

    def texture(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain with weights, hardness and a colour."""
        strata = surface.strata
        if strata is None:
            raise InputError('the terrain has no beds; lay them first: use = "strata"')
        quanta = Quanta.fitting(surface.elevation, surface.spacing)
        exposure = Exposure(surface, quanta, Run(device="numpy"))
        loose = np.zeros(surface.shape, dtype=F)
        if "sediment" in surface:
            loose = np.maximum(surface.layer("sediment"), F(0))
        bedrock = quanta.count(surface.elevation - loose)
        bed = exposure.bed(bedrock)
        run.check()
        cover = np.minimum(loose / F(self.cover_thickness), F(1))
        hard = strata.values("hardness")[bed] * (F(1) - cover)
        layers: dict[str, Field] = {"hardness": hard, "material_sediment": cover}
        colour = [cover * F(channel) for channel in LOOSE]
        for index, material in enumerate(strata.beds):
            shows = np.where(bed == index, F(1) - cover, F(0))
            name = f"material_{material.material}"
            layers[name] = layers[name] + shows if name in layers else shows
            paint = COLOURS.get(material.material, UNKNOWN)
            for channel, part in zip(colour, paint, strict=True):
                channel += shows * F(part)
        return surface.with_layers(**layers, **dict(zip(ALBEDO, colour, strict=True)))
