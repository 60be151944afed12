"""Mathematical surfaces with names: to test with, to build from, to look at."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, Literal

from terrakit.formula import (
    Formula,
    FormulaGenerator,
    Place,
    absolute,
    clamp,
    cosine,
    exp,
    fraction,
    hypot,
    maximum,
    sine,
    sqrt,
    square,
    tanh,
    where,
)
from terrakit.parameters import Maskable, parameter
from terrakit_generators.landforms.landform import Point

Shape = Callable[[Formula, Formula], Formula]
"""Height as a share of the amplitude, of distances to the right and ahead."""

SurfaceName = Literal[
    "agnesi_ridge",
    "concentric_waves",
    "cone",
    "dune_train",
    "eggcrate",
    "gaussian_hill",
    "hemisphere",
    "mexican_hat",
    "monkey_saddle",
    "paraboloid",
    "peaks",
    "plane",
    "pyramid",
    "ripple",
    "saddle",
    "sine_ridges",
    "step",
    "torus_ring",
]
TAU = 2.0 * math.pi
FARTHEST = 1000.0
"""Radii from the center beyond which what grows without bound stays as high as it is there."""
PEAKS_MAXIMUM = 8.106213589
WINDWARD = 0.75
"""Share of a dune's length that faces the wind."""
TUBE = 0.25
"""Radius of the tube of a torus, as a share of the radius of its ring."""


class Surfaces(FormulaGenerator):
    """Make a surface from the library of mathematics, in metres.

    With u and v the distances to the right and ahead over the radius, s^2 = u^2 + v^2, and phases
    p = 2 pi x / wavelength, q = 2 pi y / wavelength, the height over the amplitude is::

        agnesi_ridge   1 / (1 + v^2)                    paraboloid   max(0, 1 - s^2)
        concentric_waves  cos(2 pi r / wavelength)      peaks        MATLAB's, over 8.106
        cone           max(0, 1 - s)                    plane        v
        dune_train     (1 - cos of the skewed q) / 2    pyramid      max(0, 1 - max(|u|, |v|))
        eggcrate       sin p sin q                      ripple       sin(k r) / (k r)
        gaussian_hill  e^(-s^2 / 2)                     saddle       v^2 - u^2
        hemisphere     sqrt(max(0, 1 - s^2))            sine_ridges  sin q
        mexican_hat    (1 - s^2 / 2) e^(-s^2 / 2)       step         (1 + tanh v) / 2
        monkey_saddle  v^3 - 3 v u^2                    torus_ring   sqrt(max(0, 1 - ((s - 1) 4)^2))
    """

    name = "surfaces"
    cites = ("Gray, Abbena & Salamon 2006",)
    fields = 3
    portrait: ClassVar[float] = 4000.0
    trial: ClassVar = {"surface": "eggcrate", "center": [120.0, 90.0], "direction": 30.0}

    surface: SurfaceName = parameter("peaks", "Which surface.")
    amplitude: Maskable = parameter(
        300.0, "Height of a crest or summit above the offset.", unit="m", ge=0, le=1e6
    )
    wavelength: float = parameter(
        800.0,
        "Distance from crest to crest: ridges, waves, dunes, eggcrate, ripple.",
        unit="m",
        ge=0.001,
        le=1e8,
    )
    radius: float = parameter(
        800.0,
        "Size of what does not repeat: from its middle to its edge, its deviation, its rise.",
        unit="m",
        ge=0.001,
        le=1e8,
    )
    center: Point | None = parameter(
        None, "World x and y of its middle; the middle of the world without it.", unit="m"
    )
    direction: float = parameter(
        0.0,
        "Where it rises, its waves travel or its wind blows: degrees clockwise from north.",
        unit="deg",
        ge=-360,
        le=360,
    )
    offset: Maskable = parameter(0.0, "Height of its ground.", unit="m", ge=-1e6, le=1e6)

    presets: ClassVar = {
        "dunes": {
            "surface": "dune_train",
            "amplitude": 40.0,
            "wavelength": 350.0,
            "direction": 100.0,
        },
        "pool": {"surface": "ripple", "amplitude": 400.0, "wavelength": 500.0},
        "pass": {"surface": "saddle", "amplitude": 250.0, "radius": 1500.0},
        "dome": {"surface": "hemisphere", "amplitude": 800.0, "radius": 1200.0},
        "escarpment": {"surface": "step", "amplitude": 400.0, "radius": 250.0},
    }

    def height(self, place: Place) -> Formula:
        """Return the height at a place."""
        right, ahead = place.around(self.center, self.direction)
        length = self.wavelength if self.surface in PERIODIC else self.radius
        share = SHAPES[self.surface](right * (1.0 / length), ahead * (1.0 / length))
        return place.value(self, "offset") + place.value(self, "amplitude") * share


def _held(a: Formula) -> Formula:
    """Return a distance in radii, no farther than where growth ends."""
    return clamp(a, -FARTHEST, FARTHEST)


def _gauss(a: Formula) -> Formula:
    """Return ``e^-a``."""
    return exp(-a)


def _dune(x: Formula, y: Formula) -> Formula:
    """Rise slowly against the wind and fall fast in its lee; level at crest and foot."""
    del x
    s = fraction(y)
    skewed = where(s < WINDWARD, s * (0.5 / WINDWARD), 1.0 - (1.0 - s) * (0.5 / (1.0 - WINDWARD)))
    return 0.5 - 0.5 * cosine(skewed * TAU)


def _ripple(x: Formula, y: Formula) -> Formula:
    phase = hypot(x, y) * TAU
    # Near 0 the series, whose error is below a float's there
    return where(
        phase < 0.01, 1.0 - phase * phase * (1.0 / 6.0), sine(phase) / maximum(phase, 0.01)
    )


def _peaks(x: Formula, y: Formula) -> Formula:
    """Return MATLAB's ``peaks``, whose domain of -3 to 3 is three radii wide here."""
    u, v = _held(x) * 1.5, _held(y) * 1.5
    far = 3.0 * square(1.0 - u) * _gauss(square(u) + square(v + 1.0))
    middle = 10.0 * (u / 5.0 - u * u * u - v * v * v * v * v) * _gauss(square(u) + square(v))
    near = _gauss(square(u + 1.0) + square(v)) / 3.0
    return (far - middle - near) * (1.0 / PEAKS_MAXIMUM)


PERIODIC = ("concentric_waves", "dune_train", "eggcrate", "ripple", "sine_ridges")
"""Surfaces whose length is the wavelength."""
SHAPES: dict[str, Shape] = {
    "agnesi_ridge": lambda x, y: 1.0 / (1.0 + square(_held(y))),
    "concentric_waves": lambda x, y: cosine(hypot(x, y) * TAU),
    "cone": lambda x, y: maximum(1.0 - hypot(x, y), 0.0),
    "dune_train": _dune,
    "eggcrate": lambda x, y: sine(x * TAU) * sine(y * TAU),
    "gaussian_hill": lambda x, y: _gauss((square(_held(x)) + square(_held(y))) * 0.5),
    "hemisphere": lambda x, y: sqrt(maximum(1.0 - square(_held(x)) - square(_held(y)), 0.0)),
    "mexican_hat": lambda x, y: (lambda half: (1.0 - half) * _gauss(half))(
        (square(_held(x)) + square(_held(y))) * 0.5
    ),
    "monkey_saddle": lambda x, y: _held(y) * (square(_held(y)) - 3.0 * square(_held(x))),
    "paraboloid": lambda x, y: maximum(1.0 - square(_held(x)) - square(_held(y)), 0.0),
    "peaks": _peaks,
    "plane": lambda x, y: _held(y),
    "pyramid": lambda x, y: maximum(1.0 - maximum(absolute(x), absolute(y)), 0.0),
    "ripple": _ripple,
    "saddle": lambda x, y: square(_held(y)) - square(_held(x)),
    "sine_ridges": lambda x, y: sine(y * TAU),
    "step": lambda x, y: 0.5 + 0.5 * tanh(y),
    "torus_ring": lambda x, y: sqrt(
        maximum(1.0 - square((_held(hypot(x, y)) - 1.0) * (1.0 / TUBE)), 0.0)
    ),
}
