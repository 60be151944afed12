"""Subdivision of triangles in NumPy: topology, smooth middles, and the oracle of the kernel.

Positions are float64 on the host for both; what the kernel computes are the displacements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.mesh import Indices, Points

F = np.float32
U = np.uint32
QUANTUM = 2.0**-10
"""Metres to which the ends of an edge are rounded before they are hashed."""
UPRIGHT = 0.2
"""Least cosine between a surface and the horizontal at which middles move along gravity alone."""
MOST_NEIGHBOURS = 64
"""A vertex with more neighbours takes no part in the smooth rules."""
WEIGHT_BITS = 40
"""Bits to which weights are rounded, so that no library's cosine decides a position."""


def displacements(
    keys: NDArray[np.int32],
    length: NDArray[np.float32],
    amplitude: float,
    hurst_exponent: float,
    words: tuple[int, int],
) -> NDArray[np.float32]:
    """Return how far the middle of every edge is displaced, metres.

    Parameters
    ----------
    keys
        The quantised places of both ends, the lower one first, of shape (n, 6).
    length
        Lengths of the edges over the reference length.
    """
    size = F(amplitude) * exact.power(length, hurst_exponent)
    return size * _normal(_hash(keys, U(words[0])), _hash(keys, U(words[1])))


def _hash(keys: NDArray[np.int32], seed: np.uint32) -> NDArray[np.uint32]:
    hashes = np.full(len(keys), seed)
    for k in range(6):
        hashes = exact.mix(hashes ^ keys[:, k].astype(U)) + U(0x9E3779B9)
    return exact.mix(hashes)


def _normal(first: NDArray[np.uint32], second: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return the sum of four uniforms, scaled to a deviation of 1."""
    total = np.zeros(len(first), dtype=np.int32)
    for word in (first, second):
        total += (word & U(0xFFFF)).astype(np.int32) + (word >> U(16)).astype(np.int32)
    return (total - 131070).astype(F) * F(2.6429223e-5)


def edge_keys(vertices: Points, edges: Indices) -> NDArray[np.int32]:
    """Return the quantised places of both ends of every edge, the lower one first."""
    place = np.rint(vertices / QUANTUM).astype(np.int64)
    a, b = place[edges[:, 0]], place[edges[:, 1]]
    swapped = np.zeros(len(edges), dtype=bool)
    equal = np.ones(len(edges), dtype=bool)
    for axis in range(3):
        swapped |= equal & (b[:, axis] < a[:, axis])
        equal &= a[:, axis] == b[:, axis]
    low = np.where(swapped[:, None], b, a)
    high = np.where(swapped[:, None], a, b)
    return np.ascontiguousarray(
        np.concatenate((low, high), axis=1).astype(np.uint32).view(np.int32)
    )


@dataclass(frozen=True)
class Topology:
    """Edges of a triangle mesh and how its half-edges hang together.

    Half-edge ``3 f + k`` runs from corner ``k`` of face ``f`` to the next corner.
    """

    edges: Indices
    """Undirected edges, lower vertex first, sorted."""
    edge_of: NDArray[np.int64]
    """Undirected edge of every half-edge."""
    tail: NDArray[np.int64]
    head: NDArray[np.int64]
    twin: NDArray[np.int64]
    """The opposite half-edge, or -1 at borders and where more than two faces meet."""
    count: NDArray[np.int64]
    """Faces at every edge."""

    @classmethod
    def of(cls, faces: Indices) -> Topology:
        """Return the topology of these faces."""
        tail = faces.ravel().astype(np.int64)
        head = faces[:, [1, 2, 0]].ravel().astype(np.int64)
        pairs = np.stack((np.minimum(tail, head), np.maximum(tail, head)), axis=-1)
        edges, edge_of, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        edge_of = edge_of.ravel()
        order = np.argsort(edge_of, kind="stable")
        start = np.concatenate(([0], np.cumsum(count)[:-1]))
        two = count == 2
        one, other = order[start[two]], order[np.minimum(start[two] + 1, len(order) - 1)]
        opposite = tail[one] != tail[other]  # else one of the faces is flipped
        twin = np.full(len(tail), -1, dtype=np.int64)
        twin[one[opposite]] = other[opposite]
        twin[other[opposite]] = one[opposite]
        return cls(edges.astype(np.int32), edge_of, tail, head, twin, count)


def smooth_middles(vertices: Points, faces: Indices, topology: Topology) -> Points:
    """Return the middle of every edge on the modified butterfly surface (Zorin et al. 1996).

    Eight points around an edge between vertices of six neighbours; around others the neighbours of
    the irregular end, or the mean of both ends' rules; four points along a border. Where the rules
    want what is not there (more than two faces at an edge, both ends on a border) it is the plain
    middle.
    """
    ends = vertices[topology.edges]
    result = 0.5 * (ends[:, 0] + ends[:, 1])
    twin, tail, head = topology.twin, topology.tail, topology.head
    halves = np.arange(len(tail))
    following = halves - halves % 3 + (halves + 1) % 3
    before = halves - halves % 3 + (halves + 2) % 3

    # A vertex is whole if its half-edges make one ring around it
    ring = twin[before]  # the next half-edge that leaves the same vertex
    valence = np.bincount(tail, minlength=len(vertices))
    whole = (valence >= 3) & (valence <= MOST_NEIGHBOURS)
    whole[tail[ring < 0]] = False
    whole[head[twin < 0]] = False
    around, target = _ring_means(vertices, ring, tail, head, valence, whole)
    whole[tail[~target]] = False

    # Inner edges, once from each of their half-edges
    has = twin >= 0
    inner = halves[has & (halves < twin)]
    back = twin[inner]
    a, b = tail[inner], head[inner]
    sides = (twin[following[inner]], twin[before[inner]], twin[following[back]], twin[before[back]])
    complete = np.logical_and.reduce([side >= 0 for side in sides])
    regular = (valence[a] == 6) & (valence[b] == 6) & whole[a] & whole[b] & complete
    outer = [vertices[head[following[np.maximum(side, 0)]]] for side in sides]
    wings = vertices[head[following[inner]]] + vertices[head[following[back]]]
    eight = (
        0.5 * (vertices[a] + vertices[b])
        + 0.125 * wings
        - 0.0625 * ((outer[0] + outer[1]) + (outer[2] + outer[3]))
    )
    from_a, from_b = around[inner], around[back]
    odd_a, odd_b = whole[a] & (valence[a] != 6), whole[b] & (valence[b] != 6)
    use_a = np.where(odd_a | odd_b, odd_a, whole[a])
    use_b = np.where(odd_a | odd_b, odd_b, whole[b])
    plain = result[topology.edge_of[inner]]
    chosen = np.where(
        (use_a & use_b)[:, None],
        0.5 * (from_a + from_b),
        np.where(use_a[:, None], from_a, np.where(use_b[:, None], from_b, plain)),
    )
    result[topology.edge_of[inner]] = np.where(regular[:, None], eight, chosen)

    # Border edges: four points along the border, where it does not branch
    border = topology.edges[topology.count == 1].astype(np.int64)
    if len(border):
        neighbours = np.bincount(border.ravel(), minlength=len(vertices))
        total = np.zeros(len(vertices), dtype=np.int64)  # sum of both neighbours' numbers
        np.add.at(total, border[:, 0], border[:, 1])
        np.add.at(total, border[:, 1], border[:, 0])
        plain_run = (neighbours[border] == 2).all(axis=1)
        a, b = border[plain_run].T
        past_a, past_b = total[a] - b, total[b] - a
        four = 0.5625 * (vertices[a] + vertices[b]) - 0.0625 * (vertices[past_a] + vertices[past_b])
        result[np.flatnonzero(topology.count == 1)[plain_run]] = four
    return result


def _ring_means(
    vertices: Points,
    ring: NDArray[np.int64],
    tail: NDArray[np.int64],
    head: NDArray[np.int64],
    valence: NDArray[np.int64],
    whole: NDArray[np.bool_],
) -> tuple[Points, NDArray[np.bool_]]:
    """Return, a half-edge, the rule of its tail, and whether its ring closes with all of them."""
    mean = 0.75 * vertices[tail]
    closed = np.zeros(len(tail), dtype=bool)
    active = np.flatnonzero(whole[tail])
    spoke = active.copy()
    step = 0
    most = int(valence[tail[active]].max()) if len(active) else 3
    table = np.zeros((most + 1, most))
    for size in range(3, most + 1):
        table[size, :size] = _weights(size)
    while len(active):
        count = valence[tail[active]]
        mean[active] += table[count, step][:, None] * vertices[head[spoke]]
        spoke = ring[spoke]
        step += 1
        done = count == step
        closed[active[done]] = spoke[done] == active[done]
        going = ~done & (spoke >= 0) & (spoke != active)
        active, spoke = active[going], spoke[going]
    return mean, closed


def _weights(valence: int) -> list[float]:
    """Return the weights of the neighbours in turn, from the one across the edge."""
    if valence == 3:
        raw = [5 / 12, -1 / 12, -1 / 12]
    elif valence == 4:
        raw = [3 / 8, 0.0, -1 / 8, 0.0]
    else:
        raw = [
            (0.25 + math.cos(2 * math.pi * j / valence) + 0.5 * math.cos(4 * math.pi * j / valence))
            / valence
            for j in range(valence)
        ]
    rounded = [round(w * 2**WEIGHT_BITS) / 2**WEIGHT_BITS for w in raw]
    rounded[0] = 0.25 - sum(rounded[1:])
    return rounded


def onto_edges(
    middles: Points,
    smooth: Points,
    up: Points,
    faces: Indices,
    vertices: Points,
    topology: Topology,
    chosen: NDArray[np.bool_],
) -> Points:
    """Return the middles moved to the smooth surface without sliding sideways.

    The smooth point is where the surface passes, not where the middle has to go: moved along
    gravity, outlines stay straight and uneven triangles on a plane stay where they are. On steep
    and overhanging ground the middle moves at right angles to the surface.
    """
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(size > 0, size, 1.0)
    # The mean over at most a few faces, summed in the order of their values
    across = np.zeros((len(topology.edges), 3))
    order = np.lexsort((*np.repeat(normal, 3, axis=0).T, topology.edge_of))
    np.add.at(across, topology.edge_of[order], np.repeat(normal, 3, axis=0)[order])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across = (across / np.where(size > 0, size, 1.0))[chosen]
    rise = ((smooth - middles) * across).sum(axis=1)
    lean = (across * up).sum(axis=1)
    upright = np.abs(lean) >= UPRIGHT
    along_up = (rise / np.where(upright, lean, 1.0))[:, None] * up
    moved: Points = middles + np.where(upright[:, None], along_up, rise[:, None] * across)
    return moved


def cut_faces(
    faces: Indices, topology: Topology, middle: NDArray[np.int64], place: Points
) -> Indices:
    """Return the faces with some of their edges cut in the middle, without gaps.

    A face with three cut edges becomes four, with two three, with one two. Of the two ways to cut
    the rest of a face with two cut edges the one with the shorter new edge is taken.

    Parameters
    ----------
    middle
        Vertex in the middle of every edge, -1 where it is not cut.
    place
        Positions by which new edges are compared.
    """
    at = middle[topology.edge_of].reshape(-1, 3)
    cuts = (at >= 0).sum(axis=1)
    wide = faces.astype(np.int64)
    pieces = [wide[cuts == 0]]

    # One cut: turned so that it is the edge from a to b
    some = cuts == 1
    (a, b, c), (m, _, _) = _turned(wide[some], at[some], np.argmax(at[some] >= 0, axis=1))
    pieces += [np.stack((a, m, c), -1), np.stack((m, b, c), -1)]

    # Two cuts: turned so that the edge from c to a is whole
    some = cuts == 2
    (a, b, c), (m, n, _) = _turned(wide[some], at[some], (np.argmin(at[some], axis=1) + 1) % 3)
    from_a = ((place[a] - place[n]) ** 2).sum(axis=1)
    from_c = ((place[c] - place[m]) ** 2).sum(axis=1)
    first = (from_a < from_c) | ((from_a == from_c) & _lower(place[a], place[c]))
    pieces.append(np.stack((m, b, n), -1))
    pieces.append(np.stack((a, m, np.where(first, n, c)), -1))
    pieces.append(np.stack((np.where(first, a, m), n, c), -1))

    # Three cuts
    (a, b, c), (m, n, k) = wide[cuts == 3].T, at[cuts == 3].T
    pieces += [np.stack(t, -1) for t in ((a, m, k), (m, b, n), (k, n, c), (m, n, k))]
    return np.concatenate(pieces).astype(np.int32)


def _turned(
    faces: NDArray[np.int64], at: NDArray[np.int64], first: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return corners and middles of faces that begin at corner ``first``, one row a corner."""
    turn = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, turn, 1).T, np.take_along_axis(at, turn, 1).T


def _lower(one: Points, other: Points) -> NDArray[np.bool_]:
    lower = np.zeros(len(one), dtype=bool)
    equal = np.ones(len(one), dtype=bool)
    for axis in range(one.shape[1]):
        lower |= equal & (one[:, axis] < other[:, axis])
        equal &= one[:, axis] == other[:, axis]
    return lower


def cut_quads(
    quads: NDArray[np.int64],
    first: NDArray[np.int64],
    edge_of: NDArray[np.int64],
    faces: Indices,
    middle: NDArray[np.int64],
) -> tuple[NDArray[np.int64], Indices]:
    """Return four quads in place of each, and the triangles that they consist of.

    Parameters
    ----------
    quads
        Corners of every quad.
    first
        The first of the two consecutive faces that a quad consists of.
    """
    pair = np.stack((first, first + 1), axis=1)
    corners = faces[pair].astype(np.int64).reshape(-1, 6)
    edges = edge_of.reshape(-1, 3)[pair].reshape(-1, 6)
    tails, heads = corners, corners[:, [1, 2, 0, 4, 5, 3]]
    split = ((tails == quads[:, :1]) & (heads == quads[:, 2:3])) | (
        (tails == quads[:, 2:3]) & (heads == quads[:, :1])
    )
    even = split.any(axis=1)  # the diagonal runs from the first corner to the third

    def middle_of(tail: NDArray[np.int64], head: NDArray[np.int64]) -> NDArray[np.int64]:
        hit = ((tails == tail[:, None]) & (heads == head[:, None])) | (
            (tails == head[:, None]) & (heads == tail[:, None])
        )
        found: NDArray[np.int64] = middle[edges[np.arange(len(quads)), np.argmax(hit, axis=1)]]
        return found

    sides = [middle_of(quads[:, k], quads[:, (k + 1) % 4]) for k in range(4)]
    centre = np.where(
        even, middle_of(quads[:, 0], quads[:, 2]), middle_of(quads[:, 1], quads[:, 3])
    )
    new_quads, new_faces = [], []
    for k in range(4):
        corner, after, behind = quads[:, k], sides[k], sides[k - 1]
        new_quads.append(np.stack((corner, after, centre, behind), -1))
        from_corner = (even == (k % 2 == 0))[:, None]
        one = np.where(
            from_corner,
            np.stack((corner, after, centre), -1),
            np.stack((behind, corner, after), -1),
        )
        two = np.where(
            from_corner,
            np.stack((corner, centre, behind), -1),
            np.stack((behind, after, centre), -1),
        )
        new_faces += [one, two]
    return (
        np.stack(new_quads, axis=1).reshape(-1, 4),
        np.stack(new_faces, axis=1).reshape(-1, 3).astype(np.int32),
    )
