"""Help and version answer before anything heavy is imported."""

from __future__ import annotations

import resource
import subprocess
import sys

import pytest

HEAVY = ("numpy", "pydantic", "pyopencl", "pxr", "rich", "PIL", "rasterio", "pluggy")
CPU_SECONDS = 0.3


@pytest.mark.parametrize("argument", ["--help", "--version"])
def test_imports_nothing_heavy(argument):
    child = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "terrakit", argument],
        capture_output=True,
        text=True,
        check=True,
    )
    imported = {
        line.rpartition("|")[2].strip().partition(".")[0]
        for line in child.stderr.splitlines()
        if line.startswith("import time:")
    }
    assert "click" in imported
    assert not imported & set(HEAVY)


def test_costs_little_cpu():
    def cost() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, "-m", "terrakit", "--help"], capture_output=True, check=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    assert min(cost() for _ in range(4)) < CPU_SECONDS


def test_help_names_every_command(terrakit):
    from terrakit.cli.commands import COMMANDS

    said = terrakit("--help").worked().out
    assert all(f"  {name}" in said for name in COMMANDS)


@pytest.mark.parametrize(
    "name",
    [
        "run",
        "validate",
        "generate",
        "filter",
        "erode",
        "texture",
        "convert",
        "preview",
        "info",
        "analyze",
        "list",
        "describe",
        "plugins",
        "doctor",
    ],
)
def test_every_command_has_help(terrakit, name):
    assert "Usage: terrakit" in terrakit(name, "--help").worked().out


def test_no_arguments_is_help(terrakit):
    assert "Commands:" in terrakit().worked().out


def test_console_script_exists():
    from importlib.metadata import entry_points

    (script,) = entry_points(group="console_scripts", name="terrakit")
    assert script.value == "terrakit.cli:main"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["erod"], ["no command 'erod'", "erode"]),
        (["run"], ["RECIPE"]),
        (["run", "x.toml", "--sed", "3"], ["--sed"]),
        (["run", "x.toml", "--set", "samples"], ["KEY=VALUE"]),
        (["run", "x.toml", "--max-cells", "0"], ["--max-cells", "0"]),
        (["generate", "fbn", "a.npz"], ["fbn", "did you mean fbm"]),
        (["describe", "thermel"], ["did you mean thermal"]),
        (["list", "widgets"], ["widgets", "generator"]),
        (["validate"], ["recipe", "--schema"]),
        (["erode", "thermal", "a.npz", "b.npz", "--scheme", "x"], ["--scheme", "proportional"]),
    ],
)
def test_usage_errors_are_one_line(terrakit, arguments, words):
    terrakit(*arguments).refused(*words)
