"""The command line: words and numbers in, messages out; no terrain is made here.

A command lives in the module of its name. Nothing heavy is imported before a command runs, so that
``terrakit --help`` answers at once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NoReturn

from terrakit.cli.interruption import INTERRUPTION

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and end the process.

    Exit codes: 0 done; 1 a plugin, a kernel or a verdict failed; 2 the input cannot be used;
    130 Ctrl-C; 143 SIGTERM.
    """
    INTERRUPTION.install()
    try:
        from terrakit.cli.program import run

        code = run(sys.argv[1:] if arguments is None else list(arguments))
    except BaseException:
        if not INTERRUPTION.happened:
            raise
        code = 0
    if INTERRUPTION.happened:
        INTERRUPTION.end()
    sys.exit(code)
