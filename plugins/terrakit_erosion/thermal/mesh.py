"""Thermal erosion on the edge graph of a mesh (sheet M1): exact in volume on any triangles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from terrakit.errors import InputError, ParameterError
from terrakit.mesh import TriMesh
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.strata import Exposure
from terrakit_erosion.thermal import reference
from terrakit_erosion.thermal.ground import Counts, Floats, changes, during, layers_after, loose_on

if TYPE_CHECKING:
    from terrakit_erosion.thermal import Thermal

FRACTION_BITS = 8
"""A quantum of volume is the typical area times the quantum of height, divided by 2 this often."""


def erode_mesh(thermal: Thermal, mesh: TriMesh, run: Run) -> TriMesh:
    """Return the mesh with its slopes at rest.

    Vertices move along gravity by the volume that they gained over their area, which changes the
    volume under the surface by exactly that amount. Vertices without area (loose ones, and those of
    overhangs) keep their place.
    """
    if thermal.scheme != "flux":
        raise ParameterError(f"scheme = '{thermal.scheme}': on a mesh only 'flux' is there")
    if thermal.border != "closed":
        raise ParameterError("border = 'open': on a mesh only 'closed' is there")
    graph, area = mesh.graph, mesh.areas
    solid = area > 0
    if not solid.any():
        raise InputError("thermal: no face of the mesh looks up; flip its faces")
    typical = float(np.median(area[solid]))
    elevation = mesh.heights.astype(np.float32)
    quanta = Quanta.fitting(elevation, math.sqrt(typical))
    volume_quantum = quanta.quantum * 2.0 ** (math.floor(math.log2(typical)) - FRACTION_BITS)
    owner = np.repeat(np.arange(len(area)), np.diff(graph.start))

    # Conductances: the largest that neither end's share of the excess overshoots
    shortest = 1e-6 * math.sqrt(typical)
    usable = (graph.length > shortest) & solid[owner] & solid[graph.neighbor]
    ratio = np.where(usable, graph.width / np.maximum(graph.length, shortest), 0.0)
    total = np.bincount(owner, ratio, len(area))
    limit = np.where(total > 0, area / np.maximum(total, 1e-300), 0.0)
    share = thermal.relaxation or 0.5
    both = np.minimum(limit[owner], limit[graph.neighbor])
    conductance = share * both * ratio * (quanta.quantum / volume_quantum)

    start = quanta.count_exactly(mesh.heights)
    loose = loose_on(mesh, quanta)
    sweeps = thermal.iterations
    if sweeps is None:
        sweeps = math.ceil(4 * thermal.distance**2 / (share * typical))
    arrays = {
        "base": start,
        "length": (graph.length / quanta.quantum).astype(np.float32),
        "conductance": conductance.astype(np.float32),
        "height_a_volume": np.where(
            solid, volume_quantum / np.maximum(area, 1e-300) / quanta.quantum, 0.0
        ).astype(np.float32),
    }
    model = (NumPyMesh if run.device is None else OpenCLMesh)(mesh, arrays, start - loose, run)
    exposure = Exposure(mesh, quanta, run)
    if thermal.is_layered(exposure):
        _slide(thermal, mesh, model, exposure, sweeps, run)
    else:
        slope = _tangents(thermal, "talus_angle", mesh, sweeps)
        for sweep in run.steps(sweeps):
            model.relax(slope(sweep) if sweep == 0 or changes(thermal, "talus_angle") else None)
    height, bed, volume = model.ends()

    gained = np.where(solid, volume * volume_quantum / np.maximum(area, 1e-300), 0.0)
    run.ledger.open("rock", mesh.volume)
    result = mesh.raised(gained) if sweeps else mesh
    moved = int(np.abs(volume).sum()) * 0.5 * volume_quantum
    run.ledger.close("rock", result.volume, moved)
    if not sweeps:
        return mesh
    return result.with_layers(**layers_after(mesh, quanta, start, loose, height, bed))


def _slide(
    thermal: Thermal, mesh: TriMesh, model: Any, exposure: Exposure, sweeps: int, run: Run
) -> None:
    """Run all sweeps where rock has an angle of its own."""
    from terrakit_erosion.thermal import BEDS_EVERY

    rests = "talus_angle" if thermal.bedrock_angle is None else "bedrock_angle"
    slope = _tangents(thermal, "talus_angle", mesh, sweeps)
    rock = _tangents(thermal, rests, mesh, sweeps)
    softness = thermal.softness(mesh, sweeps)
    by_beds = exposure.present and thermal.bedrock_angle is None and thermal.supply == "all"
    for sweep in run.steps(sweeps):
        if sweep == 0 or changes(thermal, "talus_angle"):
            model.rest_loose(slope(sweep))
        if by_beds and sweep % BEDS_EVERY == 0:
            model.rest_rock(exposure.field("repose", model.bed))
        elif not by_beds and (sweep == 0 or changes(thermal, rests)):
            model.rest_rock(rock(sweep))
        if sweep == 0 or changes(thermal, "hardness"):
            model.soften(np.broadcast_to(softness(sweep), mesh.areas.shape))
        model.slide()


def _tangents(thermal: Thermal, name: str, mesh: TriMesh, sweeps: int) -> Callable[[int], Floats]:
    """Return what gives the tangent of an angle at every vertex in each sweep."""
    angles = during(thermal, name, mesh, sweeps)

    def at(sweep: int) -> Floats:
        tangent = np.tan(np.radians(angles(sweep)))
        return np.broadcast_to(tangent, mesh.areas.shape).astype(np.float32)

    return at


class NumPyMesh:
    """Heights, bedrock and volumes of the vertices, which change from sweep to sweep."""

    def __init__(self, mesh: TriMesh, arrays: dict[str, Any], bed: Counts, run: Run) -> None:
        del run
        self._graph = mesh.graph
        self._base = arrays["base"]
        self._edges = arrays["length"], arrays["conductance"], arrays["height_a_volume"]
        self._height, self.bed = self._base, bed
        self._volume = np.zeros(len(bed), dtype=np.int64)
        self._slope = self._rock = self._softness = np.zeros(len(bed), dtype=np.float32)

    def rest_loose(self, slope: Floats) -> None:
        """Set the tangent at which loose material rests."""
        self._slope = slope

    def rest_rock(self, slope: Floats) -> None:
        """Set the tangent that bedrock holds."""
        self._rock = slope

    def soften(self, softness: Floats) -> None:
        """Set how much of what bedrock would give it does give."""
        self._softness = softness

    def relax(self, slope: Floats | None) -> None:
        """Let all that is too steep slide once; None keeps the slope of before."""
        if slope is not None:
            self._slope = slope
        self._height, self._volume = reference.relax_mesh(
            *(self._height, self.bed, self._volume, self._base, self._slope, self._graph),
            *self._edges,
        )

    def slide(self) -> None:
        """Let loose material and rock slide once."""
        weight = reference.hold_mesh(self._height, self.bed, self._slope, self._graph, *self._edges)
        self._height, self._volume = reference.slide_mesh(
            *(self._height, self.bed, self._volume, self._base, self._slope, self._rock),
            *(weight, self._softness, self._graph, *self._edges),
        )

    def ends(self) -> tuple[Counts, Counts, Any]:
        """Return height, bedrock and the volume that every vertex gained."""
        return self._height, self.bed, self._volume


class OpenCLMesh:
    """The same on a device, where everything stays; see :class:`NumPyMesh`."""

    def __init__(self, mesh: TriMesh, arrays: dict[str, Any], bed: Counts, run: Run) -> None:
        device = run.device
        assert device is not None
        self._device = device
        graph, count = mesh.graph, len(bed)
        self._graph = device.upload(graph.start), device.upload(graph.neighbor)
        self._base = device.upload(arrays["base"])
        names = ("length", "conductance", "height_a_volume")
        self._edges = tuple(device.upload(arrays[name]) for name in names)
        self._height, self._after = device.copy(self._base), device.empty(count, np.int32)
        self.bed = device.upload(bed)
        self._volume = device.upload(np.zeros(count, dtype=np.int64))
        self._slope = self._rock = self._softness = device.empty(count)
        self._weight = device.empty(count)
        self._count = np.int32(count)

    def rest_loose(self, slope: Floats) -> None:
        """Set the tangent at which loose material rests."""
        self._slope = self._device.upload(slope)

    def rest_rock(self, slope: Any) -> None:
        """Set the tangent that bedrock holds."""
        self._rock = self._device.upload(slope) if isinstance(slope, np.ndarray) else slope

    def soften(self, softness: Floats) -> None:
        """Set how much of what bedrock would give it does give."""
        self._softness = self._device.upload(softness)

    def relax(self, slope: Floats | None) -> None:
        """Let all that is too steep slide once; None keeps the slope of before."""
        if slope is not None:
            self._slope = self._device.upload(slope)
        program = self._device.program(__file__, "thermal.cl")
        program.launch(
            "thermal_relax_mesh",
            int(self._count),
            *(self._height, self._after, self.bed, self._volume, self._base, self._slope),
            *(*self._graph, *self._edges, self._count),
        )
        self._height, self._after = self._after, self._height

    def slide(self) -> None:
        """Let loose material and rock slide once."""
        program = self._device.program(__file__, "thermal.cl", {"THERMAL_LAYERED": 1})
        ends = (*self._graph, *self._edges, self._count)
        program.launch(
            "thermal_hold_mesh",
            int(self._count),
            *(self._height, self.bed, self._slope, self._weight, *ends),
        )
        program.launch(
            "thermal_slide_mesh",
            int(self._count),
            *(self._height, self._after, self.bed, self._volume, self._base, self._slope),
            *(self._rock, self._weight, self._softness, *ends),
        )
        self._height, self._after = self._after, self._height

    def ends(self) -> tuple[Counts, Counts, Any]:
        """Return height, bedrock and the volume that every vertex gained."""
        return self._height.download(), self.bed.download(), self._volume.download()
