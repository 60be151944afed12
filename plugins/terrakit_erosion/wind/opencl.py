"""Wind on an OpenCL device; see ``wind.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import Device, DeviceArray, Program
from terrakit_erosion.wind.plan import CALM, FLIGHT, MOST_STRESS, STEEPEST, Blow, Gust, Plan

Counts = NDArray[np.int32]
Floats = NDArray[np.float32]


class OpenCLModel:
    """State of sand, rock and air on the device; parameters as of the NumPy model."""

    def __init__(self, plan: Plan, bedrock: Counts, sand: Counts, device: Device) -> None:
        self.plan, self.device, shape = plan, device, bedrock.shape
        self.size = np.int32(shape[0]), np.int32(shape[1])
        self.periodic = np.int32(plan.periodic)
        self.bedrock, self.sand = device.upload(bedrock), device.upload(sand)
        self.air = device.zeros(shape, np.int32)
        self.shade = device.empty(shape, np.int32)
        self.after = [device.empty(shape, np.int32) for _ in range(2)]
        self.lift = device.zeros(shape, np.int32)
        self.veer = device.zeros(shape if plan.deflection else 1, np.int32)
        self.across = (np.int32(0), np.int32(0))
        self.near, self.stress = device.empty(shape), device.empty(shape)
        self.wide = device.empty(shape) if plan.wide else self.near
        self.work = [device.empty(shape), device.empty(shape)]
        self._gone = device.zeros(1 if plan.periodic else shape, np.int64)
        self._dust = device.zeros(shape if plan.wears else 1, np.int64)
        self._sent: dict[str, tuple[Floats, bool, DeviceArray]] = {}
        self.plants = device.zeros(1)
        self.program: Program | None = None

    def refresh(
        self,
        blow: Blow,
        gusts: int,
        plants: Floats,
        softness: Floats | DeviceArray,
        seed: tuple[int, int],
    ) -> None:
        """Compute what the wind lifts and where it veers; wear the rock for the gusts to come."""
        plan, cells = self.plan, np.int32(self.bedrock.size)
        varies = plants.size > 1 or softness.size > 1
        defines = {"WIND_FIELDS": 1} if varies else {}
        defines |= {"WIND_VEER": 1} if plan.deflection else {}
        self.program = self.device.program(__file__, "wind.cl", defines)
        self.plants = self._on("plants", plants, varies)
        soft = self._on("softness", softness, varies)
        self.across = (np.int32(blow.across[0]), np.int32(blow.across[1]))
        stream, other = self.work
        self.program.launch("wind_ground", int(cells), self.bedrock, self.sand, self.shade, cells)
        further = self.after[0]
        for down, right, sinks in blow.shadows:
            step = np.int32(down), np.int32(right), np.int32(sinks)
            self._rows("wind_shade", self.shade, further, *step, self.periodic, *self.size)
            self.shade, further = further, self.shade
        self.after[0] = further
        self.program.launch("wind_stream", int(cells), self.shade, stream, cells)
        field = stream
        for step in plan.near:
            self._smooth(field, other, step, 0)
            self._smooth(other, self.near, 0, step)
            field = self.near
        for step in plan.wide:
            self._smooth(field, other, step, 0)
            self._smooth(other, self.wide, 0, step)
            field = self.wide
        field, spare = self.near, [stream, other]
        for number, level in enumerate(blow.levels):
            smooth = spare[number % 2]
            offsets = level.down, level.right, level.down_twice, level.right_twice
            self._smooth(field, smooth, *offsets)
            self.program.launch(
                "wind_press",
                int(cells),
                *(field, smooth, self.stress, np.float32(level.weight), np.int32(number == 0)),
                cells,
            )
            field = smooth
        if not blow.levels:
            self.device.fill(self.stress, 1.0)
        laws = plan.laws
        self._rows(
            "wind_lift",
            *(self.near, self.wide if plan.wide else self.near, self.stress, self.plants, soft),
            *(self.bedrock, self.sand, self.air, self.shade, self.lift, self.veer, self._dust),
            *_floats(*blow.rise, *blow.climb, *blow.aside, plan.height_rate, plan.lowest),
            *_floats(
                CALM,
                STEEPEST,
                MOST_STRESS,
                plan.threshold,
                plan.lifted,
                plan.wears * gusts,
                plan.dusty,
            ),
            *_floats(laws.per_cover, laws.per_shelter, plan.quanta.quantum / FLIGHT),
            *(np.uint32(seed[0]), np.uint32(seed[1]), self.periodic, *self.size),
        )

    def blow(self, gust: Gust) -> None:
        """Let one gust carry sand a hop further, and slopes slide."""
        laws = self.plan.laws
        sand, air = self.after
        self._rows(
            "wind_blow",
            *(self.bedrock, self.sand, self.air, self.shade, self.lift, self.plants, self.veer),
            *(sand, air, self._gone),
            *(np.int32(gust.down), np.int32(gust.right), *self.across),
            np.int32(self.plan.inflow),
            *(np.int32(laws.talus), np.int32(laws.talus_slanted)),
            *_floats(laws.axial, laws.slanted, laws.creep_axial, laws.creep_slanted),
            *_floats(laws.on_rock, laws.on_sand, laws.per_cover, laws.per_shelter),
            *(self.periodic, *self.size),
        )
        self.after = [self.sand, self.air]
        self.sand, self.air = sand, air

    def supply(self, more: Counts) -> int:
        """Lay sand down, or take away what there is of it; return the sum of the change."""
        sand = self.sand.download()
        change = np.maximum(more, -sand)
        self.device.write(self.sand, (sand + change).astype(np.int32))
        return int(change.sum(dtype=np.int64))

    def ground(self) -> tuple[Counts, Counts]:
        """Return bedrock and sand, with what still flies on it."""
        return self.bedrock.download(), self.sand.download() + self.air.download()

    def gone(self) -> NDArray[np.int64]:
        """Return what flew out over open borders, counted where it flew from."""
        gone: NDArray[np.int64] = self._gone.download()
        return np.broadcast_to(gone, self.sand.shape)

    def dust(self) -> int:
        """Return the rock that the wind carried off as dust."""
        return int(self._dust.download().sum())

    def _smooth(
        self,
        field: DeviceArray,
        result: DeviceArray,
        down: int,
        right: int,
        down_twice: int | None = None,
        right_twice: int | None = None,
    ) -> None:
        twice = (
            2 * down if down_twice is None else down_twice,
            2 * right if right_twice is None else right_twice,
        )
        offsets = (np.int32(each) for each in (down, right, *twice))
        self._rows("wind_smooth", field, result, *offsets, self.periodic, *self.size)

    def _rows(self, name: str, *arguments: DeviceArray | np.generic) -> None:
        """Launch a kernel with a row, or on a GPU a cell, for each work-item."""
        assert self.program is not None
        if self.device.is_cpu:
            self.program.launch(name, self.sand.shape[0], *arguments, local=(4,))
        else:
            self.program.launch(name, self.sand.shape, *arguments)

    def _on(self, name: str, values: Floats | DeviceArray, varies: bool) -> DeviceArray:
        """Return values on the device; those that stay the same are sent once."""
        if isinstance(values, DeviceArray):
            return values
        kept = self._sent.get(name)
        if kept is None or kept[0] is not values or kept[1] != varies:
            whole = np.broadcast_to(values, self.sand.shape) if varies else values
            kept = self._sent[name] = values, varies, self.device.upload(whole)
        return kept[2]


def _floats(*values: float) -> tuple[np.float32, ...]:
    return tuple(np.float32(value) for value in values)
