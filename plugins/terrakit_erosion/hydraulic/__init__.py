"""Hydraulic erosion: rain runs off, cuts gullies and valleys, lays down fans and deltas."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, Schedule, Seed, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit_erosion.hydraulic.plan import (
    BLOCK,
    GRAVITY,
    SLIDE,
    Beginning,
    Plan,
    Storms,
    Weather,
    around,
    constants,
)
from terrakit_erosion.hydraulic.reference import FULL, THIN, Counts
from terrakit_erosion.thermal.ground import SIDES, loose_on

HOUR = 3600.0
PER_HOUR = 1e-3 / HOUR
"""Metres a second of 1 mm/h."""
FINEST = 2.0**-22
"""Smallest quantum of water, m."""
MOST_STEPS = 4_000_000
MOST_CREEP = 0.15
DEEPEST = 20000.0
"""Deepest water above the highest ground, m: deeper than any sea."""
WET = 0.01
"""Depth of water that makes ground wet, m; a film of rain is less."""
DROWNED = 0.1
"""Depth of water that keeps raindrops off the ground, m; mud creeps under it, half as fast."""
MOST_SWEEPS = 32
STORM_LIFE = 1200.0
"""Seconds in which a storm gives way to the next."""
MOST_A_BLOCK = 2**28
"""Most counts of water that come to a cell, or leave it, in a block."""


class Hydraulic(Erosion):
    """Let rain run off as shallow water that takes up, carries and lays down sediment.

    Water follows the local-inertial form of the shallow-water equations, with Manning friction::

        dq/dt = -g h grad(b + d) - g n^2 q |q| / h^(7/3),    dd/dt = -div q + rain - losses

    It carries up to ``C = K |q| sin a`` of sediment (a load per area); what is missing is eroded,
    what is too much settles, and the load moves with the very counts of water that pass an edge::

        m < C: db/dt = -k_e (C - m),   m > C: db/dt = k_d (m - C),   dm/dt = -div(q m / d) - db/dt

    Capacity is multiplied by ``acceleration``, which stands for as many storms as one. Water, load
    and ground are whole numbers of quanta, so both ledgers close to the last one.

    Notes
    -----
    Steps take turns between the edges along the axes and along the diagonals, so that rivers do
    not follow the grid. The time step follows from ``wave_depth``: water deeper than that is given
    more inertia, so that it cannot outrun the step; steady flow is not changed. Local inertia has
    no advection of momentum, so hydraulic jumps and dam breaks without friction are not exact.
    ``scheme = "pipe"`` has neither depth nor friction, and its speed on a slope is what the time
    step allows: it is there for comparison.

    References
    ----------
    P. Bates, M. Horritt and T. Fewtrell, Journal of Hydrology 387, 2010. G. de Almeida and P.
    Bates, Water Resources Research 49, 2013. X. Mei, P. Decaudin and B. Hu, Pacific Graphics 2007.
    J. Roelvink, Coastal Engineering 53, 2006.
    """

    name = "hydraulic"
    uses = ("sediment", "erosion", "deposition", "water_depth", "wetness", "strata_datum")
    writes = (
        "elevation",
        "sediment",
        "erosion",
        "deposition",
        "water_depth",
        "discharge",
        "flow_speed",
        "wetness",
    )
    cites = (
        "Bates, Horritt & Fewtrell 2010",
        "Mei, Decaudin & Hu 2007",
        "Roelvink 2006",
    )
    fields = 25
    idle: ClassVar = {"storm_duration": 0.0}
    lasts: ClassVar = {"storm_duration": 1.0}
    lasts: ClassVar = {"storm_duration": 1.0}
    turning: ClassVar = {"rain_pattern": "uniform", "springs": []}
    refinement_tolerance: ClassVar = None
    trial: ClassVar = {"storm_duration": 0.02, "rain_pattern": "random", "storm_size": 100.0}

    storm_duration: float = parameter(
        1.0, "How long it rains; twice as long cuts about twice as deep.", unit="h", ge=0, le=1e5
    )
    rain: Maskable = parameter(
        100.0, "Rain; 5 drizzle, 50 a cloudburst.", unit="mm/h", ge=0, le=1e4
    )
    rain_pattern: Literal["uniform", "random"] = parameter(
        "uniform", "Whether rain falls evenly, or in storm cells that come and go."
    )
    storm_size: float = parameter(
        2000.0, "Distance between the cells of random rain.", unit="m", ge=1, le=1e6
    )
    springs: list[Annotated[list[float], Field(min_length=3, max_length=3)]] = parameter(
        [], "Springs: x and y in the world (m), and what they give (m3/s)."
    )
    evaporation: Maskable = parameter(
        0.0, "Water that dries up, for each hour.", unit="mm/h", ge=0, le=1e4
    )
    infiltration: Maskable = parameter(
        0.0, "Water that seeps into the ground, for each hour.", unit="mm/h", ge=0, le=1e4
    )
    lakes_at_start: Literal["full", "empty"] = parameter(
        "full", "Whether hollows are full when it begins to rain; a layer water_depth goes first."
    )
    acceleration: float = parameter(
        80.0, "Storms that this one stands for: how much deeper it cuts.", ge=0, le=1e4
    )
    sediment_capacity: float = parameter(
        1.0,
        "Load that a flow of 1 m2/s carries on a slope of 1; more cuts deeper.",
        unit="s/m",
        ge=0,
        le=1000,
    )
    erosion_rate: float = parameter(
        0.02, "Share of the missing load that is eroded in a second.", unit="1/s", ge=0, le=1000
    )
    deposition_rate: float = parameter(
        0.02, "Share of the load in excess that settles in a second.", unit="1/s", ge=0, le=1000
    )
    erosion_threshold: float = parameter(
        0.0,
        "Flow times slope below which nothing is eroded; more leaves crests and spurs alone.",
        unit="m2/s",
        ge=0,
        le=1e4,
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    manning: float = parameter(
        0.04,
        "Roughness of the bed: 0.02 smooth, 0.04 mountain stream, 0.1 scrub.",
        unit="s/m^(1/3)",
        ge=0,
        le=10,
    )
    bank_angle: float = parameter(
        40.0,
        "Banks steeper than this slump into the stream, hard or soft.",
        unit="deg",
        ge=1,
        lt=90,
    )
    splash: float = parameter(
        1.0, "Creep of soil under raindrops, which rounds crests.", unit="m2/h", ge=0, le=1e4
    )
    water_border: Literal["open", "closed", "fixed", "periodic"] = parameter(
        "open",
        "Edge of the map: water leaves, is held back, stands at border_level, or comes in again "
        "on the other side.",
    )
    border_level: float | None = parameter(
        None,
        "Level of the water beyond a fixed border; the sea's if there is one, else dry.",
        unit="m",
        ge=-1e6,
        le=1e6,
    )
    wetness_time: float = parameter(
        1.0, "How long wetness remembers.", unit="h", gt=0, le=1e6, advanced=True
    )
    mixing: float = parameter(
        0.0, "Spread of the load through the water.", unit="m2/s", ge=0, le=1e4, advanced=True
    )
    least_slope: float = parameter(
        0.005,
        "Slope that counts for what water carries on flat ground.",
        ge=0,
        le=1,
        advanced=True,
    )
    wave_depth: float = parameter(
        1.0,
        "Deepest water whose waves run at their own speed; deeper takes smaller time steps.",
        unit="m",
        ge=0.001,
        le=1e4,
        advanced=True,
    )
    courant: float = parameter(
        0.4, "Share of a cell that a wave crosses in a step.", gt=0, le=0.42, advanced=True
    )
    scheme: Literal["inertial", "pipe"] = parameter(
        "inertial", "inertial is shallow water; pipe is the older virtual pipes, to compare with."
    )
    seed: Seed = parameter(0, "Another number or word gives other storm cells.")

    presets: ClassVar = {
        "storm": {"rain": 100.0, "storm_duration": 1.0},
        "gentle_rain": {
            "rain": 20.0,
            "storm_duration": 2.0,
            "acceleration": 150.0,
            "splash": 0.8,
        },
        "flood": {
            "rain": 60.0,
            "storm_duration": 2.0,
            "acceleration": 40.0,
            "manning": 0.03,
            "erosion_threshold": 0.01,
        },
        "badlands": {
            "rain": 150.0,
            "acceleration": 200.0,
            "splash": 0.02,
            "bank_angle": 50.0,
            "manning": 0.03,
        },
        "terragen": {"acceleration": 120.0, "deposition_rate": 0.04, "splash": 0.4},
        "unreal": {
            "rain_pattern": "random",
            "sediment_capacity": 0.3,
            "acceleration": 200.0,
            "splash": 0.2,
        },
        "unity_hydraulic": {
            "evaporation": 5.0,
            "lakes_at_start": "empty",
            "erosion_rate": 0.05,
            "deposition_rate": 0.05,
        },
        "world_machine": {"storm_duration": 2.0, "hardness": 0.3, "erosion_threshold": 0.002},
        "ant_landscape": {
            "lakes_at_start": "empty",
            "evaporation": 10.0,
            "bank_angle": 45.0,
            "erosion_rate": 0.05,
        },
        "mei_pipe": {"scheme": "pipe", "erosion_rate": 0.1, "deposition_rate": 0.1},
    }

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after the storm."""
        planned = self._plan(surface, run)
        if planned is None:
            quanta = Quanta.fitting(surface.elevation, surface.spacing)
            volume = quanta.volume(quanta.count(surface.elevation), surface.cell_area)
            run.ledger.open("rock", volume)
            for _ in run.steps(0):
                pass
            run.ledger.close("rock", volume, 0.0)
            return surface
        plan, begin = planned
        framed = _framed(surface, plan) if surface.strata is not None else None
        if run.device is None:
            from terrakit_erosion.hydraulic.numpy_model import NumpyModel as Model
        else:
            from terrakit_erosion.hydraulic.opencl import OpenCLModel as Model  # type: ignore[assignment]
        model = Model(plan, begin, framed, run)
        first = begin.water
        del planned, begin  # it is where it is worked with
        done, fallen, given = self._let_it_rain(surface, plan, model, run)
        depth, load, passing = model.water()
        end, rock = model.bed(), model.rock()
        wetness, discharge = model.means()
        through = model.through()
        fallen += model.total("storms")
        self._book_rock(run, plan, end, load, through[2])
        self._book_water(run, plan, (first, depth), (fallen, given), through, model)
        if done == 0:
            return surface
        del model, load  # its fields make room for the results
        metres = plan.metres(depth)
        speed = passing / np.maximum(metres, np.float32(1e-3))
        zero = np.float32(0)
        gained = plan.quanta.metres(end - plan.start)
        before = {n: surface.layer(n) for n in ("erosion", "deposition") if n in surface}
        return surface.with_layers(
            elevation=_heights(surface, plan, end),
            sediment=plan.quanta.metres(end - rock),
            erosion=before.get("erosion", zero) + np.maximum(-gained, zero),
            deposition=before.get("deposition", zero) + np.maximum(gained, zero),
            water_depth=metres,
            discharge=discharge,
            flow_speed=np.minimum(speed, np.float32(surface.spacing / plan.seconds)),
            wetness=wetness,
        )

    def _let_it_rain(
        self, surface: Heightfield, plan: Plan, model: Any, run: Run
    ) -> tuple[int, int, int]:
        """Run every block; return how many, and the counts that rain and springs gave."""
        fallen = given = done = 0
        forecast = self._forecast(surface, plan)
        for block in run.steps(plan.blocks):
            weather = forecast(block)
            model.block(weather)
            done += 1
            if plan.storms is None:
                fallen += _total(weather.rain, plan.start.size)
            if plan.springs is not None:
                given += int(plan.springs.sum(dtype=np.int64))
            run.check()
            run.offer(lambda: surface.with_layers(elevation=_heights(surface, plan, model.bed())))
        return done, fallen, given

    # --- what is known before the first step ------------------------------------------------

    def _plan(self, surface: Heightfield, run: Run) -> tuple[Plan, Beginning] | None:
        """Return everything that stays the same from step to step; None where nothing happens."""
        total = self.storm_duration * HOUR
        longest = self.courant * surface.spacing / math.sqrt(GRAVITY * self.wave_depth)
        blocks = math.ceil(total / (BLOCK * longest))
        if blocks * BLOCK > MOST_STEPS:
            raise ParameterError(
                f"storm_duration = {self.storm_duration:g}: takes {blocks * BLOCK} steps of "
                f"{longest:.3g} s at {surface.spacing:g} m spacing, at most {MOST_STEPS}; shorten "
                "the storm and raise acceleration"
            )
        self._check_values(surface)
        if blocks == 0:
            return None
        seconds = total / (blocks * BLOCK)
        spacing, (rows, cols) = surface.spacing, surface.shape
        relief = float(surface.elevation.max()) - float(surface.elevation.min())
        flooded = self._flooded(surface, run)
        quanta = Quanta.fitting(surface.elevation, min(spacing, 1.0), 1.0 + 0.1 * relief + flooded)
        bed = quanta.quantum
        spring_volume = sum(spring[2] for spring in self.springs) * total
        deepest = 1.0 + relief + flooded + self._most("rain", surface) * PER_HOUR * total
        deepest += 4 * spring_volume / (rows * cols * spacing**2)
        water = min(FINEST, bed)
        while FULL * water < deepest and water < bed:
            water *= 2.0
        shift = round(math.log2(bed / water))
        start = quanta.count(surface.elevation)
        sea, sea_surface = self._sea(surface, quanta, run.sea_level)
        level = self.border_level if self.border_level is not None else run.sea_level
        counted = None if level is None else level / bed - quanta.datum
        ring = around(self.water_border, start, spacing, bed, shift, counted, sea)
        flow, transfer, ground = constants(
            scheme=self.scheme,
            spacing=spacing,
            seconds=seconds,
            quanta=quanta,
            water_quantum=water,
            manning=self.manning,
            wave_depth=self.wave_depth,
            capacity=self.sediment_capacity * self.acceleration,
            least_slope=self.least_slope,
            threshold=self.erosion_threshold,
            rates=(self.erosion_rate, self.deposition_rate),
            mixing=self.mixing,
        )
        seconds_a_block = seconds * BLOCK
        creep = self.splash / HOUR * self.acceleration * seconds_a_block / spacing**2
        sweeps = min(MOST_SWEEPS, max(1, math.ceil(creep / MOST_CREEP)))
        talus = math.tan(math.radians(self.bank_angle)) * spacing / bed
        before = surface.layer("wetness") if "wetness" in surface else None
        maps = ("rain", "hardness")
        plan = Plan(
            quanta=quanta,
            water_quantum=water,
            shift=shift,
            spacing=spacing,
            start=start,
            seconds=seconds,
            blocks=blocks,
            flow=flow,
            transfer=transfer,
            ground=ground,
            thin=max(1, round(float(THIN) / water)),
            wet=max(1, round(WET / water)),
            drowned=max(1, round(DROWNED / water)),
            talus=round(min(talus, 2**29)),
            slide=SLIDE * seconds / (0.5 * longest / self.courant),
            creep=min(MOST_CREEP, creep / sweeps),
            creep_sweeps=sweeps,
            round_the_map=self.water_border == "periodic",
            leaves_the_map=self.water_border in ("open", "fixed"),
            varies=any(not isinstance(getattr(self, m), (int, float, Schedule)) for m in maps)
            or self.rain_pattern == "random"
            or bool(self.springs)
            or surface.strata is not None,
            sea=sea,
            sea_surface=sea_surface,
            storms=self._storms(surface, run) if self.rain_pattern == "random" else None,
            springs=self._springs(surface, seconds_a_block, water) if self.springs else None,
            wetting=np.float32(-math.expm1(-seconds_a_block / (self.wetness_time * HOUR))),
        )
        dry = np.zeros(surface.shape, np.float32)
        begin = Beginning(
            start,
            start - loose_on(surface, quanta),
            self._water(surface, start, shift, water, sea, sea_surface, run),
            ring,
            dry if before is None else np.clip(before, np.float32(0), np.float32(1)),
        )
        return plan, begin

    def _check_values(self, surface: Heightfield) -> None:
        """Refuse springs that lie elsewhere or take water."""
        x, y = surface.grid.north_west
        width, height = surface.grid.size
        for number, spring in enumerate(self.springs, 1):
            if spring[2] < 0:
                raise ParameterError(f"springs[{number}]: {spring[2]:g} m3/s, must be >= 0")
            if not (x <= spring[0] <= x + width and y - height <= spring[1] <= y):
                raise ParameterError(
                    f"springs[{number}] = {spring}: lies off the map, which is {x:g} to "
                    f"{x + width:g} m east and {y - height:g} to {y:g} m north"
                )

    def _most(self, name: str, surface: Heightfield) -> float:
        value = getattr(self, name)
        if isinstance(value, Schedule):
            return max(value.value)
        return float(np.max(self.value(name, surface)))

    def _sea(
        self, surface: Heightfield, quanta: Quanta, sea_level: float | None
    ) -> tuple[NDArray[np.uint8] | None, int]:
        """Return where the sea is, and its surface in counts: low ground joined to the border."""
        if sea_level is None:
            return None, 0
        level = math.floor(sea_level / quanta.quantum) - quanta.datum
        level = min(max(level, -(2**29)), 2**29)
        low = surface.elevation < np.float32(sea_level)
        if not low.any():
            return None, 0
        from scipy.ndimage import label

        parts, _ = label(low)
        edge = np.concatenate((parts[0], parts[-1], parts[:, 0], parts[:, -1]))
        sea = np.isin(parts, np.unique(edge[edge > 0]))
        return (sea.astype(np.uint8), level) if sea.any() else (None, 0)

    def _flooded(self, surface: Heightfield, run: Run) -> float:
        """Return how far water stands above the highest ground when it begins, metres."""
        peak = float(surface.elevation.max())
        levels = [level for level in (run.sea_level, self.border_level) if level is not None]
        flooded = max([0.0, *(level - peak for level in levels)])
        if "water_depth" in surface:
            flooded = max(flooded, float(surface.layer("water_depth").max()))
        if flooded > DEEPEST:
            raise ParameterError(
                f"water stands {flooded:g} m above the highest ground, at most {DEEPEST:g} m; "
                "lower sea_level, border_level or the layer water_depth"
            )
        return flooded

    def _water(
        self,
        surface: Heightfield,
        start: Counts,
        shift: int,
        water_quantum: float,
        sea: NDArray[np.uint8] | None,
        sea_surface: int,
        run: Run,
    ) -> Counts:
        """Return the water to begin with, counts."""
        depth = np.zeros(start.shape, dtype=np.int64)
        if "water_depth" in surface:
            layer = surface.layer("water_depth").astype(np.float64)
            depth = np.rint(np.clip(layer / water_quantum, 0, FULL)).astype(np.int64)
        elif self.lakes_at_start == "full":
            outlet = np.zeros(start.shape, dtype=np.uint8)
            if self.water_border in ("open", "fixed"):
                outlet[[0, -1], :] = 1
                outlet[:, [0, -1]] = 1
            if sea is not None:
                outlet[sea != 0] = 1
            if outlet.any():
                depth = (_filled(start, outlet, run) - start.astype(np.int64)) << shift
        if sea is not None:
            held = np.maximum(sea_surface - start.astype(np.int64), 0) << shift
            depth = np.where(sea != 0, held, depth)
        return np.minimum(depth, FULL).astype(np.int32)

    def _storms(self, surface: Heightfield, run: Run) -> Storms:
        """Return the lattice of storms under the samples, fixed in the world."""
        rows, cols = surface.shape
        x, y = surface.grid.north_west
        places = (
            (x + np.arange(cols) * surface.spacing) / self.storm_size,
            -(y - np.arange(rows) * surface.spacing) / self.storm_size,
        )
        cells = [np.floor(place).astype(np.int64).astype(np.int32) for place in places]
        within = [place - np.floor(place) for place in places]
        parts = [(part * part * (3.0 - 2.0 * part)).astype(np.float32) for part in within]
        return Storms(
            (cells[0], cells[1]),
            (parts[0], parts[1]),
            run.words(self.name, self.seed),
            STORM_LIFE,
        )

    def _springs(self, surface: Heightfield, seconds: float, water_quantum: float) -> Counts:
        """Return what springs give in a block, counts."""
        given = np.zeros(surface.shape, dtype=np.int64)
        x, y = surface.grid.north_west
        for number, (east, north, discharge) in enumerate(self.springs, 1):
            row = round((y - north) / surface.spacing)
            col = round((east - x) / surface.spacing)
            counts = round(discharge * seconds / surface.cell_area / water_quantum)
            given[row, col] += counts
            if given[row, col] > MOST_A_BLOCK:
                most = MOST_A_BLOCK * water_quantum * surface.cell_area / seconds
                raise ParameterError(
                    f"springs[{number}]: {discharge:g} m3/s on one sample of "
                    f"{surface.spacing:g} m, at most {most:.3g}; spread it over several"
                )
        return given.astype(np.int32)

    def _forecast(self, surface: Heightfield, plan: Plan) -> Callable[[int], Weather]:
        """Return what gives the weather of each block; arrays stay the same while they can."""
        known: dict[str, Any] = {}

        def current(name: str, block: int) -> Any:
            if name not in known or isinstance(getattr(self, name), Schedule):
                value = np.asarray(
                    self.value(name, surface, (block + 0.5) / plan.blocks), dtype=np.float64
                )
                if name == "hardness":
                    known[name] = (1.0 - value).astype(np.float32)
                else:
                    counts = value * (PER_HOUR * plan.seconds * BLOCK / plan.water_quantum)
                    known[name] = np.rint(np.minimum(counts, MOST_A_BLOCK)).astype(np.int32)
            return known[name]

        def at(block: int) -> Weather:
            return Weather(
                current("rain", block),
                current("evaporation", block),
                current("infiltration", block),
                current("hardness", block),
                block * BLOCK * plan.seconds,
                np.float32(1.0 / (block + 1)),
            )

        return at

    # --- what is booked after the last step -------------------------------------------------

    def _book_rock(
        self, run: Run, plan: Plan, end: Counts, load: Counts, through: NDArray[np.int64]
    ) -> None:
        """Book the ground: what left over each border, and what is still in the water."""
        ledger = run.ledger
        unit = plan.quanta.quantum * plan.cell_area
        ledger.open("rock", plan.quanta.volume(plan.start, plan.cell_area))
        gone = 0
        for side, counts in _by_side(through, plan).items():
            if counts:
                ledger.left("rock", f"border {side}", counts * unit)
                gone += abs(counts)
        afloat = int(load.sum(dtype=np.int64))
        if afloat:
            ledger.left("rock", "suspended", afloat * unit)
        moved = int(np.abs(end.astype(np.int64) - plan.start).sum()) + gone + afloat
        ledger.close("rock", plan.quanta.volume(end, plan.cell_area), 0.5 * moved * unit)

    def _book_water(
        self,
        run: Run,
        plan: Plan,
        water: tuple[int, Counts],
        came: tuple[int, int],
        through: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
        model: Any,
    ) -> None:
        """Book the water by where it came from and went to."""
        ledger = run.ledger
        unit = plan.water_quantum * plan.cell_area
        ledger.open("water", water[0] * unit)
        passed = 0
        sources = {"rain": came[0], "springs": came[1]}
        sources |= {f"border {side}": n for side, n in _by_side(through[1], plan).items()}
        sinks = {f"border {side}": n for side, n in _by_side(through[0], plan).items()}
        sinks |= {name: model.total(name) for name in ("evaporation", "infiltration")}
        (sources if model.total("sea") > 0 else sinks)["sea"] = abs(model.total("sea"))
        for name, counts in sources.items():
            if counts:
                ledger.came("water", name, counts * unit)
                passed += counts
        for name, counts in sinks.items():
            if counts:
                ledger.left("water", name, counts * unit)
                passed += counts
        ledger.close("water", int(water[1].sum(dtype=np.int64)) * unit, passed * unit)


def _heights(surface: Heightfield, plan: Plan, end: Counts) -> NDArray[np.float32]:
    return plan.quanta.height(surface.elevation, plan.start, end)


def _total(counts: Counts, cells: int) -> int:
    """Return the sum over the map of a number or a field of counts."""
    return int(counts) * cells if counts.ndim == 0 else int(counts.sum(dtype=np.int64))


def _filled(start: Counts, outlet: NDArray[np.uint8], run: Run) -> NDArray[np.int64]:
    """Return the level to which hollows fill before they spill, counts."""
    from terrakit.routing import filled, route

    device = run.device
    if device is None:
        return np.asarray(filled(route(start, outlet), start)).astype(np.int64)
    height = device.upload(start)
    return filled(route(height, outlet, device=device), height).download().astype(np.int64)


def _framed(surface: Heightfield, plan: Plan) -> Heightfield:
    """Return the terrain with the frame of the fields, for what asks about its strata."""
    rows, cols = plan.shape
    sides = ((2, plan.framed[0] - rows - 2), (2, plan.framed[1] - cols - 2))
    x, y = surface.grid.north_west
    layers = {"strata_datum": np.pad(surface.layer("strata_datum"), sides, mode="edge")}
    return Heightfield(
        np.pad(surface.elevation, sides, mode="edge"),
        surface.spacing,
        (x - 2 * surface.spacing, y + 2 * surface.spacing),
        layers=layers,
        strata=surface.strata,
    )


def _by_side(ring: NDArray[np.int64], plan: Plan) -> dict[str, int]:
    """Return the sums of what passed through the frame, by side."""
    if not plan.leaves_the_map:
        return {}
    rows, cols = plan.shape
    ends = np.cumsum((cols + 2, cols + 2, rows))
    parts = np.split(ring, ends)
    return {side: int(part.sum()) for side, part in zip(SIDES, parts, strict=True)}
