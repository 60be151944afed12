"""What all sums of octaves have in common."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, Literal

from terrakit.formula import Formula, FormulaGenerator, Octaves, Place
from terrakit.parameters import Maskable, Seed, parameter

Basis = Literal[
    "gradient",
    "value",
    "simplex",
    "white",
    "cellular_f1",
    "cellular_f2",
    "cellular_f3",
    "cellular_f4",
    "cellular_f2_minus_f1",
    "cellular_crackle",
    "cellular_value",
]
SlopeBasis = Literal["gradient", "value", "simplex"]
"""Noise whose slopes are known."""


class Fractal(FormulaGenerator):
    """Octaves of noise, each finer and lower than the one before."""

    fields: ClassVar[int] = 3
    portrait: ClassVar[float] = 12000.0
    trial: ClassVar[dict[str, Any]] = {"wavelength": 200.0, "octaves": 4}

    amplitude: Maskable = parameter(
        1000.0, "Highest possible rise above and fall below the offset.", unit="m", ge=0, le=1e6
    )
    wavelength: float = parameter(
        5000.0, "Distance between the largest hills.", unit="m", gt=0, le=1e8
    )
    octaves: int = parameter(
        10, "Layers of ever finer detail; each is finer by the lacunarity.", ge=1, le=24
    )
    lacunarity: float = parameter(
        1.97, "How much finer each octave is than the one before.", gt=1, le=4
    )
    hurst_exponent: float = parameter(
        0.85, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    gain: float | None = parameter(
        None,
        "Height of each octave relative to the one before (persistence); "
        "without it lacunarity^-hurst_exponent.",
        gt=0,
        le=1,
        advanced=True,
    )
    basis: Basis = parameter("gradient", "The noise that is summed.")
    offset: Maskable = parameter(
        0.0, "Height of the middle of the range.", unit="m", ge=-1e6, le=1e6
    )
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    @abstractmethod
    def shape(self, place: Place) -> Formula:
        """Return the sum at a place, as a share of the amplitude."""
        raise NotImplementedError

    def height(self, place: Place) -> Formula:
        """Return the height at a place."""
        rise = self.shape(place) * place.value(self, "amplitude")
        return rise + place.value(self, "offset")

    def summed(self, place: Place, stream: str = "") -> Octaves:
        """Return the octaves that are to be summed."""
        gain = self.lacunarity**-self.hurst_exponent if self.gain is None else self.gain
        words = place.words(f"{self.name} {stream}".strip(), self.seed)
        return place.octaves(
            self.basis, self.wavelength, self.octaves, words, self.lacunarity, gain
        )
