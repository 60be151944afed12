"""Hillslope creep: soil moves downhill, ridges become round."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, Schedule, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.thermal.ground import (
    SIDES,
    Counts,
    Floats,
    changes,
    during,
    layers_after,
    loose_on,
    ring_of,
)

if TYPE_CHECKING:
    from terrakit.compute import DeviceArray

MOST_SHARE = 0.15
"""Largest share of a difference that creep moves in a sweep; half of what is stable."""
FINER = 15
"""How many times as many sweeps creep near the critical slope needs, where it is up to 10 times as
fast and answers to a change of slope up to 190 times as strongly."""
MOST_SWEEPS = 1_000_000
BEDS_EVERY = 4
"""Sweeps after which the bed that crops out is looked up again."""
BORDERS = ("closed", "open", "fixed")


class Hillslope(Erosion):
    """Let soil creep downhill, which rounds ridges and fills hollows.

    What creeps through a metre of contour grows with the slope, and, where there is a critical
    slope, without bound towards it::

        dz/dt = div(K grad z / (1 - (|grad z| / S_c)^2))

    Ridges become convex, and long slopes straight, at nearly the critical slope. With ``soil_only``
    nothing but loose material creeps: bare rock stays as it is.

    Notes
    -----
    Slopes beyond 0.95 of the critical one creep 10 times as fast as flat ground, not faster.
    ``thermal`` is for what is steeper still.

    References
    ----------
    J. Roering, J. Kirchner and W. Dietrich, Water Resources Research 35, 1999. W. E. H. Culling,
    Journal of Geology 68, 1960.
    """

    name = "hillslope"
    uses = ("sediment", "erosion", "deposition", "strata_datum")
    writes = ("elevation", "sediment", "erosion", "deposition")
    cites = ("Roering, Kirchner & Dietrich 1999", "Culling 1960")
    fields = 20
    idle: ClassVar = {"duration": 0.0}
    lasts: ClassVar = {"duration": 1.0}
    trial: ClassVar = {"duration": 3e3, "critical_slope": 50.0}

    duration: float = parameter(2e4, "Years that pass.", unit="yr", ge=0, le=1e10)
    creep_rate: Maskable = parameter(
        0.02,
        "How fast soil creeps: 0.001 is dry rocky ground, 0.05 wet and full of burrows.",
        unit="m2/yr",
        ge=0,
        le=1e4,
    )
    critical_slope: float | None = parameter(
        None,
        "Slope at which creep turns into sliding; without it creep is linear.",
        unit="deg",
        gt=0,
        lt=90,
    )
    soil_only: bool = parameter(False, "Whether only loose material creeps, and bedrock stays.")
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    border: Literal["closed", "open", "fixed"] = parameter(
        "closed",
        "Whether soil stays on the map, leaves over its edge, or the edge keeps its height.",
    )

    presets: ClassVar = {
        "dry": {"creep_rate": 0.003, "critical_slope": 45.0},
        "forest": {"creep_rate": 0.01, "critical_slope": 51.0},
        "grassland": {"creep_rate": 0.03},
        "soil": {"creep_rate": 0.02, "critical_slope": 51.0, "soil_only": True},
    }

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after ``duration`` years."""
        fastest = self._fastest(surface)
        sweeps, share = self._sweeps(fastest, surface.spacing)
        quanta = Quanta.fitting(surface.elevation, surface.spacing)
        start, loose = quanta.count(surface.elevation), loose_on(surface, quanta)
        exposure = Exposure(surface, quanta, run)
        steepness = 0.0
        if self.critical_slope is not None:
            critical = math.tan(math.radians(self.critical_slope))
            steepness = min(quanta.quantum / surface.spacing / critical, 1e8)
        plan = Plan(
            start=start,
            bed=start - loose,
            shares=(share * 2 / 3, share / 6),
            steepness=steepness,
            border=self.border,
            is_varied=steepness > 0 or not isinstance(self.creep_rate, (int, float)),
            is_layered=exposure.present or self.soil_only or self.hardness != 0,
        )
        model = (NumPyCreep if run.device is None else OpenCLCreep)(plan, run)
        rate = during(self, "creep_rate", surface, sweeps)
        hardness = during(self, "hardness", surface, sweeps)
        for sweep in run.steps(sweeps):
            if plan.needs_rate and (sweep == 0 or changes(self, "creep_rate")):
                model.pace((rate(sweep) / fastest).astype(np.float32))
            if plan.is_layered:
                if exposure.present and not self.soil_only:
                    if sweep % BEDS_EVERY == 0:
                        model.soften_beds(exposure, (1.0 - hardness(sweep)).astype(np.float32))
                elif sweep == 0 or changes(self, "hardness"):
                    allowed = 0.0 if self.soil_only else 1.0 - hardness(sweep)
                    model.soften(np.asarray(allowed, dtype=np.float32))
            model.sweep()
            run.offer(
                lambda: surface.with_layers(
                    elevation=quanta.height(surface.elevation, start, model.ends()[0])
                )
            )
        end, bed, exported = model.ends()
        self._book(run, quanta, surface, start, end, exported)
        if sweeps == 0:
            return surface
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            **layers_after(surface, quanta, start, loose, end, bed),
        )

    def _fastest(self, surface: Heightfield) -> float:
        """Return the largest rate anywhere and at any time, which sets the length of a sweep."""
        if isinstance(self.creep_rate, Schedule):
            return max(self.creep_rate.value)
        return float(np.max(self.value("creep_rate", surface)))

    def _sweeps(self, fastest: float, spacing: float) -> tuple[int, float]:
        """Return how many sweeps to make and the share of a difference that each moves."""
        spread = fastest * self.duration / spacing**2
        finer = 1 if self.critical_slope is None else FINER
        sweeps = math.ceil(finer * spread / MOST_SHARE)
        if sweeps > MOST_SWEEPS:
            raise ParameterError(
                f"duration = {self.duration:g}: creep of {fastest:g} m2/yr takes {sweeps} sweeps "
                f"at {spacing:g} m, at most {MOST_SWEEPS}; lower one, or use a coarser terrain"
            )
        return sweeps, spread / sweeps if sweeps else 0.0

    @staticmethod
    def _book(
        run: Run,
        quanta: Quanta,
        surface: Heightfield,
        start: Counts,
        end: Counts,
        exported: NDArray[np.int64],
    ) -> None:
        """Book what left through each side; a border that is held may give as well as take."""
        area = surface.cell_area
        volume = quanta.quantum * area
        run.ledger.open("rock", quanta.volume(start, area))
        for side, leaving in zip(SIDES, exported, strict=True):
            out, back = (int(np.maximum(sign * leaving, 0).sum()) for sign in (1, -1))
            if out:
                run.ledger.left("rock", f"border {side}", out * volume)
            if back:
                run.ledger.came("rock", f"border {side}", back * volume)
        changed = np.abs(end.astype(np.int64) - start)
        run.ledger.close("rock", quanta.volume(end, area), int(changed.sum()) * 0.5 * volume)


@dataclass(frozen=True)
class Plan:
    """What a model needs to know; heights in quanta."""

    start: Counts
    bed: Counts
    shares: tuple[float, float]
    """Share of a difference that passes to an axial and to a diagonal neighbour."""
    steepness: float
    """See :func:`terrakit_erosion.hillslope.reference.hasten`."""
    border: str
    is_varied: bool
    """Whether the rate of creep differs from cell to cell or from sweep to sweep."""
    is_layered: bool
    """Whether bedrock, and loose material on it, creep differently."""

    @property
    def needs_rate(self) -> bool:
        """Whether there has to be a rate for each cell."""
        return self.is_varied or self.is_layered


class NumPyCreep:
    """Heights and bedrock that change from sweep to sweep."""

    def __init__(self, plan: Plan, run: Run) -> None:
        del run
        self._plan = plan
        self._height, self._bed = plan.start, plan.bed.copy()
        self._exported = ring_of(plan.start.shape)
        self._base = self._softness = np.ones(plan.start.shape, dtype=np.float32)

    def pace(self, base: Floats) -> None:
        """Set the rate on flat ground, relative to the fastest."""
        self._base = np.broadcast_to(base, self._height.shape)

    def soften(self, softness: Floats) -> None:
        """Set how much of its creep bedrock allows."""
        self._softness = np.broadcast_to(softness, self._height.shape)

    def soften_beds(self, exposure: Exposure, factor: Floats) -> None:
        """Take the softness of the bed that crops out, times a factor."""
        self._softness = np.asarray(exposure.field("softness", self._bed, factor))

    def sweep(self) -> None:
        """Let everything creep once."""
        from terrakit_erosion.hillslope import reference

        plan = self._plan
        rate = self._base
        if plan.steepness > 0:
            rate = reference.hasten(self._height, rate, plan.steepness, plan.border)
        weight = None
        if plan.is_layered:
            weight = reference.hold(
                self._height, self._bed, rate, self._softness, plan.shares, plan.border
            )
        self._height = reference.creep(
            self._height, self._bed, rate, weight, plan.shares, plan.border, self._exported
        )

    def ends(self) -> tuple[Counts, Counts, NDArray[np.int64]]:
        """Return the height, the bedrock, and what left through the borders."""
        return self._height, self._bed, self._exported


class OpenCLCreep:
    """The same on a device, where everything stays; see :class:`NumPyCreep`."""

    def __init__(self, plan: Plan, run: Run) -> None:
        device = run.device
        assert device is not None
        self._plan, self._device = plan, device
        defines = {"HILLSLOPE_VARIED": plan.needs_rate, "HILLSLOPE_LAYERED": plan.is_layered}
        self._program = device.program(
            __file__, "hillslope.cl", {name: 1 for name, on in defines.items() if on}
        )
        shape = plan.start.shape
        self._height, self._after = device.upload(plan.start), device.empty(shape, np.int32)
        self._bed = device.upload(plan.bed)
        self._exported = device.upload(ring_of(shape))
        rates, weights = shape if plan.needs_rate else 1, shape if plan.is_layered else 1
        self._base, self._rate = device.empty(rates), device.empty(rates)
        self._softness, self._weight = device.empty(weights), device.empty(weights)
        if plan.steepness == 0:
            self._rate = self._base
        self._shares = tuple(np.float32(share) for share in plan.shares)
        size = np.int32(shape[0]), np.int32(shape[1])
        self._ends = (np.int32(BORDERS.index(plan.border)), *size)
        self._factor: DeviceArray | np.float32 | None = None

    def pace(self, base: Floats) -> None:
        """Set the rate on flat ground, relative to the fastest."""
        self._set(self._base, base)

    def soften(self, softness: Floats) -> None:
        """Set how much of its creep bedrock allows."""
        self._set(self._softness, softness)

    def soften_beds(self, exposure: Exposure, factor: Floats) -> None:
        """Take the softness of the bed that crops out, times a factor."""
        scale = self._device.upload(np.atleast_1d(factor))
        exposure.field("softness", self._bed, scale, into=self._softness)

    def sweep(self) -> None:
        """Let everything creep once."""
        plan = self._plan
        if plan.steepness > 0:
            steepness = np.float32(plan.steepness)
            self._launch("hillslope_hasten", self._height, self._base, self._rate, steepness)
        if plan.is_layered:
            ground = self._height, self._bed, self._rate
            self._launch("hillslope_hold", *ground, self._softness, self._weight, *self._shares)
        self._launch(
            "hillslope_creep",
            *(self._height, self._after, self._bed, self._rate, self._weight, self._exported),
            *self._shares,
        )
        self._height, self._after = self._after, self._height

    def ends(self) -> tuple[Counts, Counts, NDArray[np.int64]]:
        """Return the height, the bedrock, and what left through the borders."""
        return self._height.download(), self._bed.download(), self._exported.download()

    def _launch(self, name: str, *arguments: Any) -> None:
        rows, cols = self._plan.start.shape
        self._program.launch(
            name,
            (rows,) if self._device.is_cpu else (rows, cols),
            *arguments,
            *self._ends,
            local=(4,) if self._device.is_cpu else None,
        )

    def _set(self, field: DeviceArray, values: NDArray[Any]) -> None:
        """Fill a field with a number, or copy one into it."""
        if values.ndim == 0:
            self._device.fill(field, values.item())
        else:
            self._device.write(field, np.ascontiguousarray(values, dtype=field.dtype))
