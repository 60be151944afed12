"""A device that is open for work: its context, its queue, its programs and its memory.

Four rules of this module come from how OpenCL fails (measured, not assumed):

* the context remembers its process; after a fork OpenCL hangs for ever, so work is refused;
* long launches are cut into slices of at most :data:`SLICE_SECONDS`, and the queue is drained
  between them, so that Ctrl-C and cancel are answered in time;
* every kernel is compiled without contraction and with correctly rounded division and square
  root, so that its bytes equal those of the NumPy reference;
* global sizes are padded to whole work-groups; every kernel guards its own range.
"""

from __future__ import annotations

import functools
import os
import re
import threading
import time
import warnings
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from terrakit.compute import kernel_cache
from terrakit.compute.arrays import DeviceArray
from terrakit.compute.cancellation import check_cancelled
from terrakit.compute.discovery import DeviceInfo
from terrakit.errors import DeviceError, KernelError, ResourceError

if TYPE_CHECKING:
    import pyopencl as cl

SLICE_SECONDS = 0.15
"""The longest that the queue works without being asked whether to stop."""
FIRST_GUESS = 4e-7
"""Seconds a work-item takes, before the kernel has been timed; pessimistic on purpose."""
SHARED_SOURCE = Path(__file__).with_name("exact.cl")


class Device:
    """An open OpenCL device.

    Parameters
    ----------
    info
        The device, as :func:`~terrakit.compute.discovery.choose_device` returned it.
    work_group
        Work-items in a group, for tests; by default chosen for each launch.

    Raises
    ------
    DeviceError
        If the device is gone, or the process was forked after the device was opened.
    """

    def __init__(self, info: DeviceInfo, work_group: int | None = None) -> None:
        self.info = info
        self.work_group = work_group
        self._opened = _open(info, os.getpid())

    @property
    def name(self) -> str:
        """``platform: name``."""
        return self.info.label

    @property
    def is_cpu(self) -> bool:
        """Whether work-items run on processor cores: then a row each beats a cell each."""
        return self.info.kind == "cpu"

    def with_work_group(self, work_group: int) -> Device:
        """Return the same device with a fixed work-group size."""
        return Device(self.info, work_group)

    def empty(self, shape: tuple[int, ...] | int, dtype: DTypeLike = np.float32) -> DeviceArray:
        """Return an array whose values are not set."""
        opened = self._checked()
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        size = max(1, prod(shape) * np.dtype(dtype).itemsize)
        if size > self.info.largest_buffer:
            raise ResourceError(
                f"device {self.name}: one field of {'x'.join(map(str, shape))} takes "
                f"{size / 1e9:.2f} GB, the device allows {self.info.largest_buffer / 1e9:.2f} GB "
                "a buffer; use fewer samples or --device numpy"
            )
        return DeviceArray(self, opened.allocate(size), shape, dtype)

    def zeros(self, shape: tuple[int, ...] | int, dtype: DTypeLike = np.float32) -> DeviceArray:
        """Return an array of zeros."""
        return self.full(shape, 0, dtype)

    def full(
        self, shape: tuple[int, ...] | int, value: float, dtype: DTypeLike = np.float32
    ) -> DeviceArray:
        """Return an array that holds ``value`` everywhere."""
        array = self.empty(shape, dtype)
        self.fill(array, value)
        return array

    def fill(self, array: DeviceArray, value: float) -> None:
        """Set every element of ``array`` to ``value``."""
        import pyopencl as cl

        if array.size:
            opened = self._checked()
            pattern = np.array(value, dtype=array.dtype)
            with opened.lock:
                cl.enqueue_fill_buffer(opened.queue, array.buffer, pattern, 0, array.nbytes)

    def upload(self, values: NDArray[Any]) -> DeviceArray:
        """Return a copy of a host array on the device."""
        values = np.ascontiguousarray(values)
        array = self.empty(values.shape, values.dtype)
        self.write(array, values)
        return array

    def write(self, array: DeviceArray, values: NDArray[Any]) -> None:
        """Copy a C-contiguous host array of the same shape and type into ``array``."""
        import pyopencl as cl

        if array.size:
            opened = self._checked()
            with opened.lock:
                cl.enqueue_copy(opened.queue, array.buffer, values, is_blocking=True)

    def download(self, array: DeviceArray) -> NDArray[Any]:
        """Return a copy of a device array on the host."""
        import pyopencl as cl

        self.finish()
        values: NDArray[Any] = np.empty(array.shape, array.dtype)
        if array.size:
            opened = self._checked()
            with opened.lock:
                cl.enqueue_copy(opened.queue, values, array.buffer, is_blocking=True)
        return values

    def copy(self, source: DeviceArray, target: DeviceArray | None = None) -> DeviceArray:
        """Copy ``source`` to ``target``, or to a new array, on the device."""
        import pyopencl as cl

        target = self.empty(source.shape, source.dtype) if target is None else target
        if source.size:
            opened = self._checked()
            with opened.lock:
                cl.enqueue_copy(
                    opened.queue, target.buffer, source.buffer, byte_count=source.nbytes
                )
        return target

    def finish(self) -> None:
        """Wait until everything that was launched is done, then ask whether to stop."""
        self._checked().drain()
        check_cancelled()

    def program(
        self, anchor: str, file: str, defines: Mapping[str, object] | None = None
    ) -> Program:
        """Return the built program in ``file``, which lies beside the module ``anchor``.

        Parameters
        ----------
        anchor
            ``__file__`` of the calling module.
        file
            Name of the ``.cl`` file; ``exact.cl`` is put before it.
        defines
            Preprocessor definitions; each combination is built once.

        Raises
        ------
        KernelError
            If the source does not build; the message names the file and line.
        """
        path = Path(anchor).with_name(file)
        return self._program(path.name, path, defines)

    def program_from_source(
        self, name: str, source: str, defines: Mapping[str, object] | None = None
    ) -> Program:
        """Return the built program of a source text, for plugins that are one file.

        Parameters
        ----------
        name
            What messages call it.
        source
            The kernels; ``exact.cl`` is put before them.
        defines
            Preprocessor definitions; each combination is built once.

        Raises
        ------
        KernelError
            If the source does not build; the message names the line.
        """
        return self._program(name, source, defines)

    def _program(
        self, name: str, source: Path | str, defines: Mapping[str, object] | None
    ) -> Program:
        options = tuple(f"-D{key}={value}" for key, value in sorted((defines or {}).items()))
        opened = self._checked()
        with opened.lock:
            program = opened.programs.get((source, options))
            if program is None:
                text = source if isinstance(source, str) else source.read_text("utf-8")
                program = opened.programs[source, options] = opened.build(name, text, options)
        return Program(self, name.removesuffix(".cl"), program)

    def _checked(self) -> _Opened:
        if os.getpid() != self._opened.pid:
            raise DeviceError(
                f"device {self.name}: opened before this process was forked, where OpenCL hangs; "
                "start workers with multiprocessing's 'spawn' or 'forkserver'"
            )
        return self._opened


class Program:
    """The kernels of one ``.cl`` file, ready to launch."""

    def __init__(self, device: Device, stem: str, built: _Built) -> None:
        self.device = device
        self.stem = stem
        self._built = built

    @property
    def kernel_names(self) -> tuple[str, ...]:
        """Names of the kernels in the file."""
        return tuple(sorted(self._built.kernels))

    def launch(
        self,
        name: str,
        shape: tuple[int, ...] | int,
        *arguments: DeviceArray | np.generic,
        local: tuple[int, ...] | None = None,
    ) -> None:
        """Run a kernel once for every index of ``shape``.

        Parameters
        ----------
        name
            The kernel.
        shape
            Rows first, as for arrays; the last axis is ``get_global_id(0)``. It is padded to whole
            work-groups, so kernels must leave the work-items beyond their range idle.
        arguments
            Device arrays and NumPy scalars of exactly the kernel's types.
        local
            Work-group shape, in the order of ``shape``; by default long in the last axis.
        """
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        if prod(shape) == 0:
            return
        import pyopencl as cl

        opened = self.device._checked()
        kernel = self._built.kernels[name]
        group = self._group(shape, local)
        padded = tuple(-(-size // part) * part for size, part in zip(shape, group, strict=True))
        values = [a.buffer if isinstance(a, DeviceArray) else a for a in arguments]
        items_a_row = prod(padded[1:]) * group[0]
        timed = f"{name} {id(self._built)}"  # many programs call their kernel the same
        row, rows = 0, padded[0] // group[0]
        while row < rows:
            count = opened.slice_rows(timed, items_a_row, rows - row)
            with opened.lock:
                kernel.set_args(*values)
                cl.enqueue_nd_range_kernel(
                    opened.queue,
                    kernel,
                    tuple(reversed((count * group[0], *padded[1:]))),
                    tuple(reversed(group)),
                    tuple(reversed((row * group[0], *(0 for _ in padded[1:])))),
                )
            row += count
            if opened.launched(timed, count * items_a_row):
                self.device.finish()

    def _group(self, shape: tuple[int, ...], local: tuple[int, ...] | None) -> tuple[int, ...]:
        if self.device.work_group is not None:
            return (*(1 for _ in shape[1:]), self.device.work_group)
        if local is not None:
            return local
        longest = min(256, self.device.info.largest_work_group)
        width = 1 << max(0, shape[-1] - 1).bit_length()
        return (*(1 for _ in shape[1:]), min(longest, width))


class _Built:
    """A compiled program and its kernels, which are created once."""

    def __init__(self, program: cl.Program) -> None:
        self.program = program
        self.kernels = {kernel.function_name: kernel for kernel in program.all_kernels()}


class _Opened:
    """The context and queue of one device in one process, shared by all its users."""

    def __init__(self, info: DeviceInfo) -> None:
        os.environ["PYOPENCL_NO_CACHE"] = "1"  # PoCL and the GPU drivers keep caches of their own
        self.cache = kernel_cache.prepare()
        import pyopencl as cl

        self.info = info
        self.pid = os.getpid()
        self.lock = threading.RLock()
        self.programs: dict[tuple[Path | str, tuple[str, ...]], _Built] = {}
        try:
            self.context = cl.Context([_find(info)])
            self.queue = cl.CommandQueue(self.context)
        except cl.Error as error:
            raise DeviceError(
                f"device {info.label}: cannot be opened ({error}); see: terrakit doctor"
            ) from error
        self._seconds_an_item: dict[str, float] = {}
        self._pending: list[tuple[str, int]] = []
        self._since = 0.0
        self._expected = 0.0
        self._unsealed = False

    def allocate(self, size: int) -> Any:
        import pyopencl as cl

        try:
            return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size)
        except cl.Error as error:
            raise ResourceError(
                f"device {self.info.label}: no room for a buffer of {size / 1e6:.0f} MB "
                f"({error}); use fewer samples or --device numpy"
            ) from error

    def build(self, name: str, text: str, options: tuple[str, ...]) -> _Built:
        import pyopencl as cl

        flags = ["-cl-std=CL1.2", "-w", *options]
        if self.info.correctly_rounded:
            flags.append("-cl-fp32-correctly-rounded-divide-sqrt")
        if self.info.kind == "cpu":
            flags.append("-DTERRAKIT_CPU=1")
        shared = SHARED_SOURCE.read_text("utf-8")
        source = f'#line 1 "{SHARED_SOURCE.name}"\n{shared}\n#line 1 "{name}"\n{text}\n'
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                program = cl.Program(self.context, source).build(options=flags)
            except cl.RuntimeError as error:
                raise self._build_failure(name, str(error)) from None
        self._unsealed = True
        return _Built(program)

    def _build_failure(self, name: str, log: str) -> KernelError:
        lines = [line.strip() for line in log.splitlines() if line.strip()]
        first = next((line for line in lines if re.search(r"\berror\b", line)), lines[0])
        kept = self.cache / f"terrakit-build-{name.removesuffix('.cl')}.log"
        try:
            kept.write_text(log)
            where = f"; the whole log: {kept}"
        except OSError:
            where = ""
        return KernelError(f"{name} does not build on {self.info.label}: {first[:300]}{where}")

    def slice_rows(self, name: str, items_a_row: int, rows: int) -> int:
        """Return how many rows of work may be launched in one go."""
        seconds = self._seconds_an_item.get(name, FIRST_GUESS)
        return max(1, min(rows, int(SLICE_SECONDS / (seconds * items_a_row))))

    def launched(self, name: str, items: int) -> bool:
        """Note a launch; return whether the queue should be drained now."""
        if not self._pending:
            self._since = time.perf_counter()
            self._expected = 0.0
        self._pending.append((name, items))
        self._expected += self._seconds_an_item.get(name, FIRST_GUESS) * items
        return self._expected >= SLICE_SECONDS

    def drain(self) -> None:
        """Wait for the queue and learn from the time that it took."""
        with self.lock:
            self.queue.finish()
            if not self._pending:
                return
            taken = time.perf_counter() - self._since
            ratio = min(4.0, max(0.05, taken / self._expected))
            for kernel in {k for k, _ in self._pending}:
                known = self._seconds_an_item.get(kernel, FIRST_GUESS)
                self._seconds_an_item[kernel] = known * ratio
            self._pending.clear()
            if self._unsealed:
                self._unsealed = False
                kernel_cache.seal(self.cache)


@functools.lru_cache(maxsize=8)
def _open(info: DeviceInfo, pid: int) -> _Opened:
    """Open a device once a process; ``pid`` keeps a forked child from inheriting the entry."""
    if not info.is_opencl:
        raise DeviceError("the NumPy reference is not an OpenCL device")
    if _opened_in and pid not in _opened_in:
        raise DeviceError(
            "OpenCL was started before this process was forked, where it hangs; "
            "start workers with multiprocessing's 'spawn' or 'forkserver'"
        )
    opened = _Opened(info)
    _opened_in.add(pid)
    return opened


_opened_in: set[int] = set()


def _find(info: DeviceInfo) -> Any:
    import pyopencl as cl

    for platform in cl.get_platforms():
        for device in platform.get_devices():
            named = (" ".join(platform.name.split()), " ".join(device.name.split()))
            if named == (info.platform, info.name):
                return device
    raise DeviceError(f"device {info.label}: was there a moment ago and is gone")
