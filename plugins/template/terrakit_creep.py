"""Soil creep: a terrakit plugin in one file.

To make your own, copy this folder, rename the file, and change what is between the rules.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit import Erosion, Heightfield, ParameterError, Run, hookimpl, parameter
from terrakit.quanta import Quanta

# ------------------------------------------------------------------------------------------------

MOST_SHARE = 0.125
"""Largest share of a difference that moves in a sweep; half of what is stable."""

KERNEL = """
// What a cell gives to one neighbour is the exact negative of what that one gives to it.
inline int creep_given(__global const int *height, int here, int there, float share)
{
    return (int)(share * (float)(height[here] - height[there]));
}

__kernel void creep_sweep(
    __global const int *height,
    __global int *result,
    const float share,
    const int rows,
    const int cols)
{
    const int col = (int)get_global_id(0);
    const int row = (int)get_global_id(1);
    if (col >= cols || row >= rows) return;
    const int i = row * cols + col;
    int given = 0;
    if (row > 0) given += creep_given(height, i, i - cols, share);
    if (row < rows - 1) given += creep_given(height, i, i + cols, share);
    if (col > 0) given += creep_given(height, i, i - 1, share);
    if (col < cols - 1) given += creep_given(height, i, i + 1, share);
    result[i] = height[i] - given;
}
"""


class Creep(Erosion):
    """Let soil creep downhill, so that ridges round off and hollows fill.

    Heights follow the diffusion equation, with closed borders::

        dz/dt = D laplace(z)

    References
    ----------
    W. E. H. Culling, "Analytical theory of erosion", Journal of Geology 68, 1960.
    """

    name = "creep"
    cites = ("Culling 1960",)
    fields = 4
    locality = "stencil"
    idle: ClassVar = {"duration": 0.0}
    presets: ClassVar = {
        "dry": {"diffusivity": 0.002},
        "humid": {"diffusivity": 0.03},
    }

    diffusivity: float = parameter(
        0.02, "How fast soil creeps; wet and frosty ground is faster.", unit="m2/yr", ge=0, le=1e4
    )
    duration: float = parameter(1e5, "Years that pass.", unit="yr", ge=0, le=1e10)

    def reach(self, spacing: float) -> int | None:
        """Return 1: a sweep looks at the nearest neighbours."""
        del spacing
        return 1

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after ``duration`` years."""
        # As many sweeps as are stable, whatever the spacing
        spread = self.diffusivity * self.duration / surface.spacing**2
        sweeps = math.ceil(spread / MOST_SHARE)
        if sweeps > 10**6:
            raise ParameterError(
                f"duration = {self.duration:g}: takes {sweeps} sweeps at a spacing of "
                f"{surface.spacing:g} m, at most 1000000; use a coarser terrain"
            )
        share = np.float32(spread / sweeps if sweeps else 0.0)

        # Heights as integers: sums are exact and have no order
        quanta = Quanta.fitting(surface.elevation, surface.spacing)
        start = quanta.count(surface.elevation)
        relax = _relax_numpy if run.device is None else _relax_opencl
        end = relax(start, share, sweeps, run)

        # Book what there was, what is there, and what moved
        area = surface.cell_area
        moved = int(np.abs(end.astype(np.int64) - start).sum()) * 0.5 * quanta.quantum * area
        run.ledger.open("rock", quanta.volume(start, area))
        run.ledger.close("rock", quanta.volume(end, area), moved)
        return surface.with_layers(elevation=quanta.height(surface.elevation, start, end))


def _relax_numpy(
    height: NDArray[np.int32], share: np.float32, sweeps: int, run: Run
) -> NDArray[np.int32]:
    """Return the heights after ``sweeps``: the readable definition, and the oracle of KERNEL."""
    for _ in run.steps(sweeps):
        given = np.zeros_like(height)
        for axis in (0, 1):
            flow = (share * np.diff(height, axis=axis).astype(np.float32)).astype(np.int32)
            before, after = [(0, 0), (0, 0)], [(0, 0), (0, 0)]
            before[axis], after[axis] = (1, 0), (0, 1)
            given += np.pad(flow, before) - np.pad(flow, after)
        height = height - given
    return height


def _relax_opencl(
    height: NDArray[np.int32], share: np.float32, sweeps: int, run: Run
) -> NDArray[np.int32]:
    """Return the same, bit for bit, from the run's device."""
    device = run.device
    assert device is not None
    program = device.program_from_source("creep.cl", KERNEL)
    rows, cols = height.shape
    now, after = device.upload(height), device.empty(height.shape, np.int32)
    for _ in run.steps(sweeps):
        program.launch(
            "creep_sweep", height.shape, now, after, share, np.int32(rows), np.int32(cols)
        )
        now, after = after, now
    return now.download()


# ------------------------------------------------------------------------------------------------


@hookimpl
def terrakit_erosions() -> list[type[Erosion]]:
    """Tell terrakit which erosions this file brings."""
    return [Creep]
