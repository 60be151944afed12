"""The steps of hydraulic erosion with the NumPy reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.hydraulic import reference
from terrakit_erosion.hydraulic.plan import BLOCK, Beginning, Plan, Weather, turns
from terrakit_erosion.hydraulic.reference import Counts, Flow, State, Window


class NumpyModel:
    """State and totals that change from step to step."""

    def __init__(self, plan: Plan, begin: Beginning, framed: Heightfield | None, run: Run) -> None:
        self._plan = plan
        self._window = Window(*plan.shape)
        load = np.zeros(plan.framed, dtype=np.int32)
        self._state = State(begin.framed("bed"), begin.framed("depth"), load)
        self._after = State(*(field.copy() for field in self._state))
        self._before: Counts | None = None
        """The water when it was pushed last."""
        self._rock = begin.framed("rock")
        edges = [np.zeros(plan.framed, dtype=np.float32) for _ in range(4)]
        self._edges = (edges[0], edges[1]), (edges[2], edges[3])
        self._wetness = begin.wetness.copy()
        self._discharge = np.zeros(plan.shape, dtype=np.float32)
        size = 2 * (plan.shape[0] + plan.shape[1] + 2)
        zero = [np.zeros(size, dtype=np.int64) for _ in range(3)]
        self._through = zero[0], zero[1], zero[2]
        self._totals = dict.fromkeys(("storms", "evaporation", "infiltration", "sea"), 0)
        self._exposure = None if framed is None else Exposure(framed, plan.quanta, run)

    def block(self, weather: Weather) -> None:
        """Make the steps of a block, then what is done once a block."""
        plan, window = self._plan, self._window
        softness = weather.softness
        if self._exposure is not None:
            exposed = self._exposure.field("erodibility", self._rock)
            assert isinstance(exposed, np.ndarray)
            softness = softness * window(exposed)
        rain = self._rain(weather)
        for step in range(BLOCK):
            self._step(step, rain, softness)
        for _ in range(plan.creep_sweeps):
            self._round_off()
            reference.slump(
                self._state,
                self._after,
                self._rock,
                plan.drowned,
                plan.talus,
                plan.slide,
                plan.creep,
                window,
                plan.round_the_map,
            )
            self._state, self._after = (
                self._state._replace(bed=self._after.bed),
                self._after._replace(bed=self._state.bed),
            )
        for name, loss in (
            ("evaporation", weather.evaporation),
            ("infiltration", weather.infiltration),
        ):
            self._totals[name] += reference.lose(self._state.depth, loss, window)
        if plan.sea is not None:
            self._totals["sea"] += reference.level(
                self._state, plan.sea, plan.sea_surface, plan.shift, window
            )
        reference.survey(
            self._state.depth,
            self._edges,
            self._wetness,
            self._discharge,
            plan.wet,
            plan.wetting,
            weather.weight,
            window,
        )

    def _rain(self, weather: Weather) -> Counts:
        plan = self._plan
        rain = weather.rain
        if plan.storms is not None:
            epoch, later = divmod(weather.seconds / plan.storms.life, 1.0)
            rain = reference.storm(
                rain,
                plan.storms.cells,
                plan.storms.parts,
                plan.storms.seed,
                int(epoch),
                np.float32(later),
            )
            rain = np.broadcast_to(rain, plan.shape)
            self._totals["storms"] += int(rain.sum(dtype=np.int64))
        return rain if plan.springs is None else rain + plan.springs

    def _step(self, step: int, rain: Counts, softness: NDArray[np.float32]) -> None:
        plan, window = self._plan, self._window
        self._round_off()
        if step % 2 == 0:
            if isinstance(plan.flow, Flow):
                before = self._state.depth if self._before is None else self._before
                reference.push(self._edges, self._state, before, plan.flow, window)
            else:
                reference.pump(self._edges, self._state, plan.flow, window)
            self._before = self._state.depth.copy()
        family = step % 2
        steps, edges = window.families[family], self._edges[family]
        at = turns(step)
        if plan.leaves_the_map:
            reference.export(
                self._state, edges, steps, self._through, at, plan.transfer[family], window
            )
        if family == 0:
            depth, load, _ = reference.carry(
                self._state, edges, steps, rain, at, plan.transfer[0], window
            )
            window(self._after.depth)[:] = depth
            window(self._after.load)[:] = load
            self._state, self._after = (
                self._after._replace(bed=self._state.bed),
                self._state._replace(bed=self._after.bed),
            )
            return
        reference.work(
            self._state,
            self._after,
            self._rock,
            self._edges,
            rain,
            softness,
            at,
            plan.transfer[1],
            plan.ground,
            plan.thin,
            plan.shift,
            window,
        )
        self._state, self._after = self._after, self._state

    def _round_off(self) -> None:
        if self._plan.round_the_map:
            reference.wrap(self._state, self._window)

    def bed(self) -> Counts:
        """Return the heights of the ground, counts."""
        return self._window(self._state.bed).copy()

    def water(self) -> tuple[Counts, Counts, NDArray[np.float32]]:
        """Return depth and load, counts, and the discharge through each cell, m2/s."""
        _, depth, load = (self._window(field).copy() for field in self._state)
        return depth, load, reference.passing(self._edges, self._window)

    def rock(self) -> Counts:
        """Return the heights of the bedrock, counts."""
        return self._window(self._rock).copy()

    def means(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return wetness and mean discharge."""
        return self._wetness, self._discharge

    def through(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return water that left and came and load that left, by cell of the ring."""
        return self._through

    def total(self, name: str) -> int:
        """Return the counts of water booked under a name."""
        return self._totals[name]
