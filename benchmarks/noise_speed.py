"""How fast noise is, beside packages from PyPI and FastNoise2, in turn, in one run.

``python benchmarks/noise_speed.py --samples 2048 --threads 2 --fastnoise2 PATH``

Every basis is summed over octaves, the way fractals do, by a kernel of a few lines on
``terrakit/noise/noise.cl``; ``--fractals`` adds whole operators, from the call to the array. Every
round measures everything once; figures are millions of samples a second, medians of the rounds,
and ratios are medians of the rounds' ratios.

FastNoise2 is no package. ``--fastnoise2`` takes any program that is called with ``samples threads
octaves``, times with its library's ``GenUniformGrid2D`` one square grid of so many samples a side,
whose rows the threads share, and prints seconds as JSON with our names::

    {"value": 0.021, "gradient": 0.026, "simplex": 0.029, "cellular_f1": 0.096, "white": 0.014}

That is an ``FractalFBm`` of ``Value``, ``Perlin``, ``Simplex``, ``CellularDistance`` and ``White``
with a feature scale of 250, linked with the library as its own build makes it.

What is compared is like, not equal: float32 positions there, 64-bit here; contracted and
reassociated sums there, the same bits on every device here; nine cells searched there and points
kept to the middle of them, here as many as make the distance right.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from operators import SPACING, print_table, timed

WAVELENGTH = 250 * SPACING
PLAIN = ("white", "value", "gradient", "simplex", "cellular_f1", "cellular_f2", "cellular_f4")
FRACTALS = ("fbm", "billow", "ridged_multifractal", "hybrid_multifractal", "domain_warp")
FEW = 257
"""Samples a side for peers that loop in Python."""
KERNEL = """
__kernel void bench_{name}(
    __global float *out, __global const long *steps, __global const uint *seeds,
    const int octaves, const int rows, const int cols)
{{
    const int row = (int)get_global_id(1);
    const int first = (int)get_global_id(0) * {width};
    if (row >= rows || first >= cols) return;
    const int count = cols - first < {width} ? cols - first : {width};
    float sum[{width}];
    for (int c = 0; c < count; ++c) sum[c] = 0.0f;
    float weight = 1.0f;
    for (int k = 0; k < octaves; ++k) {{
        const long du = steps[6 * k + 1], dv = steps[6 * k + 4];
        const long u0 = steps[6 * k] + row * steps[6 * k + 2] + first * du;
        const long v0 = steps[6 * k + 3] + row * steps[6 * k + 5] + first * dv;
        const uint low = seeds[2 * k], high = seeds[2 * k + 1];
        NOISE_START(u, u0, du)
        NOISE_START(v, v0, dv)
        NOISE_LOOP for (int c = 0; c < count; ++c) {{
            sum[c] = sum[c] + weight * noise_{name}(
                NOISE_CELL(u), NOISE_CELL(v), NOISE_FRACTION(u), NOISE_FRACTION(v), low, high);
            NOISE_STEP(u)
            NOISE_STEP(v)
        }}
        weight = weight * 0.5f;
    }}
    for (int c = 0; c < count; ++c) out[(size_t)row * cols + first + c] = sum[c];
}}
"""
Work = dict[str, Callable[[], float]]
"""By name, what does the work once and returns the seconds a sample."""


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description="Measure noise, ours and others'.")
    parser.add_argument("--samples", type=int, default=2048, help="a side")
    parser.add_argument("--octaves", type=int, default=8)
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--device", help="a name; by default the best device")
    parser.add_argument("--runs", type=int, default=7, help="rounds after the warm-up")
    parser.add_argument("--only", action="append", help="noises whose name holds this")
    parser.add_argument("--fractals", action="store_true", help="whole operators too")
    parser.add_argument("--no-peers", action="store_true", help="no packages from PyPI")
    parser.add_argument("--fastnoise2", type=Path, metavar="PROGRAM", help="see above")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    chosen = parser.parse_args()
    # Runtimes read these when they are loaded
    os.environ["POCL_MAX_PTHREAD_COUNT"] = str(chosen.threads)
    os.environ["DPCPP_CPU_NUM_CUS"] = str(chosen.threads)

    def wanted(name: str) -> bool:
        return not chosen.only or any(word in name for word in chosen.only)

    label, ours = kernels(chosen.device, chosen.samples, chosen.octaves, wanted)
    theirs: dict[str, Work] = {}
    if not chosen.no_peers:
        for package, peer in PEERS.items():
            try:
                importlib.import_module(package)
            except ImportError:
                print(f"{package} is not installed", file=sys.stderr)
                continue
            theirs[package] = {
                name: work
                for name, work in peer(chosen.samples, chosen.octaves).items()
                if wanted(name)
            }
    load = os.getloadavg()[0]
    seconds: dict[tuple[str, str], list[float]] = {}
    for turn in range(chosen.runs + 1):
        made = {("terrakit", name): work() for name, work in ours.items()}
        if chosen.fractals:
            for name in filter(wanted, FRACTALS):
                made["terrakit operator", name] = operator(name, chosen)
        for package, works in theirs.items():
            made |= {(package, name): work() for name, work in works.items()}
        if chosen.fastnoise2:
            other = program(chosen.fastnoise2, chosen.samples, chosen.threads, chosen.octaves)
            made |= {("FastNoise2", n): s for n, s in other.items() if wanted(n)}
        for key, taken in made.items():
            if turn:
                seconds.setdefault(key, []).append(taken)
    rows = []
    for (package, name), taken in seconds.items():
        own = seconds.get(("terrakit", name), [])
        ratio = statistics.median(b / a for a, b in zip(own, taken, strict=True)) if own else None
        speed = 1e-6 / statistics.median(taken)
        rows.append((name, package, speed, ratio))
    rows.sort(key=lambda row: (row[0], row[1] != "terrakit", row[1]))
    print(
        f"{label}; {chosen.samples} samples a side, {chosen.octaves} octaves, {chosen.threads} "
        f"threads, {chosen.runs} rounds, load average {load:.1f} on {os.cpu_count()} cores\n"
    )
    print_table(
        ("noise", "by", "Msamples/s", "terrakit's speed over it"),
        [(n, by, f"{speed:.1f}", "" if r is None else f"{r:.2f}") for n, by, speed, r in rows],
    )
    if chosen.json:
        document = {"load": load, "device": label, "threads": chosen.threads, "results": rows}
        chosen.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def kernels(
    wish: str | None, samples: int, octaves: int, wanted: Callable[[str], bool]
) -> tuple[str, Work]:
    """Return the device and the bases at work on it."""
    from terrakit.compute import Device, choose_device
    from terrakit.noise import BASES
    from terrakit.noise import source as noise_source

    device = Device(choose_device(wish))
    names = [name for name in PLAIN if wanted(name)]
    width = 256 if device.is_cpu else 1
    source = noise_source(BASES)
    source += "".join(KERNEL.format(name=name, width=width) for name in names)
    program = device.program_from_source("noise_speed.cl", source)
    random = np.random.default_rng(0)
    steps, step = [], SPACING / WAVELENGTH * 2**32
    for octave in range(octaves):
        turn = 0.5 * octave
        c, s = round(np.cos(turn) * step), round(np.sin(turn) * step)
        u, v = (int(at) for at in random.integers(0, 2**45, 2))
        steps.append([u, c, s, v, s, -c])
        step *= 1.97
    arguments = (
        device.empty((samples, samples)),
        device.upload(np.array(steps, np.int64)),
        device.upload(random.integers(0, 2**32, 2 * octaves, dtype=np.uint32)),
        np.int32(octaves),
        np.int32(samples),
        np.int32(samples),
    )

    def work(name: str) -> float:
        def once() -> None:
            shape = (samples, -(-samples // width))
            local = (4, 1) if device.is_cpu else None
            program.launch(f"bench_{name}", shape, *arguments, local=local)
            device.finish()

        return timed(once) / samples**2

    return device.name, {name: lambda name=name: work(name) for name in names}  # type: ignore[misc]


def operator(name: str, chosen: argparse.Namespace) -> float:
    """Return the seconds a sample of a whole generator, transfers and all."""
    import terrakit
    from terrakit import Run
    from terrakit.compute import choose_device

    run = Run(device=choose_device(chosen.device))
    settings = {"octaves": chosen.octaves, "wavelength": WAVELENGTH}

    def made() -> object:
        return terrakit.generate(name, chosen.samples, SPACING, run=run, **settings).elevation

    return timed(made) / chosen.samples**2


def with_fastnoiselite(samples: int, octaves: int) -> Work:
    """FastNoiseLite through its Cython binding, one thread."""
    lite = importlib.import_module("pyfastnoiselite.pyfastnoiselite")
    col, row = np.meshgrid(np.arange(samples), np.arange(samples))
    places = np.stack((col.ravel(), row.ravel())).astype(np.float32)
    kinds = {
        "gradient": lite.NoiseType.NoiseType_Perlin,
        "simplex": lite.NoiseType.NoiseType_OpenSimplex2,
        "value": lite.NoiseType.NoiseType_Value,
        "cellular_f1": lite.NoiseType.NoiseType_Cellular,
    }

    def work(kind: object) -> float:
        generator = lite.FastNoiseLite(7)
        generator.noise_type = kind
        generator.fractal_type = lite.FractalType.FractalType_FBm
        generator.fractal_octaves = octaves
        generator.frequency = SPACING / WAVELENGTH
        return timed(lambda: generator.gen_from_coords(places)) / samples**2

    return {name: lambda kind=kind: work(kind) for name, kind in kinds.items()}  # type: ignore[misc]


def with_opensimplex(samples: int, octaves: int) -> Work:
    """Octaves of opensimplex on arrays; fast only where numba is installed."""
    opensimplex = importlib.import_module("opensimplex")
    side = samples if importlib.util.find_spec("numba") else min(samples, FEW // 2)
    along = np.arange(side) * (SPACING / WAVELENGTH)

    def work() -> float:
        scales = [2.0**k for k in range(octaves)]

        def made() -> object:
            return sum(opensimplex.noise2array(along * f, along * f) / f for f in scales)

        return timed(made) / side**2

    return {"simplex": work}


def with_noise(samples: int, octaves: int) -> Work:
    """Perlin noise of the package ``noise``: C, called from a Python loop."""
    noise = importlib.import_module("noise")
    side = min(samples, FEW)
    along = (np.arange(side) * (SPACING / WAVELENGTH)).tolist()

    def work(function: Callable[..., float]) -> float:
        return timed(lambda: [function(x, y, octaves) for y in along for x in along]) / side**2

    return {"gradient": lambda: work(noise.pnoise2), "simplex": lambda: work(noise.snoise2)}


PEERS: dict[str, Callable[[int, int], Work]] = {
    "pyfastnoiselite": with_fastnoiselite,
    "opensimplex": with_opensimplex,
    "noise": with_noise,
}


def program(path: Path, samples: int, threads: int, octaves: int) -> dict[str, float]:
    """Return the seconds a sample that another program needs for its noises."""
    command = [str(path), str(samples), str(threads), str(octaves)]
    answer = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    return {name: taken / samples**2 for name, taken in json.loads(answer).items()}


if __name__ == "__main__":
    sys.exit(main())
