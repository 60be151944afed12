"""What is written is whole, and what cannot be read again is computed again."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from terrakit import Heightfield, OutputError
from terrakit.atomic import atomic_path, staged_folder, write_bytes, write_text
from terrakit.results import ResultCache
from terrakit.testing import difference, irregular_mesh, rough_terrain


def left_over(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*"))


def test_error_in_the_middle_keeps_the_old_file(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.txt", "old")

    def write() -> None:
        with atomic_path(target) as temporary:
            temporary.write_bytes(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write()
    assert target.read_bytes() == b"old"
    assert left_over(tmp_path) == ["a.txt"]


def test_link_is_followed_and_mode_is_kept(tmp_path: Path) -> None:
    real = write_text(tmp_path / "real.txt", "old")
    real.chmod(0o640)
    link = tmp_path / "link.txt"
    link.symlink_to(real)
    write_bytes(link, b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
    assert real.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("kind", ["folder", "pipe", "missing", "long"])
def test_places_that_cannot_be_written_are_refused(tmp_path: Path, kind: str) -> None:
    target = tmp_path / "x.bin"
    if kind == "folder":
        target.mkdir()
    elif kind == "pipe":
        os.mkfifo(target)
    elif kind == "missing":
        target = tmp_path / "no" / "x.bin"
    else:
        target = tmp_path / ("x" * 300)
    before = left_over(tmp_path)
    with pytest.raises(OutputError) as caught:
        write_bytes(target, b"x")
    assert "\n" not in str(caught.value)
    assert left_over(tmp_path) == before


def test_file_of_a_dead_process_is_swept_up(tmp_path: Path) -> None:
    stale = tmp_path / ".a.99999999.terrakit.txt"
    mine = tmp_path / f".a.{os.getpid()}.terrakit.bin"
    stale.write_bytes(b"")
    mine.write_bytes(b"")
    write_text(tmp_path / "a.txt", "x")
    assert left_over(tmp_path) == [mine.name, "a.txt"]


def test_staged_files_come_together_or_not_at_all(tmp_path: Path) -> None:
    def fail() -> None:
        with staged_folder(tmp_path) as stage:
            (stage / "one").write_bytes(b"1")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert left_over(tmp_path) == []
    with staged_folder(tmp_path) as stage:
        (stage / "one").write_bytes(b"1")
        (stage / "sub").mkdir()
        (stage / "sub" / "two").write_bytes(b"2")
    assert left_over(tmp_path) == ["one", "sub", "two"]


def test_staged_files_stay_out_when_one_cannot_be_placed(tmp_path: Path) -> None:
    (tmp_path / "two").mkdir()

    def write() -> None:
        with staged_folder(tmp_path) as stage:
            (stage / "one").write_bytes(b"1")
            (stage / "two").write_bytes(b"2")

    with pytest.raises(OutputError):
        write()
    assert left_over(tmp_path) == ["two"]


def test_cache_returns_what_was_stored(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path)
    terrain = Heightfield(
        np.arange(6.0).reshape(2, 3), 5.0, (1.5, 2.5), "EPSG:3857", {"rain": np.ones((2, 3))}
    )
    for surface in (terrain, irregular_mesh(7), rough_terrain((4, 4)).to_mesh()):
        assert cache.load("k") is None or surface is not terrain
        cache.store("k", surface, {"rock": {"moved": 1.0}})
        kept = cache.load("k")
        assert kept is not None
        assert difference(surface, kept[0]) == ""
        assert kept[1] == {"rock": {"moved": 1.0}}
        if isinstance(surface, Heightfield):
            assert kept[0].grid == surface.grid  # type: ignore[union-attr]


def test_damaged_entries_are_misses(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path)
    cache.store("k", rough_terrain((9, 9)), {})
    path = next(tmp_path.iterdir())
    whole = path.read_bytes()
    for cut in range(0, len(whole), max(1, len(whole) // 40)):
        path.write_bytes(whole[:cut])
        assert cache.load("k") is None
    for place in range(0, len(whole), max(1, len(whole) // 60)):
        spoilt = bytearray(whole)
        spoilt[place] ^= 0xFF
        path.write_bytes(bytes(spoilt))
        kept = cache.load("k")  # a miss, or a flip in padding that changes nothing
        assert kept is None or difference(kept[0], rough_terrain((9, 9))) == ""
    path.write_bytes(b"PK not a zip")
    assert cache.load("k") is None
    assert cache.load("never stored") is None


def test_cache_forgets_what_is_unused_longest(tmp_path: Path) -> None:
    cache = ResultCache(tmp_path, largest=60_000)
    for name in ("a", "b", "c", "d", "e", "f"):
        cache.store(name, rough_terrain((50, 50)), {})
        stamp = 1_000_000 + ord(name)
        if cache._path(name).exists():
            os.utime(cache._path(name), (stamp, stamp))
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 60_000
    assert cache.load("f") is not None
    assert cache.load("a") is None


def test_cache_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_bytes(b"")
    cache = ResultCache(blocked / "results")
    cache.store("k", rough_terrain((4, 4)), {})
    assert cache.load("k") is None
