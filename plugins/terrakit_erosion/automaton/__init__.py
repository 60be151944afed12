"""Cellular automaton of rain and dissolved ground: the legacy scheme, kept for comparison."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import FromLayer, Maskable, Schedule, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure

Values = TypeVar("Values", bound=NDArray[Any])
SIDES = ("north", "south", "west", "east")
FINEST_SPACING = 1.0
"""Metres of spacing beyond which quanta grow no coarser: rain is thin, however far the samples."""
WATER_GATHERS = 16.0
"""How many times deeper than on level ground water may become before heights lose quanta to it."""


class Automaton(Erosion):
    """Dissolve ground in rain and drop it where the water goes: smooths, fills valleys.

    The classic cellular automaton of hydraulic erosion, as published. It does not carve: valleys
    come out shallower than they were. It is here because people compare with it; use
    ``hydraulic``, ``droplet`` or ``stream_power`` to erode. In every iteration::

        w += rain;   q = solubility w;   h -= q;   m += q
        to the lower of 8 neighbours:  dw_j = min(w, a - mean a) d_j / sum d,   dm_j = m dw_j / w
        w *= 1 - evaporated_share;   x = max(0, m - saturation w);   m -= x;   h += x

    with the level of the water ``a = h + w`` and ``d_j = a - a_j``. What is still dissolved after
    the last iteration is laid down where it is.

    Notes
    -----
    Water dissolves by its depth, not by its speed, so all ground dissolves alike and ponds most;
    evaporation drops the load where water gathers; nothing moves further than one sample in an
    iteration. Iterations count and results depend on the spacing: that is the scheme, and why
    ``refinement_tolerance`` is None.

    References
    ----------
    B. Benes and R. Forsbach, "Visual simulation of hydraulic erosion", WSCG 2002. J. Olsen,
    "Realtime procedural terrain generation", 2004.
    """

    name = "automaton"
    uses = ("sediment", "strata_datum")
    writes = ("elevation", "sediment")
    cites = ("Benes & Forsbach 2002", "Olsen 2004")
    fields = 17
    locality = "stencil"
    refinement_tolerance: ClassVar = None
    idle: ClassVar = {"rain_a_step": 0.0}
    lasts: ClassVar = {"iterations": 1.0}
    trial: ClassVar = {"iterations": 12, "rain_a_step": 0.25, "solubility": 0.125}

    iterations: int = parameter(
        200,
        "Rounds of rain; each moves water by one sample, so finer terrain needs more.",
        ge=0,
        le=100000,
    )
    rain_a_step: Maskable = parameter(
        0.01, "Rain that falls in each iteration; more of it smooths more.", unit="m", ge=0, le=10
    )
    solubility: float = parameter(
        0.01,
        "Ground that each iteration dissolves, as a share of the water's depth; wears all alike.",
        ge=0,
        le=1,
    )
    evaporated_share: float = parameter(
        0.5,
        "Share of the water that each iteration takes away; its load fills the valleys.",
        ge=0,
        le=1,
    )
    saturation: float = parameter(
        0.01, "Load that water can hold, as a share of its depth; the rest drops.", ge=0, le=10
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    border: Literal["closed", "open"] = parameter(
        "closed", "Whether water and its load may leave over the edge of the map."
    )

    presets: ClassVar = {
        "olsen": {
            "iterations": 200,
            "rain_a_step": 0.01,
            "solubility": 0.01,
            "evaporated_share": 0.5,
            "saturation": 0.01,
        },
        "thesis_figure": {
            "iterations": 20,
            "rain_a_step": 0.1,
            "solubility": 0.5,
            "evaporated_share": 0.1,
            "saturation": 0.01,
        },
        "blender_addon": {
            "iterations": 30,
            "rain_a_step": 0.01,
            "solubility": 0.5,
            "evaporated_share": 0.5,
            "saturation": 0.9,
        },
    }

    def reach(self, spacing: float) -> int | None:
        """Return 2: a cell's share depends on its neighbours."""
        del spacing
        return 2

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after the last drop of load has settled."""
        quanta = self._quanta(surface)
        start = quanta.count(surface.elevation)
        loose = np.zeros_like(start)
        if "sediment" in surface:
            thickness = surface.layer("sediment").astype(np.float64) / quanta.quantum
            loose = np.rint(np.clip(thickness, 0.0, 2.0**29)).astype(np.int32)
        rain, softness = self._rain(surface, quanta), self._softness(surface)
        exposure = Exposure(surface, quanta, run)
        if run.device is None:
            from terrakit_erosion.automaton.reference import NumpyModel as Model
        else:
            from terrakit_erosion.automaton.opencl import OpenCLModel as Model  # type: ignore[assignment]
        model = Model(
            start - loose,
            loose,
            (self.solubility, self.evaporated_share, self.saturation),
            self.border == "open",
            run.device,
        )
        for step in run.steps(self.iterations):
            soft: Any = softness(step / self.iterations)
            if exposure.present:
                soft = exposure.field("erodibility", model.bedrock, soft)
            model.step(rain(step / self.iterations), soft)
            run.offer(
                lambda: surface.with_layers(
                    elevation=quanta.height(surface.elevation, start, sum(model.ground()))
                )
            )
        bedrock, end_loose = model.ground()
        end = bedrock + end_loose
        self._book(run, quanta, surface.cell_area, start, end, model.exported())
        if self.iterations == 0:
            return surface
        before = surface.layer("sediment") if "sediment" in surface else np.float32(0)
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            sediment=np.where(end_loose == loose, before, quanta.metres(end_loose)),
        )

    def _quanta(self, surface: Heightfield) -> Quanta:
        """Return quanta fine enough for rain, with room for the water that stands."""
        value = self.rain_a_step
        if isinstance(value, Schedule):
            most = max(value.value)
        elif isinstance(value, FromLayer):
            most = max(value.low, value.high)
        else:
            most = float(np.max(self.value("rain_a_step", surface)))
        depth = most * min(self.iterations, 1.0 / max(self.evaporated_share, 1e-9))
        spacing = min(surface.spacing, FINEST_SPACING)
        return Quanta.fitting(surface.elevation, spacing, WATER_GATHERS * depth)

    def _rain(self, surface: Heightfield, quanta: Quanta) -> Callable[[float], NDArray[np.int32]]:
        """Return what gives the quanta of rain of one iteration, one number or a field."""

        def at(fraction: float) -> NDArray[np.int32]:
            depth = np.asarray(self.value("rain_a_step", surface, fraction), dtype=np.float64)
            return np.atleast_1d(np.rint(depth / quanta.quantum).astype(np.int32))

        return _followed(at, self.rain_a_step)

    def _softness(self, surface: Heightfield) -> Callable[[float], NDArray[np.float32]]:
        """Return what gives the share of bedrock that water dissolves, one number or a field."""

        def at(fraction: float) -> NDArray[np.float32]:
            hard = np.asarray(self.value("hardness", surface, fraction), dtype=np.float32)
            return np.atleast_1d(np.float32(1) - hard)

        return _followed(at, self.hardness)

    def _book(
        self,
        run: Run,
        quanta: Quanta,
        cell_area: float,
        start: NDArray[np.int32],
        end: NDArray[np.int32],
        exported: tuple[int, int, int, int],
    ) -> None:
        """Book what was there, the load that left through each side and what is there now."""
        run.ledger.open("rock", quanta.volume(start, cell_area))
        for side, leaving in zip(SIDES, exported, strict=True):
            if leaving:
                run.ledger.left("rock", f"border {side}", leaving * quanta.quantum * cell_area)
        changed = np.abs(end.astype(np.int64) - start)
        moved = int(changed.sum()) * 0.5 * quanta.quantum * cell_area
        run.ledger.close("rock", quanta.volume(end, cell_area), moved)


def _followed(at: Callable[[float], Values], value: object) -> Callable[[float], Values]:
    """Return ``at``, or its first value for ever where the parameter is no schedule."""
    if isinstance(value, Schedule):
        return at
    constant = at(0.0)
    return lambda fraction: constant
