"""Stream power: rivers cut, hillslopes creep, the land rises."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError, ParameterError
from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, Schedule, Seed, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure

SIDES = ("north", "south", "west", "east")
MOST_SHARE = 0.15
"""Largest share of a difference that creep moves in a sweep; half of what is stable."""
FINER = 8
"""How many times as many sweeps creep near the critical slope needs, where it is up to 4 times as
fast and answers to a change of slope up to 28 times as strongly."""
MOST_STEPS = 100_000
MOST_SWEEPS = 1_000_000


class StreamPower(Erosion):
    """Carve valleys with rivers while the land rises and hillslopes creep.

    The bed falls with the power of the stream, and soil creeps downhill::

        dz/dt = U - K a^m S^n + div(D grad z / (1 - (S / S_c)^2))

    Every step routes the water of every cell to an outlet, through depressions over their lowest
    pass, and solves the equation of the stream implicitly from the outlets up, so that any time
    step is stable. Hillslope diffusion runs in as many sweeps as its stability asks for.

    Notes
    -----
    Rivers leave where the border is lowest, one within each ``outlet_spacing``; there, and below
    the sea level, the height is held. ``outlets = "border"`` holds the whole border instead. What
    streams cut is carried out of the map; fans and deltas are not built. Beds of rock rise with the
    land, and each is cut as its erodibility says; loose material is not told from rock, but what
    creep lays down on it is added to it and what is cut comes off it.

    References
    ----------
    J. Braun and S. D. Willett, Geomorphology 180, 2013. G. Cordonnier, B. Bovy and J. Braun, Earth
    Surface Dynamics 7, 2019. J. Roering, J. Kirchner and W. Dietrich, Water Resources Research 35,
    1999. J. Fairfield and P. Leymarie, Water Resources Research 27, 1991.
    """

    name = "stream_power"
    writes = ("elevation", "drainage_area", "erosion", "sediment", "strata_datum")
    uses = ("erosion", "sediment", "strata_datum")
    cites = (
        "Braun & Willett 2013",
        "Cordonnier, Bovy & Braun 2019",
        "Roering, Kirchner & Dietrich 1999",
        "Fairfield & Leymarie 1991",
    )
    fields = 40
    idle: ClassVar = {"duration": 0.0}
    lasts: ClassVar = {"duration": 1.0}
    turning: ClassVar = {"routing": "d8"}
    trial: ClassVar = {"duration": 1e5}

    duration: float = parameter(1e6, "Years that pass.", unit="yr", ge=0, le=1e10)
    uplift_rate: Maskable = parameter(
        5e-4, "Rise of the land; with 0 the relief only wears down.", unit="m/yr", ge=0, le=1
    )
    erodibility: Maskable = parameter(
        1e-5,
        "How fast streams cut; 1e-6 is hard rock, 1e-4 is soft ground.",
        unit="m^(1-2m)/yr",
        ge=0,
        le=1,
    )
    area_exponent: float = parameter(
        0.45, "How much more a large river cuts than a brook (m).", gt=0, le=2
    )
    slope_exponent: float = parameter(
        1.0, "How much more a steep stream cuts than a flat one (n).", ge=0.3, le=4
    )
    diffusivity: float = parameter(
        0.02, "Creep of soil, which rounds the ridges.", unit="m2/yr", ge=0, le=1e4
    )
    critical_slope: float | None = parameter(
        None,
        "Slope at which creep turns into sliding; without it creep is linear.",
        unit="deg",
        gt=0,
        lt=90,
    )
    time_step: float = parameter(
        2.5e4, "Years between two routings of the water.", unit="yr", gt=0, le=1e9
    )
    routing: Literal["rho8", "d8"] = parameter(
        "rho8", "rho8 follows the true slope in the mean; d8 only the eight directions."
    )
    outlets: Literal["lowest", "border"] = parameter(
        "lowest", "Whether rivers leave at the lowest points of the border, or all along it."
    )
    outlet_spacing: float = parameter(
        3000.0, "Least distance between two rivers that leave the map.", unit="m", ge=0
    )

    seed: Seed = parameter(0, "Another number or word gives other winding rivers.")

    presets: ClassVar = {
        "alpine": {"uplift_rate": 1e-3, "erodibility": 1e-5, "critical_slope": 40.0},
        "badlands": {"uplift_rate": 5e-4, "erodibility": 1e-4, "diffusivity": 0.005},
        "old_hills": {"uplift_rate": 5e-5, "erodibility": 2e-6, "diffusivity": 0.1},
    }

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after ``duration`` years."""
        steps = math.ceil(self.duration / self.time_step - 1e-9)
        if steps > MOST_STEPS:
            raise ParameterError(
                f"time_step = {self.time_step:g}: {steps} steps for {self.duration:g} yr, at most "
                f"{MOST_STEPS}; raise time_step"
            )
        time_step = self.duration / max(1, steps)
        plan = self._plan(surface, run, time_step)
        exposure = Exposure(surface, plan.quanta, run)
        if 2 * plan.sweeps * steps > MOST_SWEEPS:
            raise ParameterError(
                f"diffusivity = {self.diffusivity:g}: creep takes {2 * plan.sweeps * steps} sweeps "
                f"at {surface.spacing:g} m, at most {MOST_SWEEPS}; lower it"
            )
        if run.device is None:
            from terrakit_erosion.stream_power.numpy_model import NumpyModel as Model
        else:
            from terrakit_erosion.stream_power.opencl import OpenCLModel as Model  # type: ignore[assignment]
        model = Model(plan, run)
        strength = self._strength(surface, time_step)
        lifted = np.zeros(1)  # metres, so that rounding does not add up from step to step
        risen = np.zeros(1, dtype=np.int64)  # quanta
        for step in run.steps(steps):
            fraction = (step + 0.5) / steps
            if isinstance(self.erodibility, Schedule):
                strength = self._strength(surface, time_step, fraction)
            rate = np.asarray(self.value("uplift_rate", surface, fraction), dtype=np.float64)
            lifted = lifted + rate * time_step
            uplift = np.rint(lifted / plan.quanta.quantum).astype(np.int64) - risen
            if exposure.present:
                model.step(
                    exposure.field("erodibility", model.ground, strength), uplift.astype(np.int32)
                )
                exposure.rise(uplift.astype(np.int32))
            else:
                model.step(strength, uplift.astype(np.int32))
            risen = risen + uplift
            run.offer(lambda: surface.with_layers(elevation=plan.heights(model.height())))
        end, area = model.height(), model.drainage_area()
        incised, received = model.removed()
        lifted_beds = risen * plan.quanta.quantum
        risen = np.where(plan.outlet != 0, 0, risen)
        self._book(run, plan, end, risen, incised, received, model.outlet_of_cells())
        if steps == 0:
            return surface
        eroded = np.maximum(risen + plan.start - end, 0) * plan.quanta.quantum
        before = surface.layer("erosion") if "erosion" in surface else np.float32(0)
        layers = {
            "elevation": plan.heights(end),
            "drainage_area": area.astype(np.float32) * np.float32(surface.cell_area),
            "erosion": before + eroded.astype(np.float32),
        }
        if "sediment" in surface:
            gained = plan.quanta.metres(end - plan.start - risen)
            layers["sediment"] = np.maximum(surface.layer("sediment") + gained, np.float32(0))
        if exposure.present:
            datum = surface.layer("strata_datum").astype(np.float64) + lifted_beds
            layers["strata_datum"] = datum.astype(np.float32)
        return surface.with_layers(**layers)

    def _strength(
        self, surface: Heightfield, time_step: float, fraction: float = 0.0
    ) -> NDArray[np.float32]:
        """Return K times the time step, of every cell or one."""
        erodibility = np.asarray(self.value("erodibility", surface, fraction), dtype=np.float64)
        return np.atleast_1d((erodibility * time_step).astype(np.float32))

    def _plan(self, surface: Heightfield, run: Run, time_step: float) -> Plan:
        """Return everything that stays the same from step to step."""
        if isinstance(self.uplift_rate, Schedule):
            fastest = max(self.uplift_rate.value)
        else:
            fastest = float(np.max(self.value("uplift_rate", surface)))
        headroom = fastest * self.duration
        quanta = Quanta.fitting(surface.elevation, surface.spacing, headroom)
        if quanta.quantum > surface.spacing:
            relief = float(surface.elevation.max()) - float(surface.elevation.min())
            if relief > headroom:
                raise InputError(
                    f"elevation: {relief:g} m of relief on samples {surface.spacing:g} m apart; "
                    "check the spacing"
                )
            raise ParameterError(
                f"uplift_rate: {fastest:g} m/yr over {self.duration:g} yr raises the land "
                f"by {headroom:g} m; lower one of the two"
            )
        start = quanta.count(surface.elevation)
        x, y = surface.origin
        spread = 0.5 * self.diffusivity * time_step / surface.spacing**2
        finer = 1 if self.critical_slope is None else FINER
        sweeps = math.ceil(finer * spread / MOST_SHARE)
        share = spread / sweeps if sweeps else 0.0
        steepness = 0.0
        if self.critical_slope is not None:
            critical = math.tan(math.radians(self.critical_slope))
            steepness = quanta.quantum / surface.spacing / critical
        return Plan(
            before=surface.elevation,
            start=start,
            outlet=self._outlets(surface, start, run.sea_level),
            quanta=quanta,
            spacing=surface.spacing,
            one_erodibility=isinstance(self.erodibility, (int, float, Schedule))
            and (surface.strata is None or "strata_datum" not in surface),
            one_uplift=isinstance(self.uplift_rate, (int, float, Schedule)),
            exponents=(self.area_exponent, self.slope_exponent),
            sweeps=sweeps,
            shares=(share * 2 / 3, share / 6, steepness, steepness / math.sqrt(2.0)),
            method=self.routing,
            seed=run.words(self.name, self.seed, lasting=True),
            world_cell=(
                -round(y / surface.spacing) & 0xFFFFFFFF,  # what rho8 hashes
                round(x / surface.spacing) & 0xFFFFFFFF,
            ),
        )

    def _outlets(
        self, surface: Heightfield, height: NDArray[np.int32], sea_level: float | None
    ) -> NDArray[np.uint8]:
        """Return 1 where water leaves and the height is held."""
        rows, cols = height.shape
        outlet = np.zeros(height.shape, dtype=np.uint8)
        if self.outlets == "border":
            outlet[[0, -1], :] = 1
            outlet[:, [0, -1]] = 1
        else:
            ring = _ring(rows, cols)
            along = height.ravel()[ring]
            window = min(round(self.outlet_spacing / surface.spacing), len(ring) // 2 - 1)
            outlet.ravel()[ring[_lowest_around(along, max(1, window))]] = 1
        if sea_level is not None:
            outlet[surface.elevation < np.float32(sea_level)] = 1
        return outlet

    def _book(
        self,
        run: Run,
        plan: Plan,
        end: NDArray[np.int32],
        risen: NDArray[np.int64],
        incised: NDArray[np.int64],
        received: NDArray[np.int64],
        outlet_of: NDArray[np.int32],
    ) -> None:
        """Book uplift, and what rivers and slopes carried out, by the side that it left through.

        The side is that to which the ground drains at the end.
        """
        ledger, cell_area = run.ledger, plan.spacing**2
        volume = plan.quanta.quantum * cell_area
        ledger.open("rock", plan.quanta.volume(plan.start, cell_area))
        ledger.came("rock", "uplift", int(np.broadcast_to(risen, end.shape).sum()) * volume)
        rows, cols = end.shape
        row, col = np.divmod(outlet_of, cols)
        side = np.full(end.shape, len(SIDES), dtype=np.int8)
        for number, along in enumerate((row == 0, row == rows - 1, col == 0, col == cols - 1)):
            side[along & (side == len(SIDES))] = number
        carried = incised + received
        for number, name in enumerate((*(f"border {s}" for s in SIDES), "sea")):
            leaving = int(carried[side == number].sum())
            if leaving:
                ledger.left("rock", name, leaving * volume)
        moved = int(incised.sum()) + int(np.abs(received).sum())
        ledger.close("rock", plan.quanta.volume(end, cell_area), moved * volume)


@dataclass(frozen=True)
class Plan:
    """What a model needs to know; heights in quanta, everything else in metres and steps."""

    before: NDArray[np.float32]
    start: NDArray[np.int32]
    outlet: NDArray[np.uint8]
    quanta: Quanta
    spacing: float
    one_erodibility: bool
    """Whether erodibility is one number for all cells."""
    one_uplift: bool
    exponents: tuple[float, float]
    sweeps: int
    """Sweeps of creep in half a time step."""
    shares: tuple[float, float, float, float]
    """See :func:`terrakit_erosion.stream_power.reference.diffuse`."""
    method: str
    seed: tuple[int, int]
    world_cell: tuple[int, int]

    def heights(self, end: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return counts as metres."""
        return self.quanta.height(self.before, self.start, end)


def _ring(rows: int, cols: int) -> NDArray[np.intp]:
    """Return the indices of the border cells, once around."""
    index = np.arange(rows * cols).reshape(rows, cols)
    return np.concatenate((index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]))


def _lowest_around(values: NDArray[np.int32], window: int) -> NDArray[np.bool_]:
    """Return which values of a ring are the lowest within ``window`` on either side."""
    # Rank instead of height, so that of equally low cells one is chosen
    order = np.lexsort((np.arange(len(values)), values))
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    least = rank.copy()
    reach = 0
    while reach < window:  # the minimum over a window that doubles
        step = min(max(1, reach), window - reach)
        least = np.minimum(least, np.minimum(np.roll(least, step), np.roll(least, -step)))
        reach += step
    return least == rank
