"""Subdivision of a mesh: finer triangles, fractal detail, a smooth surface between."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import ParameterError, ResourceError
from terrakit.execute import free_memory
from terrakit.mesh import Indices, Points, Polygons, TriMesh
from terrakit.operators import Filter
from terrakit.parameters import Seed, parameter
from terrakit.running import Run
from terrakit_filters.subdivide import reference
from terrakit_filters.subdivide.reference import Topology

BYTES_A_FACE = 400
"""About how much memory cutting takes at its peak, for every face that comes out."""
MOST_FACES = 2**31 // 3
MOST_PASSES = 40


class Subdivide(Filter):
    """Cut the triangles of a mesh finer and roughen what is between.

    Every edge is cut in its middle, so a triangle becomes four, and the middle is displaced along
    gravity by a hash of where the edge lies::

        m = (a + b) / 2 + up * amplitude * (length / reference_length)^H * xi

    ``xi`` has a deviation of 1. Length and hash are those of the mesh as it was handed in, cut but
    not displaced: the order of vertices and faces does not matter, nor the amplitude. With
    ``smoothing = "butterfly"`` middles lie on a smooth surface through the vertices instead of
    on the flat triangles, so no creases remain. With ``edge_length`` only edges that are longer
    are cut, and the triangles beside them are cut to match, so no gap opens.

    Notes
    -----
    Ground whose heights differ by d along edges of the reference length goes on as rough as it is
    with an amplitude of ``d sqrt((4^-H - 1/4) / 2)``; with less it gets smoother.

    Quads stay quads, four for one; n-gons become triangles, and so does everything where
    ``edge_length`` is given. Layers are interpolated.

    References
    ----------
    A. Fournier, D. Fussell and L. Carpenter, "Computer rendering of stochastic models", CACM 25,
    1982. D. Zorin, P. Schroeder and W. Sweldens, "Interpolating subdivision for meshes with
    arbitrary topology", SIGGRAPH 1996. M. C. Rivara, "Algorithms for refining triangular grids",
    1984.
    """

    name = "subdivide"
    surfaces = (TriMesh,)
    cites = ("Fournier, Fussell & Carpenter 1982", "Zorin, Schroeder & Sweldens 1996")
    fields = 64
    changes_grid = True
    idle: ClassVar = {"levels": 0}

    levels: int = parameter(
        1, "How many times every triangle is cut in four.", ge=0, le=12, label="Levels"
    )
    edge_length: float | None = parameter(
        None,
        "In place of levels: cut only edges that are longer than this.",
        unit="m",
        gt=0,
        le=1e7,
    )
    smoothing: Literal["linear", "butterfly"] = parameter(
        "linear", "linear keeps triangles flat; butterfly bends them into a smooth surface."
    )
    amplitude: float = parameter(
        0.0,
        "Usual displacement of the middle of an edge that is as long as the reference.",
        unit="m",
        ge=0,
        le=1e6,
    )
    reference_length: float = parameter(
        1000.0, "Length of edge to which the amplitude belongs.", unit="m", gt=0, le=1e7
    )
    hurst_exponent: float = parameter(
        0.85, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    seed: Seed = parameter(0, "Another number or word gives other detail.")

    presets: ClassVar = {
        "smooth": {"smoothing": "butterfly", "levels": 2},
        "rocky": {"amplitude": 150.0, "hurst_exponent": 0.75, "levels": 3},
    }
    trial: ClassVar = {"amplitude": 100.0, "smoothing": "butterfly", "levels": 2}

    def apply(self, surface: TriMesh, run: Run) -> TriMesh:
        """Return the mesh with finer triangles."""
        mesh, rest = surface, surface.vertices
        limit = ("edge_length", self.edge_length or 0.0)
        if self.edge_length is None:
            self._check_room(len(mesh.faces), 4**self.levels, "levels", self.levels)
            for _ in run.steps(self.levels):
                topology = Topology.of(mesh.faces)
                mesh, rest = self._cut(
                    mesh, rest, topology, np.ones(len(topology.edges), bool), run
                )
            return mesh
        self._check_room(1, _least_faces(rest, mesh.faces, self.edge_length), *limit)
        for _ in range(MOST_PASSES):
            run.check()
            topology = Topology.of(mesh.faces)
            length = _lengths(rest, topology)
            long = length > self.edge_length
            if not long.any():
                break
            growth = 1 + int(topology.count[long].sum()) / len(mesh.faces)
            self._check_room(len(mesh.faces), growth, *limit)
            mesh, rest = self._cut(mesh, rest, topology, long, run)
        return mesh

    def _check_room(self, faces: int, growth: float, name: str, value: float) -> None:
        """Raise ResourceError before there is not enough memory."""
        count = int(faces * growth)
        needed, free = count * BYTES_A_FACE, free_memory()
        way = "use fewer levels" if name == "levels" else "use longer edges"
        if count > MOST_FACES:
            raise ParameterError(
                f"{name} = {value:g}: {count} triangles, at most {MOST_FACES}; {way}"
            )
        if needed > free:
            raise ResourceError(
                f"{self.name}: {name} = {value:g}: {count} triangles take {needed / 1e9:.1f} GB > "
                f"{free / 1e9:.1f} GB free; {way}"
            )

    def _cut(
        self, mesh: TriMesh, rest: Points, topology: Topology, chosen: NDArray[np.bool_], run: Run
    ) -> tuple[TriMesh, Points]:
        """Return the mesh with the chosen edges cut, and where its vertices lie undisplaced."""
        edges = topology.edges[chosen]
        ends, rest_ends = mesh.vertices[edges], rest[edges]
        middle = 0.5 * (ends[:, 0] + ends[:, 1])
        up = _up_at(mesh, middle)
        if self.smoothing == "butterfly":
            smooth = reference.smooth_middles(mesh.vertices, mesh.faces, topology)[chosen]
            middle = reference.onto_edges(
                middle, smooth, up, mesh.faces, mesh.vertices, topology, chosen
            )
        if self.amplitude > 0:
            shift = self._displacements(rest, edges, _lengths(rest, topology)[chosen], run)
            middle = middle + shift.astype(np.float64)[:, None] * up

        number = np.full(len(chosen), -1, dtype=np.int64)
        number[chosen] = len(mesh.vertices) + np.arange(len(edges))
        rest = np.concatenate((rest, 0.5 * (rest_ends[:, 0] + rest_ends[:, 1])))
        faces, polygons = self._faces(mesh, rest, topology, number)
        layers = {}
        for name, field in mesh.layers.items():
            pair = field[edges].astype(np.float64)
            layers[name] = np.concatenate((field, (0.5 * (pair[:, 0] + pair[:, 1])).astype("f4")))
        finer = TriMesh(np.concatenate((mesh.vertices, middle)), faces, layers, mesh.up, polygons)
        return finer, rest

    def _displacements(
        self, rest: Points, edges: Indices, length: NDArray[np.float64], run: Run
    ) -> NDArray[np.float32]:
        """Return how far the middle of every edge is displaced, metres."""
        keys = reference.edge_keys(rest, edges)
        share = (length / self.reference_length).astype(np.float32)
        words = run.words(self.name, self.seed)
        device = run.device
        if device is None:
            return reference.displacements(keys, share, self.amplitude, self.hurst_exponent, words)
        result = device.empty(len(edges))
        device.program(__file__, "subdivide.cl").launch(
            "subdivide_displace",
            (len(edges),),
            result,
            device.upload(keys),
            device.upload(share),
            np.float32(self.amplitude),
            np.float32(self.hurst_exponent),
            np.uint32(words[0]),
            np.uint32(words[1]),
            np.int32(len(edges)),
        )
        shift: NDArray[np.float32] = result.download()
        return shift

    def _faces(
        self,
        mesh: TriMesh,
        rest: Points,
        topology: Topology,
        number: NDArray[np.int64],
    ) -> tuple[Indices, Polygons | None]:
        """Return the new faces, and the new polygons where quads can stay."""
        if mesh.polygons is None or self.edge_length is not None:
            return reference.cut_faces(mesh.faces, topology, number, rest), None
        counts = mesh.polygons.counts.astype(np.int64)
        starts = np.concatenate(([0], np.cumsum(counts)[:-1]))
        first = np.concatenate(([0], np.cumsum(counts - 2)[:-1]))
        is_quad = counts == 4
        quads = mesh.polygons.indices[starts[is_quad][:, None] + np.arange(4)].astype(np.int64)
        new_quads, quad_faces = reference.cut_quads(
            quads, first[is_quad], topology.edge_of, mesh.faces, number
        )
        loose = np.repeat(~is_quad, counts - 2)
        halves = np.repeat(loose, 3)
        rest_topology = Topology(
            topology.edges,
            topology.edge_of[halves],
            topology.tail[halves],
            topology.head[halves],
            topology.twin[halves],
            topology.count,
        )
        others = reference.cut_faces(mesh.faces[loose], rest_topology, number, rest)
        sizes = np.concatenate((np.full(len(new_quads), 4), np.full(len(others), 3)))
        corners = np.concatenate((new_quads.ravel(), others.ravel()))
        return (
            np.concatenate((quad_faces, others)),
            Polygons(sizes.astype(np.int32), corners.astype(np.int32)),
        )


def _lengths(rest: Points, topology: Topology) -> NDArray[np.float64]:
    along = rest[topology.edges[:, 1]] - rest[topology.edges[:, 0]]
    squares = along * along
    length: NDArray[np.float64] = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
    return length


def _least_faces(rest: Points, faces: Indices, edge_length: float) -> float:
    """Return a number of faces below which no edges are as short: equilateral ones."""
    corner = rest[faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    return max(float(len(faces)), area / (0.25 * 3**0.5 * edge_length**2))


def _up_at(mesh: TriMesh, places: Points) -> Points:
    """Return the direction against gravity at these places."""
    if mesh.up == "radial":
        squares = places * places
        length = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
        return places / np.where(length > 0, length, 1.0)[:, None]
    return np.broadcast_to(np.array(mesh.up), places.shape)
