"""Terrakit beside packages from PyPI that do the same, in turn, in one run: quote the ratios.

``python benchmarks/peers.py --samples 1025``

Nothing here is a dependency: what cannot be imported is skipped and named. Each comparison times
both sides in every round and takes the median of the rounds' ratios; above 1 terrakit is faster.
Both sides get the same terrain, and are timed with what they need to hand back a NumPy array.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import os
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from operators import SPACING, ground, print_table, timed

import terrakit
from terrakit import Heightfield, Run
from terrakit.compute import DeviceInfo, choose_device

OCTAVES = 8
WAVELENGTH = 5000.0
FEW = 257
"""Samples a side for peers that loop in Python."""


@dataclass(frozen=True)
class Pair:
    """Two ways to do the same work."""

    work: str
    peer: str
    samples: int
    ours: Callable[[], object]
    theirs: Callable[[], object]


@dataclass(frozen=True)
class Compared:
    """The medians of a pair."""

    work: str
    peer: str
    samples: int
    ours: float
    theirs: float
    ratio: float


def main() -> None:
    """Compare with whatever is installed."""
    parser = argparse.ArgumentParser(description="Compare terrakit with packages from PyPI.")
    parser.add_argument("--samples", type=int, default=1025, help="a side")
    parser.add_argument("--device", help="a name; by default the best device")
    parser.add_argument("--runs", type=int, default=5, help="rounds after the warm-up")
    parser.add_argument("--only", action="append", help="comparisons whose name holds this")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    chosen = parser.parse_args()
    info = choose_device(chosen.device)
    load = os.getloadavg()[0]
    compared, skipped = [], []
    for package, comparisons in PEERS.items():
        try:
            importlib.import_module(package)
        except (ImportError, SyntaxError) as error:  # a dependency of it may be for newer Pythons
            skipped.append(f"{package} ({type(error).__name__})")
            continue
        for pair in comparisons(chosen.samples, info):
            if not chosen.only or any(word in f"{pair.work} {pair.peer}" for word in chosen.only):
                compared.append(compare(pair, chosen.runs))
    print(f"{info.label}; load average {load:.1f} on {os.cpu_count()} cores, {chosen.runs} rounds")
    print(f"not to be imported: {', '.join(skipped) or 'none'}\n")
    print_table(
        ("work", "peer", "side", "terrakit s", "peer s", "peer / terrakit"),
        [
            (c.work, c.peer, c.samples, f"{c.ours:.4f}", f"{c.theirs:.4f}", f"{c.ratio:.1f}")
            for c in compared
        ],
    )
    if chosen.json:
        document = {"load": load, "device": info.label, "results": [asdict(c) for c in compared]}
        chosen.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def compare(pair: Pair, runs: int) -> Compared:
    """Time both sides in turn; the first round does not count."""
    rounds = [(timed(pair.ours), timed(pair.theirs)) for _ in range(runs + 1)][1:]
    return Compared(
        pair.work,
        pair.peer,
        pair.samples,
        statistics.median(ours for ours, _ in rounds),
        statistics.median(theirs for _, theirs in rounds),
        statistics.median(theirs / ours for ours, theirs in rounds),
    )


def our_noise(samples: int, info: DeviceInfo) -> object:
    """Return fractal noise of the octaves that the peers sum."""
    terrain = terrakit.generate(
        "fbm", samples, SPACING, run=Run(device=info), octaves=OCTAVES, wavelength=WAVELENGTH
    )
    return terrain.elevation


def with_noise(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """Perlin fractal noise of the package ``noise``: C, called from a Python loop."""
    noise = importlib.import_module("noise")
    side = min(samples, FEW)
    along = np.arange(side) * (SPACING / WAVELENGTH)

    def theirs() -> object:
        rows = [[noise.pnoise2(x, y, OCTAVES) for x in along.tolist()] for y in along.tolist()]
        return np.array(rows, np.float32)

    yield Pair("noise, 8 octaves", "noise", side, lambda: our_noise(side, info), theirs)


def with_opensimplex(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """Octaves of opensimplex on arrays; fast only where numba is installed."""
    opensimplex = importlib.import_module("opensimplex")
    compiled = importlib.util.find_spec("numba") is not None
    side = samples if compiled else min(samples, FEW // 2)
    along = np.arange(side) * (SPACING / WAVELENGTH)

    def theirs() -> object:
        octaves = (2.0**k for k in range(OCTAVES))
        return sum(opensimplex.noise2array(along * f, along * f) / f for f in octaves)

    peer = f"opensimplex ({'with' if compiled else 'without'} numba)"
    yield Pair("noise, 8 octaves", peer, side, lambda: our_noise(side, info), theirs)


def with_fastnoiselite(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """Perlin fractal noise of FastNoiseLite through its Cython binding."""
    lite = importlib.import_module("pyfastnoiselite.pyfastnoiselite")
    generator = lite.FastNoiseLite(7)
    generator.noise_type = lite.NoiseType.NoiseType_Perlin
    generator.fractal_type = lite.FractalType.FractalType_FBm
    generator.fractal_octaves = OCTAVES
    generator.frequency = SPACING / WAVELENGTH
    col, row = np.meshgrid(np.arange(samples), np.arange(samples))
    places = np.stack((col.ravel(), row.ravel())).astype(np.float32)
    yield Pair(
        "noise, 8 octaves",
        "pyfastnoiselite",
        samples,
        lambda: our_noise(samples, info),
        lambda: generator.gen_from_coords(places),
    )


def with_fastscapelib(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """A whole step: routing through depressions, accumulation, implicit stream power."""
    fastscape = importlib.import_module("fastscapelib")
    terrain = ground(samples)
    steps, time_step, erodibility, exponent = 4, 2.5e4, 1e-5, 0.45
    grid = fastscape.RasterGrid([samples] * 2, [SPACING] * 2, fastscape.NodeStatus.FIXED_VALUE)
    graph = fastscape.FlowGraph(grid, [fastscape.SingleFlowRouter(), fastscape.MSTSinkResolver()])
    eroder = fastscape.SPLEroder(graph, erodibility, exponent, 1.0)

    def theirs() -> object:
        height = terrain.elevation.astype(np.float64)
        for _ in range(steps):
            graph.update_routes(height)
            height -= eroder.erode(height, graph.accumulate(1.0), time_step)
        return height

    def ours() -> object:
        return terrakit.erode(
            terrain,
            "stream_power",
            run=Run(device=info),
            duration=steps * time_step,
            time_step=time_step,
            erodibility=erodibility,
            area_exponent=exponent,
            uplift_rate=0.0,
            diffusivity=0.0,
            routing="d8",
            outlets="border",
        ).elevation

    yield Pair(f"stream power, {steps} whole steps", "fastscapelib", samples, ours, theirs)


def our_sweeps(terrain: Heightfield, info: DeviceInfo | str, sweeps: int) -> object:
    """Return the terrain after some sweeps of thermal erosion."""
    return terrakit.erode(terrain, "thermal", run=Run(device=info), iterations=sweeps).elevation


def with_landlab(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """Explicit diffusion on four neighbours; ours has eight and a talus."""
    landlab = importlib.import_module("landlab")
    components = importlib.import_module("landlab.components")
    terrain = ground(samples)
    sweeps = 20
    grid = landlab.RasterModelGrid((samples, samples), xy_spacing=SPACING)
    height = grid.add_zeros("topographic__elevation", at="node")
    diffuser = components.LinearDiffuser(grid, linear_diffusivity=0.01)
    time_step = 0.2 * SPACING**2 / 0.01

    def theirs() -> object:
        height[:] = terrain.elevation.ravel()
        for _ in range(sweeps):
            diffuser.run_one_step(time_step)
        return height

    yield Pair(
        f"thermal, {sweeps} sweeps",
        "landlab LinearDiffuser",
        samples,
        lambda: our_sweeps(terrain, info, sweeps),
        theirs,
    )


def with_numpy(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """The same sweeps in NumPy: our own reference, bit for bit the same result."""
    terrain, sweeps = ground(samples), 20
    yield Pair(
        f"thermal, {sweeps} sweeps",
        "NumPy (our reference)",
        samples,
        lambda: our_sweeps(terrain, info, sweeps),
        lambda: our_sweeps(terrain, "numpy", sweeps),
    )


def with_trimesh(samples: int, info: DeviceInfo) -> Iterator[Pair]:
    """The same heightfield as OBJ: two triangles a cell there, a quad a cell here."""
    del info
    mesher = importlib.import_module("trimesh")
    side = min(samples, 513)
    terrain = ground(side)
    mesh = terrain.to_mesh()
    folder = Path(tempfile.mkdtemp(prefix="terrakit-benchmark-"))

    def theirs() -> object:
        other = mesher.Trimesh(mesh.vertices, mesh.faces, process=False)
        return (folder / "theirs.obj").write_text(mesher.exchange.obj.export_obj(other))

    yield Pair(
        "OBJ file, no texture",
        "trimesh",
        side,
        lambda: terrakit.export(terrain, folder / "ours.obj", texture=False),
        theirs,
    )


PEERS: dict[str, Callable[[int, DeviceInfo], Iterator[Pair]]] = {
    "numpy": with_numpy,
    "noise": with_noise,
    "opensimplex": with_opensimplex,
    "pyfastnoiselite": with_fastnoiselite,
    "fastscapelib": with_fastscapelib,
    "landlab": with_landlab,
    "trimesh": with_trimesh,
}


if __name__ == "__main__":
    sys.exit(main())
