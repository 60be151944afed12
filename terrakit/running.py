"""What an operator is handed while it works: seed, device, progress, cancel and ledger."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from terrakit.compute.cancellation import watched
from terrakit.errors import Cancelled, ParameterError
from terrakit.ledger import Ledger

if TYPE_CHECKING:
    from terrakit.compute import Device, DeviceInfo
    from terrakit.operators import Surface
    from terrakit.parameters import Seed

PREVIEW_SECONDS = 0.5


@dataclass(frozen=True)
class Progress:
    """How far a step has come."""

    step: str
    done: int
    total: int
    elapsed: float

    @property
    def fraction(self) -> float:
        """Share of the step that is done, 0 to 1."""
        return self.done / self.total if self.total else 1.0


def seed_words(*parts: Seed) -> tuple[int, int]:
    """Return two 32-bit words for any integers and texts: the one mapping of seeds.

    The words are the first eight bytes of the BLAKE2b digest of the parts, each written as
    ``int:<decimal>`` or ``str:<text>`` and ended by a zero byte. So -1 and 2**32 - 1 differ, and
    so do 7 and "7".
    """
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        if isinstance(part, bool) or not isinstance(part, (int, str)):
            raise ParameterError(f"seed = {part!r}: must be an integer or text")
        digest.update(f"{'int' if isinstance(part, int) else 'str'}:{part}".encode() + b"\0")
    words = digest.digest()
    return int.from_bytes(words[:4], "little"), int.from_bytes(words[4:], "little")


class Run:
    """One run of one or more operators.

    Parameters
    ----------
    seed
        Any integer or text; everything random follows from it.
    device
        A device from :func:`terrakit.compute.choose_device`, its name, or None for the best.
        ``"numpy"`` runs the references.
    on_progress
        Called from the working thread whenever a step got further.
    on_preview
        Called now and then with a surface that is not finished yet.
    work_group
        Work-group size for tests.
    sea_level
        Height of the sea of this world, metres; None where there is none.
    """

    def __init__(
        self,
        seed: Seed = 0,
        device: DeviceInfo | str | None = None,
        on_progress: Callable[[Progress], None] | None = None,
        on_preview: Callable[[Surface], None] | None = None,
        work_group: int | None = None,
        sea_level: float | None = None,
    ) -> None:
        seed_words(seed)
        self.seed = seed
        self.on_progress = on_progress
        self.on_preview = on_preview
        self.sea_level = sea_level
        self.ledger = Ledger()
        self.step = ""
        self._device = device
        self._work_group = work_group
        self._opened: Device | None = None
        self._cancel = threading.Event()
        self._finish = threading.Event()
        self._started = time.perf_counter()
        self._previewed = 0.0

    @property
    def device_info(self) -> DeviceInfo:
        """The device that this run uses."""
        from terrakit.compute import DeviceInfo, choose_device

        if not isinstance(self._device, DeviceInfo):
            self._device = choose_device(self._device)
        return self._device

    @property
    def device(self) -> Device | None:
        """The open OpenCL device, or None where the NumPy reference is to be used."""
        from terrakit.compute import Device

        if self._opened is None and self.device_info.is_opencl:
            self._opened = Device(self.device_info, self._work_group)
        return self._opened

    def words(self, stream: str, seed: Seed = 0) -> tuple[int, int]:
        """Return the seed of one stream of random numbers, as two 32-bit words.

        Parameters
        ----------
        stream
            A constant name, usually the operator's; a new stream never shifts another.
        seed
            The operator's own ``seed`` parameter.
        """
        return seed_words(self.seed, stream, seed)

    def for_step(self, name: str) -> Run:
        """Return a run for one step: its own ledger and clock, the same seed, device and cancel."""
        child = object.__new__(Run)
        child.__dict__.update(self.__dict__)
        child.ledger = Ledger()
        child.step = name
        child._started = time.perf_counter()
        return child

    def steps(self, count: int) -> Iterator[int]:
        """Yield 0 to ``count - 1``: the one loop of every operator.

        It reports progress, raises :class:`~terrakit.errors.Cancelled` when asked to stop, and
        ends early when asked to finish with what is there.
        """
        for index in range(count):
            self.check()
            if self._finish.is_set():
                break
            self._report(index, count)
            yield index
        self._report(count, count)

    def check(self) -> None:
        """Raise :class:`~terrakit.errors.Cancelled` if the user asked to stop."""
        if self._cancel.is_set():
            raise Cancelled("cancelled; nothing was written")

    def cancel(self) -> None:
        """Ask the run to stop and give up what it has; may be called from any thread."""
        self._cancel.set()

    def finish_now(self) -> None:
        """Ask the run to stop and keep what it has; may be called from any thread."""
        self._finish.set()

    @property
    def is_finishing(self) -> bool:
        """Whether the run was asked to finish with what is there."""
        return self._finish.is_set()

    def watching(self) -> AbstractContextManager[None]:
        """Return a context in which long launches ask this run whether to stop."""
        return watched(self.check)

    def offer(self, make: Callable[[], Surface]) -> None:
        """Hand an unfinished surface to whoever watches; ``make`` is called only if needed."""
        now = time.perf_counter()
        if self.on_preview is not None and now - self._previewed >= PREVIEW_SECONDS:
            self._previewed = now
            self.on_preview(make())

    def _report(self, done: int, total: int) -> None:
        if self.on_progress is not None:
            elapsed = time.perf_counter() - self._started
            self.on_progress(Progress(self.step, done, total, elapsed))
