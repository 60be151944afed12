"""Thermal erosion: slopes fall to the angle at which their material rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import ParameterError
from terrakit.heightfield import Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Erosion
from terrakit.parameters import Maskable, Schedule, parameter
from terrakit.quanta import Quanta
from terrakit.running import Run

SIDES = ("north", "south", "west", "east")


class Thermal(Erosion):
    """Slide material off slopes steeper than the talus angle.

    Along every edge, the height beyond the talus flows downhill::

        z_i <- z_i - k sum_j c_ij (max(d - T, 0) - max(-d - T, 0))
        d = z_i - z_j,   T = L_ij tan(phi)

    with isotropic weights on the eight neighbours of a grid (2/3 axial, 1/6 diagonal) and local
    conductances on a mesh. This is diffusion of the excess, so a length says how long it goes on,
    whatever the resolution. What the proportional scheme moves is shared among lower neighbours by
    their excess; it relaxes faster and rounds less.

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
    uses = ("sediment",)
    writes = ("elevation", "sediment")
    cites = ("Musgrave, Kolb & Mace 1989", "Olsen 2004", "Jako & Toth 2011")
    fields = 8
    locality = "stencil"
    idle: ClassVar = {"distance": 0.0}

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

    presets: ClassVar = {
        "scree": {"talus_angle": 35.0},
        "sand": {"talus_angle": 32.0},
        "chalk": {"talus_angle": 55.0},
        "soil": {"talus_angle": 40.0},
    }

    def reach(self, spacing: float) -> int | None:
        """Return 1 for the flux scheme, 2 for the proportional one."""
        del spacing
        return 1 if self.scheme == "flux" else 2

    def erode(self, surface: Heightfield | TriMesh, run: Run) -> Heightfield | TriMesh:
        """Return the surface with its slopes at rest."""
        if isinstance(surface, TriMesh):
            from terrakit_erosion.thermal.mesh import erode_mesh

            return erode_mesh(self, surface, run)
        sweeps, share = self._sweeps(surface.spacing)
        quanta = Quanta.fitting(surface.elevation, surface.spacing)
        start = quanta.count(surface.elevation)
        talus = self._talus(surface, quanta, sweeps)
        if run.device is None:
            end, exported = self._reference(start, talus, sweeps, share, run)
        else:
            end, exported = self._opencl(start, talus, sweeps, share, run)
        self._book(run, quanta, surface.cell_area, start, end, exported)
        if sweeps == 0:
            return surface
        gained = quanta.metres(end - start)
        before = surface.layer("sediment") if "sediment" in surface else np.float32(0)
        return surface.with_layers(
            elevation=quanta.height(surface.elevation, start, end),
            sediment=np.maximum(before + gained, np.float32(0)),
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

    def slopes(
        self, surface: Heightfield | TriMesh, sweeps: int
    ) -> Callable[[int], NDArray[np.float64]]:
        """Return what gives the tangent of the talus angle in each sweep."""

        def at(sweep: int) -> NDArray[np.float64]:
            angle = self.value("talus_angle", surface, sweep / sweeps if sweeps else 0.0)
            return np.asarray(np.tan(np.radians(np.asarray(angle, dtype=np.float64))))

        if isinstance(self.talus_angle, Schedule):
            return at
        constant = at(0)
        return lambda sweep: constant

    def _talus(
        self, surface: Heightfield, quanta: Quanta, sweeps: int
    ) -> Callable[[int], NDArray[np.int32]]:
        """Return what gives the difference to an axial neighbour that stays put, in quanta."""
        slopes = self.slopes(surface, sweeps)

        def at(sweep: int) -> NDArray[np.int32]:
            rise = slopes(sweep) * surface.spacing / quanta.quantum
            return np.minimum(np.rint(rise), 2**29).astype(np.int32)

        if isinstance(self.talus_angle, Schedule):
            return at
        constant = at(0)
        return lambda sweep: constant

    def _reference(
        self,
        start: NDArray[np.int32],
        talus: Callable[[int], NDArray[np.int32]],
        sweeps: int,
        share: float,
        run: Run,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        from terrakit_erosion.thermal import reference

        exported = np.zeros_like(start)
        open_border = exported if self.border == "open" else None
        height = start
        for sweep in run.steps(sweeps):
            limit = talus(sweep)
            if self.scheme == "flux":
                height = reference.relax(height, limit, share * 2 / 3, share / 6, open_border)
            else:
                height = reference.share_out(height, limit, share)
        return height, exported

    def _opencl(
        self,
        start: NDArray[np.int32],
        talus: Callable[[int], NDArray[np.int32]],
        sweeps: int,
        share: float,
        run: Run,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        device = run.device
        assert device is not None
        first = talus(0)
        program = device.program(
            __file__, "thermal.cl", {"THERMAL_TALUS_FIELD": 1} if first.ndim else None
        )
        rows, cols = start.shape
        size = np.int32(rows), np.int32(cols)
        height, result = device.upload(start), device.empty(start.shape, np.int32)
        limit = device.upload(np.atleast_1d(first))
        scheduled = isinstance(self.talus_angle, Schedule)
        if self.scheme == "flux":
            exported = device.zeros(start.shape if self.border == "open" else 1, np.int32)
            shares = np.float32(share * 2 / 3), np.float32(share / 6)
            for sweep in run.steps(sweeps):
                if scheduled:
                    limit = device.upload(np.atleast_1d(talus(sweep)))
                program.launch(
                    "thermal_relax",
                    (rows,) if device.is_cpu else start.shape,
                    *(height, result, limit, exported, *shares),
                    np.int32(self.border == "open"),
                    *size,
                    local=(4,) if device.is_cpu else None,
                )
                height, result = result, height
            left = exported.download() if self.border == "open" else np.zeros_like(start)
            return height.download(), left
        weight = device.empty(start.shape)
        for sweep in run.steps(sweeps):
            if scheduled:
                limit = device.upload(np.atleast_1d(talus(sweep)))
            program.launch(
                "thermal_weigh", start.shape, height, weight, limit, np.float32(share), *size
            )
            program.launch("thermal_share", start.shape, height, result, weight, limit, *size)
            height, result = result, height
        return height.download(), np.zeros_like(start)

    def _book(
        self,
        run: Run,
        quanta: Quanta,
        cell_area: float,
        start: NDArray[np.int32],
        end: NDArray[np.int32],
        exported: NDArray[np.int32],
    ) -> None:
        """Book what was there, what left through each side and what is there now."""
        run.ledger.open("rock", quanta.volume(start, cell_area))
        through = (exported[0], exported[-1], exported[1:-1, 0], exported[1:-1, -1])
        for side, leaving in zip(SIDES, through, strict=True):
            volume = int(leaving.sum(dtype=np.int64)) * quanta.quantum * cell_area
            if volume:
                run.ledger.left("rock", f"border {side}", volume)
        changed = np.abs(end.astype(np.int64) - start)
        moved = int(changed.sum()) * 0.5 * quanta.quantum * cell_area
        run.ledger.close("rock", quanta.volume(end, cell_area), moved)
