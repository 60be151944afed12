"""Weathering: bedrock turns into debris, and debris falls off what is steep."""

from __future__ import annotations

import math
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
    Floats,
    book,
    changes,
    during,
    layers_after,
    loose_on,
)
from terrakit_erosion.thermal.sliding import sliding
from terrakit_erosion.weathering.reference import SHARPEST, STEEPEST, Constants

if TYPE_CHECKING:
    from terrakit_erosion.thermal.sliding import Sliding

SHARE = 0.15
"""Share of the excess that a sweep of sliding moves, as in ``thermal``."""
FEWEST_STEPS, MOST_STEPS = 48, 2000
MOST_SWEEPS = 1_000_000
DEEPEST_SHARE = 0.25
"""Depth that a step may weather, in spacings."""


class Weathering(Erosion):
    """Turn bedrock into debris, fastest where it is bare, steep, sharp or soft.

    Rock under a cover of debris of thickness r weathers at ::

        W = W_0 exp(-r / r_0)                     (exponential)
        W = W_0 4 B y (1 - B y),  y = exp(-r / r_0)   (humped)

    across its face, so that steep faces retreat, and faster the sharper an edge is. Hard rock and
    hard beds weather less, so soft beds recede beneath ledges. Debris beyond its talus angle then
    slides away, over a ``distance`` as in ``thermal``, and bares the rock again; with
    ``distance = 0`` it stays where it is.

    References
    ----------
    A. Heimsath, W. Dietrich, K. Nishiizumi and R. Finkel, Nature 388, 1997. N. J. Cox, Earth
    Surface Processes 5, 1980. B. Minasny and A. B. McBratney, Geoderma 133, 2006. Edges: M. D.
    Jones, M. Farley, J. Butler and M. Beardall, IEEE TVCG 16, 2010.
    """

    name = "weathering"
    uses = ("sediment", "erosion", "deposition", "strata_datum")
    writes = ("elevation", "sediment", "erosion", "deposition")
    cites = (
        "Heimsath, Dietrich, Nishiizumi & Finkel 1997",
        "Cox 1980",
        "Minasny & McBratney 2006",
        "Jones, Farley, Butler & Beardall 2010",
    )
    fields = 28
    idle: ClassVar = {"duration": 0.0}
    lasts: ClassVar = {"duration": 1.0, "distance": 0.5}
    trial: ClassVar = {"duration": 2e4, "distance": 20.0}

    duration: float = parameter(3e4, "Years that pass.", unit="yr", ge=0, le=1e10)
    weathering_rate: Maskable = parameter(
        1e-4, "How fast bare, flat rock turns into debris.", unit="m/yr", ge=0, le=1
    )
    cover_depth: float = parameter(
        0.5, "Debris so thick leaves a third of the weathering.", unit="m", gt=0, le=1000
    )
    law: Literal["exponential", "humped"] = parameter(
        "exponential", "Whether bare rock weathers fastest, or rock under a little moist soil."
    )
    bare_share: float = parameter(
        0.3, "With the humped law, how fast bare rock weathers beside the fastest.", ge=0, le=1
    )
    rounding: float = parameter(
        5.0,
        "Edges of this radius weather twice as fast; 0 treats them like faces.",
        unit="m",
        ge=0,
        le=1e4,
    )
    expansion: float = parameter(
        1.0, "How much more room debris takes than the rock that it was.", ge=1, le=3
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    talus_angle: Maskable = parameter(
        36.0, "Steepest slope that stays put.", unit="deg", ge=0, lt=90
    )
    distance: float = parameter(
        50.0, "How far debris creeps: slopes this long come to rest.", unit="m", ge=0, le=1e6
    )
    border: Literal["closed", "open"] = parameter(
        "closed", "Whether debris may leave over the edge of the map."
    )

    presets: ClassVar = {
        "frost": {"weathering_rate": 3e-4, "cover_depth": 0.3, "rounding": 2.0},
        "desert": {"weathering_rate": 2e-5, "law": "humped", "bare_share": 0.2},
        "tropical": {"weathering_rate": 1e-4, "cover_depth": 3.0, "law": "humped"},
        "spheroidal": {"rounding": 40.0},
        "in_place": {"distance": 0.0},
    }

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain after ``duration`` years."""
        fastest = self._fastest(surface)
        steps = self._steps(fastest, surface.spacing)
        sweeps = math.ceil((self.distance / surface.spacing) ** 2 / SHARE / max(1, steps))
        share = (self.distance / surface.spacing) ** 2 / max(1, sweeps * steps)
        thickest = min(
            fastest * self.duration * math.sqrt(1.0 + STEEPEST) * (1.0 + SHARPEST),
            steps * DEEPEST_SHARE * surface.spacing,
        )
        quanta = Quanta.fitting(
            surface.elevation, surface.spacing, (self.expansion - 1.0) * thickest
        )
        start, loose = quanta.count(surface.elevation), loose_on(surface, quanta)
        exposure = Exposure(surface, quanta, run)
        ground = sliding(start, start - loose, "flux", share, self.border == "open", run.device)
        ground.soften(np.zeros((), dtype=np.float32))
        ground.rest_rock(np.zeros((), dtype=np.int32))
        model = (NumPyFront if run.device is None else OpenCLFront)(ground, run)
        constants = self._constants(quanta, surface.spacing)
        rate, hardness, angle = (
            during(self, name, surface, steps)
            for name in ("weathering_rate", "hardness", "talus_angle")
        )
        depth_a_rate = self.duration / max(1, steps) / quanta.quantum
        for step in run.steps(steps):
            if step == 0 or changes(self, "weathering_rate") or changes(self, "hardness"):
                depth = rate(step) * depth_a_rate * (1.0 - hardness(step))
                model.pace(np.minimum(depth, 1e30).astype(np.float32))
            if step == 0 or changes(self, "talus_angle"):
                rise = np.tan(np.radians(angle(step))) * surface.spacing / quanta.quantum
                ground.rest_loose(np.asarray(np.minimum(np.rint(rise), 2**29).astype(np.int32)))
            model.weather(constants, self.expansion - 1.0, exposure)
            for _ in range(sweeps):
                run.check()
                ground.sweep()
            run.offer(
                lambda: surface.with_layers(
                    elevation=quanta.height(surface.elevation, start, ground.ends()[0])
                )
            )
        end, bed, exported = ground.ends()
        book(run, quanta, surface, start, end, exported, {"expansion": model.swollen()})
        if steps == 0:
            return surface
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            **layers_after(surface, quanta, start, loose, end, bed),
        )

    def _fastest(self, surface: Heightfield) -> float:
        """Return the largest rate anywhere and at any time."""
        if isinstance(self.weathering_rate, Schedule):
            return max(self.weathering_rate.value)
        return float(np.max(self.value("weathering_rate", surface)))

    def _steps(self, fastest: float, spacing: float) -> int:
        """Return in how many steps to weather, so that none cuts deep or rings at an edge."""
        if self.duration == 0 or fastest == 0:
            return 0
        depth = 2.0 * fastest * self.duration
        spread = depth * self.rounding / spacing**2
        steps = math.ceil(max(depth / (0.1 * spacing), 4.0 * spread))
        steps = min(max(steps, FEWEST_STEPS), MOST_STEPS)
        sweeps = (self.distance / spacing) ** 2 / SHARE
        if max(sweeps, steps) > MOST_SWEEPS:
            raise ParameterError(
                f"distance = {self.distance:g}: debris takes {sweeps:.0f} sweeps at {spacing:g} m "
                f"spacing, at most {MOST_SWEEPS}; shorten it or use a coarser terrain"
            )
        return steps

    def _constants(self, quanta: Quanta, spacing: float) -> Constants:
        bare = 1.0 if self.law == "exponential" else self.bare_share
        hump = 0.5 * (1.0 + math.sqrt(1.0 - bare)) if self.law == "humped" else 0.0
        return Constants(
            steepness=0.5 * (quanta.quantum / spacing) ** 2,
            sharpness=self.rounding * quanta.quantum / spacing**2 / 6.0,
            shield=-quanta.quantum / (self.cover_depth * math.log(2.0)),
            hump=hump,
            depth=self.cover_depth / self.expansion / quanta.quantum,
            deepest=max(1.0, DEEPEST_SHARE * spacing / quanta.quantum),
        )


class NumPyFront:
    """The front at which rock weathers, in the ground that slides."""

    def __init__(self, ground: Sliding, run: Run) -> None:
        del run
        self._ground = ground
        self._rate: Floats = np.zeros((), dtype=np.float32)
        self._carried = np.zeros(ground.height.shape, dtype=np.float32)
        self._swollen = 0

    def pace(self, rate: Floats) -> None:
        """Set the depth of bare, flat rock that weathers in a step, quanta."""
        self._rate = rate

    def weather(self, constants: Constants, swelling: float, exposure: Exposure) -> None:
        """Turn rock into debris once."""
        from terrakit_erosion.weathering.reference import produce

        ground = self._ground
        rate = np.broadcast_to(self._rate, ground.height.shape)
        if exposure.present:
            rate = np.asarray(exposure.field("softness", ground.bed, rate))
        produced = produce(ground.height, ground.bed, rate, self._carried, constants)
        swell = (np.float32(swelling) * produced.astype(np.float32)).astype(np.int32)
        ground.bed = ground.bed - produced
        ground.height = ground.height + swell
        self._swollen += int(swell.sum(dtype=np.int64))

    def swollen(self) -> int:
        """Return by how much debris takes more room than the rock did, quanta."""
        return self._swollen


class OpenCLFront:
    """The same on a device, where everything stays; see :class:`NumPyFront`."""

    def __init__(self, ground: Sliding, run: Run) -> None:
        device = run.device
        assert device is not None
        self._ground, self._device = ground, device
        self._program = device.program(__file__, "weathering.cl")
        shape = ground.height.shape
        self._rate, self._paced = device.empty(shape), device.empty(shape)
        self._carried, self._produced = device.zeros(shape), device.empty(shape, np.int32)
        self._swelling = device.upload(np.zeros(shape, dtype=np.int64))

    def pace(self, rate: Floats) -> None:
        """Set the depth of bare, flat rock that weathers in a step, quanta."""
        if rate.ndim == 0:
            self._device.fill(self._rate, rate.item())
        else:
            self._device.write(self._rate, np.ascontiguousarray(rate))

    def weather(self, constants: Constants, swelling: float, exposure: Exposure) -> None:
        """Turn rock into debris once."""
        ground, rate = self._ground, self._rate
        rows, cols = ground.height.shape
        if exposure.present:
            rate = self._paced
            exposure.field("softness", ground.bed, self._rate, into=rate)
        self._program.launch(
            "weathering_produce",
            (rows,) if self._device.is_cpu else (rows, cols),
            *(ground.height, ground.bed, rate, self._carried, self._produced),
            *(np.float32(value) for value in constants),
            *(np.int32(rows), np.int32(cols)),
            local=(4,) if self._device.is_cpu else None,
        )
        self._program.launch(
            "weathering_loosen",
            rows * cols,
            *(ground.height, ground.bed, self._swelling, self._produced),
            *(np.float32(swelling), np.int32(rows * cols)),
        )

    def swollen(self) -> int:
        """Return by how much debris takes more room than the rock did, quanta."""
        total: NDArray[Any] = self._swelling.download()
        return int(total.sum())
