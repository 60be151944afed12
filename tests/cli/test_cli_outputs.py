"""Places that cannot be written, and what is left there: the old file or the new one."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from terrakit.registry import default_registry

EXPORTERS = {o.name: o.suffix for o in default_registry().operators("exporter")}  # type: ignore[attr-defined]
OLD = b"the old file"

exporters = pytest.mark.parametrize("suffix", EXPORTERS.values(), ids=EXPORTERS)


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@exporters
def test_exists(terrakit, terrain, suffix):
    target = terrakit.folder / f"hills{suffix}"
    target.write_bytes(OLD)
    target.chmod(0o640)
    terrakit("convert", terrain, target.name).worked()
    assert target.read_bytes() != OLD
    assert target.stat().st_mode & 0o777 == 0o640
    assert not [name for name in names(terrakit.folder) if name.startswith(".")]


@exporters
def test_disk_full(terrakit, terrain, tmpfs, suffix):
    place = tmpfs("8k")
    target = place / f"hills{suffix}"
    target.write_bytes(OLD)
    terrakit("convert", terrain, target).refused(str(place), "no space left", "MB")
    assert target.read_bytes() == OLD
    assert names(place) == [target.name]


@exporters
def test_read_only(terrakit, terrain, read_only, suffix):
    terrakit("convert", terrain, read_only / f"hills{suffix}").refused("read-only")
    assert names(read_only) == ["old.txt"]


@exporters
def test_kill_while_writing(terrakit, terrain, suffix):
    target = terrakit.folder / f"hills{suffix}"
    target.write_bytes(OLD)
    terrakit.at_start(
        """
        import os, signal
        def replace(*paths, **more):
            os.kill(os.getpid(), signal.SIGKILL)
        os.replace = os.rename = replace
        """
    )
    assert terrakit("convert", terrain, target.name).code == -9
    assert target.read_bytes() == OLD
    (terrakit.folder / "site/sitecustomize.py").unlink()
    terrakit("convert", terrain, target.name).worked()
    assert target.read_bytes() != OLD
    assert not [name for name in names(terrakit.folder) if name.startswith(".")]


@exporters
@pytest.mark.parametrize("signal", ["SIGINT", "SIGTERM"])
def test_interrupted_while_writing(terrakit, terrain, suffix, signal):
    target = terrakit.folder / f"hills{suffix}"
    target.write_bytes(OLD)
    terrakit.at_start(
        f"""
        import os, signal
        fsync = os.fsync
        def interrupted(*arguments):
            os.fsync = fsync
            os.kill(os.getpid(), signal.{signal})
            return fsync(*arguments)
        os.fsync = interrupted
        """
    )
    done = terrakit("convert", terrain, target.name)
    assert done.code == {"SIGINT": 130, "SIGTERM": 143}[signal]
    assert len(done.err.splitlines()) == 1
    assert not [name for name in names(terrakit.folder) if name.startswith(".")]


def test_run_on_a_full_disk_says_so_before_it_starts(terrakit, tmpfs):
    terrakit.recipe()
    place = tmpfs("8k")
    text = terrakit.recipe().read_text().replace("samples = 33", "samples = 1025")
    terrakit.recipe(text)
    outcome = terrakit("run", "hills.toml", "--out", place).refused("no space left", "needs", "MB")
    assert "device" not in outcome.err
    assert names(place) == []


def test_run_in_a_read_only_place(terrakit, read_only):
    terrakit.recipe()
    for out in (read_only, read_only / "new"):
        outcome = terrakit("run", "hills.toml", "--out", out).refused("read-only", "--out")
        assert "device" not in outcome.err


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("missing/a.npz", ["missing", "no such folder"]),
        ("folder", ["no extension"]),
        ("folder.npz", ["is a folder"]),
        ("a.xyz", [".xyz", "known", ".obj"]),
        ("a", ["no extension", ".obj"]),
        ("x" * 300 + ".npz", ["name is too long"]),
        ("pipe.npz", ["not a regular file"]),
        ("loop.npz", ["loop.npz"]),
        ("file.txt/a.npz", ["file.txt"]),
        ("/dev/full", ["no extension"]),
        ("full.npz", ["not a regular file"]),
    ],
)
def test_no_place_for_a_file(terrakit, target, words):
    for folder in ("folder", "folder.npz"):
        (terrakit.folder / folder).mkdir()
    os.mkfifo(terrakit.folder / "pipe.npz")
    (terrakit.folder / "loop.npz").symlink_to("loop.npz")
    (terrakit.folder / "full.npz").symlink_to("/dev/full")
    (terrakit.folder / "file.txt").write_text("text")
    before = names(terrakit.folder)
    outcome = terrakit("generate", "fbm", target, "--samples", "9").refused(*words)
    assert "device" not in outcome.err
    assert names(terrakit.folder) == before


@pytest.mark.parametrize("out", ["file.txt", "file.txt/sub", "x" * 300, "pipe"])
def test_no_place_for_a_run(terrakit, out):
    terrakit.recipe()
    (terrakit.folder / "file.txt").write_text("text")
    os.mkfifo(terrakit.folder / "pipe")
    outcome = terrakit("run", "hills.toml", "--out", out).refused()
    assert "device" not in outcome.err


@pytest.mark.parametrize(
    "name",
    [
        b"with blanks",
        b"qu'o\"te",
        b"new\nline",
        b"-dash",
        b"\xff\xfe",
        "Ünïcode".encode(),
        b"x" * 200,
        b"%s{0}$HOME",
    ],
)
def test_odd_names_work(terrakit, name):
    terrakit.recipe()
    recipe = os.path.join(os.fsencode(terrakit.folder), name + b".toml")
    os.rename(os.fsencode(terrakit.folder / "hills.toml"), recipe)
    done = terrakit("run", "--device", "numpy", "--", name + b".toml").worked()
    folder = os.path.join(os.fsencode(terrakit.folder), name)
    assert sorted(os.listdir(folder)) == sorted([name + b".npz", b"run.json"])
    assert len(done.out.splitlines()) == 2


def test_output_may_be_the_input(terrakit):
    terrakit("generate", "fbm", "a.npz", "--samples", "9", "--device", "numpy").worked()
    before = np.load(terrakit.folder / "a.npz")["elevation"]
    terrakit("convert", "a.npz", "a.npz").worked()
    assert np.array_equal(np.load(terrakit.folder / "a.npz")["elevation"], before)


def test_a_link_stays_and_its_file_is_replaced(terrakit):
    (terrakit.folder / "real.npz").write_bytes(OLD)
    (terrakit.folder / "a.npz").symlink_to("real.npz")
    terrakit("generate", "fbm", "a.npz", "--samples", "9", "--device", "numpy").worked()
    assert (terrakit.folder / "a.npz").is_symlink()
    assert (terrakit.folder / "real.npz").read_bytes() != OLD


@pytest.mark.parametrize("arguments", ["list", "--help", "validate --schema"])
def test_reader_of_stdout_goes_away(terrakit, arguments):
    line = f"{sys.executable} -m terrakit {arguments} | head -c 1"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_stdout_is_closed_or_full(terrakit):
    for redirection, codes in ((">&-", {0}), (">/dev/full", {2}), (">&- 2>&-", {0})):
        line = f"{sys.executable} -m terrakit list {redirection}"
        done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
        assert done.returncode in codes
        assert "Traceback" not in done.stderr
        assert len(done.stderr.splitlines()) <= 1
