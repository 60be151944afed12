"""From coarse to fine: erosion lays the valleys out on few samples, and details them on many."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from terrakit.heightfield import Field, Grid, Heightfield
from terrakit.layers import covers
from terrakit.ledger import Account, Ledger
from terrakit.operators import Erosion, Surface
from terrakit.parameters import parameter
from terrakit.passes import Pass, Passes, rounding_of, volume_under
from terrakit.running import Run
from terrakit.sources import OfSteps, Steps
from terrakit_erosion.multiscale import scales

LEAST_SAMPLES = 5
"""Samples a side of the coarsest grid."""
CHANGE_OF_SCALE = "change of scale"
"""Under what the ledger holds the volume that differs between one level and the next."""


class Multiscale(Erosion):
    """Run a list of steps on coarse samples first, then on finer and finer ones.

    What is wide needs many sweeps on fine samples and few on coarse ones. So the terrain is brought
    to twice the spacing, again and again, eroded there, and the change (not the terrain) is taken
    back to the next finer samples, where erosion goes on::

        h_k = R h_(k-1),   h_(k-1) <- h_(k-1) + P (E(h_k) - h_k)

    with means R that keep the volume and smooth B-splines P that keep what was moved. Details of
    the fine terrain stay; the large valleys come from the coarse one.

    Notes
    -----
    The levels share the time that the steps are given: with ``coarse_share`` 0.5 the coarsest takes
    half of ``duration``, the next a quarter, and so on; the finest takes all that is left. So the
    years, the uplift and the rain of the steps stay what they are, and more samples add a level at
    the fine end without changing the coarse ones. An erosion that declares no parameter of time
    (``lasts``), a filter or a texture does all its work on every level.

    References
    ----------
    W. Briggs, V. Henson and S. McCormick, "A multigrid tutorial", 2000. H. Schott et al., "Terrain
    amplification using multi-scale erosion", ACM Transactions on Graphics 43, 2024.
    """

    name = "multiscale"
    reads: ClassVar[Any] = OfSteps("reads", ("elevation",))
    uses: ClassVar[Any] = OfSteps("uses", ())
    writes: ClassVar[Any] = OfSteps("writes", ("elevation",))
    fields: ClassVar[Any] = OfSteps("fields", 12)
    cites = ("Briggs, Henson & McCormick 2000", "Schott et al. 2024")
    idle: ClassVar = {"steps": [{"use": "thermal", "distance": 0.0}]}
    trial: ClassVar = {
        "coarsest_spacing": 40.0,
        "steps": [{"use": "thermal", "distance": 30.0}],
    }

    steps: Steps = parameter(..., "What is done on every level, in order.")
    coarsest_spacing: float = parameter(
        200.0,
        "Distance between the samples at which to begin; larger moves larger landforms.",
        unit="m",
        gt=0,
        le=1e6,
    )
    coarse_share: float = parameter(
        0.5,
        "Share of the time for the coarsest level; each finer one takes as much of what is left.",
        ge=0,
        le=1,
    )
    split: Literal["shared", "whole"] = parameter(
        "shared", "Whether the levels share the time of the steps, or each takes the whole of it."
    )

    def portion(self, start: float, end: float) -> Multiscale:
        """Return the same levels with the steps cut down to a part of their time."""
        return self.model_copy(update={"steps": self.steps.portion(start, end)})

    def levels(self, grid: Grid) -> list[Grid]:
        """Return the grids that the steps are run on, the finest first."""
        grids = [grid]
        while True:
            coarse = scales.coarser(grids[-1])
            too_wide = coarse.spacing > self.coarsest_spacing * (1 + 1e-9)
            if too_wide or min(coarse.shape) < LEAST_SAMPLES:
                return grids
            grids.append(coarse)

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after the finest level."""
        scale = Descent(surface, len(self.levels(surface.grid)), run)
        passes = Passes(run, self._passes(scale.depth))
        run.ledger.open("rock", scale.volumes[0])
        run.ledger.close("rock", scale.volumes[0], 0.0)
        level, now = scale.depth - 1, scale.terrains[-1]
        for each in passes:
            now = self._down_to(each.number, level, now, scale, run.ledger)
            level = each.number
            now = self._worked_on(now, each, scale, passes, run)
        return self._down_to(0, level, now, scale, run.ledger)

    def _passes(self, depth: int) -> list[Pass]:
        """Return the levels that have time to work, the coarsest first; the finest is number 0."""
        passes, over = [], 0.0
        for level in reversed(range(depth)):
            start = over
            over = 1.0 if level == 0 else start + self.coarse_share * (1.0 - start)
            if self.split == "whole":
                passes.append(Pass(level, 0.0, 1.0, 0.25**level))
            elif over > start:
                passes.append(Pass(level, start, over, (over - start) * 0.25**level))
        return passes

    def _worked_on(
        self, now: Heightfield, each: Pass, scale: Descent, passes: Passes, run: Run
    ) -> Heightfield:
        """Return the terrain of one level after its share of the steps."""
        level, own, steps = each.number, Ledger(), self.steps
        if (each.start, each.end) != (0.0, 1.0):
            steps = steps.portion(each.start, each.end)

        def shown(unfinished: Surface) -> Surface:
            assert isinstance(unfinished, Heightfield)
            return self._down_to(0, level, unfinished, scale)

        result = passes.through(
            each,
            steps,
            now,
            ledger=own,
            earlier=scale.of_steps(run.earlier, level),
            preview=shown,
        )
        assert isinstance(result, Heightfield)
        booked = scale.on_the_finest(own, level)
        for store, account in booked.accounts.items():
            before = run.ledger.accounts.get(store)
            if store != "rock" and before is not None and before.end is not None:
                before.book(CHANGE_OF_SCALE, account.start - before.end)
                before.end = account.start
        run.ledger.follow(booked, lambda: scale.ratios[level] * rounding_of(now))
        return result

    def _down_to(
        self,
        target: int,
        level: int,
        now: Heightfield,
        scale: Descent,
        ledger: Ledger | None = None,
    ) -> Heightfield:
        """Return the terrain of a finer level with what has changed on ``level``."""
        while level > target:
            finer = self._finer(now, scale.terrains[level], scale.terrains[level - 1])
            if ledger is not None:
                account = ledger.accounts["rock"]
                assert account.end is not None
                gap = scale.gained(finer, level - 1) - scale.gained(now, level)
                account.book(CHANGE_OF_SCALE, gap)
                account.end += gap
            level, now = level - 1, finer
        return now

    def _finer(self, now: Heightfield, coarse: Heightfield, fine: Heightfield) -> Heightfield:
        """Return the next finer terrain, to which is added how ``now`` differs from ``coarse``."""
        changed: dict[str, Field] = {}
        for name in now:
            if name == "elevation" or not covers(self.writes, name):
                continue
            if name in coarse and now.layers[name] is coarse.layers[name]:
                continue
            before = coarse.layer(name) if name in coarse else None
            base = fine.layer(name) if name in fine else None
            changed[name] = scales.added(name, base, before, now.layer(name), fine.shape)
        rise = now.elevation.astype(np.float64) - coarse.elevation
        if rise.any():
            changed["elevation"] = scales.raised(fine, rise)
        return fine.with_layers(**changed)


class Descent:
    """A terrain on coarser and coarser samples, and how their volumes compare.

    The cells at the edge of a coarse grid reach beyond the terrain, by up to half of themselves.
    So volumes of a level count by the ``ratio`` of the areas: the mean height is what is compared.
    """

    def __init__(self, surface: Heightfield, depth: int, run: Run) -> None:
        self.terrains = [surface]
        while len(self.terrains) < depth:
            run.check()
            self.terrains.append(scales.restricted(self.terrains[-1]))
        self.volumes = [volume_under(terrain) for terrain in self.terrains]
        areas = [math.prod(t.shape) * t.cell_area for t in self.terrains]
        self.ratios = [areas[0] / area for area in areas]

    @property
    def depth(self) -> int:
        """How many levels there are."""
        return len(self.terrains)

    def gained(self, now: Heightfield, level: int) -> float:
        """Return by how much (m3) a level has changed, as a volume of the finest terrain."""
        return self.ratios[level] * (volume_under(now) - self.volumes[level])

    def on_the_finest(self, ledger: Ledger, level: int) -> Ledger:
        """Return the accounts of a level as volumes of the finest terrain.

        Rock begins at the volume under the finest terrain and what the level has gained so far.
        """
        ratio, booked = self.ratios[level], Ledger()
        for store, account in ledger.accounts.items():
            assert account.end is not None
            base = self.volumes[level] if store == "rock" else 0.0
            shift = self.volumes[0] if store == "rock" else 0.0
            booked.accounts[store] = Account(
                start=shift + ratio * (account.start - base),
                came={name: ratio * volume for name, volume in account.came.items()},
                left={name: ratio * volume for name, volume in account.left.items()},
                end=shift + ratio * (account.end - base),
                moved=ratio * account.moved,
            )
        return booked

    def of_steps(self, earlier: Mapping[str, Surface], level: int) -> dict[str, Surface]:
        """Return the surfaces that parameters may name, as coarse where they lie on the terrain."""
        found = dict(earlier)
        for name, surface in earlier.items():
            if isinstance(surface, Heightfield) and surface.grid == self.terrains[0].grid:
                for _ in range(level):
                    surface = scales.restricted(surface)
                found[name] = surface
        return found
