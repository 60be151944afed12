"""Checks of importers and exporters: all of a file or nothing, the same bytes, the right corner."""

from __future__ import annotations

import hashlib
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from terrakit.errors import TerrakitError
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Exporter, Importer
from terrakit.registry import default_registry
from terrakit.running import Run
from terrakit.testing.subjects import CORNERS, compass_terrain, with_layers
from terrakit.testing.trial import NotApplicable, Trial, refusing

CUTS = 12
"""Places at which a file is cut short."""
SMALLEST_DISK = 64
"""Bytes after which the disk is full, for the check of failing writes."""

JUNK = {
    "nothing": b"",
    "one byte": b"\0",
    "zeros": bytes(4096),
    "text": b"this is no terrain\n" * 40,
    "a web page": b"<!doctype html><html><body>404</body></html>",
    "noise": bytes(np.random.default_rng(1).integers(0, 256, 4096, dtype=np.uint8)),
}


def writes_only_what_it_lists(trial: Trial) -> None:
    """It lists every file that it wrote, the main one first, all in the target's folder."""
    for kind, surface in _surfaces(trial):
        with _folder() as folder:
            inside = folder / "out"
            inside.mkdir()
            (inside / "bystander.txt").write_text("untouched", encoding="utf-8")
            (folder / "bystander.txt").write_text("untouched", encoding="utf-8")
            listed = _export(trial, surface, inside)
            if listed[0] != inside / _file_name(trial):
                raise trial.broken(f"lists {listed[0].name} before the main file of a {kind}")
            there = {p for p in folder.rglob("*") if p.is_file() and p.name != "bystander.txt"}
            if there != set(listed):
                odd = sorted(p.name for p in there ^ set(listed))
                raise trial.broken(f"files written and files listed differ by {', '.join(odd)}")
            for path in (inside, folder):
                if (path / "bystander.txt").read_text("utf-8") != "untouched":
                    raise trial.broken("changed a file that is not its own")


def same_surface_gives_same_files(trial: Trial) -> None:
    """Two exports of one surface, also over old files, have the same bytes."""
    for kind, surface in _surfaces(trial):
        with _folder() as first, _folder() as second:
            one = _hashes(_export(trial, surface, first))
            two = _hashes(_export(trial, surface, second))
            again = _hashes(_export(trial, surface, second))
            for name in one:
                if two.get(name) != one[name] or again.get(name) != one[name]:
                    raise trial.broken(f"{name} of the same {kind} has other bytes the second time")


def surface_survives_its_export(trial: Trial) -> None:
    """The surface that is written keeps its bytes."""
    for kind, surface in _surfaces(trial):
        before = {name: surface.layer(name).copy() for name in surface}
        with _folder() as folder:
            _export(trial, surface, folder)
        for name, values in before.items():
            if not np.array_equal(values, surface.layer(name)):
                raise trial.broken(f"changed {name} of the {kind} that it wrote")


def failing_write_leaves_nothing(trial: Trial) -> None:
    """On a full disk, or with a folder in its way, it raises one line and leaves what was."""
    for _, surface in _surfaces(trial):
        with _folder() as folder:
            target = folder / _file_name(trial)
            target.mkdir()
            with refusing(trial, "a folder in the place of its file"):
                _export(trial, surface, folder)
            _nothing_new(trial, folder, set(), "with a folder in the place of its file")
            target.rmdir()
            target.write_bytes(b"old")
            with refusing(trial, "a full disk"), _full_disk(trial):
                _export(trial, surface, folder)
            _nothing_new(trial, folder, {target}, "on a full disk")
            if target.read_bytes() != b"old":
                raise trial.broken("on a full disk it destroyed the file that was there")


def corners_come_back(trial: Trial) -> None:
    """A spike in each corner is in the same corner after a way through the importers."""
    trial.needs(Heightfield in trial.operator.surfaces, "writes meshes only")
    terrain = _ready(trial, compass_terrain())
    with _folder() as folder:
        path = _export(trial, terrain, folder)[0]
        try:
            importer = _importer_of(path)
            surface = importer.from_settings({}, path.name).load(path, Run())
        except TerrakitError as error:
            trial.needs(False, f"nothing here reads it back ({error})")
    if not isinstance(surface, Heightfield):
        raise NotApplicable(f"{trial.name}: comes back as a mesh")
    check_compass(surface, trial.name)


def check_compass(terrain: Heightfield, name: str = "importer") -> None:
    """Raise AssertionError unless the spikes of ``compass_terrain`` are in their corners.

    Only their order counts, so that formats which store no scale pass as well.
    """
    height = terrain.elevation
    found = {
        "north west": float(height[0, 0]),
        "north east": float(height[0, -1]),
        "south east": float(height[-1, -1]),
        "south west": float(height[-1, 0]),
    }
    order = sorted(found, key=lambda corner: -found[corner])
    if order != list(CORNERS):
        raise AssertionError(
            f"{name}: spikes come back highest first as {', '.join(order)}; "
            f"must be {', '.join(CORNERS)}"
        )


def junk_is_refused(trial: Trial) -> None:
    """What is not its format is not recognised, and raises one line where it is loaded anyway."""
    operator = trial.made()
    assert isinstance(operator, Importer)
    with _folder() as folder:
        for what, content in JUNK.items():
            path = folder / f"junk{operator.suffixes[0] if operator.suffixes else ''}"
            path.write_bytes(content)
            try:
                answer = operator.recognises(path, content[:4096])
            except Exception as error:
                raise trial.broken(
                    f"recognises() raises {type(error).__name__} on {what}: {error}"
                ) from error
            if not isinstance(answer, (bool, np.bool_)):
                raise trial.broken(f"recognises() returns a {type(answer).__name__}, not a bool")
            with refusing(trial, f"a file of {what}"), _quietly():
                operator.load(path, Run())
        with refusing(trial, "a file that is not there"), _quietly():
            operator.load(folder / "missing", Run())


def cut_files_are_refused(trial: Trial) -> None:
    """A file cut short raises one line or gives a valid terrain, never anything else."""
    operator = trial.made()
    assert isinstance(operator, Importer)
    samples = 0
    with _folder() as folder:
        for path in _samples(trial, folder):
            samples += 1
            content = path.read_bytes()
            for cut in range(CUTS):
                path.write_bytes(content[: len(content) * cut // CUTS])
                try:
                    with _quietly():
                        surface = operator.load(path, Run())
                except TerrakitError as error:
                    if "\n" in str(error):
                        raise trial.broken(
                            f"refuses a cut file in several lines: {error}"
                        ) from error
                except Exception as error:
                    raise trial.broken(
                        f"a file cut to {cut} of {CUTS} parts: {type(error).__name__}: {error}"
                    ) from error
                else:
                    if not isinstance(surface, (Heightfield, TriMesh)):
                        raise trial.broken(f"returned a {type(surface).__name__} for a cut file")
    trial.needs(samples > 0, "no exporter here writes a file that it recognises")


def same_file_gives_same_bytes(trial: Trial) -> None:
    """Loading a file twice gives the same surface and does not touch the file."""
    from terrakit.testing.trial import difference

    operator = trial.made()
    assert isinstance(operator, Importer)
    samples = 0
    with _folder() as folder:
        for path in _samples(trial, folder):
            samples += 1
            before = path.read_bytes()
            with _quietly():
                try:
                    first, second = operator.load(path, Run()), operator.load(path, Run())
                except TerrakitError:
                    continue
            gap = difference(first, second)
            if gap:
                raise trial.broken(f"the second loading of {path.suffix}: {gap}")
            if path.read_bytes() != before:
                raise trial.broken(f"wrote into the {path.suffix} file that it read")
    trial.needs(samples > 0, "no exporter here writes a file that it recognises")


def _surfaces(trial: Trial) -> Iterator[tuple[str, Any]]:
    for kind in trial.operator.surfaces:
        terrain = compass_terrain()
        surface = terrain.to_mesh() if kind is TriMesh else terrain
        yield kind.__name__, _ready(trial, surface)


def _ready(trial: Trial, surface: Any) -> Any:
    exporter = trial.operator
    assert issubclass(exporter, Exporter)
    trial.made().check(Grid((33, 33), 10.0))  # type: ignore[attr-defined]
    return with_layers(exporter, surface)


def _file_name(trial: Trial) -> str:
    return f"terrain{getattr(trial.operator, 'suffix', '')}"


def _export(trial: Trial, surface: Any, folder: Path) -> list[Path]:
    with _quietly():
        written = trial.apply((surface, folder / _file_name(trial)))
    if not isinstance(written, list) or not written:
        raise trial.broken(f"returned {written!r:.60}, must list its files")
    return [Path(path) for path in written]


def _hashes(paths: list[Path]) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def _nothing_new(trial: Trial, folder: Path, expected: set[Path], when: str) -> None:
    there = {path for path in folder.rglob("*") if path.is_file()}
    if there != expected:
        odd = ", ".join(sorted(path.name for path in there ^ expected))
        raise trial.broken(f"{when} it leaves or removes {odd}")


def _importer_of(path: Path) -> type[Importer]:
    from terrakit.api import importer_of

    return importer_of(path)


def _samples(trial: Trial, folder: Path) -> Iterator[Path]:
    """Yield a file of every exporter that the importer on trial recognises."""
    importer = trial.operator
    assert issubclass(importer, Importer)
    for exporter in default_registry().operators("exporter"):
        if Heightfield not in exporter.surfaces:
            continue
        other = Trial(exporter, exporter.trial)
        try:
            written = _export(other, _ready(other, compass_terrain()), folder)
        except (TerrakitError, AssertionError):
            continue  # its own checks tell
        for path in written:
            head = path.read_bytes()[:4096]
            if importer.recognises(path, head):
                yield path


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="terrakit-contract-") as name:
        yield Path(name)


@contextmanager
def _quietly() -> Iterator[None]:
    """Let an importer warn about what it reads."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def _full_disk(trial: Trial) -> Iterator[None]:
    """Make every write beyond a few bytes fail, for root too, as a full disk does."""
    try:
        import resource
    except ImportError:
        trial.needs(False, "this system cannot pretend that its disk is full")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (SMALLEST_DISK, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
