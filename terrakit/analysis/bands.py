"""The yardsticks and their bands: what land that rivers eroded measures, and what noise does.

The bands hold for tiles of 256 x 256 samples or more at 10 to 250 m a sample, eroded by rivers; not
for reefs, dunes, karst, ice or the sea bed. They are a gate against noise and artefacts, not a
proof of realism.

The real range is what this package measures on nine DEMs: Jacksboro (Tennessee, 3", the whole),
three tiles of 256 x 256 of Big Tujunga (California, 30 m), Rocky Mountain NP (234 m), Boulder
(Colorado, 3"), Fuji, one tile of the Terrarium set, and the example DEM of TopoToolbox (92 m). The
spacings of Fuji (62 m) and of the Terrarium tile (122 m) are not recorded with the data but
assumed; of the yardsticks, slope_max depends on them. Rocky Mountain, Boulder and the TopoToolbox
DEM are smaller than 256 x 256. Where a definition left room, it was chosen by looking at these
DEMs, so that they pass is no independent evidence. Two others do not pass: a tile of Mount
St. Helens (hack_h 0.35) and Maungawhau, a volcano of 61 x 87 samples (Rl 1.1, beta2 5.4).

The noise range is white noise and spectral fBm of Hurst exponents 0.5, 0.7 and 0.9, 25 tiles of
256 x 256 at 30 m a sample: the white noise with a deviation of 30 m, the fBm with a relief of
1000 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["pass", "not measured", "warn", "fail"]

SEVERITY: tuple[Verdict, ...] = ("pass", "not measured", "warn", "fail")
"""Verdicts from best to worst; what cannot be measured cannot be passed."""


class NotMeasured(Exception):  # noqa: N818  (an answer, not an error)
    """A yardstick that this terrain has no value for; the message says why."""


@dataclass(frozen=True)
class Range:
    """A closed interval; an infinite end is open."""

    low: float = -math.inf
    high: float = math.inf

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    def __str__(self) -> str:
        if math.isinf(self.low):
            return f"<= {self.high:g}"
        if math.isinf(self.high):
            return f">= {self.low:g}"
        return f"{self.low:g} .. {self.high:g}"


@dataclass(frozen=True)
class Band:
    """One yardstick: what it tells, and what real land measures."""

    name: str
    meaning: str
    unit: str
    passes: Range
    warns: Range
    real: Range
    noise: Range
    source: str

    def verdict(self, value: float) -> Verdict:
        """Return where a value falls; NaN was not measured."""
        if math.isnan(value):
            return "not measured"
        if value in self.passes:
            return "pass"
        return "warn" if value in self.warns else "fail"


BANDS: tuple[Band, ...] = (
    Band(
        "pit_fraction",
        "Ground that lies in closed hollows and would flood before water leaves the map.",
        "of cells",
        Range(high=0.05),
        Range(high=0.12),
        Range(0.0, 0.046),
        Range(0.13, 0.39),
        "Zandbergen 2006; Barnes, Lehman & Mulla 2014",
    ),
    Band(
        "updown_asymmetry",
        "Valleys connect, ridges break into peaks: rivers do that. Noise looks alike both ways up.",
        "log10 ratio",
        Range(low=0.5),
        Range(low=0.25),
        Range(0.67, 3.6),
        Range(-0.28, 0.14),
        "terrakit",
    ),
    Band(
        "theta_sa_r2",
        "How well slope follows drainage area, which is what running water enforces.",
        "R2",
        Range(low=0.8),
        Range(low=0.65),
        Range(0.96, 1.0),
        Range(0.0, 0.72),
        "Flint 1974",
    ),
    Band(
        "spikes",
        "Single samples that stick out of, or sink into, everything around them.",
        "of cells",
        Range(high=0.002),
        Range(high=0.01),
        Range(0.0, 0.0003),
        Range(0.0004, 0.028),
        "terrakit",
    ),
    Band(
        "checkerboard",
        "Heights that alternate from sample to sample like the squares of a chessboard.",
        "of fine energy",
        Range(high=0.08),
        Range(high=0.18),
        Range(0.017, 0.054),
        Range(0.09, 0.34),
        "terrakit",
    ),
    Band(
        "theta_sa",
        "How fast rivers flatten as they grow: the concavity of the slope-area law.",
        "",
        Range(0.15, 0.75),
        Range(0.05, 1.0),
        Range(0.27, 0.53),
        Range(-0.09, 0.56),
        "Flint 1974; Mudd et al. 2018",
    ),
    Band(
        "hack_h",
        "How river length grows with the land it drains: long thin basins or round ones.",
        "",
        Range(0.45, 0.65),
        Range(0.4, 0.7),
        Range(0.47, 0.57),
        Range(0.4, 0.61),
        "Hack 1957; Rigon et al. 1996",
    ),
    Band(
        "Rb",
        "How many streams of one order feed one of the next (bifurcation ratio).",
        "",
        Range(3.0, 5.5),
        Range(2.5, 7.0),
        Range(4.2, 4.7),
        Range(3.8, 4.8),
        "Horton 1945; Vorosmarty et al. 2000",
    ),
    Band(
        "Ra",
        "How much larger the basins of the next stream order are (area ratio).",
        "",
        Range(3.0, 6.0),
        Range(2.5, 7.0),
        Range(4.0, 5.0),
        Range(3.7, 4.9),
        "Horton 1945; Vorosmarty et al. 2000",
    ),
    Band(
        "Rl",
        "How much longer the streams of the next order are (length ratio).",
        "",
        Range(1.5, 3.5),
        Range(1.2, 4.0),
        Range(1.9, 2.5),
        Range(1.5, 2.6),
        "Horton 1945; Vorosmarty et al. 2000",
    ),
    Band(
        "HI_tile",
        "Share of the block between lowest and highest point that is still rock: young or worn.",
        "of relief",
        Range(0.2, 0.65),
        Range(0.12, 0.8),
        Range(0.24, 0.57),
        Range(0.35, 0.54),
        "Strahler 1952",
    ),
    Band(
        "H_variogram",
        "How smooth the ground is over 1 to 16 samples: 0 is gravel, 1 is a bent sheet.",
        "Hurst exponent",
        Range(0.45, 0.95),
        Range(0.3, 1.0),
        Range(0.65, 0.88),
        Range(0.0, 0.85),
        "Mark & Aronson 1984",
    ),
    Band(
        "beta2",
        "How fast detail fades from large forms to small ones.",
        "spectral slope",
        Range(2.8, 4.6),
        Range(2.2, 5.0),
        Range(3.2, 4.6),
        Range(-0.2, 4.0),
        "Perron, Kirchner & Dietrich 2008",
    ),
    Band(
        "nyquist_excess",
        "Too much detail at the size of single samples: grain, ripples, stair steps.",
        "log10 power",
        Range(high=0.35),
        Range(high=0.8),
        Range(-1.5, 0.25),
        Range(-0.1, 0.09),
        "terrakit",
    ),
    Band(
        "bias_m4",
        "Slopes that prefer the four directions of the grid's axes, or of its diagonals.",
        "of slope",
        Range(high=0.06),
        Range(high=0.12),
        Range(0.02, 0.046),
        Range(0.001, 0.028),
        "terrakit",
    ),
    Band(
        "bias_m8",
        "Slopes that prefer the grid's eight directions, as simple flow routing does.",
        "of slope",
        Range(high=0.06),
        Range(high=0.12),
        Range(0.005, 0.017),
        Range(0.0009, 0.009),
        "terrakit",
    ),
    Band(
        "slope_max",
        "The steepest ground; beyond 75 degrees a heightfield is a wall.",
        "deg",
        Range(high=75.0),
        Range(high=85.0),
        Range(27.0, 66.0),
        Range(37.0, 75.0),
        "terrakit",
    ),
)
"""Every yardstick, in the order of the report: those that tell land from noise come first."""
