"""Wind in NumPy: the readable definition, and the oracle of ``wind.cl``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute.exact import hashed, mix, uniform
from terrakit_erosion.wind.plan import CALM, FLIGHT, MOST_STRESS, STEEPEST, Blow, Gust, Plan

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
DIRECTIONS = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))
VEERS = range(-2, 3)


class NumpyModel:
    """State of sand, rock and air, heights in quanta.

    Parameters
    ----------
    plan
        What stays the same in the run.
    bedrock, sand
        Height of the bedrock and thickness of the sand on it.
    device
        Taken for the sake of the OpenCL twin.
    """

    def __init__(self, plan: Plan, bedrock: Counts, sand: Counts, device: object = None) -> None:
        del device
        self.plan = plan
        self.bedrock, self.sand = bedrock.copy(), sand.copy()
        self.air = np.zeros_like(sand)
        self.shade = bedrock + sand
        self.lift, self.veer = np.zeros_like(sand), np.zeros_like(sand)
        self.plants: Floats = np.zeros(1, dtype=F)
        self.across = (0, 0)
        self._gone = np.zeros(sand.shape, dtype=np.int64)
        self._dust = np.zeros(sand.shape, dtype=np.int64)

    def refresh(
        self, blow: Blow, gusts: int, plants: Floats, softness: Floats, seed: tuple[int, int]
    ) -> None:
        """Compute what the wind lifts and where it veers; wear the rock for the gusts to come."""
        plan = self.plan
        self.plants, self.across = plants, blow.across
        ground = self.bedrock + self.sand
        self.shade = ground
        for down, right, sinks in blow.shadows:
            self.shade = np.maximum(self.shade, self._at(self.shade, -down, -right) - sinks)
        near = self.shade.astype(F)
        for step in plan.near:
            near = self._smooth(self._smooth(near, step, 0), 0, step)
        wide = near
        for step in plan.wide:
            wide = self._smooth(self._smooth(wide, step, 0), 0, step)
        stress, field = np.ones_like(near), near
        for level in blow.levels:
            smooth = self._smooth(
                field, level.down, level.right, level.down_twice, level.right_twice
            )
            stress = stress + F(level.weight) * (field - smooth)
            field = smooth
        to_south, to_east = self._rises(near)
        # Stress: the relief's, the slope's, and that of height
        bump = stress - F(1)
        rise = F(blow.rise[0]) * to_south + F(blow.rise[1]) * to_east
        slope = np.where(rise < F(STEEPEST), rise, F(STEEPEST))
        speed = F(1) + F(plan.height_rate) * (near - F(plan.lowest))
        raw = (F(1) + np.where(bump < 0, F(CALM) * bump, bump) + slope) * (speed * speed)
        pull = np.where(raw > 0, np.where(raw < F(MOST_STRESS), raw, F(MOST_STRESS)), F(0))
        excess = np.sqrt(pull) - F(plan.threshold)
        carries = F(plan.lifted) * pull * np.where(excess > 0, excess, F(0))
        rows, cols = ground.shape
        dice = hashed(seed, np.arange(rows)[:, None], np.arange(cols)[None, :])
        gusty = F(0.95) + F(0.1) * uniform(dice)
        self.lift = (carries * gusty * (F(1) - plants)).astype(np.int32)
        if plan.wears > 0:
            self._wear(blow, F(plan.wears * gusts), ground, near, wide, to_south, to_east, softness)
        if plan.deflection:
            near_aside = F(blow.aside[0]) * to_south + F(blow.aside[1]) * to_east
            wide_south, wide_east = self._rises(wide)
            wide_aside = F(blow.aside[0]) * wide_south + F(blow.aside[1]) * wide_east
            shift = near_aside + F(3) * wide_aside
            held = np.where(shift > 2, F(2), np.where(shift < -2, F(-2), shift))
            cells = np.floor(held + uniform(mix(dice))).astype(np.int32)
            self.veer = np.clip(cells, -2, 2)

    def _wear(
        self,
        blow: Blow,
        wears: np.float32,
        ground: Counts,
        near: Floats,
        wide: Floats,
        to_south: Floats,
        to_east: Floats,
        softness: Floats,
    ) -> None:
        """Let low-flying grains wear what faces them, where no sand lies and no lee is."""
        laws = self.plan.laws
        cover = self.sand.astype(F) * F(laws.per_cover)
        below = np.maximum(self.shade - ground, 0).astype(F) * F(laws.per_shelter)
        bare = np.where(cover < 1, F(1) - cover, F(0)) * np.where(below < 1, F(1) - below, F(0))
        climb = F(blow.climb[0]) * to_south + F(blow.climb[1]) * to_east
        facing = np.where(climb > F(-0.25), F(0.25) + climb, F(0))
        above = (near - wide) * F(self.plan.quanta.quantum / FLIGHT)
        reach = np.where(above > 0, F(1) / (F(1) + above * above), F(1))
        worn = wears * self.air.astype(F) * bare * facing * reach * softness
        rock = np.where(worn < F(2**24), worn, F(2**24)).astype(np.int32)
        fine = (F(self.plan.dusty) * rock.astype(F)).astype(np.int32)
        self.bedrock = self.bedrock - rock
        self.sand = self.sand + rock - fine
        self._dust += fine

    def blow(self, gust: Gust) -> None:
        """Let one gust carry sand a hop further, and slopes slide."""
        laws = self.plan.laws
        ground = self.bedrock + self.sand
        net, gross = np.zeros_like(ground), np.zeros_like(ground)
        for direction in DIRECTIONS:
            slanted = 0 not in direction
            out = self._slide(ground, direction, slanted)
            net += out
            gross += np.maximum(out, 0)
        arrived = self._arriving(gust)
        # Land: more readily on sand than on rock, among plants, and in the lee
        below = np.maximum(self.shade - ground, 0).astype(F) * F(laws.per_shelter)
        shelter = np.where(below < 1, below, F(1))
        cover = self.sand.astype(F) * F(laws.per_cover)
        bare = F(laws.on_rock) + (F(laws.on_sand) - F(laws.on_rock)) * np.where(
            cover < 1, cover, F(1)
        )
        green = bare + (F(1) - bare) * self.plants
        caught = green + (F(1) - green) * shelter
        laid = np.minimum((caught * arrived.astype(F)).astype(np.int32), arrived)
        # Take off again, where the wind reaches
        wanted = ((F(1) - shelter) * self.lift.astype(F)).astype(np.int32)
        lifted = np.minimum(wanted, self.sand - gross)
        self.sand = self.sand - net + laid - lifted
        self.air = arrived - laid + lifted

    def _slide(self, ground: Counts, direction: tuple[int, int], slanted: bool) -> Counts:
        """Return what slides and creeps to the neighbour in one direction, or comes from it."""
        laws = self.plan.laws
        down, right = direction
        exists = self._from(np.ones_like(ground), -down, -right, 0)
        difference = np.where(exists == 1, ground - self._from(ground, -down, -right, 0), 0)
        sand_there = self._from(self.sand, -down, -right, 0)
        talus = laws.talus_slanted if slanted else laws.talus
        beyond = np.maximum(difference - talus, 0) - np.maximum(-difference - talus, 0)
        share, creep = (
            (laws.slanted, laws.creep_slanted) if slanted else (laws.axial, laws.creep_axial)
        )
        wanted = (F(share) * beyond.astype(F) + F(creep) * difference.astype(F)).astype(np.int32)
        return np.maximum(np.minimum(wanted, self.sand >> 3), -(sand_there >> 3))

    def _arriving(self, gust: Gust) -> Counts:
        """Return the sand that flies in, and note what flies out over open borders."""
        plan = self.plan
        rows, cols = plan.shape
        to_row = np.arange(rows)[:, None] + gust.down + self.veer * self.across[0]
        to_col = np.arange(cols)[None, :] + gust.right + self.veer * self.across[1]
        stays = (to_row >= 0) & (to_row < rows) & (to_col >= 0) & (to_col < cols)
        if not plan.periodic:
            self._gone += np.where(stays, 0, self.air)
        if not plan.deflection:
            return self._from(self.air, gust.down, gust.right, plan.inflow)
        arrived = np.zeros_like(self.air)
        for veer in VEERS:
            own = np.where(self.veer == veer, self.air, 0)
            arrived += self._from(
                own,
                gust.down + veer * self.across[0],
                gust.right + veer * self.across[1],
                plan.inflow if veer == 0 else 0,
            )
        return arrived

    def _from(self, field: Counts, down: int, right: int, outside: int) -> Counts:
        """Return for every cell the value at (row - down, col - right)."""
        if self.plan.periodic:
            return np.roll(field, (down, right), (0, 1))
        rows, cols = field.shape
        result = np.full_like(field, outside)
        if abs(down) < rows and abs(right) < cols:
            to = (
                slice(max(0, down), rows + min(0, down)),
                slice(max(0, right), cols + min(0, right)),
            )
            of = (
                slice(max(0, -down), rows - max(0, down)),
                slice(max(0, -right), cols - max(0, right)),
            )
            result[to] = field[of]
        return result

    def _smooth(
        self,
        field: Floats,
        down: int,
        right: int,
        down_twice: int | None = None,
        right_twice: int | None = None,
    ) -> Floats:
        """Return the spline of five samples one or two steps away."""
        twice = (
            2 * down if down_twice is None else down_twice,
            2 * right if right_twice is None else right_twice,
        )
        one = self._at(field, -down, -right) + self._at(field, down, right)
        two = self._at(field, -twice[0], -twice[1]) + self._at(field, *twice)
        return F(0.375) * field + F(0.25) * one + F(0.0625) * two

    def _rises(self, field: Floats) -> tuple[Floats, Floats]:
        """Return the differences of the neighbours to the south and north, east and west."""
        return (
            self._at(field, 1, 0) - self._at(field, -1, 0),
            self._at(field, 0, 1) - self._at(field, 0, -1),
        )

    def _at(self, field: NDArray[Any], down: int, right: int) -> NDArray[Any]:
        """Return for every cell the value at (row + down, col + right), or the border's."""
        rows, cols = field.shape
        row, col = np.arange(rows) + down, np.arange(cols) + right
        if self.plan.periodic:
            row, col = row % rows, col % cols
        else:
            row, col = np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)
        return field[row[:, None], col[None, :]]

    def supply(self, more: NDArray[np.int32]) -> int:
        """Lay sand down, or take away what there is of it; return the sum of the change."""
        change = np.maximum(more, -self.sand)
        self.sand = self.sand + change
        return int(change.sum(dtype=np.int64))

    def ground(self) -> tuple[Counts, Counts]:
        """Return bedrock and sand, with what still flies on it."""
        return self.bedrock, self.sand + self.air

    def gone(self) -> NDArray[np.int64]:
        """Return what flew out over open borders, counted where it flew from."""
        return self._gone

    def dust(self) -> int:
        """Return the rock that the wind carried off as dust."""
        return int(self._dust.sum())
