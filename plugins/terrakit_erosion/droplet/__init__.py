"""Droplet erosion: rain runs downhill drop by drop, takes up ground and lays it down."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, Schedule, Seed, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.droplet.plan import (
    NO_WATER,
    NORTH,
    PARTS,
    SINKS,
    Plan,
    brush,
)

GRAVITY = 9.81
LEAST_RADIUS = 1.2
"""Radius of the brush, in samples, below which rills would be one sample wide."""
MOST_RADIUS = 128.0
DRY_AT = 0.01
"""Share of its water at which a drop ends."""
REFRESH = 0.125
"""Drops for each sample between two looks for the way out of hollows."""
BITE = 0.4
"""Most that a batch may lower a place, as a share of what flattens it over a brush radius."""
SLUMPS = 0.1
"""Share of what is too steep that slumps to an axial neighbour in a sweep."""
MOST_LEVELLING = 0.15
"""Largest share of a difference that levels out in a sweep; half of what is stable."""
MOST_SWEEPS = 16
_TEXTBOOK = {
    "brush_radius": 24.0,
    "pickup_length": 22.4,
    "settling_length": 22.4,
    "friction": 0.0,
    "longest_path": 240.0,
    "rain_depth": 1.0,
    "drops_a_cell": 1.0,
    "lakes": "end",
    "bank_angle": None,
    "levelling": 0.0,
}
"""What the usual droplet codes have in common, on samples 8 m apart."""


class Droplet(Erosion):
    """Carve rills, gullies and valleys with rain, drop by drop.

    Each drop runs downhill with some inertia. It can carry so much (volume)::

        c = capacity * max(slope, least_slope) * speed * water

    It takes up a share of what is missing and lays down a share of what is too much, over the area
    of a brush, while speed follows the height lost, ``d(v^2)/dx = 2 g slope - 2 friction v^2``, and
    water dries up. Drops run in batches over ground that stands still; where many of a batch come
    together, each may take only its part, so that none cuts what another has cut.

    Notes
    -----
    Water that fills a hollow leaves over its lowest pass: drops lay their load down in it and go
    on from there. The slopes, ways and areas are in metres, so that twice the samples give the same
    gullies, more finely drawn; only a brush radius below 1.2 samples is raised to that.

    References
    ----------
    H. T. Beyer, "Implementation of a method for hydraulic erosion", 2015. J. Olsen, "Realtime
    procedural terrain generation", 2004.
    """

    name = "droplet"
    uses = ("sediment", "erosion", "deposition", "strata_datum")
    writes = ("elevation", "sediment", "erosion", "deposition")
    cites = ("Beyer 2015",)
    fields = 24
    idle: ClassVar = {"rain_depth": 0.0}
    lasts: ClassVar = {"rain_depth": 1.0}
    turning: ClassVar = None
    refinement_tolerance: ClassVar = None
    trial: ClassVar = {"drops_a_cell": 0.25, "longest_path": 250.0, "drops_at_once": 0.125}

    rain_depth: Maskable = parameter(
        100.0,
        "Depth of all the rain that falls: how much is eroded.",
        unit="m",
        ge=0,
        le=1e6,
    )
    brush_radius: float = parameter(
        20.0, "Radius of what a drop touches: the finest gullies.", unit="m", gt=0, le=1e5
    )
    capacity: float = parameter(
        1.0,
        "Share of its own volume that a drop carries at slope 1 and 1 m/s.",
        unit="s/m",
        ge=0,
        le=1e4,
    )
    pickup_length: float = parameter(
        1000.0,
        "Way on which a drop takes up most of what it can carry; long ways carve valleys.",
        unit="m",
        gt=0,
        le=1e7,
    )
    settling_length: float = parameter(
        50.0, "Way on which most of what is too much settles.", unit="m", gt=0, le=1e7
    )
    inertia: float = parameter(
        0.3, "Share of its direction that a drop keeps over a brush radius.", ge=0, le=0.999
    )
    friction: float = parameter(
        0.2, "Share of its speed that a drop loses on a metre.", unit="1/m", ge=0, le=1e4
    )
    drying_length: float = parameter(
        2000.0, "Way on which two thirds of a drop dry up.", unit="m", gt=0, le=1e8
    )
    longest_path: float = parameter(
        3000.0, "Way after which a drop ends at the latest.", unit="m", gt=0, le=1e8
    )
    bank_angle: float | None = parameter(
        50.0, "Steepest bank; steeper ones slump. Without it they stand.", unit="deg", gt=0, lt=90
    )
    levelling: float = parameter(
        25.0, "How far wet sediment spreads, which smooths plains and fans.", unit="m", ge=0, le=1e5
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    lakes: Literal["cross", "end"] = parameter(
        "cross", "Whether drops cross hollows, as water that fills them does, or end there."
    )
    border: Literal["closed", "open"] = parameter(
        "open", "Whether water and sediment leave over the edge of the map, which is then held."
    )
    ending: Literal["carried_out", "laid_down"] = parameter(
        "carried_out", "What becomes of the load of a drop that dries up."
    )
    drops_a_cell: float = parameter(
        4.0, "Drops that run for each sample; more is smoother and takes longer.", gt=0, le=10000
    )
    drops_at_once: float = parameter(
        1 / 64,
        "Drops for each sample that run before the ground changes.",
        ge=1e-4,
        le=0.25,
        advanced=True,
    )
    least_slope: float = parameter(
        0.01, "Slope that counts for what a drop carries on flat ground.", ge=0, le=1, advanced=True
    )
    start_speed: float = parameter(
        1.0, "Speed at which drops begin to run.", unit="m/s", ge=0, le=100, advanced=True
    )
    seed: Seed = parameter(0, "Another number or word lets the drops fall elsewhere.")

    presets: ClassVar = {
        "gullies": {"brush_radius": 10.0, "pickup_length": 300.0, "rain_depth": 60.0},
        "soft_hills": {"brush_radius": 40.0, "levelling": 80.0, "bank_angle": 35.0},
        "canyons": {
            "pickup_length": 5000.0,
            "rain_depth": 1500.0,
            "bank_angle": 65.0,
            "levelling": 15.0,
        },
        "lague": {**_TEXTBOOK, "inertia": 1e-4, "capacity": 4.0, "drying_length": 800.0},
        "beyer": {
            **_TEXTBOOK,
            "inertia": 0.005,
            "capacity": 8.0,
            "drying_length": 400.0,
            "longest_path": 512.0,
        },
        "unity_thesis": {**_TEXTBOOK, "brush_radius": 10.0, "longest_path": 512.0},
        "blender_addon": {
            **_TEXTBOOK,
            "brush_radius": 10.0,
            "settling_length": 8.0,
            "pickup_length": 8.0,
            "friction": 0.03,
        },
    }

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after the rain."""
        plan = self._plan(surface, run)
        if run.device is None:
            from terrakit_erosion.droplet.numpy_model import NumpyModel as Model
        else:
            from terrakit_erosion.droplet.opencl import OpenCLModel as Model  # type: ignore[assignment]
        model = Model(plan, run)
        exposure = Exposure(surface, plan.quanta, run)
        rain = self._rain(surface, 0.0)
        outcrop: Any = None
        bed = self._bed(surface, 0.0) if plan.is_hard else None
        for number in run.steps(plan.batches):
            fraction = (number + 0.5) / plan.batches
            if isinstance(self.rain_depth, Schedule):
                rain = self._rain(surface, fraction)
            if plan.is_hard and isinstance(self.hardness, Schedule):
                bed = self._bed(surface, fraction)
            if exposure.present and number % plan.refresh == 0:
                outcrop = exposure.field("erodibility", model.bedrock, bed)
            model.batch(number, rain, outcrop if exposure.present else bed)
            run.offer(
                lambda: surface.with_layers(
                    elevation=plan.quanta.height(surface.elevation, plan.start, model.height())
                )
            )
        end, rest = _laid(model.height(), plan.start, model.pending())
        self._book(run, plan, surface.cell_area, end, model.left(), model.held(), rest)
        if plan.batches == 0:
            return surface
        change = plan.quanta.metres(end.astype(np.int64) - plan.start)
        zero = np.float32(0)
        earlier = {
            name: surface.layer(name) if name in surface else np.zeros(surface.shape, np.float32)
            for name in ("sediment", "erosion", "deposition")
        }
        loose = plan.quanta.metres(model.loose() - plan.loose)
        return surface.with_layers(
            elevation=plan.quanta.height(surface.elevation, plan.start, end),
            sediment=np.maximum(earlier["sediment"] + loose, zero),
            erosion=earlier["erosion"] + np.maximum(-change, zero),
            deposition=earlier["deposition"] + np.maximum(change, zero),
        )

    def _rain(self, surface: Heightfield, fraction: float) -> NDArray[np.float32]:
        """Return the depth of rain, of every sample or one, metres."""
        rain = self.value("rain_depth", surface, fraction)
        return np.atleast_1d(np.asarray(rain, dtype=np.float32))

    def _bed(self, surface: Heightfield, fraction: float) -> NDArray[np.float32]:
        """Return how far the bedrock of every sample gives way, 0 to 1."""
        hardness = np.asarray(self.value("hardness", surface, fraction), dtype=np.float32)
        return np.broadcast_to(np.float32(1) - hardness, surface.shape).astype(np.float32)

    def _plan(self, surface: Heightfield, run: Run) -> Plan:
        """Return everything that stays the same from batch to batch."""
        shape, spacing = surface.shape, surface.spacing
        cells = shape[0] * shape[1]
        tall, wide = (max(1, round(n * math.sqrt(self.drops_at_once))) for n in shape)
        batches = max(1, round(self.drops_a_cell * cells / (tall * wide)))
        if isinstance(self.rain_depth, Schedule):
            ends = self.rain_depth.value
        else:
            ends = [float(np.max(self.value("rain_depth", surface)))]
        if max(ends) == 0.0 or min(shape) < 3:
            batches = 0
        hardness = (
            max(self.hardness.value)
            if isinstance(self.hardness, Schedule)
            else float(np.max(self.value("hardness", surface)))
        )
        quanta = Quanta.fitting(surface.elevation, spacing)
        start = quanta.count(surface.elevation)
        loose = np.zeros(shape, dtype=np.int32)
        if "sediment" in surface:
            thick = surface.layer("sediment").astype(np.float64) / quanta.quantum
            loose = np.clip(np.rint(thick), 0, 2**29).astype(np.int32)
        radius = min(max(self.brush_radius / spacing, LEAST_RADIUS), MOST_RADIUS)
        spread, share, _ = brush(radius)
        way = min(self.longest_path, -math.log(DRY_AT) * self.drying_length)
        sea = NO_WATER
        if run.sea_level is not None:
            level = run.sea_level / quanta.quantum - quanta.datum
            sea = round(min(max(level, -(2.0**30)), 2.0**30))
        spreading = (self.levelling / spacing) ** 2 / 2 / max(1, batches)
        sweeps = min(max(1, math.ceil(spreading / MOST_LEVELLING)), MOST_SWEEPS)
        levels = min(spreading / sweeps, MOST_LEVELLING) * 2 / 3
        if self.bank_angle is None and levels == 0:
            sweeps = 0
        return Plan(
            start=start,
            loose=loose,
            outlet=self._outlets(start, sea),
            quanta=quanta,
            settings=self._settings(quanta, surface, radius, batches * tall * wide),
            spread=spread,
            share=share,
            seed=run.words(self.name, self.seed),
            batches=batches,
            tall=tall,
            wide=wide,
            steps=min(max(1, math.ceil(way / spacing)), 8 * sum(shape)),
            patience=math.ceil(4 * radius),
            sea=sea,
            crosses=self.lakes == "cross",
            refresh=max(1, round(REFRESH / self.drops_at_once)),
            is_open=self.border == "open",
            is_laid_down=self.ending == "laid_down",
            is_hard=hardness > 0 or (surface.strata is not None and "strata_datum" in surface),
            sweeps=sweeps,
            bank=self._bank(quanta, spacing),
            slumps=SLUMPS if self.bank_angle is not None else 0.0,
            levels=levels,
            shield=BITE * radius,
        )

    def _bank(self, quanta: Quanta, spacing: float) -> tuple[int, int]:
        """Return the difference to an axial and a diagonal neighbour that stands, quanta."""
        if self.bank_angle is None:
            return 2**30, 2**30
        rise = math.tan(math.radians(self.bank_angle)) * spacing / quanta.quantum
        return min(round(rise), 2**30), min(round(rise * math.sqrt(2)), 2**30)

    def _settings(
        self, quanta: Quanta, surface: Heightfield, radius: float, drops: int
    ) -> NDArray[np.float32]:
        """Return the list of settings; a step is as long as the spacing."""
        spacing, area = surface.spacing, brush(radius)[2]
        cells = (surface.shape[0] - 1) * (surface.shape[1] - 1)
        part = quanta.quantum / PARTS  # metres of height
        slowing = 2 * self.friction * spacing
        kept = math.exp(-slowing)
        gained = GRAVITY * (1 - kept) / self.friction if slowing > 1e-6 else 2 * GRAVITY * spacing
        settings = [
            self.inertia ** (1 / radius),
            quanta.quantum / spacing,
            kept if kept > 1e-20 else 0.0,
            gained,
            self.capacity,
            self.least_slope,
            1 - math.exp(-spacing / self.pickup_length),
            1 - math.exp(-spacing / self.settling_length),
            max(math.exp(-spacing / self.drying_length), 1e-20),
            cells / max(1, drops) / part,
            area * PARTS,
            area * BITE * radius * spacing / part,
            self.start_speed**2,
        ]
        return np.array(settings, dtype=np.float32)

    def _outlets(self, start: NDArray[np.int32], sea: int) -> NDArray[np.uint8]:
        """Return 1 where water leaves."""
        outlet = (start < sea).astype(np.uint8)
        if self.border == "open":
            outlet[[0, -1], :] = 1
            outlet[:, [0, -1]] = 1
        elif not outlet.any():
            outlet.flat[np.argmin(start)] = 1
        return outlet

    def _book(
        self,
        run: Run,
        plan: Plan,
        cell_area: float,
        end: NDArray[np.int32],
        left: NDArray[np.int64],
        held: NDArray[np.int64],
        rest: int,
    ) -> None:
        """Book what was there, what drops took away and what is there now."""
        part = plan.quanta.quantum / PARTS * cell_area
        left = left.copy()
        left[NORTH : NORTH + len(held)] += held
        left[0] += rest
        ledger = run.ledger
        ledger.open("rock", plan.quanta.volume(plan.start, cell_area))
        for sink, parts in zip(SINKS, left, strict=True):
            if parts > 0:
                ledger.left("rock", sink, int(parts) * part)
            elif parts < 0:  # a held border gives ground to what was cut beside it
                ledger.came("rock", sink, -int(parts) * part)
        moved = int(np.abs(end.astype(np.int64) - plan.start).sum()) * PARTS * 0.5 * part
        ledger.close("rock", plan.quanta.volume(end, cell_area), moved)


def _laid(
    height: NDArray[np.int32], start: NDArray[np.int32], pending: NDArray[np.int64]
) -> tuple[NDArray[np.int32], int]:
    """Return heights with the parts of quanta that are pending, and the parts that remain.

    They are added up cell by cell, and a quantum goes where the sum passes one: no cell that
    changed is off by more than a quantum, and none that did not is touched.
    """
    touched = np.flatnonzero(height != start)
    end = height.copy()
    if len(touched):
        whole = np.cumsum(pending.ravel()[touched]) // PARTS
        end.ravel()[touched] += np.diff(whole, prepend=0).astype(np.int32)
    gained = int((end.astype(np.int64) - height).sum())
    return end, int(pending.sum()) - gained * PARTS
