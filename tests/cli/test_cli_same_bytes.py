"""The same recipe gives the same bytes, whatever the machine is set to."""

from __future__ import annotations

import hashlib
import json

import pytest

TEXT = """\
size = 2000.0
samples = 33
seed = 7
[[step]]
use = "fbm"
[[step]]
use = "thermal"
iterations = 4
[[step]]
use = "slope_height"
"""


@pytest.fixture(scope="module")
def steps():
    from terrakit.registry import default_registry

    return "".join(
        f'[[step]]\nuse = "{o.name}"\nfile = "{o.name}{o.suffix}"\n'  # type: ignore[attr-defined]
        for o in default_registry().operators("exporter")
    )


def digests(terrakit, out, **more):
    terrakit("run", "hills.toml", "--no-cache", "--out", out, **more).worked()
    folder = terrakit.folder / out
    return {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.iterdir())
        if p.name != "run.json"
    }


ENVIRONMENTS = {
    "C": {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "zone and hashes": {"TZ": "Asia/Kolkata", "PYTHONHASHSEED": "1"},
    "hash seed": {"PYTHONHASHSEED": "4242"},
    "decimal comma": {"LC_ALL": "de_DE.UTF-8", "LC_NUMERIC": "de_DE.UTF-8"},
    "narrow": {"COLUMNS": "20", "TERM": "dumb"},
    "one thread": {"POCL_MAX_PTHREAD_COUNT": "1"},
}


def test_every_file_is_the_same_everywhere(terrakit, steps):
    terrakit.recipe(TEXT + steps)
    expected = digests(terrakit, "first")
    assert len(expected) > 5
    for index, (name, environment) in enumerate(ENVIRONMENTS.items()):
        assert digests(terrakit, f"out{index}", env=environment) == expected, name
    record = json.loads((terrakit.folder / "first/run.json").read_text())
    assert {o["file"]: o["sha256"] for o in record["outputs"]} == expected


def test_device_and_numpy_agree(terrakit, steps):
    terrakit.recipe(TEXT + steps)
    outputs = []
    for device in ("numpy", "cpu"):
        done = terrakit("run", "hills.toml", "--no-cache", "--device", device, "--json").worked()
        outputs.append(json.loads(done.out)["outputs"])
    assert outputs[0] == outputs[1]


def test_two_processes_with_a_cold_cache(terrakit):
    terrakit.recipe(TEXT + '[[step]]\nuse = "npz"\n')
    cold = {"TERRAKIT_CACHE_DIR": str(terrakit.folder / "cold")}
    children = [
        terrakit.start("run", "hills.toml", "--out", out, env=cold)
        for out in ("a", "b", "same", "same")
    ]
    for child in children:
        child.communicate(timeout=120)
    assert [child.returncode for child in children] == [0, 0, 0, 0]
    contents = {(terrakit.folder / out / "hills.npz").read_bytes() for out in ("a", "b", "same")}
    assert len(contents) == 1
    assert {p.name for p in (terrakit.folder / "same").iterdir()} == {"hills.npz", "run.json"}


def test_colours_and_progress_on_a_terminal(terrakit):
    import os
    import pty

    terrakit.recipe(TEXT + '[[step]]\nuse = "npz"\n')
    main, other = pty.openpty()
    child = terrakit.start(
        "run",
        "hills.toml",
        "--device",
        "numpy",
        "--no-cache",
        stdout=other,
        stderr=other,
        env={"TERM": "xterm"},
    )
    os.close(other)
    said = b""
    while True:
        try:
            block = os.read(main, 4096)
        except OSError:
            break
        if not block:
            break
        said += block
    child.wait(60)
    os.close(main)
    assert child.returncode == 0, said
    assert b"hills/hills.npz" in said
    assert b"thermal" in said
