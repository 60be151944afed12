"""Runs a command line and turns whatever it raises into one line and an exit code."""

from __future__ import annotations

import errno
import os
import sys

import click

from terrakit.cli import messages
from terrakit.cli.commands import terrakit
from terrakit.cli.interruption import INTERRUPTION
from terrakit.errors import TerrakitError

INTERNAL_ERROR = 1
BROKEN_PIPE = 141


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code."""
    settings = messages.Settings()
    messages.install_warnings()
    if "_TERRAKIT_COMPLETE" in os.environ:
        terrakit.main(arguments, prog_name="terrakit")
    try:
        try:
            code = _invoke(arguments, settings)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except click.exceptions.Exit as end:
        return end.exit_code
    except (KeyboardInterrupt, click.Abort):
        return 130
    except BaseException as problem:
        return _report(problem, settings)
    return code


def _invoke(arguments: list[str], settings: messages.Settings) -> int:
    with terrakit.make_context("terrakit", arguments or ["--help"], obj=settings) as context:
        result = terrakit.invoke(context)
    return result if isinstance(result, int) else 0


def _report(problem: BaseException, settings: messages.Settings) -> int:
    """Say what went wrong and return the exit code."""
    if INTERRUPTION.happened:  # whatever it is, it came of the interruption
        return 130
    if isinstance(problem, BrokenPipeError) or getattr(problem, "errno", None) == errno.EPIPE:
        messages.close_output()
        return BROKEN_PIPE
    if settings.debug and not isinstance(problem, click.ClickException):
        import traceback

        traceback.print_exception(problem)
    cause = problem.__cause__ if isinstance(problem, TerrakitError) else problem
    if isinstance(cause, Warning):
        messages.error(f"{cause} (a warning; --strict makes it an error)")
        return 2
    if isinstance(problem, TerrakitError):
        messages.error(str(problem))
        return problem.exit_code
    if isinstance(problem, click.UsageError):
        where = f" (see: {problem.ctx.command_path} --help)" if problem.ctx else ""
        messages.error(problem.format_message().rstrip(".") + where)
        return problem.exit_code
    if isinstance(problem, click.ClickException):
        messages.error(problem.format_message())
        return 2
    if isinstance(problem, MemoryError):
        messages.error("out of memory; use fewer samples")
        return 2
    if isinstance(problem, OSError) and problem.errno == errno.ENOSPC:
        messages.close_output()
        messages.error("standard output: no space left")
        return 2
    if isinstance(problem, SystemExit):
        messages.error(f"internal error: something ended the program (exit {problem.code})")
        return INTERNAL_ERROR
    hint = "" if settings.debug else "; run with --debug"
    messages.error(f"internal error: {type(problem).__name__}: {problem}{hint}")
    return INTERNAL_ERROR
