"""``terrakit doctor``."""

from __future__ import annotations

import platform
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from terrakit.cli import options
from terrakit.cli.tables import write_json, write_table

if TYPE_CHECKING:
    from terrakit.compute import DeviceInfo

BANDWIDTH_BYTES = 64 * 2**20
CHECK_SHAPE = (33, 35)
CHECK_SPACING = 30.0
FORMULAS = ("fbm", "noise", "surfaces", "swiss", "terrace")
"""Operators that stand for all those that are formulas: sums, slopes, functions, layers."""


@options.command("doctor")
@click.option(
    "--clear-cache", is_flag=True, help="Only delete compiled kernels and earlier results."
)
@click.option("--all", "everything", is_flag=True, help="Check every operator that is a formula.")
@options.device_option
@options.json_option
def command(clear_cache: bool, everything: bool, device: str | None, as_json: bool) -> int:
    """Check devices, caches, and every operator's kernels against its reference.

    Operators that are formulas share one engine; without --all a few stand for all of them.

    Ends with 1 if a kernel fails or its result differs from the reference.
    """
    from terrakit.compute import kernel_cache
    from terrakit.compute.discovery import choose_device, discover
    from terrakit.results import ResultCache

    results = ResultCache()
    if clear_cache:
        cleared = [str(kernel_cache.clear()), str(results.clear())]
        if as_json:
            write_json({"cleared": cleared})
        else:
            click.echo("\n".join(f"cleared  {folder}" for folder in cleared))
        return 0
    found = discover()
    chosen = choose_device(device)
    report: dict[str, Any] = {
        "versions": _versions(),
        "devices": [
            {
                "name": info.label,
                "kind": info.kind,
                "version": info.version,
                "memory": info.memory,
                "exact_division": info.correctly_rounded,
                "used": info == chosen,
            }
            for info in found.devices
        ],
        "used": chosen.label,
        "why": _why(chosen, device),
        "problems": list(found.problems),
        "bandwidth": _bandwidth(chosen),
        "caches": [
            {"name": name, "folder": str(folder), "bytes": _size(folder)}
            for name, folder in (
                ("kernels", kernel_cache.cache_home() / "kernels"),
                ("results", results.folder),
            )
        ],
        "checks": _checks(chosen, everything),
    }
    if as_json:
        write_json(report)
    else:
        _write(report)
    failed = [check for check in report["checks"] if check["verdict"] in ("differs", "broken")]
    return 1 if failed else 0


def _versions() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    versions = {"python": platform.python_version()}
    for name in ("terrakit", "numpy", "pydantic", "pyopencl", "pocl-binary-distribution"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _why(chosen: DeviceInfo, asked: str | None) -> str:
    import os

    if asked:
        return f"--device {asked}"
    if os.environ.get("TERRAKIT_DEVICE"):
        return f"TERRAKIT_DEVICE = {os.environ['TERRAKIT_DEVICE']}"
    if not chosen.is_opencl:
        return "no OpenCL device works; this is the slow reference"
    return (
        f"the best that works: exact division first, then a gpu, then a cpu; it is a {chosen.kind}"
    )


def _bandwidth(chosen: DeviceInfo) -> float | None:
    """Return roughly how many bytes a second the device reads and writes."""
    if not chosen.is_opencl:
        return None
    from terrakit.compute import Device

    device = Device(chosen)
    source = device.zeros(BANDWIDTH_BYTES // 4)
    target = device.copy(source)
    device.finish()
    best = float("inf")
    for _ in range(3):
        started = time.perf_counter()
        device.copy(source, target)
        device.finish()
        best = min(best, time.perf_counter() - started)
    return 2 * BANDWIDTH_BYTES / best


def _checks(chosen: DeviceInfo, everything: bool) -> list[dict[str, str]]:
    """Run operators on the reference and on the device, and compare their bytes."""
    from terrakit.formula import FormulaFilter, FormulaGenerator
    from terrakit.heightfield import Grid, Heightfield
    from terrakit.mesh import TriMesh
    from terrakit.registry import default_registry

    checks = []
    for operator in default_registry().operators():
        is_formula = issubclass(operator, (FormulaGenerator, FormulaFilter))
        if is_formula and not everything and operator.name not in FORMULAS:
            continue
        if operator.kind == "generator":
            subjects: dict[str, Any] = {"grid": Grid(CHECK_SHAPE, CHECK_SPACING)}
        elif operator.kind in ("filter", "erosion", "texture"):
            terrain = _terrain([*operator.reads, *operator.uses])
            subjects = {"heightfield": terrain} if Heightfield in operator.surfaces else {}
            if TriMesh in operator.surfaces:
                subjects["mesh"] = terrain.to_mesh()
        else:
            continue
        for surface, subject in subjects.items():
            started = time.perf_counter()
            verdict, remark = _compare(operator, subject, chosen)
            checks.append(
                {
                    "operator": operator.name,
                    "surface": surface,
                    "verdict": verdict,
                    "remark": remark,
                    "seconds": f"{time.perf_counter() - started:.1f}",
                }
            )
    return checks


def _compare(operator: Any, subject: Any, chosen: DeviceInfo) -> tuple[str, str]:
    """Return ``same``, ``differs``, ``statistical`` or ``broken``, and what there is to say."""
    import numpy as np

    from terrakit.errors import Cancelled, ParameterError, TerrakitError
    from terrakit.execute import execute
    from terrakit.running import Run

    try:
        made = operator.from_settings(dict(operator.trial), operator.name)
    except ParameterError as error:
        return "not checked", str(error)
    try:
        expected, actual = (
            execute(made, subject, Run(1, d, sea_level=0.0)) for d in ("numpy", chosen)
        )
    except Cancelled:
        raise
    except TerrakitError as error:
        return "broken", str(error)
    if not chosen.is_opencl:
        return "works", "there is no device to compare with"
    if operator.parity != "exact":
        return "statistical", "need not be the same; see terrakit describe"
    for name in expected:
        want, got = expected.layer(name), actual.layer(name)
        if want.tobytes() != got.tobytes():
            worst = float(np.abs(want.astype(np.float64) - got).max())
            count = int((want != got).sum())
            return "differs", f"{name}: {count} of {want.size} values, by up to {worst:.3g}"
    if hasattr(expected, "vertices") and expected.vertices.tobytes() != actual.vertices.tobytes():
        return "differs", "vertices"
    return "same", ""


def _terrain(names: list[str]) -> Any:
    """Return a small mountain, with whichever layers, and beds, an operator reads."""
    import numpy as np

    from terrakit.heightfield import Heightfield
    from terrakit.strata import Bed, Strata

    rows, cols = CHECK_SHAPE
    row, col = np.mgrid[0:rows, 0:cols]
    height = 900 - 3 * (row - 15) ** 2 - 2 * (col - 17) ** 2 + (row * 37 + col * 101) % 53
    mask = ((row + col) % 16) / 16
    layers = {
        (name + "check" if name.endswith("_") else name): mask
        for name in names
        if name != "elevation"
    }
    beds = [Bed(material=name, thickness=9.0) for name in ("limestone", "shale")]
    strata = Strata(beds=tuple(beds), repeated=True) if "strata_datum" in layers else None
    return Heightfield(height.astype(np.float32), CHECK_SPACING, layers=layers, strata=strata)


def _size(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size if path.is_file() else 0
        except OSError:
            continue
    return total


def _write(report: dict[str, Any]) -> None:
    for name, version in report["versions"].items():
        click.echo(f"{name}  {version}")
    click.echo("")
    for device in report["devices"]:
        exact = "" if device["exact_division"] else ", division is not exact"
        click.echo(f"device  {device['name']}  ({device['kind']}{exact}, {device['version']})")
    click.echo(f"used  {report['used']}: {report['why']}")
    if report["bandwidth"]:
        click.echo(f"bandwidth  about {report['bandwidth'] / 1e9:.0f} GB/s")
    for problem in report["problems"]:
        click.echo(f"problem  {problem}")
    for cache in report["caches"]:
        click.echo(f"cache  {cache['name']}: {cache['folder']}  {cache['bytes'] / 1e6:.1f} MB")
    click.echo("")
    columns = ("operator", "surface", "verdict", "seconds", "remark")
    write_table(columns, [tuple(check[c] for c in columns) for check in report["checks"]])
