"""How fast the erosions are, beside textbook code and packages from PyPI, in turn, in one run.

``python benchmarks/erosion_speed.py --samples 513 1025 2049``

Every round measures the bandwidth of the device's memory and then everything once; figures are
medians over rounds after one to warm up, and ratios are medians of the rounds' ratios. Terrakit's
and most others' work is timed at two lengths, whose difference is the time of a sweep, an iteration
or a drop, free of transfers and set-up.

The floor is the compulsory traffic of one pass (``--models`` says which) at the measured
bandwidth. A droplet's path is arithmetic and chance: it has none.

What is compared is like, not equal. The textbook codes (``benchmarks/textbook.py``) and the
packages do one process each, in float32 or float64, without a ledger; terrakit's do what the
operator promises, ledger, limits and layers included. Packages that are not installed are named
and skipped; so are operators that are not there.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import textbook
from operators import SPACING, Bandwidth, ground, print_table, timed

from terrakit import Heightfield, Run
from terrakit.compute import DeviceInfo, choose_device
from terrakit.execute import execute
from terrakit.registry import default_registry
from terrakit.running import Progress

Work = Callable[[int], object]
"""Does so many units of work."""


@dataclass(frozen=True)
class Contender:
    """One way to do some work."""

    work: str
    """What is done; the same for all that compete."""
    unit: str
    by: str
    run: Work
    few: int
    many: int
    bytes_a_cell: float = 0.0

    def measure(self) -> float:
        """Return the seconds of one unit."""
        short = timed(lambda: self.run(self.few)) if self.few else 0.0
        long = timed(lambda: self.run(self.many))
        return max(long - short, 1e-9) / (self.many - self.few)


@dataclass(frozen=True)
class Case:
    """An operator of terrakit, and how long and short runs of it are asked for."""

    work: str
    unit: str
    operator: str
    settings: Mapping[str, Any]
    count: Callable[[int, int], dict[str, Any]]
    """The settings of so many units on so many cells."""
    few: Callable[[int], int]
    many: Callable[[int], int]
    bytes_a_cell: float = 0.0
    model: str = ""
    in_a_block: int = 0
    """Units in a step of progress, of operators that are stopped early; 0 where settings count."""


def iterations(n: int, cells: int) -> dict[str, Any]:
    """Return the setting of operators that count iterations."""
    del cells
    return {"iterations": n}


def nothing(n: int, cells: int) -> dict[str, Any]:
    """Return no setting: the work is stopped in time."""
    del n, cells
    return {}


CASES = (
    Case(
        "grid water",
        "iteration",
        "hydraulic",
        {"storm_duration": 100.0},
        nothing,
        lambda cells: 32,
        lambda cells: 96 if cells > 2**21 else 160,
        40,
        "ground, water, load and flow across two edges read and written: 5 x (4 + 4)",
        in_a_block=32,
    ),
    Case(
        "thermal",
        "sweep",
        "thermal",
        {"scheme": "flux"},
        iterations,
        lambda cells: 20,
        lambda cells: 60,
        8,
        "height read and written: 4 + 4",
    ),
    Case(
        "cellular automaton",
        "iteration",
        "automaton",
        {},
        iterations,
        lambda cells: 5,
        lambda cells: 15,
        24,
        "ground, water and load read and written: 3 x (4 + 4)",
    ),
    Case(
        "hillslope",
        "sweep",
        "hillslope",
        {"creep_rate": 0.02},
        # As long as it may take a sweep: 0.15 of a difference moves
        lambda n, cells: {"duration": (n - 0.001) * 0.15 * SPACING**2 / 0.02},
        lambda cells: 20,
        lambda cells: 60,
        8,
        "height read and written: 4 + 4",
    ),
    Case(
        "droplets, 30 steps",
        "drop",
        "droplet",
        {"brush_radius": 3 * SPACING, "longest_path": 30 * SPACING, "drops_at_once": 0.0625},
        lambda n, cells: {"drops_a_cell": n / cells},
        lambda cells: cells // 8,
        lambda cells: cells // 2,
    ),
)


@dataclass(frozen=True)
class Measured:
    """The medians of one contender at one size."""

    work: str
    by: str
    samples: int
    unit: str
    seconds: float
    speed: float
    """Millions of cells, or of drops, a second."""
    ratio: float | None
    """How many times the time of terrakit's."""
    times_floor: float | None


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description="Measure the erosions, ours and others'.")
    parser.add_argument("--samples", type=int, nargs="+", default=[1025], help="a side")
    parser.add_argument("--device", help="a name; by default the best device")
    parser.add_argument("--runs", type=int, default=5, help="rounds after the warm-up")
    parser.add_argument("--only", action="append", help="works whose name holds this")
    parser.add_argument("--no-peers", action="store_true", help="terrakit and the floor alone")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument("--models", action="store_true", help="print the byte models and end")
    chosen = parser.parse_args()
    if chosen.models:
        rows = [(c.work, c.unit, f"{c.bytes_a_cell:g}", c.model or "none") for c in CASES]
        print_table(("work", "unit", "bytes a cell", "from"), rows)
        return
    info = choose_device(chosen.device)
    load = os.getloadavg()[0]
    skipped: list[str] = []
    measured, bandwidths = [], []
    for samples in chosen.samples:
        contenders = [
            one
            for one in contenders_on(ground(samples), info, not chosen.no_peers, skipped)
            if not chosen.only or any(word in one.work for word in chosen.only)
        ]
        rows, bandwidth = measure(contenders, info, samples, chosen.runs)
        measured += rows
        bandwidths.append(bandwidth)
    print(
        f"{info.label}; load average {load:.1f} on {os.cpu_count()} cores, {chosen.runs} rounds, "
        f"memory {max(bandwidths) / 1e9:.1f} GB/s\nnot there: {', '.join(skipped) or 'none'}\n"
    )
    head = ("work", "by", "side", "ms", "per", "M/s", "time / terrakit's", "x floor")
    print_table(head, [row_of(one) for one in measured])
    if chosen.json:
        document = {"load": load, "device": info.label, "results": [asdict(m) for m in measured]}
        chosen.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def measure(
    contenders: list[Contender], info: DeviceInfo, samples: int, runs: int
) -> tuple[list[Measured], float]:
    """Return the figures of all contenders at one size, and the bandwidth."""
    memory = Bandwidth(info)
    seconds: dict[Contender, list[float]] = {one: [] for one in contenders}
    bandwidths = []
    for turn in range(runs + 1):
        bandwidth = memory.measure()
        taken = {one: one.measure() for one in contenders}
        if turn:
            bandwidths.append(bandwidth)
            for one, time in taken.items():
                seconds[one].append(time)
    ours = {one.work: seconds[one] for one in contenders if one.by == "terrakit"}
    rows = []
    for one in contenders:
        median = statistics.median(seconds[one])
        floors = [one.bytes_a_cell * samples**2 / speed for speed in bandwidths]
        pairs = zip(seconds[one], ours.get(one.work, []), strict=False)
        ratios = [theirs / own for theirs, own in pairs]
        rows.append(
            Measured(
                one.work,
                one.by,
                samples,
                one.unit,
                median,
                1e-6 * (1 if one.unit == "drop" else samples**2) / median,
                statistics.median(ratios) if ratios else None,
                statistics.median(s / f for s, f in zip(seconds[one], floors, strict=True))
                if one.bytes_a_cell
                else None,
            )
        )
    return rows, statistics.median(bandwidths)


def row_of(one: Measured) -> tuple[object, ...]:
    """Return a line of the table; of drops, the time of a thousand."""
    drops = one.unit == "drop"
    return (
        one.work,
        one.by,
        one.samples,
        f"{1e3 * one.seconds * (1000 if drops else 1):.2f}",
        "1000 drops" if drops else one.unit,
        f"{one.speed:.3g}",
        "" if one.ratio is None else f"{one.ratio:.2f}",
        "" if one.times_floor is None else f"{one.times_floor:.1f}",
    )


def contenders_on(
    terrain: Heightfield, info: DeviceInfo, peers: bool, skipped: list[str]
) -> Iterator[Contender]:
    """Yield all that can be measured on a terrain; note in ``skipped`` what cannot."""
    cells = terrain.shape[0] * terrain.shape[1]
    there = {kind.name for kind in default_registry().operators("erosion")}
    for case in CASES:
        if case.operator not in there:
            note(skipped, f"operator {case.operator}")
            continue
        yield Contender(
            case.work,
            case.unit,
            "terrakit",
            our_work(case, terrain, info),
            case.few(cells),
            case.many(cells),
            case.bytes_a_cell,
        )
    if not peers:
        return
    for package, made in PEERS.items():
        try:
            module = importlib.import_module(package)
        except (ImportError, SyntaxError):  # a dependency of it may be for newer Pythons
            note(skipped, package)
            continue
        yield from made(terrain, module)


def note(skipped: list[str], name: str) -> None:
    """Add what is missing, once."""
    if name not in skipped:
        skipped.append(name)


def our_work(case: Case, terrain: Heightfield, info: DeviceInfo) -> Work:
    """Return what runs a case's operator for so many units."""
    kind = default_registry().get(case.operator)
    cells = terrain.shape[0] * terrain.shape[1]

    def work(units: int) -> object:
        run = Run(seed=7, device=info)

        def stop(progress: Progress) -> None:
            if case.in_a_block and (progress.done + 1) * case.in_a_block >= units:
                run.finish_now()

        run.on_progress = stop
        operator = kind(**case.settings, **case.count(units, cells))
        result = execute(operator, terrain, run)
        if run.device is not None:
            run.device.finish()
        return result

    return work


def with_numpy(terrain: Heightfield, numpy: Any) -> Iterator[Contender]:
    """Textbook codes in plain NumPy."""
    height = terrain.elevation
    unit_ground = unit(height)
    drop = SPACING * numpy.tan(numpy.radians(33.0))
    several = max(1, 2**20 // height.size)
    by = "NumPy, textbook"
    yield Contender(
        "thermal", "sweep", by, lambda n: textbook.talus(height, drop, n), 0, 2 * several
    )
    yield Contender("grid water", "iteration", by, lambda n: textbook.pipes(height, n), 0, several)
    yield Contender(
        "droplets, 30 steps", "drop", by, lambda n: textbook.drops(unit_ground, n), 0, 8192
    )


def with_numba(terrain: Heightfield, numba: Any) -> Iterator[Contender]:
    """The same, compiled."""
    height = terrain.elevation
    unit_ground = unit(height)
    pipes, drops = textbook.compiled_pipes(numba), textbook.compiled_drops(numba)
    several = max(2, 4 * 2**20 // height.size)
    by = "numba, textbook"
    yield Contender("grid water", "iteration", by, lambda n: pipes(height, n), 1, 1 + several)
    yield Contender(
        "droplets, 30 steps", "drop", f"{by}, 1 thread", lambda n: drops(unit_ground, n), 1, 50_000
    )


def with_landlab(terrain: Heightfield, landlab: Any) -> Iterator[Contender]:
    """Explicit diffusion on four neighbours, and slopes with a limit."""
    components = importlib.import_module("landlab.components")
    grid = landlab.RasterModelGrid(terrain.shape, xy_spacing=terrain.spacing)
    height = grid.add_zeros("topographic__elevation", at="node")
    diffuser = components.LinearDiffuser(grid, linear_diffusivity=0.01)
    time_step = 0.2 * terrain.spacing**2 / 0.01

    def work(sweeps: int) -> object:
        height[:] = terrain.elevation.ravel()
        for _ in range(sweeps):
            diffuser.run_one_step(time_step)
        return height

    for name in ("thermal", "hillslope"):
        yield Contender(name, "sweep", "landlab LinearDiffuser", work, 1, 4)


def with_fastscapelib(terrain: Heightfield, fastscape: Any) -> Iterator[Contender]:
    """Implicit diffusion in alternating directions: one step may be a long one."""
    rows, cols = terrain.shape
    status = fastscape.NodeStatus.FIXED_VALUE
    grid = fastscape.RasterGrid([rows, cols], [terrain.spacing] * 2, status)
    eroder = fastscape.DiffusionADIEroder(grid, 0.01)

    def work(steps: int) -> object:
        height = terrain.elevation.astype(np.float64)
        for _ in range(steps):
            height -= eroder.erode(height, 1000.0)
        return height

    for name in ("thermal", "hillslope"):
        yield Contender(name, "sweep", "fastscapelib DiffusionADI", work, 1, 3)


def unit(height: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return heights from 0 to 60 samples, for codes that know no metres."""
    low, high = float(height.min()), float(height.max())
    return ((height - low) * (60.0 / max(high - low, 1e-6))).astype(np.float32)


PEERS: dict[str, Callable[[Heightfield, Any], Iterator[Contender]]] = {
    "numpy": with_numpy,
    "numba": with_numba,
    "landlab": with_landlab,
    "fastscapelib": with_fastscapelib,
}


if __name__ == "__main__":
    sys.exit(main())
