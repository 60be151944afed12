"""The batches on a device; the state stays there from the first to the last."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import DeviceArray
from terrakit.routing import filled, route
from terrakit.running import Run
from terrakit_erosion.droplet.plan import PARTS, SINKS, Plan

_INT = np.int32


SPAN = 64
"""Drops that a work-item walks on a CPU, eight at a time."""


class OpenCLModel:
    """Heights, loose material and what is pending, which change from batch to batch.

    Beside the heights and the loose material it holds three integers for each sample (visits,
    what is pending, scratch) and six for each drop of one batch, however many drops there are.
    """

    def __init__(self, plan: Plan, run: Run) -> None:
        device = run.device
        assert device is not None
        self._plan = plan
        self._device = device
        self._span = SPAN if device.is_cpu else 1
        self._program = device.program(
            __file__, "droplet.cl", {"DROPLET_PARTS": PARTS, "DROPLET_SPAN": self._span}
        )
        shape = plan.start.shape
        nothing = device.zeros(1, _INT)
        self._height = device.upload(plan.start)
        self._loose = device.upload(plan.loose)
        self._pending = device.zeros(shape, _INT)
        self._visits = device.zeros(shape, _INT)
        self._scratch = device.empty(shape, _INT)
        self._smooth = DeviceArray(device, self._scratch.buffer, shape, np.float32)
        self._left = device.zeros((len(SINKS), plan.batch), np.int64)
        self._held = device.zeros(2 * sum(shape), np.int64)
        self._settings = device.upload(plan.settings)
        self._spread = device.upload(plan.spread)
        self._share = device.upload(plan.share)
        self._outlet = device.upload(plan.outlet)
        self._level = self._receiver = nothing
        self._cuts = self._removed = nothing
        self._bed = self._soft = self._column = self._gives = device.zeros(1)
        if plan.is_hard:
            self._cuts, self._removed = device.zeros(shape, _INT), device.empty(shape, _INT)
            self._soft, self._column, self._gives = (device.empty(shape) for _ in range(3))
        self._uploaded: dict[str, tuple[NDArray[np.float32], DeviceArray]] = {}

    @property
    def bedrock(self) -> DeviceArray:
        """Heights without the loose material, quanta; they hold until the next batch."""
        cells = self._height.size
        arguments = (self._height, self._loose, self._scratch, _INT(cells))
        self._program.launch("droplet_bare", cells, *arguments)
        return self._scratch

    def batch(
        self, number: int, rain: NDArray[np.float32], bed: NDArray[np.float32] | DeviceArray | None
    ) -> None:
        """Let one batch of drops run.

        Rain is in metres, of every sample or one; ``bed`` says how far the bedrock gives way.
        """
        plan = self._plan
        size = tuple(_INT(n) for n in plan.start.shape)
        if plan.crosses and number % plan.refresh == 0:
            routing = route(self._height, self._outlet, seed=plan.seed, device=self._device)
            self._receiver, self._level = routing.receiver, filled(routing, self._height)
            cells = self._height.size
            self._program.launch("droplet_dry", cells, self._height, self._level, _INT(cells))
        if bed is not None:
            self._soften(bed)
        ground = (self._height, self._level, self._receiver)
        water = self._on_device("rain", rain)
        items = -(-plan.batch // self._span)
        walk = (
            *(np.uint32(word) for word in plan.seed),
            *(_INT(number), _INT(plan.tall), _INT(plan.wide), _INT(plan.steps)),
            _INT(rain.size > 1),
            *(_INT(plan.crosses), _INT(plan.sea), _INT(plan.is_open), _INT(plan.patience)),
        )
        group = (4,) if self._device.is_cpu else (64,)
        self._device.fill(self._visits, 0)
        self._program.launch(
            "droplet_count",
            items,
            *(*ground, self._visits, water, self._settings, *walk, *size),
            local=group,
        )
        reach = _INT(len(plan.share) - 1)
        self._over_rows(
            "droplet_smooth_rows", self._visits, self._smooth, self._share, reach, *size
        )
        self._over_rows(
            "droplet_smooth_columns", self._smooth, self._visits, self._share, reach, *size
        )
        self._program.launch(
            "droplet_carry",
            items,
            *(*ground, self._visits, self._pending, self._cuts, self._gives, self._left),
            *(water, self._settings, *walk, _INT(plan.is_laid_down), _INT(plan.is_hard)),
            *size,
            local=group,
        )
        reach = _INT(len(plan.spread) - 1)
        if plan.is_hard:
            self._cut(reach, size)
        self._over_rows(
            "droplet_spread_rows", self._pending, self._scratch, self._spread, reach, *size
        )
        self._over_rows(
            "droplet_apply",
            *(self._scratch, self._removed, self._pending, self._height, self._loose, self._held),
            *(self._spread, reach, _INT(plan.is_hard), _INT(plan.is_open), *size),
        )

        for _ in range(plan.sweeps):
            self._over_rows(
                "droplet_rest",
                *(self._height, self._loose, self._bed),
                *(self._scratch, self._visits, self._held),
                *(_INT(plan.bank[0]), _INT(plan.bank[1])),
                *(np.float32(plan.slumps), np.float32(plan.levels)),
                *(_INT(plan.is_hard), _INT(plan.is_open), *size),
            )
            self._height, self._scratch = self._scratch, self._height
            self._loose, self._visits = self._visits, self._loose
        self._smooth = DeviceArray(self._device, self._scratch.buffer, plan.start.shape, np.float32)

    def height(self) -> NDArray[np.int32]:
        """Return the heights now, quanta."""
        return self._height.download()

    def loose(self) -> NDArray[np.int32]:
        """Return the loose material now, quanta."""
        return self._loose.download()

    def left(self) -> NDArray[np.int64]:
        """Return what drops took away, by sink, parts."""
        total: NDArray[np.int64] = self._left.download().sum(axis=1)
        return total

    def held(self) -> NDArray[np.int64]:
        """Return what the held border passed on through each side, parts."""
        rows, cols = self._plan.start.shape
        passed = self._held.download()
        parts = np.split(passed, np.cumsum([cols, cols, rows]))
        return np.array([part.sum() for part in parts])

    def pending(self) -> NDArray[np.int64]:
        """Return what is not applied yet, parts."""
        total: NDArray[np.int64] = self._pending.download().astype(np.int64)
        return total + self._cuts.download() if self._plan.is_hard else total

    def _soften(self, bed: NDArray[np.float32] | DeviceArray) -> None:
        """Work out how far the ground under the brush gives way."""
        plan = self._plan
        shape = plan.start.shape
        size = tuple(_INT(n) for n in shape)
        reach = _INT(len(plan.spread) - 1)
        launch = self._program.launch
        shield = np.float32(plan.shield)
        self._bed = bed if isinstance(bed, DeviceArray) else self._on_device("bed", bed)
        launch(
            "droplet_soften",
            shape,
            *(self._height, self._loose, self._bed, self._soft, shield, *size),
        )
        launch("droplet_reach_columns", shape, self._soft, self._column, self._spread, reach, *size)
        launch("droplet_reach_rows", shape, self._column, self._gives, self._spread, reach, *size)

    def _cut(self, reach: np.int32, size: tuple[np.int32, ...]) -> None:
        """Share the cuts among the points that give way."""
        shape = self._plan.start.shape
        self._program.launch(
            "droplet_cut_rows",
            shape,
            *(self._cuts, self._gives, self._column, self._scratch, self._spread, reach, *size),
        )
        self._program.launch(
            "droplet_cut_columns",
            shape,
            *(self._scratch, self._column, self._soft, self._cuts, self._removed),
            *(self._spread, reach, *size),
        )

    def _over_rows(self, kernel: str, *arguments: DeviceArray | np.generic) -> None:
        shape = self._plan.start.shape
        self._program.launch(
            kernel,
            shape[:1] if self._device.is_cpu else shape,
            *arguments,
            local=(4,) if self._device.is_cpu else None,
        )

    def _on_device(self, name: str, values: NDArray[np.float32]) -> DeviceArray:
        """Return a copy on the device, the same as long as the values are."""
        known = self._uploaded.get(name)
        if known is None or known[0] is not values:
            known = self._uploaded[name] = values, self._device.upload(values)
        return known[1]
