"""Which OpenCL devices there are, and which one a run uses.

Devices are known by name, never by index: an index changes when a driver is installed.
"""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terrakit.compute import kernel_cache
from terrakit.errors import DeviceError

PROBE_SECONDS = 60.0
DEBUGGERS = ("oclgrind",)
"""Platforms that check kernels instead of running them fast: used only when named."""


@dataclass(frozen=True)
class DeviceInfo:
    """The facts about one device on which the choice depends; sizes in bytes."""

    name: str
    platform: str
    version: str
    kind: str
    memory: int
    largest_buffer: int
    compute_units: int
    largest_work_group: int
    correctly_rounded: bool

    @property
    def label(self) -> str:
        """``platform: name``, the text that ``--device`` is compared with."""
        return f"{self.platform}: {self.name}"

    @property
    def is_opencl(self) -> bool:
        """Whether kernels run on it; False for the NumPy reference."""
        return self.kind != "numpy"


NUMPY = DeviceInfo(
    name="numpy",
    platform="NumPy",
    version="",
    kind="numpy",
    memory=0,
    largest_buffer=0,
    compute_units=1,
    largest_work_group=1,
    correctly_rounded=True,
)
"""The reference implementation, chosen by the name ``numpy``."""


@dataclass(frozen=True)
class Discovery:
    """The devices that work and the reasons why others do not."""

    devices: tuple[DeviceInfo, ...]
    problems: tuple[str, ...]


@functools.lru_cache(maxsize=1)
def discover() -> Discovery:
    """Probe every OpenCL device in a child process, once a process of ours."""
    kernel_cache.prepare()
    devices: list[DeviceInfo] = []
    problems: list[str] = []
    skip: list[str] = []
    for _ in range(8):  # a device that kills its process is skipped in the next attempt
        answers, death = _probe(skip)
        devices = [DeviceInfo(**answer["device"]) for answer in answers if "device" in answer]
        problems += [f"{a['failed']}: {a['reason']}" for a in answers if "failed" in a]
        if death is None:
            break
        culprit = [answer["trying"] for answer in answers if "trying" in answer][-1:]
        name = culprit[0] if culprit else "OpenCL"
        problems.append(f"{name}: {death}")
        if ": " not in name:
            break
        skip.append(name)
    return Discovery(tuple(sorted(devices, key=_preference)), tuple(problems))


def available_devices() -> tuple[DeviceInfo, ...]:
    """Return the devices that ran a kernel, best first, then the NumPy reference."""
    return (*discover().devices, NUMPY)


def choose_device(name: str | None = None) -> DeviceInfo:
    """Return the device to use: the one named, or a GPU before a CPU before NumPy.

    Parameters
    ----------
    name
        Part of ``platform: device`` in any case, ``gpu``, ``cpu`` or ``numpy``. Without it the
        environment variable ``TERRAKIT_DEVICE`` is asked.

    Raises
    ------
    DeviceError
        If a device is named and none matches.
    """
    wanted = (name or os.environ.get("TERRAKIT_DEVICE") or "").strip().lower()
    if wanted == "numpy":
        return NUMPY
    devices = discover().devices
    if wanted:
        for device in devices:
            if wanted == device.kind or wanted in device.label.lower():
                return device
        known = ", ".join(device.label for device in available_devices())
        raise DeviceError(f"device {name or wanted!r}: no such device here; there are: {known}")
    usable = [d for d in devices if not d.platform.lower().startswith(DEBUGGERS)]
    if usable:
        return usable[0]
    reason = "; ".join(discover().problems) or "no OpenCL platform is installed"
    warnings.warn(
        f"no OpenCL device ({reason}); using the NumPy reference, which is slower. "
        "On Linux: pip install 'pyopencl[pocl]'",
        stacklevel=2,
    )
    return NUMPY


def _preference(device: DeviceInfo) -> tuple[bool, bool, int, int, str]:
    return (
        device.platform.lower().startswith(DEBUGGERS),
        not device.correctly_rounded,
        ("gpu", "accelerator", "cpu").index(device.kind),
        -device.compute_units,
        device.label,
    )


def _probe(skip: list[str]) -> tuple[list[dict[str, Any]], str | None]:
    """Run the probe; return its lines and, if it did not end well, how it died."""
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(p for p in sys.path if p))
    environment["PYOPENCL_NO_CACHE"] = "1"
    command = [sys.executable, str(Path(__file__).with_name("probe.py")), *skip]
    try:
        child = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PROBE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired as expired:
        return _lines(expired.stdout or b""), f"no answer in {PROBE_SECONDS:.0f} s"
    except OSError as error:
        return [], f"the probe cannot be started ({error.strerror})"
    answers = _lines(child.stdout)
    if any("done" in answer for answer in answers) or (child.returncode == 0 and answers):
        return answers, None
    last = child.stderr.decode(errors="replace").strip().splitlines()
    why = f"signal {-child.returncode}" if child.returncode < 0 else f"exit {child.returncode}"
    return answers, f"the probe died ({why}{': ' + last[-1][:200] if last else ''})"


def _lines(output: bytes) -> list[dict[str, Any]]:
    answers = []
    for line in output.decode(errors="replace").splitlines():
        try:
            answer = json.loads(line)
        except ValueError:
            continue
        if isinstance(answer, dict):
            answers.append(answer)
    return answers
