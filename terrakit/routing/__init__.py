"""Where water goes: receivers, depressions, drainage area and sweeps over the tree of flow.

Heights come as integers (quanta of a length that the caller chooses), so that drops, passes and
areas are exact, and the NumPy reference and the OpenCL kernels give the same bytes.

References
----------
.. [1] G. Cordonnier, B. Bovy, J. Braun, "A versatile, linear complexity algorithm for flow routing
   in topographies with depressions", Earth Surface Dynamics 7, 2019: passes between basins, their
   spanning tree, carving.
.. [2] A. Jain, B. Kerbl, J. Gain, B. Finley, G. Cordonnier, "FastFlow: GPU acceleration of flow
   and depression routing for landscape simulation", Computer Graphics Forum 43, 2024: the same in
   parallel.
.. [3] O. Boruvka, "O jistem problemu minimalnim", 1926: the spanning tree.
.. [4] J. Fairfield, P. Leymarie, "Drainage networks from grid digital elevation models", Water
   Resources Research 27, 1991: rho8.
.. [5] R. Barnes, C. Lehman, D. Mulla, "Priority-flood", Computers & Geosciences 62, 2014: the level
   to which depressions fill, which :func:`filled` returns by another road.
.. [6] D. Sleator, R. Tarjan, "A data structure for dynamic trees", 1983: heavy paths.
"""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import Device, DeviceArray, Program, exact
from terrakit.errors import ParameterError
from terrakit.routing import opencl, reference
from terrakit.routing.paths import ArrayT, Paths, Routing

__all__ = [
    "Paths",
    "Routing",
    "accumulate",
    "filled",
    "flow_length",
    "longest_length",
    "outlets",
    "route",
    "strahler_order",
    "sweep_down",
    "sweep_up",
]

METHODS = ("d8", "rho8")
MOST_CELLS = 2**29 - 1
HIGHEST = 2**30 - 1
_TIES = 0x7465


@overload
def route(
    height: NDArray[np.int32],
    outlet: NDArray[np.uint8],
    *,
    method: str = ...,
    seed: tuple[int, int] = ...,
    origin: tuple[int, int] = ...,
    device: None = None,
) -> Routing[NDArray[Any]]: ...
@overload
def route(
    height: NDArray[np.int32] | DeviceArray,
    outlet: NDArray[np.uint8] | DeviceArray,
    *,
    method: str = ...,
    seed: tuple[int, int] = ...,
    origin: tuple[int, int] = ...,
    device: Device,
) -> Routing[DeviceArray]: ...
def route(
    height: NDArray[np.int32] | DeviceArray,
    outlet: NDArray[np.uint8] | DeviceArray,
    *,
    method: str = "d8",
    seed: tuple[int, int] = (0, 0),
    origin: tuple[int, int] = (0, 0),
    device: Device | None = None,
) -> Routing[NDArray[Any]] | Routing[DeviceArray]:
    """Lead the water of every cell to an outlet.

    Each cell drains to its steepest strictly lower neighbour. Depressions, flats among them, drain
    over their lowest pass, as if a river had cut its way from the pit up to it: receivers are
    always neighbours, without a cycle, and the highest cell on the way out is as low as possible.

    Parameters
    ----------
    height
        int32 (rows, cols), in quanta, between -2**30 and 2**30.
    outlet
        uint8 (rows, cols), not 0 where water leaves: border, sea, no data. At least one cell.
    method
        ``d8``, or ``rho8``, whose diagonals are weighted at random so that flow on a plane
        follows the true direction in the mean.
    seed
        Two 32-bit words; they decide ``rho8`` and which of equally low passes are taken.
    origin
        World row and column of the first cell, for ``rho8``.
    device
        Where to work, and where the result stays; without one, the NumPy reference.

    Raises
    ------
    ParameterError
        If an array has the wrong shape or type, or no cell is an outlet.
    """
    _check(height, outlet, method)
    words = (seed[0] & 0xFFFFFFFF, seed[1] & 0xFFFFFFFF)
    tie_seed = int(exact.hashed(words, _TIES, 0)[0])
    if device is not None:
        if not isinstance(height, DeviceArray):
            height = device.upload(height)
        if not isinstance(outlet, DeviceArray):
            outlet = device.upload(outlet)
        return opencl.route(device, height, outlet, method, words, origin, tie_seed)
    if isinstance(height, DeviceArray) or isinstance(outlet, DeviceArray):
        raise ParameterError("device: none given for arrays that are on a device")
    receiver = reference.receivers(height, outlet, method, words, origin)
    receiver = reference.drain_depressions(height, outlet, receiver, tie_seed)
    area = reference.drainage_area(receiver)
    main_donor = reference.main_donors(receiver, area)
    heads, offsets = reference.heads(receiver, area, main_donor)
    shape = height.shape
    paths = Paths(main_donor.reshape(shape), heads, offsets)
    return Routing(receiver.reshape(shape), area.reshape(shape), paths)


def accumulate(routing: Routing[ArrayT], weight: ArrayT) -> ArrayT:
    """Return the sum of a weight, int32 or float32, over the cells that drain through each cell.

    With rain on each cell it is the discharge. Donors are added in the order of their numbers, so
    that floating point gives the same on every device. Integers must not overflow.
    """
    receiver = routing.receiver
    if weight.dtype not in (np.int32, np.float32) or weight.shape != receiver.shape:
        raise ParameterError(
            f"weight: needs int32 or float32 {tuple(receiver.shape)}, "
            f"got {weight.dtype} {tuple(weight.shape)}"
        )
    if isinstance(receiver, DeviceArray):
        total = receiver.device.empty(receiver.shape, weight.dtype)
        kernel = "routing_sum_int" if weight.dtype == np.int32 else "routing_sum_float"
        rows, cols = receiver.shape
        arguments = (weight, total, np.int32(rows), np.int32(cols))
        sweep_down(routing, opencl.program(receiver.device), kernel, *arguments)
        return total
    return reference.accumulate(receiver.ravel(), weight).reshape(receiver.shape)


def filled(routing: Routing[ArrayT], height: ArrayT) -> ArrayT:
    """Return the level to which water rises before it finds a way out, int32 (rows, cols).

    It is the highest cell between here and the outlet, and equals what Priority-Flood [5]_ fills.
    """
    receiver = routing.receiver
    if isinstance(receiver, DeviceArray):
        level = receiver.device.empty(receiver.shape, np.int32)
        sweep_up(routing, opencl.program(receiver.device), "routing_fill", height, level)
        return level
    return reference.filled(height, receiver.ravel()).reshape(receiver.shape)


def outlets(routing: Routing[ArrayT]) -> ArrayT:
    """Return the number of the outlet that each cell drains to, int32 (rows, cols)."""
    receiver = routing.receiver
    if isinstance(receiver, DeviceArray):
        outlet_of = receiver.device.empty(receiver.shape, np.int32)
        program = opencl.program(receiver.device)
        sweep_up(routing, program, "routing_find_outlets", outlet_of)
        return outlet_of
    return reference.follow(receiver.ravel()).reshape(receiver.shape)


def flow_length(routing: Routing[ArrayT]) -> ArrayT:
    """Return the way along the flow from each cell to its outlet, in cells, float32 (rows, cols).

    The axial and the diagonal steps are counted as integers, and put together at the end.
    """
    receiver = routing.receiver
    if isinstance(receiver, DeviceArray):
        device, shape = receiver.device, receiver.shape
        axial, diagonal = device.empty(shape, np.int32), device.empty(shape, np.int32)
        length = device.empty(shape, np.float32)
        arguments = (axial, diagonal, length, np.int32(shape[1]))
        sweep_up(routing, opencl.program(device), "routing_measure", *arguments)
        return length
    return reference.flow_length(receiver.ravel(), receiver.shape[1]).reshape(receiver.shape)


def strahler_order(receiver: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the Strahler order of each cell of a host array (rows, cols) of receivers."""
    return reference.strahler_order(receiver.ravel()).reshape(receiver.shape)


def longest_length(receiver: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return the length, in cells, of the longest way upstream of each cell of a host array."""
    return reference.longest_length(receiver.ravel(), receiver.shape[1]).reshape(receiver.shape)


def sweep_up(
    routing: Routing[DeviceArray],
    program: Program,
    kernel: str,
    *arguments: DeviceArray | np.generic,
) -> None:
    """Launch a kernel over the paths of a routing, level by level from the outlets up.

    The kernel begins ``(heads, start, count, receiver, main_donor, ...)`` as ``routing_fill`` in
    ``routing.cl`` does: a work-item takes the path of ``heads[start + get_global_id(0)]`` and
    solves ``x[i] = f(x[receiver[i]], ...)`` from its head along the main donors. The result is that
    of a serial sweep, bit for bit.
    """
    opencl.sweep_up(routing, program, kernel, *arguments)


def sweep_down(
    routing: Routing[DeviceArray],
    program: Program,
    kernel: str,
    *arguments: DeviceArray | np.generic,
) -> None:
    """Launch a kernel over the paths of a routing, level by level from the sources down.

    The kernel begins as for :func:`sweep_up`; a work-item walks from the source of its path down to
    the head, and finds the donors from the side done. See ``routing_sum_float``.
    """
    opencl.sweep_down(routing, program, kernel, *arguments)


def _check(
    height: NDArray[Any] | DeviceArray, outlet: NDArray[Any] | DeviceArray, method: str
) -> None:
    if method not in METHODS:
        raise ParameterError(f"method: {method!r} is none of {', '.join(METHODS)}")
    if height.dtype != np.int32 or len(height.shape) != 2 or 0 in height.shape:
        raise ParameterError(
            f"height: needs int32 (rows, cols), got {height.dtype} {tuple(height.shape)}"
        )
    if outlet.dtype != np.uint8 or outlet.shape != height.shape:
        raise ParameterError(
            f"outlet: needs uint8 {tuple(height.shape)}, got {outlet.dtype} {tuple(outlet.shape)}"
        )
    if height.size > MOST_CELLS:
        raise ParameterError(
            f"height: {height.size} cells, routing takes at most {MOST_CELLS}; use fewer samples"
        )
    if isinstance(outlet, np.ndarray) and not outlet.any():
        raise ParameterError(reference.NO_OUTLET)
    if isinstance(height, np.ndarray):
        lowest, highest = int(height.min()), int(height.max())
        if max(-lowest, highest) > HIGHEST:
            raise ParameterError(
                f"height: {lowest} to {highest} quanta, routing takes up to {HIGHEST} either way; "
                "use a larger quantum"
            )
