"""Measure a shipped recipe at full size, seed by seed, against the bands of real land.

python benchmarks/realism.py [recipe] [samples] [device]
"""

from __future__ import annotations

import sys
import time

import terrakit

SEEDS = (7, 1, 2, 3, 4)


def main(recipe: str = "alps", samples: str = "", device: str | None = None) -> int:
    settings = {"samples": int(samples)} if samples else {}
    columns, failed = [], 0
    for seed in SEEDS:
        started = time.perf_counter()
        result = terrakit.run(recipe, seed=seed, device=device, settings=settings, cache=False)
        made = time.perf_counter() - started
        assert isinstance(result.surface, terrakit.Heightfield)
        low, high = float(result.surface.elevation.min()), float(result.surface.elevation.max())
        analysis = terrakit.analyze(result.surface)
        columns.append(analysis.table())
        failed += analysis.count("fail")
        print(
            f"seed {seed}: {result.surface.shape[0]} samples at {result.surface.spacing:g} m, "
            f"{made:.1f} s, relief {high - low:.0f} m, "
            f"{analysis.verdict}",
            flush=True,
        )
    print("\n" + f"{'yardstick':18}" + "".join(f"{seed:>12}" for seed in SEEDS) + "   passes")
    for rows in zip(*columns, strict=True):
        marks = {"pass": "", "warn": " ?", "fail": " !", "not measured": " -"}
        cells = "".join(f"{row.value + marks[row.verdict]:>12}" for row in rows)
        print(f"{rows[0].name:18}{cells}   {rows[0].passes}")
    return failed


if __name__ == "__main__":
    sys.exit(bool(main(*sys.argv[1:])))
