"""Ctrl-C and SIGTERM: one line, nothing left behind, and the end within three seconds.

Python runs signal handlers in the main thread only, between two of its instructions: never while a
library works in C, and not before a sleep ends that began just after the signal. So signals wake a
thread as well. The current work is asked to stop; where nothing asks back, KeyboardInterrupt is
raised in the main thread; and work that neither answers nor returns is given up: the thread removes
the temporary files and ends the process. A second signal ends it at once.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM)
PATIENCE_SECONDS = 0.8
"""How long work may take to stop by itself before KeyboardInterrupt is raised in it."""
LAST_SECONDS = 2.2
"""How long after the signal the process ends, whatever it is doing."""
ECHO_SECONDS = 0.2
"""Signals this close to the first are the same one, sent to the process and to its group."""


class Interruption:
    """The state of a process that may be asked to end."""

    def __init__(self) -> None:
        self._signal = 0
        self._insists = False
        self._cancel: Callable[[], None] | None = None
        self._said = False

    @property
    def happened(self) -> bool:
        """Whether a signal came."""
        return self._signal != 0

    def install(self) -> None:
        """Take over Ctrl-C and SIGTERM, unless the parent had them ignored."""
        if os.name == "posix":
            inlet, outlet = os.pipe()
            os.set_blocking(outlet, False)
            signal.set_wakeup_fd(outlet, warn_on_full_buffer=False)
            # What a forked child is sent is not for its parent
            os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))
            threading.Thread(target=self._watch, args=(inlet,), daemon=True).start()
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._arrived)
        sys.unraisablehook = _unraisable

    @contextlib.contextmanager
    def cancelling(self, cancel: Callable[[], None]) -> Iterator[None]:
        """Inside, a signal calls ``cancel`` first; the work stops itself at its next step."""
        self._cancel = cancel
        try:
            yield
        finally:
            self._cancel = None

    def end(self) -> NoReturn:
        """Say that the program was interrupted and end it."""
        import atexit

        self._say()
        with contextlib.suppress(Exception):
            atexit._run_exitfuncs()
        self._leave()

    def _arrived(self, number: int, frame: Any) -> None:
        """Stop the main thread, which is where Python calls this."""
        del frame
        self._signal = self._signal or number
        if self._cancel is None or self._insists:
            self._insists = False
            raise KeyboardInterrupt
        self._cancel()

    def _watch(self, inlet: int) -> None:
        """Wait for a signal; then cancel, insist, and at last end the process."""
        while (number := os.read(inlet, 1)[0]) not in SIGNALS:
            pass
        self._signal = self._signal or number
        began = time.monotonic()
        if self._cancel is not None:
            self._cancel()
        self._wait(inlet, began + PATIENCE_SECONDS)
        self._insists = True
        # The same signal again, to the main thread, which it reaches in a system call too
        signal.pthread_kill(threading.main_thread().ident or 0, self._signal)
        self._wait(inlet, began + LAST_SECONDS)
        self._leave()

    def _wait(self, inlet: int, until: float) -> None:
        """Wait until a time, or end the process if another signal comes."""
        time.sleep(ECHO_SECONDS)
        while select.select([inlet], [], [], 0)[0]:
            os.read(inlet, 1)
        while (left := until - time.monotonic()) > 0:
            if select.select([inlet], [], [], left)[0] and os.read(inlet, 1)[0] in SIGNALS:
                self._leave()

    def _leave(self) -> NoReturn:
        self._say()
        atomic = sys.modules.get("terrakit.atomic")
        if atomic is not None:
            atomic.discard_unfinished()
        with contextlib.suppress(Exception):
            sys.stdout.flush()
        os._exit(128 + self._signal)

    def _say(self) -> None:
        if not self._said:
            self._said = True
            with contextlib.suppress(OSError):
                os.write(2, b"terrakit: interrupted; no half-written file is left\n")


def _unraisable(problem: Any) -> None:
    """Keep quiet about an interruption that came while something was being finalised."""
    if not isinstance(problem.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(problem)


INTERRUPTION = Interruption()
