"""A mask of ridges or hollows of a chosen size."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Heightfield
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_texturing.mask import F, Field, Mask, rising

BLOCK = 64
"""Rows that are worked on at once, so that they stay in the processor's cache."""


class CurvatureMask(Mask):
    """Select what bulges out (ridges, edges) or in (valleys, gullies) at a chosen size.

    The curvature is that of the terrain seen through a bell of standard deviation
    ``sigma = radius / 2``::

        kappa = -1/2 laplace(G_sigma * z)        (1/m; positive on ridges)
        m = s(curvature_min, curvature_min + curvature_blend, +-kappa)

    A ball of radius R has 1/R on its top. The size is in metres, so the same ridges are found at
    any spacing that can show them.

    Notes
    -----
    A radius below two samples cannot be told from noise of the grid and works like two samples.
    Beyond its edge the terrain goes on point-symmetrically, so that a plane stays a plane.

    References
    ----------
    D. Marr and E. Hildreth, "Theory of edge detection", Proc. R. Soc. B 207, 1980 (laplacian of
    gaussian). J. Wood, "The geomorphological characterisation of digital elevation models", 1996
    (curvature at many scales).
    """

    name = "curvature_mask"
    cites = ("Marr & Hildreth 1980", "Wood 1996")
    fields = 16
    locality = "stencil"
    trial: ClassVar = {"allow_empty": True, "radius": 20.0}

    layer: str = parameter("mask_curvature", "Name of the layer to write; begins with mask_.")
    form: Literal["convex", "concave"] = parameter(
        "convex", "convex selects ridges and edges, concave selects valleys and gullies."
    )
    radius: float = parameter(
        100.0, "Size of the forms: finer ones are smoothed over.", unit="m", gt=0
    )
    curvature_min: float = parameter(
        0.0005, "Curvature at which the mask begins: 1 over the radius of a ball.", unit="1/m", ge=0
    )
    curvature_blend: float = parameter(
        0.0015, "How much more curved the ground is where the mask is full.", unit="1/m", ge=0
    )

    presets: ClassVar = {
        "ridges": {"layer": "mask_ridges", "form": "convex"},
        "valley_floors": {
            "layer": "mask_valley_floors",
            "form": "concave",
            "radius": 300.0,
            "curvature_min": 0.0001,
            "curvature_blend": 0.0005,
        },
        "gullies": {"layer": "mask_gullies", "form": "concave", "radius": 60.0},
    }

    def reach(self, spacing: float) -> int | None:
        """Return how many samples the bell is wide to one side."""
        return len(bell(self.radius / 2, spacing)[0]) - 1

    def remedy(self) -> str:
        """Return how to select something."""
        return (
            f"nothing of this size is more {self.form} than curvature_min = "
            f"{self.curvature_min:g} 1/m; lower it, or change radius = {self.radius:g} m"
        )

    def select(self, surface: Heightfield, run: Run) -> Field:
        """Return the mask."""
        bulge = curvature(surface.elevation, surface.spacing, self.radius / 2, run)
        if self.form == "concave":
            bulge = -bulge
        start = self.curvature_min
        return rising(bulge, start, start + self.curvature_blend) * (bulge > 0).astype(F)


def bell(deviation: float, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the weights, from the middle outwards, of smoothing and of the second derivative.

    The weights are scaled so that they take constants and parabolas for what they are.
    """
    sigma = max(deviation, spacing) / spacing
    distance = np.arange(math.ceil(4 * sigma) + 1)
    gauss = np.array([math.exp(-0.5 * (k / sigma) ** 2) for k in distance.tolist()])
    average = gauss / (gauss[0] + 2 * gauss[1:].sum())
    bend = (distance**2 / sigma**2 - 1) * gauss
    bend /= (bend[1:] * distance[1:] ** 2).sum() * spacing**2
    bend[0] = -2 * bend[1:].sum()
    return average, bend


def curvature(height: Field, spacing: float, deviation: float, run: Run) -> Field:
    """Return minus half the laplacian of the smoothed heights, 1/m."""
    average, bend = bell(deviation, spacing)
    padded = _continued(height.astype(np.float64), len(average) - 1)
    # First the second derivative along one axis, then the average along the other: turning the
    # terrain swaps the two terms, and their sum keeps its bits
    laplacian = _along_rows(_along_columns(padded, bend, run), average, run)
    laplacian += _along_columns(_along_rows(padded, bend, run), average, run)
    laplacian *= -0.5
    return laplacian.astype(F)


def _continued(height: NDArray[np.float64], margin: int) -> NDArray[np.float64]:
    """Return the terrain with a margin, mirrored at the points of its edge."""
    return np.pad(height, margin, mode="reflect", reflect_type="odd")


def _along_columns(
    padded: NDArray[np.float64], weights: NDArray[np.float64], run: Run
) -> NDArray[np.float64]:
    """Return a symmetric sum down the columns; the margin of the first axis is used up."""
    margin = len(weights) - 1
    result = np.empty((len(padded) - 2 * margin, padded.shape[1]))
    for first in range(0, len(result), BLOCK):
        run.check()
        out = result[first : first + BLOCK]
        middle = first + margin
        np.multiply(padded[middle : middle + len(out)], weights[0], out=out)
        pair = np.empty_like(out)
        for k in range(1, margin + 1):
            above = padded[middle - k : middle - k + len(out)]
            np.add(above, padded[middle + k : middle + k + len(out)], out=pair)
            pair *= weights[k]
            out += pair
    return result


def _along_rows(
    padded: NDArray[np.float64], weights: NDArray[np.float64], run: Run
) -> NDArray[np.float64]:
    """Return a symmetric sum along the rows; the margin of the second axis is used up."""
    margin = len(weights) - 1
    width = padded.shape[1] - 2 * margin
    result = np.empty((len(padded), width))
    for first in range(0, len(result), BLOCK):
        run.check()
        out = result[first : first + BLOCK]
        block = padded[first : first + len(out)]
        np.multiply(block[:, margin : margin + width], weights[0], out=out)
        pair = np.empty_like(out)
        for k in range(1, margin + 1):
            west = block[:, margin - k : margin - k + width]
            np.add(west, block[:, margin + k : margin + k + width], out=pair)
            pair *= weights[k]
            out += pair
    return result
