"""The content-addressed cache: what a step made, found again by what it depends on."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from terrakit import atomic
from terrakit.compute.kernel_cache import cache_home
from terrakit.errors import OutputError
from terrakit.heightfield import Heightfield
from terrakit.mesh import Polygons, TriMesh
from terrakit.operators import Surface
from terrakit.strata import Strata

LARGEST_CACHE = 2 * 2**30
"""Bytes that the cache may hold; the results unused for longest go first."""


class ResultCache:
    """Results of earlier steps, one file each, under terrakit's cache folder.

    A result that cannot be read is a miss, and one that cannot be written is not kept: the cache
    never makes a run fail.
    """

    def __init__(self, folder: Path | None = None, largest: int = LARGEST_CACHE) -> None:
        self.folder = folder or cache_home() / "results"
        self.largest = largest

    def load(self, key: str) -> tuple[Surface, dict[str, Any]] | None:
        """Return the surface and ledger kept under ``key``, or None."""
        path = self._path(key)
        try:
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as kept:
                about = json.loads(str(kept["about"]))
                arrays = {name: kept[name] for name in kept.files if name != "about"}
            os.utime(path)
            return _rebuilt(about, arrays), about["ledger"]
        except Exception:  # a damaged zip raises anything, from KeyError to SyntaxError
            return None

    def store(self, key: str, surface: Surface, ledger: dict[str, Any]) -> None:
        """Keep a surface and the ledger of the step that made it."""
        about: dict[str, Any] = {"type": type(surface).__name__, "ledger": ledger}
        if surface.strata is not None:
            about["strata"] = surface.strata.to_dict()
        if isinstance(surface, Heightfield):
            about |= {"spacing": surface.spacing, "origin": surface.origin, "crs": surface.crs}
            arrays = {f"layer_{name}": surface.layer(name) for name in surface}
        else:
            about["up"] = surface.up
            arrays = {f"layer_{name}": surface.layer(name) for name in surface.layers}
            arrays |= {"vertices": surface.vertices, "faces": surface.faces}  # type: ignore[dict-item]
            if surface.polygons is not None:
                arrays["polygon_counts"] = surface.polygons.counts  # type: ignore[assignment]
                arrays["polygon_indices"] = surface.polygons.indices  # type: ignore[assignment]
        stream = io.BytesIO()
        np.savez(stream, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]
        content = stream.getbuffer()
        if content.nbytes > self.largest // 4:
            return
        with contextlib.suppress(OSError, OutputError):
            atomic.make_folder(self.folder)
            atomic.write_bytes(self._path(key), content)
            self._trim()

    def clear(self) -> Path:
        """Delete every kept result and return the emptied folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
        return self.folder

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"

    def _trim(self) -> None:
        entries = sorted(
            ((e.stat().st_mtime, e.stat().st_size, e.path) for e in os.scandir(self.folder)),
            reverse=True,
        )
        held = 0
        for _, size, path in entries:
            held += size
            if held > self.largest:
                with contextlib.suppress(OSError):
                    os.unlink(path)


def _rebuilt(about: dict[str, Any], arrays: dict[str, Any]) -> Surface:
    strata = Strata.from_dict(about.get("strata"))
    layers = {n.removeprefix("layer_"): a for n, a in arrays.items() if n.startswith("layer_")}
    if about["type"] == "Heightfield":
        elevation = layers.pop("elevation")
        return Heightfield(
            elevation, about["spacing"], tuple(about["origin"]), about["crs"], layers, strata
        )
    polygons = None
    if "polygon_counts" in arrays:
        polygons = Polygons(arrays["polygon_counts"], arrays["polygon_indices"])
    up: Any = about["up"] if isinstance(about["up"], str) else tuple(about["up"])
    return TriMesh(arrays["vertices"], arrays["faces"], layers, up, polygons, strata)
