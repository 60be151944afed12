"""Thermal erosion: slopes fall to the angle at which their material rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.materials import MATERIALS
from terrakit.mesh import TriMesh
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.thermal.ground import (
    Counts,
    book,
    changes,
    during,
    layers_after,
    loose_on,
    ring_of,
)

if TYPE_CHECKING:
    from terrakit_erosion.thermal.sliding import Sliding

BEDS_EVERY = 4
"""Sweeps after which the bed that crops out is looked up again."""


def _materials() -> dict[str, dict[str, Any]]:
    """Return a preset for every material: loose ones rest, cliffs of rock stand above scree."""
    scree = MATERIALS["scree"].repose_angle
    return {
        name: {"talus_angle": material.repose_angle}
        if material.is_loose
        else {"talus_angle": scree, "bedrock_angle": material.repose_angle}
        for name, material in MATERIALS.items()
    }


class Thermal(Erosion):
    """Slide material off slopes steeper than the talus angle.

    Along every edge, the height beyond the talus flows downhill::

        z_i <- z_i - k sum_j c_ij (max(d - T, 0) - max(-d - T, 0))
        d = z_i - z_j,   T = L_ij tan(phi)

    with isotropic weights on the eight neighbours of a grid (2/3 axial, 1/6 diagonal) and local
    conductances on a mesh. This is diffusion of the excess, so a length says how long it goes on,
    whatever the resolution. What the proportional scheme moves is shared among lower neighbours by
    their excess; it relaxes faster and rounds less.

    Bedrock may stand steeper than what is loose: with ``bedrock_angle``, with beds of strata, which
    have an angle each, with ``hardness``, or with ``supply = "debris"``, where only loose material
    moves. Then what flows out of a cell is the larger of what its loose material would give, as far
    as that goes round, and of what rock beyond its own angle would.

    Notes
    -----
    Slopes are tested along edges, so a cone may end up to 1/cos(22.5 deg) = 1.08 steeper between
    two directions of a grid, and 1/cos(30 deg) = 1.15 on good triangles.

    References
    ----------
    F. K. Musgrave, C. E. Kolb and R. S. Mace, SIGGRAPH 1989. J. Olsen, "Realtime procedural terrain
    generation", 2004. B. Jako and B. Toth, Eurographics 2011.
    """

    name = "thermal"
    surfaces = (Heightfield, TriMesh)
    uses = ("sediment", "erosion", "deposition", "strata_datum")
    writes = ("elevation", "sediment", "erosion", "deposition")
    cites = ("Musgrave, Kolb & Mace 1989", "Olsen 2004", "Jako & Toth 2011")
    fields = 16
    locality = "stencil"
    idle: ClassVar = {"distance": 0.0}
    trial: ClassVar = {"distance": 20.0}
    lasts: ClassVar = {"distance": 0.5, "iterations": 1.0}

    talus_angle: Maskable = parameter(
        33.0, "Steepest slope that stays put.", unit="deg", ge=0, lt=90
    )
    distance: float = parameter(
        100.0, "How far debris creeps: slopes this long come to rest.", unit="m", ge=0, le=1e6
    )
    scheme: Literal["flux", "proportional"] = parameter(
        "flux", "flux is exact and smooth; proportional comes to rest sooner."
    )
    border: Literal["closed", "open"] = parameter(
        "closed", "Whether debris may leave over the edge of the map."
    )
    supply: Literal["all", "debris"] = parameter(
        "all", "Whether bedrock breaks where it is too steep, or only loose material moves."
    )
    bedrock_angle: Maskable | None = parameter(
        None,
        "Steepest slope that bedrock holds; without it that of its beds, or the talus angle.",
        unit="deg",
        ge=0,
        lt=90,
    )
    hardness: Maskable = parameter(
        0.0, "Share of erosion that the ground withstands, 0 soft to 1 immovable.", ge=0, le=1
    )
    iterations: int | None = parameter(
        None,
        "Sweeps in place of those that distance asks for; the result then depends on the spacing.",
        ge=0,
        le=100000,
        advanced=True,
    )
    relaxation: float | None = parameter(
        None,
        "Share of the excess that a sweep moves; 0.15 for flux, 0.5 for proportional and meshes.",
        gt=0,
        le=1,
        advanced=True,
    )

    presets: ClassVar = _materials()

    def reach(self, spacing: float) -> int | None:
        """Return 2: what a neighbour gives depends on the neighbours of that one."""
        del spacing
        return 2

    def erode(self, surface: Heightfield | TriMesh, run: Run) -> Heightfield | TriMesh:
        """Return the surface with its slopes at rest."""
        if isinstance(surface, TriMesh):
            from terrakit_erosion.thermal.mesh import erode_mesh

            return erode_mesh(self, surface, run)
        sweeps, share = self._sweeps(surface.spacing)
        quanta = Quanta.fitting(surface.elevation, surface.spacing)
        start, loose = quanta.count(surface.elevation), loose_on(surface, quanta)
        exposure = Exposure(surface, quanta, run)
        if self.is_layered(exposure):
            end, bed, exported = self._slide(
                surface, quanta, start, start - loose, exposure, sweeps, share, run
            )
        else:
            talus = self._limits("talus_angle", surface, quanta, sweeps)
            relax = self._reference if run.device is None else self._opencl
            end, bed, exported = relax(start, start - loose, talus, sweeps, share, run)
        book(run, quanta, surface, start, end, exported)
        if sweeps == 0:
            return surface
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            **layers_after(surface, quanta, start, loose, end, bed),
        )

    def is_layered(self, exposure: Exposure) -> bool:
        """Return whether bedrock and the loose material on it behave differently."""
        return (
            exposure.present
            or self.supply == "debris"
            or self.bedrock_angle is not None
            or self.hardness != 0
        )

    def _sweeps(self, spacing: float) -> tuple[int, float]:
        """Return how many sweeps to make and the share that each moves."""
        flux = self.scheme == "flux"
        share = self.relaxation or (0.15 if flux else 0.5)
        if flux and share > 0.3:
            raise ParameterError(
                f"relaxation = {share:g}: must be 0 < relaxation <= 0.3 for flux on a grid"
            )
        if self.iterations is not None:
            return self.iterations, share
        spread = (self.distance / spacing) ** 2
        sweeps = math.ceil(spread / share)
        if sweeps > 10**6:
            raise ParameterError(
                f"distance = {self.distance:g}: takes {sweeps} sweeps at {spacing:g} m spacing; "
                "use a coarser terrain or scheme = 'proportional'"
            )
        return sweeps, (spread / sweeps if flux and sweeps else share)

    def _limits(
        self, name: str, surface: Heightfield, quanta: Quanta, sweeps: int
    ) -> Callable[[int], Counts]:
        """Return what gives the difference to an axial neighbour that stays put, in quanta."""
        angles = during(self, name, surface, sweeps)
        scale = surface.spacing / quanta.quantum

        def at(sweep: int) -> Counts:
            rise = np.tan(np.radians(angles(sweep))) * scale
            return np.asarray(np.minimum(np.rint(rise), 2**29).astype(np.int32))

        if changes(self, name):
            return at
        constant = at(0)
        return lambda sweep: constant

    def _reference(
        self,
        start: Counts,
        bed: Counts,
        talus: Callable[[int], Counts],
        sweeps: int,
        share: float,
        run: Run,
    ) -> tuple[Counts, Counts, NDArray[np.int64]]:
        from terrakit_erosion.thermal import reference

        exported = ring_of(start.shape)
        through = exported if self.border == "open" else None
        height = start
        for sweep in run.steps(sweeps):
            limit = talus(sweep)
            if self.scheme == "flux":
                height = reference.relax(height, bed, limit, share * 2 / 3, share / 6, through)
            else:
                height = reference.share_out(height, bed, limit, share, through)
        return height, bed, exported

    def _opencl(
        self,
        start: Counts,
        bed: Counts,
        talus: Callable[[int], Counts],
        sweeps: int,
        share: float,
        run: Run,
    ) -> tuple[Counts, Counts, NDArray[np.int64]]:
        device = run.device
        assert device is not None
        first = talus(0)
        program = device.program(
            __file__, "thermal.cl", {"THERMAL_TALUS_FIELD": 1} if first.ndim else None
        )
        is_open = self.border == "open"
        ends = np.int32(is_open), np.int32(start.shape[0]), np.int32(start.shape[1])
        shape = (start.shape[0],) if device.is_cpu else start.shape
        local = (4,) if device.is_cpu else None
        flux = self.scheme == "flux"
        height, result = device.upload(start), device.empty(start.shape, np.int32)
        rock = device.upload(bed)
        limit = device.upload(np.atleast_1d(first))
        exported = device.upload(ring_of(start.shape if is_open else (1,)))
        weight = device.empty(1 if flux else start.shape)
        shares = np.float32(share * 2 / 3), np.float32(share / 6)
        scheduled = changes(self, "talus_angle")
        for sweep in run.steps(sweeps):
            if scheduled:
                limit = device.upload(np.atleast_1d(talus(sweep)))
            if flux:
                program.launch(
                    "thermal_relax",
                    shape,
                    *(height, result, rock, limit, exported, *shares, *ends),
                    local=local,
                )
            else:
                program.launch(
                    "thermal_weigh",
                    shape,
                    *(height, weight, limit, np.float32(share), *ends),
                    local=local,
                )
                program.launch(
                    "thermal_share",
                    shape,
                    *(height, result, rock, weight, limit, exported, *ends),
                    local=local,
                )
            height, result = result, height
        left = exported.download() if is_open else ring_of(start.shape)
        return height.download(), rock.download(), left

    def _slide(
        self,
        surface: Heightfield,
        quanta: Quanta,
        start: Counts,
        bed: Counts,
        exposure: Exposure,
        sweeps: int,
        share: float,
        run: Run,
    ) -> tuple[Counts, Counts, NDArray[np.int64]]:
        """Return height, bedrock and what left, where rock has an angle of its own."""
        from terrakit_erosion.thermal.sliding import sliding

        ground = sliding(start, bed, self.scheme, share, self.border == "open", run.device)
        talus = self._limits("talus_angle", surface, quanta, sweeps)
        rests = "talus_angle" if self.bedrock_angle is None else "bedrock_angle"
        rock = self._limits(rests, surface, quanta, sweeps)
        softness = self.softness(surface, sweeps)
        by_beds = exposure.present and self.bedrock_angle is None and self.supply == "all"
        scale = surface.spacing / quanta.quantum
        for sweep in run.steps(sweeps):
            if sweep == 0 or changes(self, "talus_angle"):
                ground.rest_loose(talus(sweep))
            if by_beds and sweep % BEDS_EVERY == 0:
                ground.rest_beds(exposure, scale)
            elif not by_beds and (sweep == 0 or changes(self, rests)):
                ground.rest_rock(rock(sweep))
            if sweep == 0 or changes(self, "hardness"):
                ground.soften(softness(sweep))
            ground.sweep()
            run.offer(lambda: self._preview(surface, quanta, start, ground))
        return ground.ends()

    def softness(
        self, surface: Heightfield | TriMesh, sweeps: int
    ) -> Callable[[int], NDArray[np.float32]]:
        """Return what gives, in each sweep, how much of what bedrock would give it does give."""
        if self.supply == "debris":
            return lambda sweep: np.zeros((), dtype=np.float32)
        hardness = during(self, "hardness", surface, sweeps)
        return lambda sweep: np.asarray((1.0 - hardness(sweep)).astype(np.float32))

    @staticmethod
    def _preview(
        surface: Heightfield, quanta: Quanta, start: Counts, ground: Sliding
    ) -> Heightfield:
        height = ground.ends()[0]
        return surface.with_layers(elevation=quanta.height(surface.elevation, start, height))
