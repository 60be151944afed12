"""Ctrl-C and SIGTERM: one line, nothing left behind, and the end within three seconds.

The first signal asks the current work to stop; where nothing asks back, KeyboardInterrupt is raised
in the main thread. Work that neither answers nor returns (a library that swallows the exception,
or stays in C) is given up by a watchdog, which removes the temporary files and ends the process.
A second signal ends it at once.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

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
        self._arrived_at = 0.0
        self._insists = False
        self._cancel: Callable[[], None] | None = None
        self._said = False

    @property
    def happened(self) -> bool:
        """Whether a signal came."""
        return self._signal != 0

    def install(self) -> None:
        """Take over Ctrl-C and SIGTERM, unless the parent had them ignored."""
        for number in (signal.SIGINT, signal.SIGTERM):
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
        del frame
        now = time.monotonic()
        if self._insists:
            self._insists = False
            raise KeyboardInterrupt
        if self._signal:
            if now - self._arrived_at > ECHO_SECONDS:
                self._leave()
            return
        self._signal, self._arrived_at = number, now
        threading.Thread(target=self._watch, daemon=True).start()
        if self._cancel is None:
            raise KeyboardInterrupt
        self._cancel()

    def _watch(self) -> None:
        """Insist, then end the process."""
        import _thread

        time.sleep(PATIENCE_SECONDS)
        self._insists = True
        _thread.interrupt_main()
        time.sleep(LAST_SECONDS - PATIENCE_SECONDS)
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
