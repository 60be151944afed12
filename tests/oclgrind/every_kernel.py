"""Launch every kernel on small terrains on Oclgrind; run as a child of test_kernels.py.

Prints the kernels that were launched, one a line, to the file named on the command line. Buffers
are kept alive: Oclgrind remembers what was not initialised by address, and would blame a buffer for
the one that lay there before. Fills and copies go through the host for the same reason: Oclgrind
does not see that they initialise.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from terrakit import Grid, Heightfield, Run
from terrakit.compute import DeviceArray
from terrakit.compute import device as compute_device
from terrakit.execute import execute
from terrakit.operators import Erosion, Filter, Generator
from terrakit.routing import accumulate, filled, flow_length, outlets, route
from terrakit_erosion.automaton import Automaton
from terrakit_erosion.droplet import Droplet
from terrakit_erosion.hillslope import Hillslope
from terrakit_erosion.hydraulic import Hydraulic
from terrakit_erosion.stream_power import StreamPower
from terrakit_erosion.thermal import Thermal
from terrakit_erosion.weathering import Weathering
from terrakit_erosion.wind import Wind
from terrakit_filters.amplify import Amplify
from terrakit_filters.brush import Brush
from terrakit_filters.dequantise import Dequantise
from terrakit_filters.join import Join
from terrakit_filters.subdivide import Subdivide
from terrakit_filters.terrace import Terrace
from terrakit_generators.diamond_square import DiamondSquare
from terrakit_generators.fractals.domain_warp import DomainWarp
from terrakit_generators.fractals.fbm import Fbm
from terrakit_generators.fractals.noise import Noise
from terrakit_generators.fractals.swiss import Swiss
from terrakit_generators.landforms.atoll import Atoll
from terrakit_generators.landforms.canyon import Canyon
from terrakit_generators.landforms.meander import Meander
from terrakit_generators.midpoint_displacement import MidpointDisplacement
from terrakit_generators.plates import Plates
from terrakit_generators.spectral import Spectral
from terrakit_generators.square_square import SquareSquare
from terrakit_texturing.strata import LayStrata

UNOPTIMISED = ("hydraulic.cl",)
"""Kernels in which the optimiser puts instructions that Oclgrind does not know (freeze)."""
SHAPES = ((3, 3), (16, 16), (17, 5))


def main(listing: Path) -> None:
    """Run everything and compare it with the reference."""
    launched: set[str] = set()
    alive: list[object] = []
    launch = compute_device.Program.launch
    allocate = compute_device._Opened.allocate
    build = compute_device._Opened.build

    def noting(self: compute_device.Program, name: str, *arguments: object, **options: object):
        launched.add(name)
        return launch(self, name, *arguments, **options)

    def keeping(self: compute_device._Opened, size: int) -> object:
        alive.append(allocate(self, size))
        return alive[-1]

    def filling(self: compute_device.Device, array: DeviceArray, value: float) -> None:
        self.write(array, np.full(array.shape, value, array.dtype))

    def copying(self: compute_device.Device, source: DeviceArray, target=None) -> DeviceArray:
        target = self.empty(source.shape, source.dtype) if target is None else target
        self.write(target, source.download())
        return target

    def building(self: compute_device._Opened, name: str, text: str, options: tuple[str, ...]):
        plain = ("-cl-opt-disable",) if name in UNOPTIMISED else ()
        return build(self, name, text, (*options, *plain))

    compute_device._Opened.build = building
    compute_device.Device.fill = filling
    compute_device.Device.copy = copying
    compute_device.Program.launch = noting
    compute_device._Opened.allocate = keeping
    checked(Run(0, "oclgrind").device)
    for shape in SHAPES:
        grid = Grid(shape, 20.0)
        terrain = both(Fbm(amplitude=600.0, wavelength=200.0, octaves=3), grid)
        for generator in generators():
            both(generator, grid)
        hardness = np.linspace(0, 1, terrain.elevation.size).reshape(shape)
        terrain = terrain.with_layers(hardness=hardness)
        for operator in (*operators(), *filters(min(shape))):
            both(operator, terrain)
        layered = both(LayStrata(beds=[{"material": "shale", "thickness": 7.0}] * 3), terrain)
        lift = {"layer": "hardness", "low": 0.0, "high": 1e-3}
        both(StreamPower(duration=5e4), layered)
        both(StreamPower(duration=5e4, erodibility=lift, uplift_rate=lift), layered)
        both(Thermal(iterations=2), layered)
        loose = terrain.with_layers(sediment=9.0 * hardness)
        if shape == SHAPES[2]:
            for operator in layered_operators():
                both(operator, loose)
        if shape == SHAPES[0]:
            both(Droplet(drops_a_cell=1.0, drops_at_once=0.25), layered)
            both(Hydraulic(storm_duration=0.005), loose, sea_level=300.0)
        both(Thermal(iterations=2), terrain.to_mesh())
        both(Thermal(iterations=2, bedrock_angle=60.0), loose.to_mesh())
        both(Subdivide(amplitude=20.0, smoothing="butterfly"), terrain.to_mesh())
        routed(terrain)
    listing.write_text("\n".join(sorted(launched)))


def generators() -> list[Generator]:
    """Return generators whose settings reach every branch of the kernels, and wide formulas."""
    return [
        *(kind(wavelength=160.0) for kind in (DiamondSquare, MidpointDisplacement, SquareSquare)),
        DiamondSquare(wavelength=150.0, additions=True, noise="uniform"),
        MidpointDisplacement(wavelength=150.0, additions=True),
        Plates(**Plates.trial),
        Spectral(period=300.0, shortest_wavelength=20.0),
        Swiss(wavelength=200.0, octaves=3),
        DomainWarp(wavelength=200.0, octaves=2, source=Noise(basis="cellular_f2", wavelength=50.0)),
        Meander(),
        Atoll(),
        Canyon(),
    ]


def filters(side: int) -> list[Filter]:
    """Return filters whose settings reach every branch of the kernels."""
    line = [[5.0, 5.0], [100.0, 60.0], [20.0, 200.0]]
    tools = (
        ("raise", 45.0, 9.0),
        ("lower", 30.0, 3.0),
        ("smooth", 60.0, 0.6),
        ("flatten", 9.0, 0.8),
    )
    strokes = [
        {"tool": tool, "points": line, "radius": radius, "strength": strength}
        for tool, radius, strength in tools
    ]
    refined = [Amplify(factor=4), Amplify(factor=2, stencil="mean")] if side >= 9 else []
    return [
        *refined,
        Brush(strokes=strokes),
        Dequantise(step=5.0, terrace_width=200.0),
        Join(other=50.0, line=line, transition=40.0, wander=20.0, wavelength=100.0),
        Terrace(bench_height=20.0, wavelength=200.0),
    ]


def operators() -> list[Thermal | StreamPower]:
    """Return erosions whose settings reach every branch of the kernels."""
    angle = {"layer": "hardness", "low": 10.0, "high": 50.0}
    strength = {"layer": "hardness", "low": 1e-6, "high": 1e-4}
    lift = {"layer": "hardness", "low": 0.0, "high": 1e-3}
    brief = {"duration": 5e4, "outlet_spacing": 40.0}
    return [
        Thermal(iterations=2),
        Thermal(iterations=2, border="open", talus_angle=angle),
        Thermal(iterations=2, scheme="proportional"),
        Thermal(iterations=2, scheme="proportional", talus_angle=angle),
        StreamPower(**brief),
        StreamPower(**brief, routing="d8", critical_slope=30.0, slope_exponent=1.4),
        StreamPower(**brief, outlets="border", erodibility=strength, uplift_rate=lift),
    ]


def layered_operators() -> list[Erosion]:
    """Return erosions that tell loose material from rock, with settings that reach every branch."""
    varied = {"layer": "hardness", "low": 0.0, "high": 0.05}
    drops = {"drops_a_cell": 0.5, "longest_path": 100.0, "drops_at_once": 0.25}
    gusts = {"duration": 0.01, "sand_depth": 2.0, "hop_length": 40.0, "abrasion": 1.0}
    return [
        Automaton(iterations=3),
        Droplet(**drops),
        Droplet(**drops, border="closed", lakes="end", ending="laid_down", hardness="hardness"),
        Hillslope(duration=500.0, border="open"),
        Hillslope(duration=100.0, critical_slope=40.0, border="fixed", creep_rate=varied),
        Hillslope(duration=100.0, soil_only=True, critical_slope=40.0, border="open"),
        Hydraulic(storm_duration=0.005),
        Hydraulic(storm_duration=0.005, scheme="pipe", water_border="periodic"),
        Hydraulic(
            storm_duration=0.005,
            rain_pattern="random",
            evaporation=50.0,
            springs=[[20.0, 20.0, 1.0]],
        ),
        Thermal(iterations=2, supply="debris", border="open"),
        Thermal(iterations=2, scheme="proportional", bedrock_angle=60.0),
        Thermal(iterations=2, scheme="proportional", border="open"),
        Weathering(duration=100.0, distance=20.0, expansion=1.3, law="humped"),
        Wind(**gusts),
        Wind(**gusts, border="periodic", deflection=1.0, speed_up=0.01, vegetation=varied),
    ]


def both(operator: object, subject: object, sea_level: float = -100.0) -> Heightfield:
    """Return the result on Oclgrind after comparing it with the reference."""
    ours, theirs = (
        execute(operator, subject, Run(3, name, sea_level=sea_level))
        for name in ("oclgrind", "numpy")
    )
    for layer in theirs:
        if not np.array_equal(ours.layer(layer), theirs.layer(layer)):
            raise SystemExit(f"{operator!r}: {layer} differs from the reference")
    return ours


def checked(device: compute_device.Device) -> None:
    """Count what is not finite."""
    values = np.full(2500, np.nan, np.float32)
    values[7:1000] = 1.0
    if (
        Heightfield(device.upload(values.reshape(50, 50)), 1.0).layers["elevation"].not_finite()
        != 1507
    ):
        raise SystemExit("survey_not_finite miscounts")


def routed(terrain: Heightfield) -> None:
    """Route water with both methods, on rough and on flat ground."""
    device = Run(0, "oclgrind").device
    rough = (terrain.elevation * 1000).astype(np.int32)
    outlet = np.zeros(terrain.shape, np.uint8)
    outlet[0, 0] = 1
    for height in (rough, np.zeros_like(rough)):
        for method in ("d8", "rho8"):
            routing = route(height, outlet, method=method, seed=(1, 2), device=device)
            filled(routing, device.upload(height)).download()
            outlets(routing).download()
            flow_length(routing).download()
            for weight in (np.int32(2), np.float32(0.5)):
                accumulate(routing, device.upload(np.full(height.shape, weight))).download()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
