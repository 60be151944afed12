"""Noise on a lattice: what generators sum, masks cut and plates bend.

A basis is evaluated at a cell ``(i, j)`` and a fraction ``(x, y)`` in it, so that it is as sharp a
million cells from the origin as at it, and knows no tile. :data:`BASES` names them; each is a
function of :mod:`terrakit.noise.reference` and of ``noise.cl`` or ``cellular.cl``, which return the
same bits. A kernel puts the text of :func:`source` before its own and calls ``noise_<name>``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from terrakit.noise import reference
from terrakit.noise.reference import METRICS, RANGES, Evaluate, Feature, Metric, Values

__all__ = ["BASES", "Basis", "basis_functions", "source"]


def source(bases: Iterable[str] = ()) -> str:
    """Return the kernels' twin of :mod:`terrakit.noise.reference`; ``exact.cl`` goes before it.

    Parameters
    ----------
    bases
        Names of the bases that are called. Cellular noise is long, and slow to compile, so it
        comes only if one of them is cellular.
    """
    files = ["noise.cl"]
    if any(name.startswith("cellular") for name in bases):
        files.append("cellular.cl")
    return "".join(Path(__file__).with_name(file).read_text("utf-8") for file in files)


EvaluateSlope = Callable[
    [ArrayLike, ArrayLike, ArrayLike, ArrayLike, int, int], tuple[Values, Values, Values]
]


@dataclass(frozen=True)
class Basis:
    """One kind of noise.

    Parameters
    ----------
    name
        The word in recipes.
    summary
        What it looks like.
    numpy
        The function of ``(i, j, x, y, low, high)`` in NumPy.
    numpy_slope
        The same with derivatives along the two straight axes, per cell, if there is one.
    is_skewed
        Whether the lattice is one of triangles: the caller skews positions, by
        ``(x + s, y + s)`` with ``s = (sqrt(3) - 1) / 2 (x + y)``, where it makes them.
    bound
        No value is further from 0.
    mean, deviation
        Of values over many cells and seeds.
    neighbours
        Lattice points that are hashed for a value.
    range
        Of distances: the distance in cells that is shown as 1, while 0 is shown as -1.
    """

    name: str
    summary: str
    numpy: Evaluate
    numpy_slope: EvaluateSlope | None = None
    is_skewed: bool = False
    bound: float = 1.0
    mean: float = 0.0
    deviation: float = 1.0
    neighbours: int = 4
    range: float | None = None

    @property
    def opencl(self) -> str:
        """Name of the OpenCL function."""
        return f"noise_{self.name}"

    @property
    def has_slope(self) -> bool:
        """Whether there are :attr:`numpy_slope` and the OpenCL function ``<opencl>_slope``."""
        return self.numpy_slope is not None


CELLULAR: dict[Feature, str] = {
    "f1": "Distance to the nearest of scattered points: bumps.",
    "f2": "Distance to the second nearest point.",
    "f3": "Distance to the third nearest point.",
    "f4": "Distance to the fourth nearest point.",
    "f2_minus_f1": "Second less first distance: plates with valleys between them.",
    "crackle": "Flat plates with sharp cracks between them.",
    "value": "One height for all that is nearest to a point: flat plates.",
}
FARTHEST: dict[Metric, tuple[float, ...]] = {
    "euclidean": (1.4143, 1.5812, 1.8028, 1.8385),
    "euclidean_squared": (2.0, 2.5, 3.25, 3.38),
    "manhattan": (2.0, 2.0, 2.5, 2.5),
    "chebyshev": (1.0, 1.5, 1.5, 1.5),
    "minkowski_half": (4.0, 4.0, 4.776, 4.896),
}
"""The first to fourth nearest point is never further, in cells, however the points lie."""
MOMENTS: dict[Metric, tuple[tuple[float, float], ...]] = {
    "euclidean": (
        (-0.141, 0.380),
        (0.118, 0.282),
        (0.301, 0.236),
        (0.406, 0.200),
        (-0.461, 0.402),
        (0.755, 0.520),
    ),
    "euclidean_squared": (
        (-0.559, 0.349),
        (-0.307, 0.330),
        (-0.119, 0.310),
        (0.009, 0.281),
        (-0.565, 0.346),
        (0.768, 0.508),
    ),
    "manhattan": (
        (-0.135, 0.386),
        (0.169, 0.298),
        (0.283, 0.237),
        (0.325, 0.194),
        (-0.463, 0.402),
        (0.800, 0.479),
    ),
    "chebyshev": (
        (-0.128, 0.387),
        (0.105, 0.283),
        (0.269, 0.236),
        (0.359, 0.197),
        (-0.452, 0.411),
        (0.725, 0.543),
    ),
    "minkowski_half": (
        (-0.198, 0.367),
        (0.112, 0.299),
        (0.250, 0.249),
        (0.317, 0.213),
        (-0.487, 0.391),
        (0.878, 0.386),
    ),
}
"""Mean and deviation of the features in the order of :data:`CELLULAR`, without ``value``."""
UNIFORM = (0.0, 3**-0.5)
"""Mean and deviation of what is uniform in [-1, 1]."""


def _lattice() -> list[Basis]:
    """Return the bases that join hashes at lattice points."""
    return [
        Basis(
            "white",
            "One height for every cell, none like its neighbour.",
            reference.white,
            deviation=UNIFORM[1],
            neighbours=1,
        ),
        Basis(
            "value",
            "Soft blocks: heights at lattice points, joined smoothly.",
            reference.value,
            reference.value_slope,
            deviation=0.4525,
        ),
        Basis(
            "gradient",
            "Rolling hills of one size (improved Perlin noise).",
            reference.gradient,
            reference.gradient_slope,
            deviation=0.329,
        ),
        Basis(
            "simplex",
            "Rolling hills on triangles, without directions of its own.",
            reference.simplex,
            reference.simplex_slope,
            is_skewed=True,
            deviation=0.454,
            neighbours=3,
        ),
    ]


def _cellular() -> list[Basis]:
    """Return cellular noise of every feature and metric; plain names are euclidean."""
    bases = []
    for metric in METRICS:
        moments = dict(zip(CELLULAR, (*MOMENTS[metric], UNIFORM), strict=True))
        farthest = dict(zip(CELLULAR, (*FARTHEST[metric], FARTHEST[metric][1]), strict=False))
        for feature, summary in CELLULAR.items():
            suffix = "" if metric == "euclidean" else f"_{metric}"
            shown = RANGES[metric].get(feature)
            bound = 1.0 if shown is None else max(1.0, 2 * farthest[feature] / shown - 1)
            bases.append(
                Basis(
                    f"cellular_{feature}{suffix}",
                    summary,
                    reference.cellular(feature, metric),
                    bound=bound,
                    mean=moments[feature][0],
                    deviation=moments[feature][1],
                    neighbours=reference.cells_across(feature, metric) ** 2,
                    range=shown,
                )
            )
    return bases


BASES = {basis.name: basis for basis in (*_lattice(), *_cellular())}
"""Every basis by name: ``white``, ``value``, ``gradient``, ``simplex`` and
``cellular_<feature>[_<metric>]``."""


def basis_functions() -> dict[str, Evaluate]:
    """Return the NumPy function of each basis by name."""
    return {name: basis.numpy for name, basis in BASES.items()}
