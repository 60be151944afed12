"""How long work learns that its user asked to stop.

The run that is in charge of this thread (or task) installs a check; whatever takes long calls
:func:`check_cancelled` at least every half second. Outside a run nothing is installed and the call
does nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_check: ContextVar[Callable[[], None] | None] = ContextVar("terrakit_check", default=None)


def check_cancelled() -> None:
    """Raise :class:`~terrakit.errors.Cancelled` if the current run was asked to stop."""
    check = _check.get()
    if check is not None:
        check()


@contextmanager
def watched(check: Callable[[], None]) -> Iterator[None]:
    """Install ``check`` as the answer to :func:`check_cancelled` inside the block."""
    token = _check.set(check)
    try:
        yield
    finally:
        _check.reset(token)
