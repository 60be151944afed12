"""Terrain as any triangle mesh, with the edge graph on which erosion runs.

Discrete geometry after Meyer, Desbrun, Schröder & Barr (2003): barycentric projected areas are
the mass of a vertex, because the volume under the surface changes by exactly their sum times a
vertical displacement; cotangent weights are the widths of the interfaces between vertices.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrakit.errors import InputError

if TYPE_CHECKING:
    from terrakit.heightfield import Field, Heightfield
    from terrakit.strata import Strata

Points = NDArray[np.float64]
Indices = NDArray[np.int32]
Up = tuple[float, float, float] | Literal["radial"]

_Array = TypeVar("_Array", bound="NDArray[Any]")

SMALLEST_WIDTH = 0.05
"""Cotangent widths below this share of the barycentric width are raised to it."""


@dataclass(frozen=True)
class Polygons:
    """Faces as they came in: ``indices`` holds ``counts[i]`` corners of polygon ``i`` in turn."""

    counts: Indices
    indices: Indices


@dataclass(frozen=True)
class EdgeGraph:
    """The neighbours of every vertex in compressed rows, sorted by vertex id.

    The neighbours of vertex ``i`` are ``neighbor[start[i]:start[i + 1]]``; ``length`` and
    ``width`` (metres) belong to the same positions, ``edge`` is the undirected edge's index.
    """

    start: Indices
    neighbor: Indices
    edge: Indices
    length: NDArray[np.float64]
    width: NDArray[np.float64]


class TriMesh:
    """A triangle mesh with layers on its vertices; immutable to its users.

    Parameters
    ----------
    vertices
        Positions of shape (n, 3), metres, kept as float64.
    faces
        Vertex indices of shape (m, 3), counter-clockwise seen from above.
    layers
        Fields of shape (n,), by the names of :mod:`terrakit.layers`; ``elevation`` is derived.
    up
        Direction against gravity, or ``"radial"`` for a planet around the origin.
    polygons
        The quads and n-gons that the triangles came from; exporters write these.
    strata
        The beds under the surface, whose top is the layer ``strata_datum``; None without.

    Raises
    ------
    InputError
        If a coordinate is not finite, an index is out of range or a shape is wrong.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        layers: Mapping[str, ArrayLike] | None = None,
        up: Up = (0.0, 0.0, 1.0),
        polygons: Polygons | None = None,
        strata: Strata | None = None,
    ) -> None:
        self.vertices: Points = _frozen(_checked_vertices(vertices))
        self.faces: Indices = _frozen(_checked_faces(faces, len(self.vertices)))
        self.up: Up = up if up == "radial" else _unit(up)
        self.polygons = polygons
        self.strata = strata
        self._layers = {name: self._fitting(name, v) for name, v in (layers or {}).items()}

    @classmethod
    def from_polygons(
        cls,
        vertices: ArrayLike,
        counts: ArrayLike,
        indices: ArrayLike,
        layers: Mapping[str, ArrayLike] | None = None,
        up: Up = (0.0, 0.0, 1.0),
    ) -> TriMesh:
        """Return a mesh from triangles, quads and n-gons, which are kept for export.

        A polygon is cut into a fan from its first corner that gives no inverted triangle, so that
        concave quads and star-shaped n-gons keep their area.
        """
        points = _checked_vertices(vertices)
        count = np.asarray(counts, dtype=np.int32).ravel()
        index = np.asarray(indices, dtype=np.int32).ravel()
        if count.size and count.min() < 3:
            raise InputError(f"face {int(np.argmin(count))}: has fewer than three corners")
        if int(count.sum()) != index.size:
            raise InputError(f"faces: counts sum to {int(count.sum())}, there are {index.size}")
        _checked_range(index, len(points))
        faces = _triangulate(points, count, index)
        return cls(points, faces, layers, up, Polygons(_frozen(count), _frozen(index)))

    @classmethod
    def from_heightfield(cls, terrain: Heightfield) -> TriMesh:
        """Return the grid as a mesh: one quad a cell, diagonals alternating like a chequerboard."""
        rows, cols = terrain.shape
        if rows < 2 or cols < 2:
            raise InputError(f"terrain {rows}x{cols}: a mesh needs at least 2x2 samples")
        x, y = terrain.origin
        east, south = np.meshgrid(np.arange(cols), np.arange(rows))
        vertices = np.stack(
            (x + east * terrain.spacing, y - south * terrain.spacing, terrain.elevation), axis=-1
        ).reshape(-1, 3)
        row, col = np.meshgrid(np.arange(rows - 1), np.arange(cols - 1), indexing="ij")
        nw = (row * cols + col).ravel()
        sw, ne, se = nw + cols, nw + 1, nw + cols + 1
        even = ((row + col) % 2 == 0).ravel()[:, None]
        first = np.where(even, np.stack((nw, sw, se), -1), np.stack((nw, sw, ne), -1))
        second = np.where(even, np.stack((nw, se, ne), -1), np.stack((sw, se, ne), -1))
        faces = np.stack((first, second), axis=1).reshape(-1, 3)
        quads = np.stack((nw, sw, se, ne), axis=-1).ravel().astype(np.int32)
        polygons = Polygons(np.full(nw.size, 4, np.int32), quads)
        layers = {n: terrain.layer(n).ravel() for n in terrain if n != "elevation"}
        return cls(vertices, faces, layers, polygons=polygons, strata=terrain.strata)

    @property
    def layers(self) -> Mapping[str, Field]:
        """Every layer by name; ``elevation`` is not stored but derived."""
        return MappingProxyType(self._layers)

    @cached_property
    def elevation(self) -> Field:
        """Height of every vertex against gravity, metres (float32)."""
        return _frozen(self.heights.astype(np.float32))

    @cached_property
    def heights(self) -> NDArray[np.float64]:
        """Height of every vertex against gravity, metres (float64)."""
        if self.up == "radial":
            return _frozen(np.linalg.norm(self.vertices, axis=1))
        return _frozen(self.vertices @ np.array(self.up))

    def layer(self, name: str) -> Field:
        """Return a layer, read-only.

        Raises
        ------
        InputError
            If there is no such layer.
        """
        if name == "elevation":
            return self.elevation
        try:
            return self._layers[name]
        except KeyError:
            known = ", ".join(self)
            raise InputError(f"layer {name!r}: the mesh has none; it has: {known}") from None

    def __contains__(self, name: object) -> bool:
        return name == "elevation" or name in self._layers

    def __iter__(self) -> Iterator[str]:
        return iter(("elevation", *self._layers))

    def with_layers(self, **layers: ArrayLike) -> TriMesh:
        """Return a mesh with these layers added or replaced; topology and caches are shared."""
        new = self._sibling()
        for name, values in layers.items():
            new._layers[name] = self._fitting(name, values)
        return new

    def with_strata(self, strata: Strata | None) -> TriMesh:
        """Return the same mesh with other beds under it; everything else is shared."""
        new = self._sibling()
        new.strata = strata
        return new

    def raised(self, amount: NDArray[np.float64]) -> TriMesh:
        """Return the mesh with every vertex moved by ``amount`` metres against gravity."""
        new = self._sibling()
        new.vertices = _frozen(self.vertices + np.asarray(amount)[:, None] * self._up_vectors())
        for derived in ("elevation", "heights"):
            new.__dict__.pop(derived, None)
        if self.up == "radial":  # areas grow with the radius
            for derived in ("areas", "graph"):
                new.__dict__.pop(derived, None)
        return new

    @cached_property
    def edges(self) -> Indices:
        """Undirected edges of shape (k, 2), lower vertex first, sorted."""
        return _frozen(self._edges_and_counts[0])

    @cached_property
    def is_boundary(self) -> NDArray[np.bool_]:
        """Whether a vertex lies on an edge with a single face."""
        edges, counts = self._edges_and_counts
        flags = np.zeros(len(self.vertices), dtype=bool)
        flags[edges[counts == 1].ravel()] = True
        return _frozen(flags)

    @cached_property
    def components(self) -> Indices:
        """Connected component of every vertex, numbered from 0 by their lowest vertex."""
        label = np.arange(len(self.vertices))
        low, high = self.edges.T
        while True:
            least = np.minimum(label[low], label[high])
            new = label.copy()
            np.minimum.at(new, low, least)
            np.minimum.at(new, high, least)
            new = new[new]
            if np.array_equal(new, label):
                break
            label = new
        return _frozen(np.unique(label, return_inverse=True)[1].astype(np.int32).ravel())

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """Horizontal area that each vertex stands for, square metres; 0 for loose vertices.

        A third of the projected area of every face around it (barycentric dual).
        """
        area = np.zeros(len(self.vertices))
        third = self._projected_face_areas() / 3.0
        for corner in range(3):
            np.add.at(area, self.faces[:, corner], third)
        return _frozen(area)

    @cached_property
    def graph(self) -> EdgeGraph:
        """Neighbours of every vertex with horizontal edge lengths and interface widths."""
        edges = self.edges
        a, b = self.vertices[edges[:, 0]], self.vertices[edges[:, 1]]
        along = b - a
        up = self._up_vectors()
        middle = up[edges[:, 0]] + up[edges[:, 1]]
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        along = along - (along * middle).sum(axis=1, keepdims=True) * middle
        length = np.linalg.norm(along, axis=1)
        width = self._widths()
        count = len(edges)
        tail = np.concatenate((edges[:, 0], edges[:, 1]))
        head = np.concatenate((edges[:, 1], edges[:, 0]))
        edge = np.concatenate((np.arange(count), np.arange(count)))
        order = np.lexsort((head, tail))
        start = np.zeros(len(self.vertices) + 1, dtype=np.int32)
        np.cumsum(np.bincount(tail, minlength=len(self.vertices)), out=start[1:])
        return EdgeGraph(
            _frozen(start),
            _frozen(head[order].astype(np.int32)),
            _frozen(edge[order].astype(np.int32)),
            _frozen(length[edge[order]]),
            _frozen(width[edge[order]]),
        )

    @property
    def volume(self) -> float:
        """Volume under the surface (m3): faces' projected areas times their mean heights."""
        return float((self._projected_face_areas() * self.heights[self.faces].mean(axis=1)).sum())

    def __repr__(self) -> str:
        return f"TriMesh({len(self.vertices)} vertices, {len(self.faces)} faces)"

    @cached_property
    def _edges_and_counts(self) -> tuple[Indices, Indices]:
        corners = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        pairs = np.sort(corners, axis=1)
        edges, counts = np.unique(pairs, axis=0, return_counts=True)
        return edges.reshape(-1, 2).astype(np.int32), counts.astype(np.int32)

    def _up_vectors(self) -> Points:
        if self.up == "radial":
            return _directions(self.vertices)
        return np.broadcast_to(np.array(self.up), self.vertices.shape)

    def _projected_face_areas(self) -> NDArray[np.float64]:
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        normal = np.cross(b - a, c - a) * 0.5
        if self.up == "radial":
            area: NDArray[np.float64] = (normal * _directions(a + b + c)).sum(axis=1)
        else:
            area = normal @ np.array(self.up)
        return area

    def _widths(self) -> NDArray[np.float64]:
        """Return the width of the interface across each edge, metres (clamped cotangents)."""
        edges = self.edges
        key = edges[:, 0].astype(np.int64) * len(self.vertices) + edges[:, 1]
        cotangent = np.zeros(len(edges))
        barycentric = np.zeros(len(edges))
        length = np.zeros(len(edges))
        for corner in range(3):
            apex, left, right = (self.faces[:, (corner + k) % 3] for k in range(3))
            up = self._face_up()
            to_left = _flat(self.vertices[left] - self.vertices[apex], up)
            to_right = _flat(self.vertices[right] - self.vertices[apex], up)
            twice_area = np.abs((np.cross(to_left, to_right) * up).sum(axis=1))
            opposite = np.linalg.norm(to_right - to_left, axis=1)
            low, high = np.minimum(left, right), np.maximum(left, right)
            edge = np.searchsorted(key, low.astype(np.int64) * len(self.vertices) + high)
            cot = (to_left * to_right).sum(axis=1) / np.maximum(twice_area, 1e-12 * opposite**2)
            np.add.at(cotangent, edge, cot)
            to_middle = 0.5 * (to_left + to_right)
            np.add.at(barycentric, edge, np.linalg.norm(to_middle, axis=1) / 3.0)
            length[edge] = opposite
        return np.maximum(0.5 * cotangent * length, SMALLEST_WIDTH * barycentric)

    def _face_up(self) -> Points:
        if self.up == "radial":
            return _directions(self.vertices[self.faces].sum(axis=1))
        return np.broadcast_to(np.array(self.up), (len(self.faces), 3))

    def _sibling(self) -> TriMesh:
        new = object.__new__(TriMesh)
        new.__dict__.update(self.__dict__)
        new._layers = dict(self._layers)
        return new

    def _fitting(self, name: str, values: ArrayLike) -> Field:
        from terrakit.heightfield import checked_field

        if name == "elevation":
            raise InputError("elevation: is derived from a mesh's vertices; use raised()")
        field = checked_field(name, values)
        if field.shape != (len(self.vertices),):
            raise InputError(
                f"layer {name!r}: shape {field.shape}, the mesh has {len(self.vertices)} vertices"
            )
        return _frozen(field)


def _checked_vertices(vertices: ArrayLike) -> Points:
    points = np.array(vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"vertices: need shape (n, 3), got {points.shape}")
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        raise InputError(f"vertex {int(np.argmin(finite))}: coordinate is not finite")
    return points


def _checked_faces(faces: ArrayLike, count: int) -> Indices:
    values = np.asarray(faces)
    if values.ndim != 2 or values.shape[1] != 3 or values.dtype.kind not in "iu":
        raise InputError(f"faces: need integer shape (m, 3), got {values.dtype} {values.shape}")
    if len(values) == 0:
        raise InputError("faces: there are no faces")
    _checked_range(values, count)
    return values.astype(np.int32)


def _checked_range(indices: NDArray[np.integer], count: int) -> None:
    wrong = (indices < 0) | (indices >= count)
    if wrong.any():
        raise InputError(f"faces: vertex {int(indices[wrong][0])} of {count}")


def _unit(up: tuple[float, float, float]) -> tuple[float, float, float]:
    vector = np.asarray(up, dtype=np.float64)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"up {up}: needs three numbers that are not all zero, or 'radial'")
    x, y, z = vector / length
    return float(x), float(y), float(z)


def _triangulate(points: Points, counts: Indices, indices: Indices) -> Indices:
    """Cut polygons into fans, in the order of the polygons."""
    starts = np.concatenate(([0], np.cumsum(counts)[:-1]))
    owners, pieces = [], []
    for size in np.unique(counts):
        chosen = np.flatnonzero(counts == size)
        corners = indices[starts[chosen][:, None] + np.arange(size)]
        if size > 3:
            corners = _best_fan(points, corners)
        fan = [corners[:, [0, k, k + 1]] for k in range(1, int(size) - 1)]
        owners.append(np.repeat(chosen, int(size) - 2))
        pieces.append(np.stack(fan, axis=1).reshape(-1, 3))
    if not pieces:
        return np.zeros((0, 3), dtype=np.int32)
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(pieces)[order].astype(np.int32)


def _best_fan(points: Points, corners: Indices) -> Indices:
    """Rotate every polygon so that a fan from its first corner has the least inverted area."""
    size = corners.shape[1]
    position = points[corners]
    centred = position - position.mean(axis=1, keepdims=True)
    normal = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    inverted = np.empty((len(corners), size))
    for first in range(size):
        turned = np.roll(position, -first, axis=1)
        side = (
            np.cross(turned[:, 1:-1] - turned[:, :1], turned[:, 2:] - turned[:, :1])
            @ normal[:, :, None]
        )
        inverted[:, first] = np.minimum(side[..., 0], 0.0).sum(axis=1)
    best = np.argmax(inverted, axis=1)
    return np.take_along_axis(corners, (best[:, None] + np.arange(size)) % size, axis=1)


def _flat(vectors: Points, up: Points) -> Points:
    flat: Points = vectors - (vectors * up).sum(axis=1, keepdims=True) * up
    return flat


def _directions(vectors: Points) -> Points:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    directions: Points = vectors / np.maximum(length, 1e-300)
    return directions


def _frozen(values: _Array) -> _Array:
    values.flags.writeable = False
    return values
