"""Routing on an OpenCL device: which kernels run, and in what order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from terrakit.compute import Device, DeviceArray, Program
from terrakit.errors import KernelError, ParameterError
from terrakit.routing.paths import Paths, Routing
from terrakit.routing.reference import NO_OUTLET

CELLS_AN_ITEM = 1024
"""Consecutive cells that a work-item takes on a CPU; on a GPU it takes one."""
BLOCK = 256
"""Cells whose path heads are counted together."""
LEVELS = 32

_INT = np.int32
_UINT = np.uint32


def program(device: Device, method: str = "d8") -> Program:
    """Return the routing kernels."""
    return device.program(__file__, "routing.cl", {"RHO8": int(method == "rho8")})


# One work-group size each, whatever the length: PoCL compiles a kernel anew for each size
_PATHS_A_GROUP = (64,)


def _group(device: Device) -> tuple[int]:
    return (8,) if device.is_cpu else (64,)


class Kernels:
    """The routing program and its launches over a grid of a given shape."""

    def __init__(self, device: Device, shape: tuple[int, int], method: str = "d8") -> None:
        self.device = device
        self.shape = shape
        self.rows, self.cols = shape
        self.cells = self.rows * self.cols
        self.program = program(device, method)
        self.run = CELLS_AN_ITEM if device.is_cpu else 1

    def over_rows(self, name: str, *arguments: DeviceArray | np.generic) -> None:
        """Launch a kernel whose work-items take runs of cells of one row."""
        self.program.launch(
            name,
            (self.rows, -(-self.cols // self.run)),
            *arguments,
            *(_INT(self.rows), _INT(self.cols), _INT(self.run)),
            local=(*_group(self.device), 1) if self.device.is_cpu else None,
        )

    def over_list(self, name: str, size: int, *arguments: DeviceArray | np.generic) -> None:
        """Launch a kernel whose work-items take runs of a list."""
        self.program.launch(
            name,
            -(-size // self.run),
            *arguments,
            *(_INT(size), _INT(self.run)),
            local=_group(self.device),
        )

    def integers(self) -> DeviceArray:
        """Return an array of int32, a cell each."""
        return self.device.empty(self.shape, _INT)


def route(
    device: Device,
    height: DeviceArray,
    outlet: DeviceArray,
    method: str,
    seed: tuple[int, int],
    origin: tuple[int, int],
    tie_seed: int,
) -> Routing[DeviceArray]:
    """Return the receivers, the drainage area and the paths of a terrain."""
    rows, cols = height.shape
    kernels = Kernels(device, (rows, cols), method)
    receiver = kernels.integers()
    words = [_UINT(word & 0xFFFFFFFF) for word in (*seed, *origin)]
    kernels.over_rows("routing_receivers", height, outlet, receiver, *words)
    drain_depressions(kernels, height, outlet, receiver, _UINT(tie_seed))
    area = drainage_area(kernels, receiver)
    return Routing(receiver, area, cut_into_paths(kernels, receiver, area))


# --- depressions ----------------------------------------------------------------------------


def drain_depressions(
    kernels: Kernels,
    height: DeviceArray,
    outlet: DeviceArray,
    receiver: DeviceArray,
    tie_seed: np.uint32,
) -> None:
    """Lead the receivers, in place, out of every depression over the lowest possible passes."""
    device = kernels.device
    counter = device.zeros(1, _INT)
    link = kernels.integers()
    kernels.over_list("routing_number_pits", kernels.cells, receiver, outlet, link, counter)
    basins = _read(counter)
    if basins == 0:
        return
    link = follow(kernels, link, kernels.cells)

    # Boruvka: join components until only the outside, number 0, is left
    edges = list_passes(kernels, height, link, tie_seed)
    parent = device.zeros(basins + 1, _INT)
    spill = device.empty(basins + 1, _UINT)
    components = basins
    while components:
        if edges.size == 0:
            raise ParameterError(NO_OUTLET)
        components, joined = join(kernels, height, link, edges, parent, spill, components, tie_seed)
        if components:
            edges = edges.contract(kernels, joined)

    kernels.program.launch(
        "routing_carve",
        basins,
        *(link, spill, receiver, _INT(basins), _INT(kernels.cols)),
        local=_PATHS_A_GROUP,
    )


def follow(kernels: Kernels, link: DeviceArray, size: int) -> DeviceArray:
    """Return the end of every chain of links; the given links are overwritten."""
    device = kernels.device
    further = device.empty(link.shape, _INT)
    unfinished = device.empty(1, _INT)
    for _ in range(size.bit_length() + 1):  # each launch makes the links at least twice as long
        device.fill(unfinished, 0)
        kernels.over_list("routing_follow", size, link, further, unfinished)
        link, further = further, link
        if not _read(unfinished):
            return link
    raise KernelError(f"routing.cl on {device.name}: chains of links run in a circle")


class Edges:
    """A list of edges between components: the edge, and the component at either end."""

    def __init__(self, device: Device, capacity: int) -> None:
        self.edge = device.empty(capacity, _UINT)
        self.one = device.empty(capacity, _INT)
        self.two = device.empty(capacity, _INT)
        self.capacity = capacity
        self.size = 0

    @property
    def arrays(self) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
        """The three columns, in the order of the kernels."""
        return self.edge, self.one, self.two

    def contract(self, kernels: Kernels, joined: DeviceArray) -> Edges:
        """Return the edges that still lead to another component, under the new numbers."""
        kept = Edges(kernels.device, self.size)
        counter = kernels.device.zeros(1, _INT)
        kernels.over_list(
            "routing_contract",
            self.size,
            *(joined, *self.arrays, *kept.arrays, counter, _UINT(kept.capacity)),
        )
        kept.size = _read(counter)
        return kept


def list_passes(
    kernels: Kernels, height: DeviceArray, link: DeviceArray, tie_seed: np.uint32
) -> Edges:
    """Return the edges between basins that may belong to the tree."""
    capacity = max(64, kernels.cells)
    while True:
        edges = Edges(kernels.device, capacity)
        counter = kernels.device.zeros(1, _INT)
        kernels.over_rows(
            "routing_list_passes",
            *(height, link, *edges.arrays, counter, _UINT(capacity), tie_seed),
        )
        edges.size = _read(counter)
        if edges.size <= capacity:
            return edges
        capacity = edges.size  # flats have up to four edges a cell: list again, with room


def join(
    kernels: Kernels,
    height: DeviceArray,
    link: DeviceArray,
    edges: Edges,
    parent: DeviceArray,
    spill: DeviceArray,
    components: int,
    tie_seed: np.uint32,
) -> tuple[int, DeviceArray]:
    """Join each component to a neighbour; return how many are left, and the new numbers."""
    device = kernels.device
    high, low, tie = (device.full(components + 1, 0xFFFFFFFF, _UINT) for _ in range(3))
    for step in range(3):
        kernels.over_list(
            "routing_offer",
            edges.size,
            *(height, *edges.arrays, high, low, tie, _INT(step), tie_seed, _INT(kernels.cols)),
        )
    joined = device.full(components + 1, -1, _INT)
    counter = device.zeros(1, _INT)
    kernels.over_list(
        "routing_join",
        edges.size,
        *(link, *edges.arrays, tie, parent, spill, joined, counter, tie_seed, _INT(kernels.cols)),
    )
    return _read(counter), follow(kernels, joined, components + 1)


def _read(counter: DeviceArray) -> int:
    return int(counter.download()[0])


# --- drainage area and paths ----------------------------------------------------------------


def drainage_area(kernels: Kernels, receiver: DeviceArray) -> DeviceArray:
    """Return the number of cells that drain through each cell."""
    area = kernels.integers()
    donors = kernels.device.empty(kernels.shape, np.uint8)
    kernels.over_rows("routing_count_donors", receiver, donors, area)
    kernels.over_list("routing_accumulate", kernels.cells, receiver, donors, area)
    return area


def cut_into_paths(
    kernels: Kernels, receiver: DeviceArray, area: DeviceArray
) -> Paths[DeviceArray]:
    """Return the paths along the main donors."""
    device = kernels.device
    main_donor = kernels.integers()
    kernels.over_rows("routing_main_donors", receiver, area, main_donor)

    # Sort the heads by level: count, sum up, list
    blocks = -(-kernels.cells // BLOCK)
    tree = (receiver, main_donor, area)
    sizes = (_INT(kernels.cells), _INT(blocks), _INT(BLOCK))
    counts = device.empty((LEVELS, blocks), _INT)
    launch, local = kernels.program.launch, _group(device)
    launch("routing_count_heads", blocks, *tree, counts, *sizes, local=local)
    counted = counts.download()
    ends = np.cumsum(counted.ravel(), dtype=_INT)
    starts = (ends - counted.ravel()).reshape(counted.shape)
    heads = device.empty(int(ends[-1]), _INT)
    launch("routing_list_heads", blocks, *tree, device.upload(starts), heads, *sizes, local=local)
    used = np.flatnonzero(counted.any(axis=1))
    levels = starts[used[0] : used[-1] + 1, 0]
    return Paths(main_donor, heads, (*levels.tolist(), heads.size))


def sweep_up(
    routing: Routing[DeviceArray],
    program: Program,
    kernel: str,
    *arguments: DeviceArray | np.generic,
) -> None:
    """Launch a kernel over the paths, level by level from the outlets up."""
    for start, end in pairwise(routing.paths.offsets):
        _over_level(routing, program, kernel, start, end - start, arguments)


def sweep_down(
    routing: Routing[DeviceArray],
    program: Program,
    kernel: str,
    *arguments: DeviceArray | np.generic,
) -> None:
    """Launch a kernel over the paths, level by level from the sources down."""
    for end, start in pairwise(reversed(routing.paths.offsets)):
        _over_level(routing, program, kernel, start, end - start, arguments)


def _over_level(
    routing: Routing[DeviceArray],
    program: Program,
    kernel: str,
    start: int,
    count: int,
    arguments: tuple[DeviceArray | np.generic, ...],
) -> None:
    paths = routing.paths
    tree = (paths.heads, _INT(start), _INT(count), routing.receiver, paths.main_donor)
    program.launch(kernel, count, *tree, *arguments, local=_PATHS_A_GROUP)
