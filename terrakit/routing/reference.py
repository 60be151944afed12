"""The readable definition of routing, in NumPy, and the oracle of the kernels.

Cells are numbered row by row; every array of cells is flat in here. Trees point downstream: the
receiver of a cell is the neighbour that takes its water, and an outlet is its own receiver. All
decisions are made on integers, so that no order of summation and no tie is left to chance.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.errors import ParameterError

Cells = NDArray[np.int32]
Height = NDArray[np.int32]
Mask = NDArray[np.uint8]

SCAN_ORDER = ((-1, 0), (0, 1), (1, 0), (0, -1), (-1, 1), (1, 1), (1, -1), (-1, -1))
"""(row, column) steps to the neighbours; the first of equal slopes wins, so the axes come first."""
FORWARD = ((0, 1), (1, -1), (1, 0), (1, 1))
"""Steps to the neighbours with a larger number: each undirected edge once."""
NO_OUTLET = "outlet: no cell is an outlet; mark at least one"
INVERSE_SQRT2 = np.float32(0.70710678)
SQRT2 = np.float32(1.41421356)

# --- receivers ------------------------------------------------------------------------------


def receivers(
    height: Height,
    outlet: Mask,
    method: str = "d8",
    seed: tuple[int, int] = (0, 0),
    origin: tuple[int, int] = (0, 0),
) -> Cells:
    """Return the steepest strictly lower neighbour of each cell, or the cell itself.

    A pit keeps itself, and so does each cell of a flat; an outlet always does.
    """
    rows, cols = height.shape
    number = np.arange(height.size, dtype=np.int32).reshape(height.shape)
    diagonal = diagonal_factor(height.shape, method, seed, origin)
    receiver = number.copy()
    steepest = np.zeros(height.shape, np.float32)
    for down, right in SCAN_ORDER:
        here, there = _overlap(rows, cols, down, right)
        slope = (height[here] - height[there]).astype(np.float32)
        if down and right:
            slope = slope * diagonal[here]
        better = slope > steepest[here]
        receiver[here] = np.where(better, number[there], receiver[here])
        steepest[here] = np.where(better, slope, steepest[here])
    return np.where(outlet != 0, number, receiver).ravel()


def diagonal_factor(
    shape: tuple[int, int], method: str, seed: tuple[int, int], origin: tuple[int, int]
) -> NDArray[np.float32]:
    """Return what the drop to a diagonal neighbour is multiplied with.

    ``d8`` divides by the distance, sqrt(2). ``rho8`` divides by 2 - u with u uniform in [0, 1):
    on a plane whose steepest descent is at an angle a from an axis, the diagonal then wins with
    probability tan(a), and the mean direction of flow is the true one.
    """
    if method == "d8":
        return np.broadcast_to(INVERSE_SQRT2, shape)
    rows = np.arange(shape[0], dtype=np.int64)[:, np.newaxis] + origin[0]
    cols = np.arange(shape[1], dtype=np.int64)[np.newaxis, :] + origin[1]
    u = exact.uniform(exact.hashed(seed, rows & 0xFFFFFFFF, cols & 0xFFFFFFFF))
    factor: NDArray[np.float32] = np.float32(1) / (np.float32(2) - u)
    return factor


def _overlap(
    rows: int, cols: int, down: int, right: int
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the cells that have a neighbour at the given step, and those neighbours."""
    here = (
        slice(max(0, -down), rows - max(0, down)),
        slice(max(0, -right), cols - max(0, right)),
    )
    there = (
        slice(max(0, down), rows - max(0, -down)),
        slice(max(0, right), cols - max(0, -right)),
    )
    return here, there


# --- depressions ----------------------------------------------------------------------------


def drain_depressions(height: Height, outlet: Mask, receiver: Cells, tie_seed: int) -> Cells:
    """Return receivers that lead every cell to an outlet over the lowest possible passes.

    The basins of the pits and the passes between them are a graph; its minimum spanning tree,
    rooted outside, says over which pass each basin spills (Cordonnier et al. 2019). The way from
    the pit up to that pass is turned round, as if a river had cut it.
    """
    basin = basins(outlet, receiver)
    first, second = passes(height, basin, tie_seed)
    tree = spanning_tree(basin[first], basin[second])
    first, second = first[tree], second[tree]
    spill = orient(basin[first], basin[second])

    # Turn the chain from the pass down to the pit, one cell of every basin at a time
    own = np.arange(1, spill.size)
    leaves_first = basin[first[spill[own]]] == own
    cell = np.where(leaves_first, first[spill[own]], second[spill[own]])
    previous = np.where(leaves_first, second[spill[own]], first[spill[own]])
    receiver = receiver.copy()
    while cell.size:
        following = receiver[cell]
        receiver[cell] = previous
        going = following != cell
        previous, cell = cell[going], following[going]
    return receiver


def basins(outlet: Mask, receiver: Cells) -> Cells:
    """Return the basin of each cell: 0 if it reaches an outlet, else its pit's number from 1."""
    root = follow(receiver)
    is_pit = (receiver == np.arange(receiver.size)) & (outlet.ravel() == 0)
    number = np.where(is_pit, np.cumsum(is_pit), 0).astype(np.int32)
    basin: Cells = number[root]
    return basin


def follow(pointer: NDArray[Any]) -> NDArray[Any]:
    """Return where each chain of pointers ends, doubling the jump until nothing moves."""
    while True:
        further: NDArray[Any] = pointer[pointer]
        if np.array_equal(further, pointer):
            return further
        pointer = further


def passes(height: Height, basin: Cells, tie_seed: int) -> tuple[Cells, Cells]:
    """Return both cells of every edge between two basins, lowest pass first.

    The order is that of the higher cell, then of the lower one, then of a bijective hash of the
    edge, which makes it strict. A hash, because rivers across a lake or a plain would otherwise
    run along the rows.
    """
    rows, cols = height.shape
    number = np.arange(height.size, dtype=np.int32).reshape(height.shape)
    basin = basin.reshape(height.shape)
    firsts, seconds, edges = [], [], []
    for direction, (down, right) in enumerate(FORWARD):
        here, there = _overlap(rows, cols, down, right)
        crossing = basin[here] != basin[there]
        firsts.append(number[here][crossing])
        seconds.append(number[there][crossing])
        edges.append(number[here][crossing].astype(np.uint32) * np.uint32(4) + np.uint32(direction))
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    tie = exact.mix(np.concatenate(edges) ^ np.uint32(tie_seed))
    z_first, z_second = height.ravel()[first], height.ravel()[second]
    order = np.lexsort((tie, np.minimum(z_first, z_second), np.maximum(z_first, z_second)))
    return first[order], second[order]


def spanning_tree(first: Cells, second: Cells) -> NDArray[np.intp]:
    """Return which edges of a graph, given in strict order, make its minimum spanning tree.

    Boruvka: every component but the outside takes its first edge that leads to another one.
    """
    size = int(max(first.max(initial=0), second.max(initial=0))) + 1
    component = np.arange(size)
    alive = np.arange(first.size)
    chosen = [np.zeros(0, np.intp)]
    while alive.size:
        # Find the best edge of each component
        best = np.full(size, first.size)
        np.minimum.at(best, component[first[alive]], alive)
        np.minimum.at(best, component[second[alive]], alive)
        best[0] = first.size
        choosing = np.flatnonzero(best < first.size)
        if not choosing.size:
            raise ParameterError(NO_OUTLET)
        edge = best[choosing]
        chosen.append(np.unique(edge))

        # Join the components; of two that chose each other, the smaller number stays the root
        other = component[first[edge]] + component[second[edge]] - choosing
        stays = (best[other] == edge) & (choosing < other)
        hook = np.arange(size)
        hook[choosing] = np.where(stays, choosing, other)
        component = follow(hook)[component]
        alive = alive[component[first[alive]] != component[second[alive]]]
    if component.any():
        raise ParameterError(NO_OUTLET)
    return np.concatenate(chosen)


def orient(first: Cells, second: Cells) -> NDArray[np.intp]:
    """Return for each node of a tree but 0 the edge that leads towards node 0.

    Leaves are taken off, over and over; the exclusive or of its edges names a leaf's last one.
    """
    size = first.size + 1
    edges = np.arange(first.size)
    last = np.zeros(size, np.intp)
    np.bitwise_xor.at(last, first, edges)
    np.bitwise_xor.at(last, second, edges)
    degree = np.bincount(first, minlength=size) + np.bincount(second, minlength=size)
    degree[0] = size + 1  # never a leaf
    towards = np.zeros(size, np.intp)
    leaves = np.flatnonzero(degree == 1)
    while leaves.size:
        edge = last[leaves]
        towards[leaves] = edge
        other = first[edge] + second[edge] - leaves
        np.bitwise_xor.at(last, other, edge)
        np.subtract.at(degree, other, 1)
        leaves = np.unique(other[degree[other] == 1])
    return towards


# --- sweeps over the tree -------------------------------------------------------------------


def generations(receiver: Cells) -> list[NDArray[np.intp]]:
    """Return the cells by their number of steps to the outlet, outlets first.

    Nothing depends on the order within a generation, and a cell's donors are all in the next.
    """
    steps = (receiver != np.arange(receiver.size)).astype(np.int32)
    pointer = receiver
    while True:
        further = pointer[pointer]
        if np.array_equal(further, pointer):
            break
        steps = steps + steps[pointer]
        pointer = further
    order = np.argsort(steps, kind="stable")
    return np.split(order, np.cumsum(np.bincount(steps))[:-1])


def drainage_area(receiver: Cells) -> Cells:
    """Return the number of cells that drain through each cell, itself included."""
    area = np.ones(receiver.size, np.int32)
    for cells in reversed(generations(receiver)[1:]):
        np.add.at(area, receiver[cells], area[cells])
    return area


def accumulate(receiver: Cells, weight: NDArray[Any]) -> NDArray[Any]:
    """Return the sum of a weight over the cells that drain through each cell.

    A cell adds its donors in increasing cell number, so floating point gives the same everywhere.
    """
    total = weight.ravel().copy()
    # Donors sorted by receiver, then by number: the k-th donor of every cell in one go
    donors = np.argsort(receiver, kind="stable")
    donors = donors[receiver[donors] != donors]
    start = np.searchsorted(receiver[donors], np.arange(receiver.size))
    count = np.bincount(receiver[donors], minlength=receiver.size)
    for cells in reversed(generations(receiver)):
        for k in range(int(count[cells].max(initial=0))):
            taking = cells[count[cells] > k]
            total[taking] = total[taking] + total[donors[start[taking] + k]]
    return total


def main_donors(receiver: Cells, area: Cells) -> Cells:
    """Return the donor with the largest area, the first of equals, or -1 without a donor."""
    donors = np.flatnonzero(receiver != np.arange(receiver.size))
    order = np.lexsort((-donors, area[donors]))
    main = np.full(receiver.size, -1, np.int32)
    main[receiver[donors[order]]] = donors[order]  # the last assignment stays
    return main


def heads(receiver: Cells, area: Cells, main_donor: Cells) -> tuple[Cells, tuple[int, ...]]:
    """Return the downstream ends of all paths, level by level, and where the levels begin.

    The level is the power of two below the area at the head, the largest first. A path that joins
    another has less than half of the area of the cell that it joins, so it is in a later level.
    """
    number = np.arange(receiver.size, dtype=np.int32)
    head = number[(receiver == number) | (main_donor[receiver] != number)]
    power = np.frexp(area[head].astype(np.float64))[1] - 1
    levels = power.max() - power
    counts = np.bincount(levels)
    return head[np.argsort(levels, kind="stable")], (0, *np.cumsum(counts).tolist())


def filled(height: Height, receiver: Cells) -> Cells:
    """Return the lowest level at which water at each cell finds a way out."""
    level = height.ravel().copy()
    for cells in generations(receiver)[1:]:
        level[cells] = np.maximum(level[cells], level[receiver[cells]])
    return level


def step_counts(receiver: Cells, cols: int) -> tuple[Cells, Cells]:
    """Return the numbers of axial and of diagonal steps from each cell to its outlet."""
    number = np.arange(receiver.size)
    is_diagonal = is_diagonal_step(number, receiver, cols)
    axial = ((receiver != number) & ~is_diagonal).astype(np.int32)
    diagonal = is_diagonal.astype(np.int32)
    for cells in generations(receiver)[1:]:
        axial[cells] += axial[receiver[cells]]
        diagonal[cells] += diagonal[receiver[cells]]
    return axial, diagonal


def is_diagonal_step(cell: NDArray[Any], receiver: NDArray[Any], cols: int) -> NDArray[np.bool_]:
    """Return whether row and column both change from a cell to its receiver."""
    slants: NDArray[np.bool_] = (cell // cols != receiver // cols) & (
        cell % cols != receiver % cols
    )
    return slants


def flow_length(receiver: Cells, cols: int) -> NDArray[np.float32]:
    """Return the distance along the flow from each cell to its outlet, in cells."""
    axial, diagonal = step_counts(receiver, cols)
    length: NDArray[np.float32] = axial.astype(np.float32) + diagonal.astype(np.float32) * SQRT2
    return length


def strahler_order(receiver: Cells) -> Cells:
    """Return the Strahler order: 1 at sources, one more where two streams of one order meet."""
    order = np.ones(receiver.size, np.int32)
    largest = np.zeros(receiver.size, np.int32)
    meeting = np.zeros(receiver.size, np.int32)
    for cells in reversed(generations(receiver)):
        order[cells] = np.maximum(largest[cells] + (meeting[cells] >= 2), 1)
        flowing = cells[receiver[cells] != cells]
        target = receiver[flowing]
        np.maximum.at(largest, target, order[flowing])
        np.add.at(meeting, target, order[flowing] == largest[target])
    return order


def longest_length(receiver: Cells, cols: int) -> NDArray[np.float32]:
    """Return the length of the longest way upstream of each cell, in cells."""
    length = flow_length(receiver, cols)
    farthest = length.copy()
    for cells in reversed(generations(receiver)[1:]):
        np.maximum.at(farthest, receiver[cells], farthest[cells])
    longest: NDArray[np.float32] = farthest - length
    return longest
