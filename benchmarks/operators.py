"""How fast the operators are, beside what the memory of the same device gives in the same run.

``python benchmarks/operators.py --samples 1025 2049``

Every round measures the bandwidth, then every case once; all figures are medians over rounds, after
one round to warm up. Where an operator repeats itself, two runs of different length are timed and
their difference is the time of a sweep or step, free of transfers and set-up; the column *call* is
the whole of the shorter run, with them.

The floor is ``bytes a cell x cells / bandwidth``. Bytes are compulsory traffic, stated below: each
field that a pass needs is read once and written once, neighbours come from the cache for nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrakit.compute import Device, DeviceInfo, available_devices, choose_device
from terrakit.execute import execute
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Operator
from terrakit.registry import default_registry
from terrakit.running import Run

SPACING = 20.0
BANDWIDTH_FLOATS = 2**25
"""Elements of each array of the bandwidth kernels: 128 MiB, beyond most caches."""
RUN_ON_CPU = 2**14


@dataclass(frozen=True)
class Case:
    """One operator at work, and what it has to move through memory."""

    name: str
    operator: str
    settings: dict[str, Any]
    unit: str
    bytes_a_cell: float
    model: str
    """Where the bytes come from."""
    repeats: tuple[str, float, int, int] | None = None
    """The parameter that counts repeats, what it is per repeat, and how often: few and many."""
    on_host: bool = False
    """Whether it is NumPy whatever the device."""


CREEP_SWEEPS = 10
CASES = (
    Case("fbm, 8 octaves", "fbm", {"octaves": 8}, "call", 4, "elevation written: 4"),
    Case(
        "thermal, flux",
        "thermal",
        {"scheme": "flux"},
        "sweep",
        8,
        "height read and written: 4 + 4",
        ("iterations", 1, 20, 60),
    ),
    Case(
        "thermal, proportional",
        "thermal",
        {"scheme": "proportional"},
        "sweep",
        20,
        "weigh: height 4, weight 4; share: height 4, weight 4, height 4",
        ("iterations", 1, 10, 30),
    ),
    Case(
        "stream_power, no creep",
        "stream_power",
        {"diffusivity": 0.0, "time_step": 2.5e4},
        "step",
        139,
        "receivers 9, pits 8, chains 16, passes 8, donors 9, area 14, main donors 12, heads 26, "
        "incision 37 (receiver 4, donor 4, area 4, outlet 1, height 4 + 4, incised 8 + 8)",
        ("duration", 2.5e4, 2, 5),
    ),
    Case(
        "stream_power, creep",
        "stream_power",
        {"diffusivity": 0.02, "time_step": 2.5e4},
        "step",
        139 + 9 * CREEP_SWEEPS,
        f"as above, and {CREEP_SWEEPS} sweeps of height 4 + 4 and outlet 1",
        ("duration", 2.5e4, 2, 5),
    ),
    Case(
        "slope_height",
        "slope_height",
        {},
        "call",
        36,
        "elevation read 4, five weights and three colours written 32",
        on_host=True,
    ),
)


@dataclass(frozen=True)
class Measured:
    """The medians of one case on one device at one size."""

    case: str
    device: str
    samples: int
    unit: str
    seconds: float
    call_seconds: float
    cells_a_second: float
    bytes_a_cell: float
    bandwidth: float
    floor_seconds: float
    times_floor: float


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description="Measure the operators against the memory.")
    parser.add_argument("--samples", type=int, nargs="+", default=[1025], help="a side")
    parser.add_argument("--device", action="append", help="a name; by default the best device")
    parser.add_argument("--all-devices", action="store_true", help="every OpenCL device")
    parser.add_argument("--runs", type=int, default=5, help="rounds after the warm-up")
    parser.add_argument("--only", action="append", help="cases whose name holds this")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument("--models", action="store_true", help="print the byte models and end")
    chosen = parser.parse_args()
    if chosen.models:
        print_table(
            ("case", "bytes a cell", "from"),
            [(c.name, f"{c.bytes_a_cell:g}", c.model) for c in CASES],
        )
        return
    devices = [choose_device(name) for name in chosen.device or [None]]
    if chosen.all_devices:
        devices = [device for device in available_devices() if device.is_opencl]
    cases = [c for c in CASES if not chosen.only or any(word in c.name for word in chosen.only)]

    load = os.getloadavg()[0]
    measured = [
        result
        for device in devices
        for samples in chosen.samples
        for result in measure(device, samples, cases, chosen.runs)
    ]
    print(f"load average {load:.1f} on {os.cpu_count()} cores, {chosen.runs} rounds\n")
    print_table(
        (
            "case",
            "device",
            "side",
            "ms",
            "per",
            "Mcells/s",
            "call s",
            "B/cell",
            "GB/s",
            "x floor",
        ),
        [
            (
                row.case,
                row.device.partition(": ")[2],
                row.samples,
                f"{1e3 * row.seconds:.2f}",
                row.unit,
                f"{row.cells_a_second / 1e6:.1f}",
                f"{row.call_seconds:.3f}",
                f"{row.bytes_a_cell:g}",
                f"{row.bandwidth / 1e9:.1f}",
                f"{row.times_floor:.1f}",
            )
            for row in measured
        ],
    )
    if chosen.json:
        document = {"load": load, "rounds": chosen.runs, "results": [asdict(m) for m in measured]}
        chosen.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def measure(info: DeviceInfo, samples: int, cases: list[Case], runs: int) -> Iterator[Measured]:
    """Yield the figures of every case on one device at one size."""
    terrain = ground(samples)
    bandwidth = Bandwidth(info)
    wanted = [case for case in cases if not (case.on_host and info.is_opencl)]
    bandwidths: list[float] = []
    seconds: dict[str, list[float]] = {case.name: [] for case in wanted}
    calls: dict[str, list[float]] = {case.name: [] for case in wanted}
    floors: dict[str, list[float]] = {case.name: [] for case in wanted}
    for turn in range(runs + 1):
        speed = bandwidth.measure()
        for case in wanted:
            one, whole = time_case(case, info, terrain)
            if turn:
                seconds[case.name].append(one)
                calls[case.name].append(whole)
                floors[case.name].append(case.bytes_a_cell * samples**2 / speed)
        if turn:
            bandwidths.append(speed)
    for case in wanted:
        taken = statistics.median(seconds[case.name])
        floor = statistics.median(floors[case.name])
        pairs = zip(seconds[case.name], floors[case.name], strict=True)
        yield Measured(
            case.name,
            info.label,
            samples,
            case.unit,
            taken,
            statistics.median(calls[case.name]),
            samples**2 / taken,
            case.bytes_a_cell,
            statistics.median(bandwidths),
            floor,
            statistics.median(one / least for one, least in pairs),
        )


def time_case(case: Case, info: DeviceInfo, terrain: Heightfield) -> tuple[float, float]:
    """Return the seconds of one unit of work, and those of a whole call."""
    if case.repeats is None:
        whole = timed(lambda: work(case, case.settings, info, terrain))
        return whole, whole
    parameter, amount, few, many = case.repeats
    as_given = int if isinstance(amount, int) else float
    short, long = (
        timed(
            lambda n=n: work(  # type: ignore[misc]
                case, case.settings | {parameter: as_given(n * amount)}, info, terrain
            )
        )
        for n in (few, many)
    )
    return max(long - short, 1e-9) / (many - few), short


def work(case: Case, settings: dict[str, Any], info: DeviceInfo, terrain: Heightfield) -> None:
    """Do it once; what is left in a queue is waited for."""
    run = Run(seed=7, device=info)
    kind = default_registry().get(case.operator)
    operator: Operator = kind(**settings)
    subject = terrain.grid if kind.kind == "generator" else terrain
    execute(operator, subject, run)
    if run.device is not None:
        run.device.finish()


def ground(samples: int) -> Heightfield:
    """Return the terrain that everything works on, the same on every device."""
    kind = default_registry().get("fbm")
    grid = Grid((samples, samples), SPACING)
    terrain: Heightfield = execute(kind(octaves=8, amplitude=1500.0), grid, Run(seed=7))
    return Heightfield(terrain.elevation, SPACING)


class Bandwidth:
    """Bytes a second that the memory of a device gives: the better of triad and in-place scale."""

    def __init__(self, info: DeviceInfo) -> None:
        self.device = Device(info) if info.is_opencl else None
        if self.device is None:
            self.arrays: list[Any] = [np.ones(BANDWIDTH_FLOATS, np.float32) for _ in range(3)]
        else:
            self.arrays = [self.device.full(BANDWIDTH_FLOATS, 1.0) for _ in range(3)]

    def measure(self) -> float:
        """Return bytes a second, write-allocation not counted."""
        triad = min(timed(self._triad) for _ in range(3))
        scale = min(timed(self._scale) for _ in range(3))
        return max(12 * BANDWIDTH_FLOATS / triad, 8 * BANDWIDTH_FLOATS / scale)

    def _triad(self) -> None:
        a, b, c = self.arrays
        if self.device is None:
            np.add(b, c, out=a)
        else:
            self._launch("bandwidth_triad", a, b, c)

    def _scale(self) -> None:
        if self.device is None:
            np.multiply(self.arrays[0], np.float32(1), out=self.arrays[0])
        else:
            self._launch("bandwidth_scale", self.arrays[0])

    def _launch(self, kernel: str, *arrays: Any) -> None:
        assert self.device is not None
        run = RUN_ON_CPU if self.device.is_cpu else 1
        self.device.program(__file__, "bandwidth.cl").launch(
            kernel,
            -(-BANDWIDTH_FLOATS // run),
            *arrays,
            np.float32(1),
            np.int32(run),
            np.int32(BANDWIDTH_FLOATS),
            local=(8,) if self.device.is_cpu else None,
        )
        self.device.finish()


def timed(action: Callable[[], object]) -> float:
    """Return the seconds that ``action`` takes."""
    started = time.perf_counter()
    action()
    return time.perf_counter() - started


def print_table(head: tuple[str, ...], rows: list[tuple[object, ...]]) -> None:
    """Print a Markdown table."""
    for cells in (head, ["---"] * len(head), *rows):
        print(f"| {' | '.join(str(cell) for cell in cells)} |")


if __name__ == "__main__":
    sys.exit(main())
