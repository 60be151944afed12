"""The folder in which PoCL keeps compiled kernels, checked before PoCL sees it.

PoCL aborts the whole process when an entry of its cache is damaged, and on a cache folder that it
cannot write. So terrakit gives it a folder of its own, records the digest of every file in it
after each build, and empties the folder when a recorded file no longer matches.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import shutil
import tempfile
import time
import warnings
from pathlib import Path

MANIFEST = "terrakit-manifest.json"
GRACE_SECONDS = 600.0
"""An unrecorded file younger than this may belong to a process that is compiling right now."""
SMALLEST_FREE_DISK = 64 * 2**20


def cache_home() -> Path:
    """Return terrakit's cache folder: ``TERRAKIT_CACHE_DIR``, or the platform's own place."""
    named = os.environ.get("TERRAKIT_CACHE_DIR")
    if named:
        return Path(named).expanduser()
    import platformdirs

    return Path(platformdirs.user_cache_dir("terrakit", appauthor=False))


def prepare() -> Path:
    """Return a kernel cache that is writable and whole, and point PoCL at it.

    Falls back to a private temporary folder, with a warning, where the cache folder cannot be
    written or its disk is nearly full.
    """
    folder = cache_home() / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, test = tempfile.mkstemp(dir=folder, prefix=".writable-")
        os.close(handle)
        os.unlink(test)
        if shutil.disk_usage(folder).free < SMALLEST_FREE_DISK:
            raise OSError(f"less than {SMALLEST_FREE_DISK >> 20} MB free")
    except (OSError, RuntimeError) as error:
        folder = Path(_temporary_cache(os.getpid()))
        reason = getattr(error, "strerror", None) or error
        warnings.warn(
            f"kernel cache {cache_home() / 'kernels'} cannot be used ({reason}); "
            f"kernels are compiled afresh in {folder}",
            stacklevel=2,
        )
    else:
        _drop_if_damaged(folder)
    os.environ["POCL_CACHE_DIR"] = str(folder)
    return folder


def seal(folder: Path) -> None:
    """Record the digest of every file that the cache holds now."""
    with contextlib.suppress(OSError):
        manifest = {
            str(path.relative_to(folder)): _digest(path)
            for path in sorted(folder.rglob("*"))
            if path.is_file() and not path.name.startswith((".", "terrakit-"))
        }
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=".manifest-")
        with os.fdopen(handle, "w") as stream:
            json.dump(manifest, stream)
        os.replace(temporary, folder / MANIFEST)


def clear() -> Path:
    """Delete every compiled kernel and return the emptied folder."""
    folder = cache_home() / "kernels"
    shutil.rmtree(folder, ignore_errors=True)
    return folder


@functools.cache
def _temporary_cache(pid: int) -> str:
    """Return the one folder that this process uses in place of the cache."""
    import atexit

    del pid

    folder = tempfile.mkdtemp(prefix="terrakit-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _drop_if_damaged(folder: Path) -> None:
    """Empty the cache if a recorded file changed, or if an old one was never recorded."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text())
        if not isinstance(manifest, dict):
            raise ValueError
    except (OSError, ValueError):
        manifest = {}
    newest_strange = time.time() - GRACE_SECONDS
    damaged = False
    seen = set()
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if not path.is_file() or path.name.startswith((".", "terrakit-")):
            continue
        seen.add(name)
        with contextlib.suppress(FileNotFoundError):
            if name in manifest:
                damaged = damaged or _digest(path) != manifest[name]
            else:
                damaged = damaged or path.stat().st_mtime < newest_strange
    if damaged or set(manifest) - seen:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)


def _digest(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
