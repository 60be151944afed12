"""Shared by all tests: caches of their own, so that nobody's are read or filled."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep kernels and results in a folder of this session."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [n for n in os.environ if n.startswith("TERRAKIT_")]:
            patch.delenv(name)
        patch.setenv("TERRAKIT_CACHE_DIR", str(tmp_path_factory.mktemp("terrakit-cache")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c() -> None:
    """Let children be interrupted even where this session runs in the background of a shell."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
