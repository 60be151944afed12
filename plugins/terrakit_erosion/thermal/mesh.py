"""Thermal erosion on the edge graph of a mesh (sheet M1): exact in volume on any triangles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from terrakit.errors import InputError, ParameterError
from terrakit.mesh import TriMesh
from terrakit.parameters import Schedule
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit_erosion.thermal import reference

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
    sweeps = thermal.iterations
    if sweeps is None:
        sweeps = math.ceil(4 * thermal.distance**2 / (share * typical))
    tangents = thermal.slopes(mesh, sweeps)

    def slope(sweep: int) -> np.ndarray:
        return np.broadcast_to(tangents(sweep), area.shape).astype(np.float32)

    arrays = {
        "base": start,
        "slope": slope(0),
        "length": (graph.length / quanta.quantum).astype(np.float32),
        "conductance": conductance.astype(np.float32),
        "height_a_volume": np.where(
            solid, volume_quantum / np.maximum(area, 1e-300) / quanta.quantum, 0.0
        ).astype(np.float32),
    }
    scheduled = slope if isinstance(thermal.talus_angle, Schedule) else None
    volume = _relaxed(arrays, mesh, sweeps, run, scheduled)

    gained = np.where(solid, volume * volume_quantum / np.maximum(area, 1e-300), 0.0)
    run.ledger.open("rock", mesh.volume)
    result = mesh.raised(gained) if sweeps else mesh
    moved = int(np.abs(volume).sum()) * 0.5 * volume_quantum
    run.ledger.close("rock", result.volume, moved)
    if not sweeps:
        return mesh
    before = mesh.layer("sediment") if "sediment" in mesh else np.float32(0)
    return result.with_layers(
        sediment=np.maximum(before + gained.astype(np.float32), np.float32(0))
    )


def _relaxed(
    arrays: dict[str, np.ndarray],
    mesh: TriMesh,
    sweeps: int,
    run: Run,
    scheduled: Callable[[int], np.ndarray] | None,
) -> np.ndarray:
    """Return the volume that every vertex gained, in quanta of volume."""
    graph, count = mesh.graph, len(mesh.vertices)
    height, volume = arrays["base"], np.zeros(count, dtype=np.int64)
    device = run.device
    if device is None:
        for sweep in run.steps(sweeps):
            height, volume = reference.relax_mesh(
                height,
                volume,
                arrays["base"],
                scheduled(sweep) if scheduled else arrays["slope"],
                graph,
                arrays["length"],
                arrays["conductance"],
                arrays["height_a_volume"],
            )
        return volume
    program = device.program(__file__, "thermal.cl")
    names = ("base", "slope", "length", "conductance", "height_a_volume")
    base, slope, length, conductance, rise = (device.upload(arrays[name]) for name in names)
    start, neighbor = device.upload(graph.start), device.upload(graph.neighbor)
    now, after = device.copy(base), device.empty(count, np.int32)
    gained = device.upload(volume)
    for sweep in run.steps(sweeps):
        if scheduled:
            slope = device.upload(scheduled(sweep))
        program.launch(
            "thermal_relax_mesh",
            count,
            *(now, after, gained, base, slope, start, neighbor, length, conductance, rise),
            np.int32(count),
        )
        now, after = after, now
    return gained.download()
