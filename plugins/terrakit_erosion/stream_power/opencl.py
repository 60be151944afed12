"""The steps of stream power on a device; the state stays there from the first to the last."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import DeviceArray
from terrakit.routing import Routing, outlets, route, sweep_up
from terrakit.running import Run
from terrakit_erosion.stream_power import Plan


class OpenCLModel:
    """Heights and totals that change from step to step."""

    def __init__(self, plan: Plan, run: Run) -> None:
        device = run.device
        assert device is not None
        self._plan = plan
        self._device = device
        defines = {
            "POWER_UNIFORM": plan.one_erodibility,
            "UPLIFT_UNIFORM": plan.one_uplift,
            "CREEP_NONLINEAR": plan.shares[2] > 0,
            "SLOPE_LINEAR": plan.exponents[1] == 1.0,
        }
        self._program = device.program(
            __file__, "stream_power.cl", {name: 1 for name, on in defines.items() if on}
        )
        shape = plan.start.shape
        self._now = device.upload(plan.start)
        self._after = device.empty(shape, np.int32)
        self._outlet = device.upload(plan.outlet)
        self._near_outlets = device.upload(_near(plan.outlet))
        self._erodibility: tuple[NDArray[np.float32], DeviceArray] | None = None
        self._incised = device.zeros(shape, np.int64)
        self._received = device.zeros(shape, np.int64)
        self._routing: Routing[DeviceArray] | None = None

    @property
    def ground(self) -> DeviceArray:
        """The heights now, quanta, on the device."""
        return self._now

    def step(
        self, erodibility: NDArray[np.float32] | DeviceArray, uplift: NDArray[np.int32]
    ) -> None:
        """Creep for half the time, route and cut, creep for the other half.

        Erodibility is K times the time step, uplift is in quanta; of every cell or one.
        """
        plan = self._plan
        if isinstance(erodibility, DeviceArray):
            power = erodibility
        else:
            if self._erodibility is None or self._erodibility[0] is not erodibility:
                self._erodibility = erodibility, self._device.upload(erodibility)
            power = self._erodibility[1]
        self._creep()
        cols = plan.start.shape[1]
        self._routing = self._route()
        sweep_up(
            self._routing,
            self._program,
            "stream_power_incise",
            *(self._routing.area, self._outlet, self._now, self._after, self._incised),
            *(power, self._device.upload(uplift)),
            *(np.float32(value) for value in (plan.spacing**2, *plan.exponents, plan.spacing)),
            *(np.float32(plan.quanta.quantum), np.int32(cols)),
        )
        self._now, self._after = self._after, self._now
        self._creep()
        self._device.finish()

    def _creep(self) -> None:
        plan = self._plan
        rows, cols = plan.start.shape
        shares = tuple(np.float32(share) for share in plan.shares)
        for _ in range(plan.sweeps):
            arguments = (
                *(self._now, self._after, self._outlet, self._received, *shares),
                *(np.int32(rows), np.int32(cols)),
            )
            self._program.launch(
                "stream_power_diffuse",
                (rows,) if self._device.is_cpu else (rows, cols),
                *arguments,
                local=(4,) if self._device.is_cpu else None,
            )
            self._program.launch(
                "stream_power_mend",
                self._near_outlets.size,
                *(*arguments, self._near_outlets, np.int32(self._near_outlets.size)),
            )
            self._now, self._after = self._after, self._now

    def height(self) -> NDArray[np.int32]:
        """Return the heights now, quanta."""
        return self._now.download()

    def drainage_area(self) -> NDArray[np.int32]:
        """Return the number of cells that drain through each cell."""
        return self._last_routing().area.download()

    def outlet_of_cells(self) -> NDArray[np.int32]:
        """Return the cell at which the water of each cell leaves."""
        return outlets(self._last_routing()).download()

    def removed(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return what streams cut from each cell, and what held cells took, quanta."""
        return self._incised.download(), self._received.download()

    def _last_routing(self) -> Routing[DeviceArray]:
        if self._routing is None:
            self._routing = self._route()
        return self._routing

    def _route(self) -> Routing[DeviceArray]:
        plan = self._plan
        return route(
            self._now,
            self._outlet,
            method=plan.method,
            seed=plan.seed,
            origin=plan.world_cell,
            device=self._device,
        )


def _near(outlet: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the cells inside the border that are an outlet or have one as neighbour."""
    rows, cols = outlet.shape
    near = np.zeros(outlet.shape, dtype=bool)
    inside = near[1:-1, 1:-1]
    for row in range(3):
        for col in range(3):
            inside |= outlet[row : rows - 2 + row, col : cols - 2 + col] != 0
    return np.flatnonzero(near).astype(np.int32)
