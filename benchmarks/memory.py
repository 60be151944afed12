"""How much memory each erosion takes at its peak, beyond the terrain that it is given.

``python benchmarks/memory.py --samples 2048 --only thermal droplet``

Every operator runs in a process of its own, once on a small terrain (which loads and compiles what
it needs) and once on the large one. On a processor the device's buffers are part of the process, so
the peak of its resident memory holds them too. ``fields`` is what the operator declares, and what
the check before a run asks for: the measured number must not be above it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from typing import Any

CHILD = """
import json, resource, sys
import numpy as np
from terrakit import Grid, Run
from terrakit.execute import execute
from terrakit.registry import default_registry
from terrakit_generators.fractals.fbm import Fbm

name, settings, samples = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])
operator = default_registry().get(name)(**settings)


def resident(which):
    with open("/proc/self/status") as status:
        line = next(line for line in status if line.startswith(which))
    return int(line.split()[1]) * 1024


for side in (65, samples):
    run = Run(1)
    terrain = execute(Fbm(amplitude=600.0, wavelength=4000.0), Grid((side, side), 8.0), run)
    terrain.elevation
    with open("/proc/self/clear_refs", "w") as peak:
        peak.write("5")  # the peak so far is forgotten
    before = resident("VmRSS")
    execute(operator, terrain, Run(1))
print(json.dumps({"peak": resident("VmHWM") - before, "fields": operator.fields}))
"""

BRIEF: dict[str, dict[str, Any]] = {
    "automaton": {"iterations": 5},
    "droplet": {"drops_a_cell": 0.0625},
    "hillslope": {"duration": 1e3},
    "hydraulic": {"storm_duration": 0.02},
    "repeat": {"times": 2, "steps": [{"use": "thermal", "iterations": 5}]},
    "multiscale": {"steps": [{"use": "thermal", "iterations": 5}]},
    "stream_power": {"duration": 5e4},
    "thermal": {"iterations": 5},
    "weathering": {"duration": 1e3, "distance": 20.0},
    "wind": {"duration": 0.005},
}
"""Settings with which an operator takes all its memory in little time."""


def main() -> None:
    """Measure and print a table."""
    from terrakit.registry import default_registry

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=2048)
    parser.add_argument("--only", nargs="*", default=[])
    given = parser.parse_args()
    cells = given.samples**2
    print(f"{given.samples}x{given.samples} samples; a field is {4 * cells / 1e6:.0f} MB")
    print(f"{'operator':14} {'peak MB':>8} {'bytes/cell':>11} {'fields':>7} {'declared':>9}")
    for kind in default_registry().operators("erosion"):
        if given.only and kind.name not in given.only:
            continue
        settings = json.dumps(BRIEF.get(kind.name, {}))
        command = [sys.executable, "-c", CHILD, kind.name, settings, str(given.samples)]
        child = subprocess.run(command, capture_output=True, text=True, check=False)
        if child.returncode:
            print(f"{kind.name:14} {child.stderr.strip().splitlines()[-1][:100]}")
            continue
        found = json.loads(child.stdout)
        a_cell = found["peak"] / cells
        print(
            f"{kind.name:14} {found['peak'] / 1e6:8.0f} {a_cell:11.0f} {a_cell / 4:7.1f} "
            f"{found['fields']:9d}",
            flush=True,
        )


if __name__ == "__main__":
    main()
