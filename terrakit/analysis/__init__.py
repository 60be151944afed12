"""Does it look like land? Seventeen yardsticks, measured and held against real terrain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrakit.analysis import drainage, relief, scaling, texture
from terrakit.analysis.bands import BANDS, SEVERITY, Band, NotMeasured, Range, Verdict
from terrakit.errors import InputError

__all__ = ["BANDS", "Analysis", "Band", "Range", "Row", "Verdict", "analyze"]

SMALLEST = 32
"""Fewest rows and columns that can be analysed."""
RELIABLE = 256
"""Fewest rows and columns for which the bands were set; smaller tiles scatter."""
SPACINGS = (10.0, 250.0)
"""Spacings (m) for which the bands were set."""


class Row(NamedTuple):
    """One line of a report, ready to print."""

    name: str
    value: str
    unit: str
    verdict: Verdict
    passes: str
    warns: str
    real: str
    noise: str
    meaning: str


@dataclass(frozen=True)
class Analysis:
    """What a terrain measures, and how that compares with real land.

    ``values`` are NaN, and ``verdicts`` "not measured", where ``reasons`` says why.
    """

    values: Mapping[str, float]
    verdicts: Mapping[str, Verdict]
    reasons: Mapping[str, str]
    notes: tuple[str, ...]
    shape: tuple[int, int]
    spacing: float

    @property
    def verdict(self) -> Verdict:
        """The worst of all verdicts."""
        return max(self.verdicts.values(), key=SEVERITY.index)

    def count(self, verdict: Verdict) -> int:
        """Return how many yardsticks came to a verdict."""
        return list(self.verdicts.values()).count(verdict)

    def table(self) -> list[Row]:
        """Return the report, one row a yardstick, the most telling first."""
        return [
            Row(
                name=band.name,
                value=_number(self.values[band.name]),
                unit=band.unit,
                verdict=self.verdicts[band.name],
                passes=str(band.passes),
                warns=str(band.warns),
                real=str(band.real),
                noise=str(band.noise),
                meaning=self.reasons.get(band.name, band.meaning),
            )
            for band in BANDS
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the analysis for JSON: what was not measured is ``None``."""
        return {
            "verdict": self.verdict,
            "shape": list(self.shape),
            "spacing": self.spacing,
            "notes": list(self.notes),
            "yardsticks": {
                band.name: {
                    "value": None if math.isnan(value := self.values[band.name]) else value,
                    "verdict": self.verdicts[band.name],
                    "unit": band.unit,
                    "pass": _ends(band.passes),
                    "warn": _ends(band.warns),
                    "real": _ends(band.real),
                    "noise": _ends(band.noise),
                    "reason": self.reasons.get(band.name),
                }
                for band in BANDS
            },
        }


def analyze(elevation: ArrayLike, spacing: float) -> Analysis:
    """Measure a heightfield with every yardstick of :data:`BANDS`.

    Parameters
    ----------
    elevation
        Heights in metres, (rows, columns), row 0 in the north; at least 32 x 32, all finite.
    spacing
        Distance between neighbouring samples, metres.

    Raises
    ------
    InputError
        If the heights are not a grid, too small or not finite, or the spacing is not positive.

    Notes
    -----
    The bands are for land that rivers shaped, on 256 x 256 samples or more at 10 to 250 m a
    sample; ``notes`` says where a terrain is outside of that.
    """
    heights = _checked(elevation, spacing)
    water = drainage.drain(heights, spacing)
    families: tuple[tuple[tuple[str, ...], Callable[[], float | tuple[float, ...]]], ...] = (
        (("pit_fraction",), lambda: drainage.pit_fraction(water)),
        (("updown_asymmetry",), lambda: drainage.updown_asymmetry(water)),
        (("theta_sa", "theta_sa_r2"), lambda: drainage.slope_area(water, spacing)),
        (("hack_h",), lambda: drainage.hack_exponent(water)),
        (("Rb", "Ra", "Rl"), lambda: drainage.horton_ratios(water)),
        (("spikes",), lambda: texture.spike_fraction(heights)),
        (("checkerboard",), lambda: texture.checkerboard_energy(heights)),
        (("bias_m4", "bias_m8"), lambda: texture.aspect_bias(heights, spacing)),
        (("H_variogram",), lambda: scaling.variogram_hurst(heights)),
        (("beta2", "nyquist_excess"), lambda: scaling.spectral_slope(heights)),
        (("HI_tile",), lambda: relief.hypsometric_integral(heights)),
        (("slope_max",), lambda: relief.steepest_slope(heights, spacing)),
    )
    values: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for names, measure in families:
        try:
            result = measure()
        except NotMeasured as why:
            values.update(dict.fromkeys(names, math.nan))
            reasons.update(dict.fromkeys(names, str(why)))
        else:
            numbers = result if isinstance(result, tuple) else (result,)
            values.update(zip(names, numbers, strict=True))
    return Analysis(
        values=MappingProxyType({band.name: values[band.name] for band in BANDS}),
        verdicts=MappingProxyType({b.name: b.verdict(values[b.name]) for b in BANDS}),
        reasons=MappingProxyType(reasons),
        notes=_notes(heights, spacing),
        shape=(heights.shape[0], heights.shape[1]),
        spacing=float(spacing),
    )


def _checked(elevation: ArrayLike, spacing: float) -> NDArray[np.float64]:
    """Return the heights above their mean as float64, or refuse them."""
    heights = np.asarray(elevation)
    if heights.ndim != 2:
        raise InputError(f"elevation: {heights.ndim} dimensions; give a grid of rows and columns")
    rows, columns = heights.shape
    if min(rows, columns) < SMALLEST:
        raise InputError(
            f"elevation: {rows} x {columns} samples are too few to analyse; "
            f"give at least {SMALLEST} x {SMALLEST}"
        )
    with np.errstate(over="ignore"):
        bad = int(np.count_nonzero(~np.isfinite(heights.astype(np.float32))))
    if bad:
        raise InputError(f"elevation: {bad} samples are NaN or infinite; fill or crop them first")
    if not (math.isfinite(spacing) and spacing > 0):
        raise InputError(f"spacing: {spacing} m; give a positive number of metres")
    centred: NDArray[np.float64] = heights.astype(np.float64) - heights.mean(dtype=np.float64)
    return centred


def _notes(heights: NDArray[np.float64], spacing: float) -> tuple[str, ...]:
    """Return where the terrain is outside of what the bands were set for."""
    notes = []
    rows, columns = heights.shape
    if min(rows, columns) < RELIABLE:
        notes.append(
            f"{rows} x {columns} samples: the bands are for {RELIABLE} x {RELIABLE} or more, "
            "and small tiles scatter"
        )
    if not SPACINGS[0] <= spacing <= SPACINGS[1]:
        notes.append(
            f"{spacing:g} m a sample: the bands are for {SPACINGS[0]:g} to {SPACINGS[1]:g} m"
        )
    return tuple(notes)


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def _ends(band: Range) -> list[float | None]:
    return [end if math.isfinite(end) else None for end in (band.low, band.high)]
