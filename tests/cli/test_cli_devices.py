"""Devices that are missing, unnamed, full, or whose cache is damaged."""

from __future__ import annotations

import json
import os
import textwrap

import pytest

NO_OPENCL = {"OCL_ICD_VENDORS": "/nonexistent", "POCL_DEVICES": None}


@pytest.fixture
def no_opencl(terrakit):
    """Make OpenCL find no platform at all."""
    terrakit.at_start(
        """
        import importlib.abc, sys
        class Absent(importlib.abc.MetaPathFinder):
            def find_spec(self, name, path=None, target=None):
                if name == "pyopencl":
                    raise ModuleNotFoundError("No module named 'pyopencl'", name=name)
        sys.meta_path.insert(0, Absent())
        """
    )
    return terrakit


def test_without_opencl_numpy_is_used_with_a_warning(no_opencl):
    no_opencl.recipe()
    done = no_opencl("run", "hills.toml").worked()
    warnings = [line for line in done.err.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "no OpenCL device" in warnings[0]
    assert "pip install" in warnings[0]
    no_opencl("run", "hills.toml", "--strict", "--out", "b").refused("no OpenCL device")
    no_opencl("run", "hills.toml", "--device", "gpu", "--out", "b").refused("'gpu'", "numpy")
    assert not (no_opencl.folder / "b").exists()
    report = json.loads(no_opencl("doctor", "--json").worked().out)
    assert report["used"] == "NumPy: numpy"
    assert report["problems"]


def test_a_device_must_exist(terrakit):
    terrakit.recipe()
    terrakit("run", "hills.toml", "--device", "quantum").refused("'quantum'", "NumPy: numpy")
    terrakit("run", "hills.toml", env={"TERRAKIT_DEVICE": "quantum"}).refused("'quantum'")


def test_the_device_is_named_and_recorded(terrakit):
    terrakit.recipe()
    done = terrakit(
        "run", "hills.toml", "--device", "cpu", "--json", env={"PYOPENCL_CTX": "nonsense"}
    ).worked()
    label = json.loads(done.out)["device"]["name"]
    assert f"device  {label}\n" in done.err
    assert done.err.count(label) == 1


KERNEL = """\
import os
import numpy as np
from pathlib import Path
from terrakit import Generator, Heightfield, hookimpl

class Kernel(Generator):
    '''Use the device in a way that cannot work.'''
    name = "kernel"
    def generate(self, grid, run):
        {body}

@hookimpl
def terrakit_generators():
    return [Kernel]
"""


def test_a_kernel_that_does_not_build(terrakit):
    terrakit.plugin("tkbad-x", KERNEL.format(body='run.device.program(__file__, "bad.cl")'))
    (terrakit.folder / "site/bad.cl").write_text("__kernel void f(__global float *a) { a[0] = x; }")
    outcome = terrakit("generate", "kernel", "a.npz", "--samples", "9", "-q")
    outcome.refused("bad.cl", "error", "undeclared", "log", code=1)
    log = outcome.err.strip().rpartition(": ")[2]
    assert os.path.isfile(log)


def test_a_buffer_larger_than_the_device_allows(terrakit):
    terrakit.plugin("tkbad-x", KERNEL.format(body="run.device.empty((1000000, 1000000))"))
    terrakit("generate", "kernel", "a.npz", "--samples", "9", "-q").refused(
        "4000.00 GB", "allows", "--device numpy"
    )


def test_doctor_says_that_a_kernel_is_broken(terrakit):
    terrakit.plugin("tkbad-x", KERNEL.format(body='run.device.program(__file__, "bad.cl")'))
    (terrakit.folder / "site/bad.cl").write_text("nonsense")
    done = terrakit("doctor", "--device", "cpu")
    assert done.code == 1
    assert "broken" in done.out


@pytest.fixture
def own_cache(terrakit):
    terrakit.environment["TERRAKIT_CACHE_DIR"] = str(terrakit.folder / "cache")
    terrakit.recipe()
    return terrakit


def test_a_damaged_kernel_cache_is_rebuilt(own_cache):
    run = ("run", "hills.toml", "--no-cache")
    own_cache(*run).worked()
    before = (own_cache.folder / "hills/hills.npz").read_bytes()
    compiled = [
        p
        for p in (own_cache.folder / "cache/kernels").rglob("*")
        if p.is_file() and p.name.endswith((".so", ".bc", "program.bc"))
    ]
    assert compiled
    for path in compiled:
        path.write_bytes(b"junk" * 100)
    own_cache(*run).worked()
    assert (own_cache.folder / "hills/hills.npz").read_bytes() == before


def test_doctor_clears_the_caches(own_cache):
    own_cache("run", "hills.toml").worked()
    assert list((own_cache.folder / "cache/results").iterdir())
    own_cache("doctor", "--clear-cache").worked()
    assert not (own_cache.folder / "cache/results").exists()
    assert "from the cache" not in own_cache("run", "hills.toml").worked().err


@pytest.mark.parametrize("place", ["file", "no home"])
def test_an_unwritable_cache_is_replaced_with_a_warning(terrakit, place):
    terrakit.recipe()
    (terrakit.folder / "file").write_text("in the way")
    if place == "file":
        changes = {"TERRAKIT_CACHE_DIR": str(terrakit.folder / "file")}
    else:
        changes = {"TERRAKIT_CACHE_DIR": None, "HOME": "/proc/none", "XDG_CACHE_HOME": None}
    done = terrakit("run", "hills.toml", env=changes).worked()
    warnings = [line for line in done.err.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "kernel cache" in warnings[0]
    terrakit("run", "hills.toml", "--device", "numpy", env=changes).worked()


def test_nowhere_to_put_a_cache(terrakit):
    terrakit.recipe()
    changes = {"TERRAKIT_CACHE_DIR": "/proc/none", "TMPDIR": "/proc/none"}
    done = terrakit("run", "hills.toml", env=changes)
    assert done.code in (0, 2)
    assert "Traceback" not in done.err
    assert len(done.err.splitlines()) <= 8


def script(terrakit, text, **more):
    """Run a Python script that uses the library."""
    import subprocess
    import sys

    path = terrakit.folder / "script.py"
    path.write_text(textwrap.dedent(text))
    return subprocess.run(
        [sys.executable, str(path)],
        cwd=terrakit.folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **more,
    )


def test_fork_after_the_start_is_an_error_not_a_hang(terrakit):
    done = script(
        terrakit,
        """
        import os, terrakit
        first = terrakit.generate("fbm", 9)
        child = os.fork()
        if child == 0:
            try:
                terrakit.generate("fbm", 9)
            except terrakit.DeviceError as error:
                print(error, flush=True)
                os._exit(7)
            os._exit(0)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        """,
    )
    assert done.stdout.splitlines()[-1] == "7"
    assert "spawn" in done.stdout


def test_spawn_and_threads_give_the_same_bytes(terrakit):
    done = script(
        terrakit,
        """
        import hashlib, multiprocessing, threading
        from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
        import terrakit

        def work(seed):
            terrain = terrakit.generate("fbm", 33, run=terrakit.Run(seed))
            terrain = terrakit.erode(terrain, "thermal", iterations=20)
            return hashlib.sha256(terrain.elevation.tobytes()).hexdigest()

        if __name__ == "__main__":
            expected = [work(seed) for seed in range(6)]
            with ThreadPoolExecutor(4) as pool:
                assert list(pool.map(work, range(6))) == expected
            spawn = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(2, mp_context=spawn) as pool:
                assert list(pool.map(work, range(6))) == expected
            print("same")
        """,
    )
    assert done.stdout.strip() == "same", done.stderr


def test_a_full_disk_under_the_cache_is_avoided_with_a_warning(terrakit, tmpfs):
    terrakit.recipe()
    done = terrakit("run", "hills.toml", env={"TERRAKIT_CACHE_DIR": str(tmpfs("64k"))}).worked()
    warnings = [line for line in done.err.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "MB free" in warnings[0]
