"""Another Python process with another hash seed, in which an operator is run once more.

Not ``multiprocessing``: that would run the caller's main script again.
"""

from __future__ import annotations

import atexit
import functools
import os
import pickle
import subprocess
import sys
from typing import Any

from terrakit.testing.trial import Trial, verb


def run_elsewhere(trial: Trial, operator: Any, subject: Any, seed: int) -> Any:
    """Return what ``operator`` makes of ``subject`` in the other process."""
    child = _child()
    assert child.stdin is not None
    assert child.stdout is not None
    try:
        pickle.dump((operator, subject, trial.device, trial.name, seed), child.stdin)
        child.stdin.flush()
        answer = pickle.load(child.stdout)
    except (EOFError, OSError, pickle.UnpicklingError) as error:
        _child.cache_clear()
        raise trial.broken(f"another process died of it: {error!r}") from error
    if isinstance(answer, str):
        raise trial.broken(f"another process cannot run it: {answer}")
    return answer


@functools.lru_cache(maxsize=1)
def _child() -> subprocess.Popen[bytes]:
    """Start one process for all operators."""
    hash_seed = "815" if os.environ.get("PYTHONHASHSEED") == "4711" else "4711"
    child = subprocess.Popen(
        [sys.executable, "-c", "from terrakit.testing.child import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={
            **os.environ,
            "PYTHONHASHSEED": hash_seed,
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        },
    )
    atexit.register(_end, child)
    return child


def _end(child: subprocess.Popen[bytes]) -> None:
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.close()
    child.stdout.close()
    child.wait(timeout=30)


def serve() -> None:
    """Answer requests on standard input until it ends."""
    from terrakit.execute import grid_under
    from terrakit.running import Run

    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what an operator prints must not get between the answers
    while True:
        try:
            operator, subject, device, step, seed = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            run = Run(seed, device).for_step(step)
            with run.watching(grid_under(subject)):
                answer = verb(operator)(subject, run)
            content = pickle.dumps(answer)
        except Exception as error:
            content = pickle.dumps(f"{type(error).__name__}: {error}")
        answers.write(content)
        answers.flush()
