"""The one way in which terrakit writes files: all of a file, or nothing.

A file is written beside its target under a hidden name, pushed to the disk and renamed. A run that
is killed leaves the old file or the new one; a temporary file that a dead process left behind is
removed by the next write to the same name.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from terrakit.errors import OutputError

LONGEST_NAME = 255
_unfinished: set[Path] = set()
"""Temporary files and folders that exist now, for whoever must end the process at once."""


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``target``, with its suffix, that becomes it on success.

    A symbolic link is followed: the file that it points to is replaced, the link stays.

    Raises
    ------
    OutputError
        If the place cannot be written, or the disk is full; nothing is left behind.
    """
    target = writable_target(target)
    for stale in _stale(target):
        with contextlib.suppress(OSError):
            stale.unlink()
    mark = f"{threading.get_native_id()}.{os.getpid()}.terrakit"
    temporary = target.with_name(f".{target.stem[:80]}.{mark}{target.suffix}")
    _unfinished.add(temporary)
    try:
        yield temporary
        with open(temporary, "rb+") as stream:
            os.fsync(stream.fileno())
        with contextlib.suppress(FileNotFoundError):
            os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
        os.replace(temporary, target)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise explain_os_error(error, target) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
        _unfinished.discard(temporary)


def discard_unfinished() -> None:
    """Remove every temporary file of this process: the last act before it ends at once."""
    for path in tuple(_unfinished):
        with contextlib.suppress(OSError):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()


def write_bytes(target: Path, content: bytes | memoryview) -> Path:
    """Write ``content`` to ``target`` whole, and return ``target``."""
    with atomic_path(target) as temporary, open(temporary, "wb") as stream:
        stream.write(content)
    return target


def write_text(target: Path, content: str) -> Path:
    """Write ``content`` as UTF-8 with newlines as they are, and return ``target``."""
    return write_bytes(target, content.encode())


@contextmanager
def staged_folder(target: Path) -> Iterator[Path]:
    """Yield an empty folder whose files move to the folder ``target`` together at the end.

    Exporters that write several files stage them here, so that an error or Ctrl-C in the middle
    leaves none of them.
    """
    folder = make_folder(target)
    for stale in _stale(folder / "stage"):
        shutil.rmtree(stale, ignore_errors=True)
    try:
        stage = Path(
            tempfile.mkdtemp(prefix=".stage.", suffix=f".{os.getpid()}.terrakit", dir=folder)
        )
    except OSError as error:
        raise explain_os_error(error, folder) from error
    _unfinished.add(stage)
    try:
        yield stage
        moves = []
        for path in sorted(p for p in stage.rglob("*") if p.is_file()):
            final = folder / path.relative_to(stage)
            make_folder(final.parent)
            with open(path, "rb+") as stream:
                os.fsync(stream.fileno())
            final = writable_target(final)
            with contextlib.suppress(FileNotFoundError):
                os.chmod(path, stat.S_IMODE(final.stat().st_mode))
            moves.append((path, final))
        for path, final in moves:  # all of it is on the disk: from here on it goes fast
            os.replace(path, final)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise explain_os_error(error, folder) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        _unfinished.discard(stage)


def make_folder(folder: Path) -> Path:
    """Create a folder and its parents.

    Raises
    ------
    OutputError
        If a file is in the way or the place is read-only.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise explain_os_error(error, folder) from error
    return folder


def writable_target(target: Path) -> Path:
    """Return the file to replace, with links followed, after checking that it may be written.

    Raises
    ------
    OutputError
        If the name is too long, the folder is missing or read-only, or the target is a folder,
        device or pipe.
    """
    if len(os.fsencode(target.name)) > LONGEST_NAME - 40:
        raise OutputError(f"{target.name[:40]}...: the name is too long; use at most 200 bytes")
    try:
        target = target.resolve() if target.is_symlink() else target
        if target.is_symlink():  # resolved and still a link, which older Pythons raise for
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        if target.exists() and not target.is_file():
            kind = "a folder" if target.is_dir() else "not a regular file"
            raise OutputError(f"{target}: is {kind}; name a file")
        if not target.parent.is_dir():
            raise OutputError(f"{target.parent}: no such folder; create it first")
        if not os.access(target.parent, os.W_OK):
            raise OutputError(f"{target.parent}: read-only; choose another folder with --out")
    except OutputError:
        raise
    except (OSError, RuntimeError) as error:
        raise explain_os_error(error, target) from error
    return target


def explain_os_error(error: OSError | RuntimeError, path: Path) -> OutputError:
    """Return an error of the operating system as one sentence about ``path``."""
    number = error.errno if isinstance(error, OSError) else None
    if number in (errno.ENOSPC, errno.EDQUOT):
        free = ""
        with contextlib.suppress(OSError):
            existing = next(p for p in (path, *path.parents) if p.exists())
            free = f" ({shutil.disk_usage(existing).free / 1e6:.0f} MB free)"
        return OutputError(f"{path}: no space left on the disk{free}; the old file is untouched")
    if number in (errno.EROFS, errno.EACCES, errno.EPERM):
        return OutputError(f"{path}: read-only; choose another place with --out")
    if number in (errno.EEXIST, errno.ENOTDIR):
        return OutputError(f"{path}: a file is in the way of a folder; choose another place")
    if number == errno.ENAMETOOLONG:
        return OutputError(f"{path.name[:40]}...: the name is too long; use at most 200 bytes")
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return OutputError(f"{path}: cannot be written ({reason})")


def _stale(target: Path) -> list[Path]:
    """Return temporary files beside ``target`` whose process is gone."""
    pattern = re.compile(r"^\..+\.(\d+)\.terrakit(\.[^.]*)?$")
    found = []
    try:
        for entry in os.scandir(target.parent):
            match = pattern.match(entry.name)
            mine = entry.name.startswith((f".{target.stem[:80]}.", ".stage."))
            if match and mine and not _alive(int(match[1])):
                found.append(Path(entry.path))
    except OSError:
        return []
    return found


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
