"""The steps of hydraulic erosion on a device; the state stays there from the first to the last."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import DeviceArray
from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.hydraulic.plan import BLOCK, Beginning, Plan, Weather, turns
from terrakit_erosion.hydraulic.reference import Counts, Flow

PART = 32
"""Rows that a work-item adds up."""


class OpenCLModel:
    """State and totals that change from step to step."""

    def __init__(self, plan: Plan, begin: Beginning, framed: Heightfield | None, run: Run) -> None:
        device = run.device
        assert device is not None
        self._plan, self._device = plan, device
        defines = {"HYDRAULIC_FIELDS": 1} if plan.varies else None
        self._program = device.program(__file__, "hydraulic.cl", defines)
        rows, cols = plan.shape
        self._size = np.int32(rows), np.int32(cols)
        load = device.zeros(plan.framed, np.int32)
        self._state = [device.upload(begin.framed(name)) for name in ("bed", "depth")] + [load]
        self._after = [device.copy(field) for field in self._state]
        self._before: DeviceArray | None = None
        """The water when it was pushed last."""
        self._rock = device.upload(begin.framed("rock"))
        self._edges = [device.zeros(plan.framed) for _ in range(4)]
        self._wetness = device.upload(begin.wetness)
        self._discharge = device.zeros(plan.shape)
        size = 2 * (rows + cols + 2) if plan.leaves_the_map else 1
        self._through = [device.zeros(size, np.int64) for _ in range(3)]
        self._totals: dict[str, DeviceArray] = {}
        self._sea = None if plan.sea is None else device.upload(plan.sea)
        self._exposure = None if framed is None else Exposure(framed, plan.quanta, run)
        field = plan.framed if plan.varies else 1
        self._rain = device.zeros(field, np.int32)
        self._softness = device.zeros(field)
        self._bare_softness = self._softness
        self._uploaded: dict[str, tuple[object, DeviceArray]] = {}
        if plan.varies and self._exposure is not None:
            self._bare_softness = device.zeros(field)
        self._dry = np.zeros(1, dtype=np.int32)
        self._families = ((1, cols + 4), (cols + 5, cols + 3))

    def block(self, weather: Weather) -> None:
        """Make the steps of a block, then what is done once a block."""
        plan = self._plan
        self._expose(weather)
        self._let_rain(weather)
        for step in range(BLOCK):
            self._step(step, weather)
        for _ in range(plan.creep_sweeps):
            self._round_off()
            self._launch_rows(
                "hydraulic_slump",
                plan.shape,
                *(self._state[0], self._after[0], self._rock, self._state[1]),
                *(np.int32(plan.drowned), np.int32(plan.talus)),
                *(np.float32(plan.slide), np.float32(plan.creep), np.int32(plan.round_the_map)),
            )
            self._state[0], self._after[0] = self._after[0], self._state[0]
        for name, loss in (
            ("evaporation", weather.evaporation),
            ("infiltration", weather.infiltration),
        ):
            if loss.any():
                self._launch_parts(
                    "hydraulic_lose",
                    *(self._state[1], self._on_device(name, loss), self._total(name)),
                    np.int32(loss.ndim),
                )
        if self._sea is not None:
            self._launch_parts(
                "hydraulic_level",
                *(self._state[0], self._state[1], self._sea, self._total("sea")),
                *(np.int32(plan.sea_surface), np.int32(plan.shift)),
            )
        self._launch_rows(
            "hydraulic_survey",
            plan.shape,
            *(self._state[1], *self._edges, self._wetness, self._discharge),
            *(np.int32(plan.wet), plan.wetting, weather.weight),
        )

    def _step(self, step: int, weather: Weather) -> None:
        plan = self._plan
        rows, cols = plan.shape
        self._round_off()
        bed, depth, load = self._state
        if step % 2 == 0:
            is_flow = isinstance(plan.flow, Flow)
            if self._before is None:
                self._before = self._device.copy(depth)
            self._launch_rows(
                "hydraulic_flow" if is_flow else "hydraulic_pipe",
                (rows + 3, cols + 4),
                *((bed, depth, self._before) if is_flow else (bed, depth)),
                *(*self._edges, *plan.flow),
            )
        family = step % 2
        edges = self._edges[2 * family : 2 * family + 2]
        at, transfer = turns(step), plan.transfer[family]
        offsets = tuple(np.int32(offset) for offset in self._families[family])
        if plan.leaves_the_map:
            self._program.launch(
                "hydraulic_border",
                2 * (rows + cols + 2),
                *(bed, depth, load, *edges, *self._through),
                *(at.water, at.load, *transfer, *offsets, *self._size),
            )
        count = np.int32(0 if plan.varies else weather.rain)
        if family == 0:
            self._launch_rows(
                "hydraulic_carry",
                plan.shape,
                *(depth, self._after[1], load, self._after[2], *edges, self._rain),
                *(count, at.rain, at.water, at.load, *transfer),
            )
            self._state[1:], self._after[1:] = self._after[1:], self._state[1:]
            return
        assert self._before is not None
        self._after[1], self._before = self._before, self._after[1]
        self._launch_rows(
            "hydraulic_work",
            plan.shape,
            *(bed, self._after[0], depth, self._after[1], load, self._after[2], *self._edges),
            *(self._rock, self._rain, self._softness, count),
            np.float32(0 if plan.varies else weather.softness),
            *(*at, *transfer, *plan.ground, np.int32(plan.thin), np.int32(plan.shift)),
        )
        self._state, self._after = self._after, self._state

    def _round_off(self) -> None:
        if self._plan.round_the_map:
            rows, cols = self._plan.shape
            self._program.launch(
                "hydraulic_wrap", 4 * (cols + 4) + 4 * rows, *self._state, *self._size
            )

    def _expose(self, weather: Weather) -> None:
        """Bring the softness of the ground to the device, if it is a field."""
        plan = self._plan
        if not plan.varies:
            return
        if self._is_new("softness", weather.softness):
            inside = np.broadcast_to(weather.softness, plan.shape)
            framed = np.ones(plan.framed, dtype=np.float32)
            framed[2:-3, 2:-2] = inside
            self._device.write(self._bare_softness, framed)
        if self._exposure is not None:
            self._exposure.field(
                "erodibility", self._rock, self._bare_softness, into=self._softness
            )

    def _let_rain(self, weather: Weather) -> None:
        """Bring the rain to the device, if it is a field."""
        plan = self._plan
        if not plan.varies:
            return
        if plan.storms is None:
            if self._is_new("rain", weather.rain):
                rain = weather.rain if plan.springs is None else weather.rain + plan.springs
                inside = np.broadcast_to(rain, plan.shape).astype(np.int32)
                self._device.write(self._rain, np.pad(inside, ((2, 3), (2, 2))))
            return
        storms = plan.storms
        epoch, later = divmod(weather.seconds / storms.life, 1.0)
        springs = self._dry if plan.springs is None else plan.springs
        self._launch_parts(
            "hydraulic_storm",
            *(self._on_device("steady", weather.rain), self._rain),
            *(self._on_device("cell_x", storms.cells[0]), self._on_device("x", storms.parts[0])),
            *(self._on_device("cell_y", storms.cells[1]), self._on_device("y", storms.parts[1])),
            *(self._on_device("springs", springs), self._total("storms")),
            *(np.int32(weather.rain.ndim), np.int32(plan.springs is not None)),
            *(np.uint32(storms.seed[0]), np.uint32(storms.seed[1])),
            *(np.int32(epoch), np.float32(later)),
        )

    def _launch_rows(
        self, name: str, shape: tuple[int, int], *arguments: DeviceArray | np.generic
    ) -> None:
        cpu = self._device.is_cpu
        self._program.launch(
            name,
            shape[:1] if cpu else shape,
            *arguments,
            *self._size,
            local=(4,) if cpu else None,
        )

    def _launch_parts(self, name: str, *arguments: DeviceArray | np.generic) -> None:
        rows, cols = self._plan.shape
        self._program.launch(name, (-(-rows // PART), cols), *arguments, *self._size)

    def _is_new(self, name: str, values: object) -> bool:
        known = self._uploaded.get(name)
        if known is not None and known[0] is values:
            return False
        self._uploaded[name] = values, self._rock
        return True

    def _on_device(self, name: str, values: NDArray[np.generic]) -> DeviceArray:
        """Return a host array on the device, uploaded when it is another than before."""
        known = self._uploaded.get(name)
        if known is None or known[0] is not values:
            known = values, self._device.upload(np.atleast_1d(values))
            self._uploaded[name] = known
        return known[1]

    def _total(self, name: str) -> DeviceArray:
        if name not in self._totals:
            rows, cols = self._plan.shape
            self._totals[name] = self._device.zeros((-(-rows // PART), cols), np.int64)
        return self._totals[name]

    def bed(self) -> Counts:
        """Return the heights of the ground, counts."""
        return self._within(self._state[0])

    def water(self) -> tuple[Counts, Counts, NDArray[np.float32]]:
        """Return depth and load, counts, and the discharge through each cell, m2/s; the last."""
        plan = self._plan
        spare = self._after
        for field in spare[:2]:  # no longer wanted, and as large as fields of floats
            self._device.fill(field, 0)
        self._launch_rows(
            "hydraulic_survey",
            plan.shape,
            *(self._state[1], *self._edges, spare[0], spare[1]),
            *(np.int32(plan.thin), np.float32(1), np.float32(1)),
        )
        rows, cols = plan.shape
        now = spare[1].download().view(np.float32).reshape(-1)[: rows * cols].reshape(rows, cols)
        self._edges, self._after = [], []
        return self._within(self._state[1]), self._within(self._state[2]), now

    def rock(self) -> Counts:
        """Return the heights of the bedrock, counts."""
        return self._within(self._rock)

    def means(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return wetness and mean discharge."""
        return self._wetness.download(), self._discharge.download()

    def through(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return water that left and came and load that left, by cell of the ring."""
        left, came, carried = (total.download() for total in self._through)
        return left, came, carried

    def total(self, name: str) -> int:
        """Return the counts of water booked under a name."""
        return int(self._totals[name].download().sum()) if name in self._totals else 0

    def _within(self, field: DeviceArray) -> Counts:
        values: Counts = field.download()[2:-3, 2:-2].copy()
        return values
