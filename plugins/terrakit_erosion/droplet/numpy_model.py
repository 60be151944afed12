"""The batches in NumPy; the same as :mod:`terrakit_erosion.droplet.opencl`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.routing import filled, route
from terrakit.running import Run
from terrakit_erosion.droplet import reference
from terrakit_erosion.droplet.plan import KEEP, NO_WATER, NORTH, SINKS, WATER, Plan


class NumpyModel:
    """Heights, loose material and what is pending, which change from batch to batch."""

    def __init__(self, plan: Plan, run: Run) -> None:
        del run
        self._plan = plan
        self._height, self._loose = plan.start.copy(), plan.loose.copy()
        shape = plan.start.shape
        self._changes = reference.Changes(
            np.zeros(shape, dtype=np.int32),
            np.zeros(shape, dtype=np.int32),
            np.zeros(len(SINKS), dtype=np.int64),
        )
        self._border: NDArray[np.bool_] | None = None
        if plan.is_open:
            self._border = np.zeros(shape, dtype=bool)
            self._border[[0, -1], :] = True
            self._border[:, [0, -1]] = True
        self._passed = np.zeros(shape, dtype=np.int64)
        self._level: NDArray[np.int32] | None = None
        self._receiver: NDArray[np.int32] | None = None

    @property
    def bedrock(self) -> NDArray[np.int32]:
        """Heights without the loose material, quanta."""
        return self._height - self._loose

    def batch(
        self, number: int, rain: NDArray[np.float32], bed: NDArray[np.float32] | None
    ) -> None:
        """Let one batch of drops run.

        Rain is in metres, of every sample or one; ``bed`` says how far the bedrock gives way.
        """
        plan, changes = self._plan, self._changes
        cols = plan.start.shape[1]
        if plan.crosses and number % plan.refresh == 0:
            routing = route(self._height, plan.outlet, seed=plan.seed)
            level = filled(routing, self._height)
            self._level = np.where(level > self._height, level, np.int32(NO_WATER))
            self._receiver = routing.receiver
        ground = reference.Ground(
            self._height,
            self._level,
            self._receiver,
            plan.settings[KEEP],
            plan.sea,
            plan.is_open,
            plan.patience,
        )
        drops = reference.begin(plan.seed, number, (plan.tall, plan.wide), ground.shape)
        at_start = drops.nearest(cols) if rain.size > 1 else np.zeros(plan.batch, dtype=np.intp)
        water = plan.settings[WATER] * rain.ravel()[at_start]
        some = water > np.float32(1e-6)
        drops, water = drops.chosen(some), water[some]
        visits = reference.count(drops.chosen(water > 0), ground, plan.steps)
        visits = reference.smooth(visits, plan.share)
        soft = column = gives = None
        if bed is not None:
            soft = reference.soften(self._height, self._loose, bed, np.float32(plan.shield))
            column, gives = reference.reach(soft, plan.spread)
        reference.carry(
            drops,
            water,
            ground,
            visits,
            gives,
            plan.settings,
            plan.steps,
            plan.is_laid_down,
            changes,
        )
        total = reference.spread(changes.pending, plan.spread)
        if soft is not None and column is not None and gives is not None:
            lost, changes.cuts = reference.cut(changes.cuts, soft, column, gives, plan.spread)
            total = total + lost
        self._height, self._loose, changes.pending, passed = reference.apply(
            total, self._height, self._loose, self._border
        )
        self._passed += passed
        for _ in range(plan.sweeps):
            self._height, self._loose, passed = reference.rest(
                self._height,
                self._loose,
                bed,
                plan.bank,
                np.float32(plan.slumps),
                np.float32(plan.levels),
                self._border,
            )
            self._passed += passed

    def height(self) -> NDArray[np.int32]:
        """Return the heights now, quanta."""
        return self._height

    def loose(self) -> NDArray[np.int32]:
        """Return the loose material now, quanta."""
        return self._loose

    def left(self) -> NDArray[np.int64]:
        """Return what drops took away, by sink, parts."""
        return self._changes.left

    def held(self) -> NDArray[np.int64]:
        """Return what the held border passed on through each side, parts."""
        passed = self._passed
        sides = (passed[0], passed[-1], passed[1:-1, 0], passed[1:-1, -1])
        result = np.zeros(4, dtype=np.int64)
        for side, along in enumerate(sides, start=NORTH):
            result[side - NORTH] = along.sum()
        return result

    def pending(self) -> NDArray[np.int64]:
        """Return what is not applied yet, parts."""
        return self._changes.pending.astype(np.int64) + self._changes.cuts
