"""What a third party copies works: installed as its own distribution, found, and tested."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TEMPLATE = Path(__file__).parents[2] / "plugins" / "template"


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install the template into a folder of its own, and return an environment that sees it."""
    if not TEMPLATE.is_dir():
        pytest.skip("tests run without the sources")
    pytest.importorskip("hatchling")
    target = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    subprocess.run([*command, "--target", str(target), str(TEMPLATE)], check=True)
    return {**os.environ, "PYTHONPATH": str(target)}


def test_plugin_is_found_and_named(environment: dict[str, str]) -> None:
    program = (
        "import json, terrakit.registry as r; o = r.default_registry().get('creep');"
        "print(json.dumps([o.name, r.default_registry().owner(o).label]))"
    )
    told = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, check=True
    )
    assert json.loads(told.stdout) == ["creep", "terrakit-creep 0.1.0"]


def test_its_own_tests_pass(environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    told = subprocess.run(
        command, cwd=TEMPLATE, env=environment, capture_output=True, text=True, encoding="utf-8"
    )
    assert told.returncode == 0, told.stdout + told.stderr
    assert "passed" in told.stdout
