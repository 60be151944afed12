"""The steps of stream power with the NumPy reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.routing import Routing, outlets, route
from terrakit.running import Run
from terrakit_erosion.stream_power import Plan, reference


class NumpyModel:
    """Heights and totals that change from step to step."""

    def __init__(self, plan: Plan, run: Run) -> None:
        self._plan = plan
        self._run = run
        self._height = plan.start
        self._incised = np.zeros(plan.start.shape, dtype=np.int64)
        self._received = np.zeros(plan.start.shape, dtype=np.int64)
        self._routing: Routing[NDArray[np.int32]] | None = None

    @property
    def ground(self) -> NDArray[np.int32]:
        """The heights now, quanta."""
        return self._height

    def step(self, erodibility: NDArray[np.float32], uplift: NDArray[np.int32]) -> None:
        """Creep for half the time, route and cut, creep for the other half.

        Erodibility is K times the time step, uplift is in quanta; of every cell or one.
        """
        plan = self._plan
        self._creep()
        self._routing = self._route()
        constants = (plan.spacing**2, *plan.exponents, plan.spacing, plan.quanta.quantum)
        self._height = reference.incise(
            self._routing,
            plan.outlet,
            self._height,
            self._incised,
            erodibility,
            uplift,
            constants,
        )
        self._creep()

    def _creep(self) -> None:
        plan = self._plan
        for _ in range(plan.sweeps):
            self._run.check()
            self._height = reference.diffuse(self._height, plan.outlet, self._received, plan.shares)

    def height(self) -> NDArray[np.int32]:
        """Return the heights now, quanta."""
        return self._height

    def drainage_area(self) -> NDArray[np.int32]:
        """Return the number of cells that drain through each cell."""
        return self._last_routing().area

    def outlet_of_cells(self) -> NDArray[np.int32]:
        """Return the cell at which the water of each cell leaves."""
        return outlets(self._last_routing())

    def removed(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return what streams cut from each cell, and what held cells took, quanta."""
        return self._incised, self._received

    def _last_routing(self) -> Routing[NDArray[np.int32]]:
        if self._routing is None:
            self._routing = self._route()
        return self._routing

    def _route(self) -> Routing[NDArray[np.int32]]:
        plan = self._plan
        return route(
            self._height, plan.outlet, method=plan.method, seed=plan.seed, origin=plan.world_cell
        )
