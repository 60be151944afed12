"""A surface as the arrays of a USD mesh, in float32 near its own origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Surface

Vectors = NDArray[np.float32]
Indices = NDArray[np.int32]

FAR = 4.0
"""Coordinates beyond this many times the extent would waste the digits of float32."""


@dataclass(frozen=True)
class Geometry:
    """Arrays as USD wants them; adding ``shift`` to ``points`` gives world coordinates."""

    points: Vectors
    counts: Indices
    indices: Indices
    shift: tuple[float, float, float]
    st: Vectors | None
    normals: Vectors | None

    def y_up(self) -> Geometry:
        """Return the same with +y up and -z north, by a turn about x."""
        x, y, z = self.shift
        return Geometry(
            _turned(self.points),
            self.counts,
            self.indices,
            (x, z, -y if y else 0.0),
            self.st,
            None if self.normals is None else _turned(self.normals),
        )


def geometry_of(surface: Surface, normals: bool, local: bool = False) -> Geometry:
    """Return the geometry of a surface with +z up.

    Faces are counter-clockwise seen from above: a quad for every cell of a heightfield, and the
    polygons that a mesh came with. Texture coordinates run from the south-west (0, 0) to the
    north-east (1, 1); a planet has none.

    Parameters
    ----------
    surface
        A heightfield or a mesh.
    normals
        Whether to compute smooth normals.
    local
        Whether to move the lowest corner to the origin even if float32 does not ask for it.

    Raises
    ------
    InputError
        If a heightfield has a single row or column.
    """
    if isinstance(surface, Heightfield):
        return _of_heightfield(surface, normals, local)
    return _of_mesh(surface, normals, local)


def _of_heightfield(terrain: Heightfield, normals: bool, local: bool) -> Geometry:
    rows, cols = terrain.shape
    if rows < 2 or cols < 2:
        raise InputError(f"terrain {rows}x{cols}: a mesh needs at least 2x2 samples")

    # Place the samples: column to the east, row to the south
    west, north = terrain.origin
    width, height = terrain.grid.size
    low = np.array([west, north - height])
    high = np.array([west + width, north])
    shift = _shift(low, high, local)
    points = np.empty((rows, cols, 3), dtype=np.float32)
    points[..., 0] = west - shift[0] + np.arange(cols) * terrain.spacing
    points[..., 1] = (north - shift[1] - np.arange(rows) * terrain.spacing)[:, None]
    points[..., 2] = terrain.elevation

    # One quad a cell: north-west, south-west, south-east, north-east
    corner = np.arange(rows - 1, dtype=np.int32)[:, None] * np.int32(cols) + np.arange(
        cols - 1, dtype=np.int32
    )
    quads = np.empty((rows - 1, cols - 1, 4), dtype=np.int32)
    for place, offset in enumerate((0, cols, cols + 1, 1)):
        quads[..., place] = corner + np.int32(offset)

    st = np.empty((rows, cols, 2), dtype=np.float32)
    st[..., 0] = np.linspace(0.0, 1.0, cols)
    st[..., 1] = np.linspace(1.0, 0.0, rows)[:, None]
    return Geometry(
        points.reshape(-1, 3),
        np.full(corner.size, 4, dtype=np.int32),
        quads.reshape(-1),
        shift,
        st.reshape(-1, 2),
        _grid_normals(terrain) if normals else None,
    )


def _of_mesh(mesh: TriMesh, normals: bool, local: bool) -> Geometry:
    axes = 3 if mesh.up == "radial" else 2
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    shift = _shift(low[:axes], high[:axes], local)
    if mesh.polygons is None:
        counts = np.full(len(mesh.faces), 3, dtype=np.int32)
        indices = mesh.faces.reshape(-1)
    else:
        counts, indices = mesh.polygons.counts, mesh.polygons.indices

    # Project the texture from above
    st = None
    if mesh.up != "radial":
        extent = np.maximum(high[:2] - low[:2], 1e-9)
        st = ((mesh.vertices[:, :2] - low[:2]) / extent).astype(np.float32)
    return Geometry(
        (mesh.vertices - shift).astype(np.float32),
        counts,
        indices,
        shift,
        st,
        _mesh_normals(mesh) if normals else None,
    )


def _shift(
    low: NDArray[np.float64], high: NDArray[np.float64], local: bool
) -> tuple[float, float, float]:
    """Return the lowest corner if asked, or where float32 would be coarse; else nothing."""
    farthest = max(float(np.abs(low).max()), float(np.abs(high).max()))
    if not local and farthest <= FAR * float((high - low).max()):
        return 0.0, 0.0, 0.0
    x, y, *z = (float(value) for value in low)
    return x, y, (z[0] if z else 0.0)


def _grid_normals(terrain: Heightfield) -> Vectors:
    """Return normals from central differences; one-sided at the border."""
    to_south, to_east = np.gradient(terrain.elevation, np.float32(terrain.spacing))
    normals = np.empty((*terrain.shape, 3), dtype=np.float32)
    normals[..., 0] = 0.0 - to_east  # 0 rather than -0 on the flat
    normals[..., 1] = to_south
    normals[..., 2] = 1.0
    normals /= np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    return normals.reshape(-1, 3)


def _mesh_normals(mesh: TriMesh) -> Vectors:
    """Return the area-weighted mean of the faces around every vertex; up for loose vertices."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    face_normals = np.cross(b - a, c - a)
    count = len(mesh.vertices)
    total = np.zeros((count, 3))
    for corner in range(3):
        for axis in range(3):
            weights = face_normals[:, axis]
            total[:, axis] += np.bincount(mesh.faces[:, corner], weights, minlength=count)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    up = mesh.vertices if mesh.up == "radial" else np.array([mesh.up])
    up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)
    normals = np.where(length > 0, total / np.maximum(length, 1e-300), up)
    return np.asarray(normals, dtype=np.float32)


def _turned(vectors: Vectors) -> Vectors:
    x, y, z = vectors.T
    return np.stack((x, z, -y), axis=-1)
