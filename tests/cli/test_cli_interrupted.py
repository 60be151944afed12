"""Ctrl-C and SIGTERM at any moment: soon, one line, 130 or 143, nothing half-written."""

from __future__ import annotations

import os
import signal
import subprocess
import time

import pytest

LONG = """\
size = 4000.0
samples = 257
seed = 7
[[step]]
use = "fbm"
[[step]]
use = "thermal"
iterations = 100000
[[step]]
use = "npz"
"""
ENOUGH = 15
"""Seconds in which even a loaded machine ends what should end in three."""


def interrupt(child, number=signal.SIGINT, code=130):
    child.send_signal(number)
    _, err = child.communicate(timeout=ENOUGH)
    lines = err.decode().splitlines()
    assert child.returncode == code, (child.returncode, lines)
    assert lines[-1] == "terrakit: interrupted; no half-written file is left"
    assert not [line for line in lines if "Traceback" in line or "error" in line], lines


def wait_for_line(child, beginning: bytes):
    for line in child.stderr:
        if line.startswith(beginning):
            return
    raise AssertionError("never said")


@pytest.mark.parametrize("device", ["numpy", "cpu"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_while_eroding(terrakit, device, number, code):
    terrakit.recipe(LONG)
    child = terrakit.start("run", "hills.toml", "--device", device, "--no-cache")
    wait_for_line(child, b"fbm")
    time.sleep(0.2)
    interrupt(child, number, code)
    assert [p.name for p in terrakit.folder.iterdir()] == ["hills.toml"]


@pytest.mark.parametrize("delay", [0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.3, 2.0])
def test_at_any_moment(terrakit, delay):
    terrakit.recipe(LONG)
    # The moment at which Python has started: before it there is no program to be polite
    terrakit.at_start("import os\nos.write(2, b'started\\n')")
    child = terrakit.start("run", "hills.toml", "--no-cache")
    wait_for_line(child, b"started")
    time.sleep(delay)
    interrupt(child, *((signal.SIGTERM, 143) if delay in (0.2, 0.9) else ()))
    assert sorted(p.name for p in terrakit.folder.iterdir()) == ["hills.toml", "site"]


STUBBORN = """
import time
from terrakit import Generator, hookimpl

class Stubborn(Generator):
    '''Never listen.'''
    name = "stubborn"
    def generate(self, grid, run):
        import os
        os.write(2, b"working\\n")
        {body}

@hookimpl
def terrakit_generators():
    return [Stubborn]
"""
SWALLOWS = r"exec('while True:\n try:\n  time.sleep(600)\n except BaseException:\n  pass')"


@pytest.mark.parametrize(
    "body",
    [
        "time.sleep(600)",
        SWALLOWS,
        "import hashlib; hashlib.pbkdf2_hmac('sha256', b'a', b'b', 10**10 % 2**31)",
    ],
    ids=["sleeps", "swallows", "is in C"],
)
def test_work_that_does_not_listen(terrakit, body):
    terrakit.plugin("tk-stubborn", STUBBORN.format(body=body))
    child = terrakit.start("generate", "stubborn", "a.npz", "--device", "numpy")
    wait_for_line(child, b"working")
    interrupt(child)
    assert not (terrakit.folder / "a.npz").exists()


def test_a_second_signal_ends_it_at_once(terrakit):
    terrakit.plugin(
        "tk-stubborn",
        STUBBORN.format(body=SWALLOWS),
    )
    child = terrakit.start("generate", "stubborn", "a.npz", "--device", "numpy")
    wait_for_line(child, b"working")
    child.send_signal(signal.SIGINT)
    time.sleep(0.4)
    interrupt(child)


def test_an_ignored_ctrl_c_stays_ignored(terrakit):
    terrakit.recipe()
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        child = terrakit.start("run", "hills.toml", "--device", "numpy", "--no-cache")
    finally:
        signal.signal(signal.SIGINT, previous)
    wait_for_line(child, b"device")
    child.send_signal(signal.SIGINT)
    child.communicate(timeout=ENOUGH * 2)
    assert child.returncode == 0


def test_signals_to_the_whole_group(terrakit):
    terrakit.recipe(LONG)
    child = terrakit.start("run", "hills.toml", "--no-cache", start_new_session=True)
    time.sleep(0.7)
    os.killpg(child.pid, signal.SIGINT)
    try:
        _, err = child.communicate(timeout=ENOUGH)
    except subprocess.TimeoutExpired:
        child.kill()
        raise
    assert child.returncode == 130
    assert b"warning" not in err
