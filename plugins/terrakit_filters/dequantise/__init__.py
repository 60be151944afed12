"""Takes the terraces out of terrains that were stored in whole steps."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import DeviceArray
from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_filters.dequantise import reference

__all__ = ["Dequantise", "step_of"]

SWEEPS = 8
"""Sweeps at each stride above one."""
LAST_SWEEPS = 16
"""Sweeps at the stride of one: more of them straighten real bends as well."""
BOUND = 0.498
"""Farthest that a height moves, in steps: it still rounds back."""


class Dequantise(Filter):
    """Smooth the terraces of 8-bit and whole-metre terrains, each height within its own step.

    The ground relaxes like a thin plate that is held within half a step of the data::

        z <- clamp(z - 0.55 B(B(z)), z_0 - q/2, z_0 + q/2),   B(z) = mean of 8 neighbours - z

    on neighbours far apart first, where terraces are wide, and next to each other last. So every
    height rounds back to what was stored, slopes run on through terraces, and bends stay: a plate
    resists bending, where diffusion would flatten ridges until they meet the bound. Where the
    ground falls by more than two steps a sample there is no terrace, and nothing is touched.

    Notes
    -----
    Level ground that is wider than ``terrace_width``, such as a lake, stays level in its middle,
    within a few hundredths of a step.

    References
    ----------
    W. E. L. Grimson, "From images to surfaces", MIT Press, 1981, for the thin plate. K. Bredies and
    M. Holler, "A total variation-based JPEG decompression model", SIAM Journal on Imaging Sciences
    5, 2012, for smoothing within the bounds of the stored steps.
    """

    name = "dequantise"
    cites = ("Grimson 1981", "Bredies & Holler 2012")
    fields = 5
    locality = "global"
    trial: ClassVar = {"step": 1.0}

    step: float | None = parameter(
        None,
        "Height of one step: 1 for whole metres; without it found from the heights.",
        unit="m",
        gt=0,
        le=1e5,
    )
    terrace_width: float = parameter(
        500.0, "Widest terrace that becomes a slope.", unit="m", ge=0, le=1e6
    )

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain without terraces."""
        step = self.step or step_of(surface.elevation)
        if step == 0:
            return surface
        half_step = BOUND * step
        sweeps = self._sweeps(surface)
        device = run.device
        start = surface.elevation
        if device is None:
            height = start
            before, is_wide = 0, np.ones(start.shape, dtype=bool)
            for index in run.steps(len(sweeps)):
                stride = sweeps[index]
                if stride != before:
                    before, is_wide = stride, reference.wide(start, stride, _limit(step, stride))
                height = reference.relax(height, start, is_wide, half_step, stride)
            return surface.with_layers(elevation=height)
        program = device.program(__file__, "dequantise.cl")
        data = surface.on(device)
        here: DeviceArray = device.copy(data)
        there, bend = device.empty(start.shape), device.empty(start.shape)
        items = start.shape[:1] if device.is_cpu else start.shape
        local = (4,) if device.is_cpu else None
        for index in run.steps(len(sweeps)):
            stride = sweeps[index]
            size = [np.int32(n) for n in (stride, *start.shape)]
            program.launch("dequantise_bend", items, bend, here, *size, local=local)
            program.launch(
                "dequantise_relax",
                items,
                *(there, here, bend, data),
                *(np.float32(_limit(step, stride)), np.float32(half_step)),
                *size,
                local=local,
            )
            here, there = there, here
        device.finish()
        return surface.with_layers(elevation=here)

    def _sweeps(self, surface: Heightfield) -> list[int]:
        """Return the stride of every sweep: half a terrace first, one sample last."""
        widest = min(self.terrace_width / surface.spacing, float(max(surface.shape))) / 2
        stride, strides = 1, [1]
        while 2 * stride <= widest:
            stride *= 2
            strides.append(stride)
        return [s for s in reversed(strides) for _ in range(SWEEPS if s > 1 else LAST_SWEEPS)]


def _limit(step: float, stride: int) -> float:
    """Return how much heights on a terrace, or one beside it, may differ."""
    return (2.01 if stride == 1 else 1.01) * step


def step_of(elevation: NDArray[np.float32]) -> float:
    """Return the step in which heights were stored; 0 where they are all the same.

    The smallest difference between two heights that occurs again, made exact by counting the
    steps of ever larger differences.

    Raises
    ------
    InputError
        If the heights are no multiples of one step.
    """
    levels = np.unique(elevation).astype(np.float64)
    rises = levels - levels[0]
    if len(levels) == 1:
        return 0.0
    grain = float(np.spacing(np.float32(np.abs(levels).max())))
    gaps = np.sort(np.diff(levels))
    again = np.flatnonzero(np.diff(gaps) <= 2 * grain + 1e-3 * gaps[:-1])
    step = float(gaps[again[0]] if len(again) else gaps[0])
    reach = 4 * step
    while True:
        near = rises[rises <= reach]
        count = float(np.rint(near[-1] / step))
        if count:
            step = float(near[-1]) / count
        if len(near) == len(rises):
            break
        reach *= 2
    missed = np.abs(rises / step - np.rint(rises / step))
    if step < 16 * grain or missed.max() > 0.02 + 2 * grain / step:
        raise InputError(
            f"the {len(levels)} different heights are no multiples of one step, so there are no "
            "terraces to find; give step in metres, or leave dequantise out"
        )
    return step
