"""Wind: sand flies, dunes form and wander, bare rock wears."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import FromLayer, Maskable, Schedule, Seed, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run, seed_words
from terrakit.strata import Exposure
from terrakit_erosion.wind import plan as weather
from terrakit_erosion.wind.plan import Laws, Plan

SIDES = ("north", "south", "west", "east")
MOST_GUSTS = 2_000_000
MOST_WINDS = 64
SUPPLIES = 64
"""How often, at most, a schedule of the sand's depth is followed in a run."""


class Wind(Erosion):
    """Blow sand into dunes, and wear bare rock with it.

    Sand hops downwind with the same hop everywhere in one gust, of random length and a little
    askew from gust to gust, so that any direction is as good as any other. Of what arrives, a
    share stays: more on sand than on rock, all of it in the lee. What the wind takes up in turn
    goes with its stress::

        q = 6.7 rho_a / (g rho_s) u*^2 (u* - u*_t),   u*^2 = u*_0^2 (1 + P[h] + R dh/dx)
        dh/dt = -dq/dx,   dq/dx = (q(stress) - q) / (hop_length / 0.8)

    ``P`` is the pressure of the relief that stands out along the wind, on all scales, and ``h``
    with the hollow behind every crest, up to the line that sinks by ``shadow_angle``. There
    nothing is lifted and all sand falls. Steeper than the talus angle it slides.

    Notes
    -----
    Dunes measure some twenty hops and more, so the hop is the scale of the land: what is shorter
    than the spacing counts as the spacing. Time runs in gusts that move a tenth of the spacing
    squared; twice the samples take four times as many.

    References
    ----------
    B. T. Werner, "Eolian dunes: computer simulations and attractor interpretation", Geology 23,
    1995: hops, shadow, slabs. G. Sauermann, K. Kroy and H. J. Herrmann, Physical Review E 64, 2001,
    and P. S. Jackson and J. C. R. Hunt, QJRMS 101, 1975: stress and saturation. A. Paris, A.
    Peytavie, E. Guerin, O. Argudo and E. Galin, "Desertscape simulation", Computer Graphics Forum
    38, 2019: height, deflection, abrasion, vegetation. K. Lettau and H. Lettau, 1978: sand moved.
    """

    name = "wind"
    uses = ("sediment", "erosion", "deposition", "strata_datum")
    writes = ("elevation", "sediment", "erosion", "deposition")
    cites = (
        "Werner 1995",
        "Sauermann, Kroy & Herrmann 2001",
        "Jackson & Hunt 1975",
        "Paris et al. 2019",
        "Lettau & Lettau 1978",
    )
    fields = 62
    turning: ClassVar = None
    refinement_tolerance: ClassVar = 0.45
    idle: ClassVar = {"duration": 0.0}
    lasts: ClassVar = {"duration": 1.0}
    trial: ClassVar = {"duration": 0.2, "sand_depth": 2.0, "abrasion": 1.0, "hop_length": 25.0}

    duration: float = parameter(0.5, "Years that it blows.", unit="yr", ge=0, le=1e10)
    wind_speed: float = parameter(
        8.0,
        "Wind 10 m above ground while sand moves; below 5.5 m/s none does.",
        unit="m/s",
        ge=0,
        le=60,
    )
    wind_direction: float = parameter(
        270.0,
        "Where the wind comes from, clockwise from north.",
        unit="deg",
        ge=-360,
        le=360,
    )
    winds: list[list[float]] = parameter(
        [],
        "Several winds that take turns in place of one: [direction in degrees, weight], ....",
    )
    wind_cycle: float = parameter(
        0.5,
        "Years in which all winds have their turn; stars take longer than seifs.",
        unit="yr",
        gt=0,
        le=1e6,
        advanced=True,
    )
    sand_depth: Maskable = parameter(
        1.0,
        "Sand laid on the ground at first, besides loose ground that is there.",
        unit="m",
        ge=0,
        le=1e4,
    )
    patchiness: float = parameter(
        0.2, "How unevenly that sand lies: 0 as a sheet, 1 in heaps.", ge=0, le=1
    )
    sand_inflow: float = parameter(
        0.5,
        "Sand that comes in over open borders: 0 none, 1 as much as the wind carries.",
        ge=0,
        le=1,
    )
    border: Literal["open", "periodic"] = parameter(
        "open", "Whether sand leaves the map, or comes in again on the other side."
    )
    hop_length: float = parameter(
        2.5,
        "How far a grain hops: dunes are some twenty times as long, so larger dunes need more.",
        unit="m",
        gt=0,
        le=1e4,
    )
    talus_angle: float = parameter(
        33.0, "Steepest slope that sand holds: that of slip faces.", unit="deg", ge=3, lt=90
    )
    vegetation: Maskable = parameter(
        0.0, "Cover of plants, which hold sand and let more settle.", ge=0, le=1
    )
    abrasion: float = parameter(
        0.0,
        "Soft, level rock that flying sand wears in a year; yardangs take 0.001, or impatience.",
        unit="m/yr",
        ge=0,
        le=100,
    )
    dust: float = parameter(
        0.5, "Share of worn rock that leaves as dust; the rest is sand.", ge=0, le=1
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    speed_up: float = parameter(
        0.0,
        "How much faster the wind is for every metre above the lowest ground.",
        unit="1/m",
        ge=0,
        le=1,
    )
    deflection: float = parameter(
        0.0, "How much hills turn the wind aside: 0 not at all, 1 as relief does.", ge=0, le=4
    )
    shadow_angle: float = parameter(
        15.0,
        "Slope of the lee's upper end; flatter means longer lees.",
        unit="deg",
        ge=5,
        le=60,
        advanced=True,
    )
    seed: Seed = parameter(0, "Another number or word lets other gusts blow.")

    presets: ClassVar = {
        "barchan": {
            "sand_depth": 0.7,
            "patchiness": 1.0,
            "border": "periodic",
            "duration": 2.5,
        },
        "transverse": {"sand_depth": 4.0, "border": "periodic", "duration": 2.0},
        "seif": {
            "sand_depth": 2.0,
            "patchiness": 0.05,
            "winds": [[215.0, 1.0], [325.0, 1.0]],
            "wind_cycle": 0.6,
            "border": "periodic",
            "duration": 6.0,
        },
        "star": {
            "sand_depth": 4.0,
            "patchiness": 0.05,
            "winds": [[0.0, 1.0], [120.0, 1.0], [240.0, 1.0]],
            "wind_cycle": 1.5,
            "border": "periodic",
            "duration": 9.0,
        },
        "yardang": {
            "sand_depth": 0.1,
            "border": "periodic",
            "hop_length": 8.0,
            "wind_speed": 10.0,
            "abrasion": 20.0,
            "dust": 1.0,
            "duration": 1.0,
        },
        "unity_wind": {
            "sand_depth": 0.5,
            "wind_speed": 10.0,
            "abrasion": 5.0,
            "deflection": 0.5,
            "duration": 0.5,
        },
        "sand_sheet": {"sand_depth": 1.0, "duration": 0.5, "deflection": 0.5},
        "nabkha": {
            "sand_depth": 0.3,
            "sand_inflow": 1.0,
            "vegetation": [
                {
                    "use": "noise",
                    "basis": "simplex",
                    "wavelength": 30.0,
                    "amplitude": 3.0,
                    "offset": -1.2,
                },
                {"use": "clamp", "low": 0.0, "high": 0.9},
            ],
            "duration": 1.0,
        },
    }

    @model_validator(mode="after")
    def _winds_blow(self) -> Self:
        if len(self.winds) > MOST_WINDS:
            raise ValueError(f"winds: {len(self.winds)} of them; at most {MOST_WINDS}")
        for number, wind in enumerate(self.winds, 1):
            if len(wind) != 2 or not abs(wind[0]) <= 360 or not 0 < wind[1] <= 1e6:
                raise ValueError(
                    f"winds: number {number} is {wind}; must be [direction, weight], "
                    "-360 to 360 deg and > 0"
                )
        return self

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after the wind has blown for ``duration`` years."""
        quanta = self._quanta(surface)
        start = quanta.count(surface.elevation)
        loose = np.zeros_like(start)
        if "sediment" in surface:
            thickness = surface.layer("sediment").astype(np.float64) / quanta.quantum
            loose = np.rint(np.clip(thickness, 0.0, 2.0**29)).astype(np.int32)
        plan = self._plan(surface, quanta, start, run)
        if run.device is None:
            from terrakit_erosion.wind.reference import NumpyModel as Model
        else:
            from terrakit_erosion.wind.opencl import OpenCLModel as Model  # type: ignore[assignment]
        model = Model(plan, start - loose, loose, run.device)
        depth = self._depth(surface, plan, run)
        plants = _followed(lambda t: self._field("vegetation", surface, t), self.vegetation)
        softness = _followed(
            lambda t: np.float32(1) - self._field("hardness", surface, t), self.hardness
        )
        exposure = Exposure(surface, quanta, run)
        laid, given, entered, supplied = np.zeros_like(start), 0, 0, 0
        blocks = plan.refreshes()
        refreshed = 0
        for gust in run.steps(plan.gusts):
            moment = gust / plan.gusts
            if gust == refreshed:
                first, refreshed = next(blocks)
                if gust == 0 or int(moment * SUPPLIES) != supplied:
                    supplied = int(moment * SUPPLIES)
                    wanted = depth(moment)
                    if gust == 0 and run.span[0] > 0:  # laid in an earlier pass of a loop
                        laid = wanted
                    if wanted is not laid:
                        given += model.supply(wanted - laid)
                        laid = wanted
                soft: Any = softness(moment)
                if exposure.present and self.abrasion:
                    soft = exposure.field("softness", model.bedrock, soft)
                blow = plan.blow(plan.wind_of(gust))
                dice = seed_words(*plan.seed, first)
                model.refresh(blow, refreshed - first, plants(moment), soft, dice)
                run.offer(
                    lambda: surface.with_layers(
                        elevation=quanta.height(surface.elevation, start, sum(model.ground()))
                    )
                )
            hop = plan.gust(gust)
            model.blow(hop)
            entered += 0 if plan.periodic else plan.entering(hop) * plan.inflow
        bedrock, sand = model.ground()
        end = bedrock + sand
        self._book(
            run, plan, surface.cell_area, start, end, (given, entered, model.dust()), model.gone()
        )
        if plan.gusts == 0:
            return surface
        before = {
            name: surface.layer(name) if name in surface else np.float32(0)
            for name in ("sediment", "erosion", "deposition")
        }
        rise = quanta.metres(end.astype(np.int64) - start)
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            sediment=np.where(sand == loose, before["sediment"], quanta.metres(sand)),
            erosion=before["erosion"] + np.maximum(-rise, np.float32(0)),
            deposition=before["deposition"] + np.maximum(rise, np.float32(0)),
        )

    def _quanta(self, surface: Heightfield) -> Quanta:
        """Return quanta with room for the sand."""
        value = self.sand_depth
        if isinstance(value, Schedule):
            most = max(value.value)
        elif isinstance(value, FromLayer):
            most = max(value.low, value.high)
        else:
            most = float(np.max(self.value("sand_depth", surface)))
        return Quanta.fitting(surface.elevation, surface.spacing, 2.0 * most)

    def _plan(
        self, surface: Heightfield, quanta: Quanta, start: NDArray[np.int32], run: Run
    ) -> Plan:
        """Return everything that stays the same in the run."""
        spacing, quantum = surface.spacing, quanta.quantum
        hop = max(self.hop_length, spacing)
        most = weather.moving_sand(self.wind_speed, weather.MOST_STRESS)
        gusts = weather.FEWEST_GUSTS if self.duration else 0
        if most > 0:
            needed = self.duration * most / (weather.GUST * spacing**2)
            if needed > MOST_GUSTS:
                raise ParameterError(
                    f"duration = {self.duration:g}: takes {needed:.3g} gusts at {spacing:g} m "
                    f"spacing, at most {MOST_GUSTS}; blow for less, or use a coarser terrain"
                )
            gusts = max(gusts, math.ceil(needed)) if self.duration else 0
        years = self.duration / max(1, gusts)
        # Hops of a cloud in balance carry the sand that Lettau says over every line
        friction = weather.FRICTION * self.wind_speed
        threshold = weather.THRESHOLD_SPEED / max(self.wind_speed, 1e-3)
        carried = weather.LETTAU * weather.YEAR * friction**3 * years / hop / quantum
        lifted = carried * weather.ON_SAND
        flying = lifted * max(0.0, 1.0 - threshold) / weather.ON_SAND
        worn = 4.0 * self.abrasion * years / quantum
        directions = self.winds or [[self.wind_direction, 1.0]]
        total, until, winds = sum(weight for _, weight in directions), 0.0, []
        for angle, weight in directions:
            until += weight / total
            winds.append((angle, until))
        winds[-1] = (winds[-1][0], 2.0)
        cycle = max(
            weather.REFRESH * len(winds), round(min(self.wind_cycle / max(years, 1e-12), 1e9))
        )
        talus = math.tan(math.radians(self.talus_angle - weather.LAG)) * spacing / quantum
        shadow_slope = math.tan(math.radians(self.shadow_angle))
        moves = most > 0
        return Plan(
            quanta=quanta,
            spacing=spacing,
            shape=surface.shape,
            periodic=self.border == "periodic",
            deflection=self.deflection,
            gusts=gusts,
            winds=tuple(winds),
            gusts_a_cycle=cycle,
            hop=hop,
            shadow_slope=shadow_slope,
            longest_shadow=(int(start.max()) - int(start.min())) * quantum / shadow_slope
            + weather.DUNE_SHADOWS,
            laws=Laws(
                talus=int(min(talus, 2.0**29)),
                talus_slanted=int(min(talus * math.sqrt(2.0), 2.0**29)),
                axial=weather.SLIDE * 2 / 3,
                slanted=weather.SLIDE / 6,
                creep_axial=weather.CREEP * 2 / 3 if moves else 0.0,
                creep_slanted=weather.CREEP / 6 if moves else 0.0,
                on_rock=weather.ON_ROCK,
                on_sand=weather.ON_SAND,
                per_cover=quantum / weather.COVER,
                per_shelter=quantum / weather.SHELTER,
            ),
            lifted=lifted,
            threshold=threshold,
            inflow=int(self.sand_inflow * min(flying, 2.0**24)),
            wears=worn / flying if flying >= 1 else 0.0,
            dusty=self.dust,
            height_rate=self.speed_up * quantum,
            lowest=float(start.min()),
            seed=run.words(self.name, self.seed),
        )

    def _field(self, name: str, surface: Heightfield, moment: float) -> NDArray[np.float32]:
        """Return a parameter as one number, or a field, of float32."""
        return np.atleast_1d(np.asarray(self.value(name, surface, moment), dtype=np.float32))

    def _depth(
        self, surface: Heightfield, plan: Plan, run: Run
    ) -> Callable[[float], NDArray[np.int32]]:
        """Return what gives the sand that is to have been laid, in quanta: a little uneven."""
        seed = run.words("wind sand", self.seed, lasting=True)
        heaps = 8.0 * weather.patches(surface.grid, 36.0 * plan.hop, seed)
        uneven = np.maximum(0.0, 1.0 + self.patchiness * (heaps - 1.0))

        def at(moment: float) -> NDArray[np.int32]:
            depth = np.asarray(self.value("sand_depth", surface, moment), dtype=np.float64)
            return np.rint(depth * uneven / plan.quanta.quantum).astype(np.int32)

        return _followed(at, self.sand_depth)

    def _book(
        self,
        run: Run,
        plan: Plan,
        cell_area: float,
        start: NDArray[np.int32],
        end: NDArray[np.int32],
        brought: tuple[int, int, int],
        gone: NDArray[np.int64],
    ) -> None:
        """Book what was there, what was laid, came and left over borders, and what is there now."""
        ledger, volume = run.ledger, plan.quanta.quantum * cell_area
        given, entered, dust = brought
        ledger.open("rock", plan.quanta.volume(start, cell_area))
        if given > 0:
            ledger.came("rock", "sand laid", given * volume)
        elif given < 0:
            ledger.left("rock", "sand taken", -given * volume)
        if entered:
            ledger.came("rock", "sand blown in", entered * volume)
        if dust:
            ledger.left("rock", "dust", dust * volume)
        rows, cols = plan.shape
        row, col = np.arange(rows)[:, None], np.arange(cols)[None, :]
        whole = np.zeros(plan.shape, dtype=np.int64)
        distance = np.stack(
            [row + whole, rows - 1 - row + whole, col + whole, cols - 1 - col + whole]
        )
        side = distance.argmin(axis=0)
        for number, name in enumerate(SIDES):
            leaving = int(gone[side == number].sum())
            if leaving:
                ledger.left("rock", f"border {name}", leaving * volume)
        changed = int(np.abs(end.astype(np.int64) - start).sum())
        ledger.close("rock", plan.quanta.volume(end, cell_area), 0.5 * changed * volume)


def _followed(at: Callable[[float], Any], value: object) -> Callable[[float], Any]:
    """Return ``at``, or its first value for ever where the parameter is no schedule."""
    if isinstance(value, Schedule):
        return at
    constant = at(0.0)
    return lambda moment: constant
