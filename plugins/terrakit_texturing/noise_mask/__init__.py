"""A mask of patches: where fractal noise is high."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from terrakit.formula import Place, fbm, smoothstep
from terrakit.heightfield import Heightfield
from terrakit.parameters import Seed, parameter
from terrakit.running import Run
from terrakit_texturing.mask import Field, Mask


class NoiseMask(Mask):
    """Select irregular patches, as of forest, fog or rain.

    The mask is 1 where fractal noise, from -1 to 1, is above the threshold, and fades in over
    ``softness``::

        m = s(threshold - softness / 2, threshold + softness / 2, sum_k gain^k n_k / sum_k gain^k)

    It is a function of the place alone, whatever the terrain.

    References
    ----------
    K. Perlin, "Improving noise", SIGGRAPH 2002.
    """

    name = "noise_mask"
    cites = ("Perlin 2002",)
    locality = "pointwise"
    turning: ClassVar = None
    trial: ClassVar = {"allow_empty": True, "wavelength": 100.0}

    layer: str = parameter("mask_noise", "Name of the layer to write; begins with mask_.")
    wavelength: float = parameter(
        800.0, "Distance between the largest patches.", unit="m", gt=0, le=1e8
    )
    octaves: int = parameter(
        5, "Layers of ever finer detail; each is finer by the lacunarity.", ge=1, le=24
    )
    threshold: float = parameter(
        0.0, "Noise above which ground is selected: -1 selects all, 0 half, 1 none.", ge=-1, le=1
    )
    softness: float = parameter(0.1, "Over how much noise the mask fades in.", gt=0, le=2)
    basis: Literal["gradient", "value", "simplex", "cellular_f1", "cellular_value"] = parameter(
        "gradient", "The noise that is summed."
    )
    seed: Seed = parameter(0, "Another number or word gives other patches.")

    presets: ClassVar = {
        "forest": {"layer": "mask_forest", "threshold": -0.05, "wavelength": 600.0},
        "showers": {"layer": "mask_showers", "softness": 0.8, "wavelength": 5000.0, "octaves": 3},
        "fields": {"layer": "mask_fields", "basis": "cellular_value", "octaves": 1},
    }

    def remedy(self) -> str:
        """Return how to select something."""
        return f"no noise is above {self.threshold:g}; lower threshold"

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        place = Place(surface.grid, run, surface)
        words = place.words(self.name, self.seed)
        noise = fbm(place.octaves(self.basis, self.wavelength, self.octaves, words))
        low, high = self.threshold - self.softness / 2, self.threshold + self.softness / 2
        (mask,) = place.computed(smoothstep(low, high, noise))
        host = mask if isinstance(mask, np.ndarray) else mask.download()
        return np.minimum(host, np.float32(1))
