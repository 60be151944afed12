"""The bed that crops out at every point, while the ground comes down."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from terrakit.quanta import Quanta

if TYPE_CHECKING:
    from terrakit.compute import DeviceArray
    from terrakit.operators import Surface
    from terrakit.running import Run
    from terrakit.strata.column import Strata

CELLS_AN_ITEM = 4096
"""Consecutive points that a work-item takes on a CPU; on a GPU it takes one."""
FARTHEST = 2**29
"""Largest count of the datum and of its rise: beyond it, one bed goes on for ever."""

_Array = TypeVar("_Array", "NDArray[np.int32]", "DeviceArray")


class Exposure:
    """What an erosion asks which bed it meets.

    ::

        exposure = Exposure(surface, quanta, run)
        if exposure.present:
            factor = exposure.field("erodibility", bedrock)

    Parameters
    ----------
    surface
        The terrain; without strata, ``present`` is False and there is nothing to ask.
    quanta
        How the operator counts heights.
    run
        Its device computes the fields; with the NumPy reference they are host arrays.
    """

    def __init__(self, surface: Surface, quanta: Quanta, run: Run) -> None:
        self.strata: Strata | None = surface.strata if "strata_datum" in surface else None
        self._device = run.device
        self._lift = 0
        self._held: dict[str, DeviceArray] = {}
        if self.strata is None:
            return
        self._bases = self.strata.bases(quanta.quantum)
        self._total = int(self._bases[-1]) if self.strata.repeated else 0
        datum = np.rint(surface.layer("strata_datum").astype(np.float64) / quanta.quantum)
        counts = datum - quanta.datum
        if self._total:
            counts = counts % self._total
        self._datum = np.clip(counts, -FARTHEST, FARTHEST).astype(np.int32)

    @property
    def present(self) -> bool:
        """Whether the surface has beds."""
        return self.strata is not None

    def rise(self, counts: NDArray[np.int32] | int) -> None:
        """Lift the beds with the ground, by quanta: of every point, or one for all."""
        if np.ndim(counts) == 0 or np.size(counts) == 1:
            risen = self._lift + int(np.reshape(counts, -1)[0])
            self._lift = risen % self._total if self._total else min(risen, FARTHEST)
            return
        total = self._datum.astype(np.int64) + counts
        if self._total:
            total %= self._total
        self._datum = np.clip(total, -FARTHEST, FARTHEST).astype(np.int32)
        self._held.pop("datum", None)

    def field(
        self,
        name: str,
        bedrock: _Array,
        factor: float | NDArray[np.float32] | DeviceArray = 1.0,
        into: DeviceArray | None = None,
    ) -> NDArray[np.float32] | DeviceArray:
        """Return a property of the bed that crops out, times ``factor``, of the surface's shape.

        Parameters
        ----------
        name
            ``erodibility``, ``softness``, ``hardness`` or ``repose``; see
            :meth:`terrakit.strata.Strata.values`.
        bedrock
            Height of the bedrock, quanta: a host array with the reference, else on the device.
        factor
            A number or a field; on the device a field is a float32 array of it.
        into
            Device array to write to, instead of a new one.
        """
        assert self.strata is not None
        values = self.strata.values(name)
        per_total = np.float32(1.0 / self._total) if self._total else np.float32(0)
        if isinstance(bedrock, np.ndarray):
            found = values[self.bed(bedrock)]
            exposed: NDArray[np.float32] = np.asarray(factor, dtype=np.float32) * found
            return exposed
        return self._launch(name, values, bedrock, factor, into, per_total)

    def bed(self, bedrock: NDArray[np.int32]) -> NDArray[np.intp]:
        """Return the number of the bed that crops out, 0 the uppermost, on the host."""
        depth = (self._datum + np.int32(self._lift) - bedrock).astype(np.int32)
        if self._total:
            depth = _within(depth, self._total, np.float32(1.0 / self._total))
        found: NDArray[np.intp] = np.searchsorted(self._bases[:-1], depth, side="right")
        return found

    def _launch(
        self,
        name: str,
        values: NDArray[np.float32],
        bedrock: DeviceArray,
        factor: float | NDArray[np.float32] | DeviceArray,
        into: DeviceArray | None,
        per_total: np.float32,
    ) -> DeviceArray:
        device = self._device
        assert device is not None
        if isinstance(factor, (int, float, np.ndarray, np.generic)):
            factor = device.upload(np.atleast_1d(np.asarray(factor, dtype=np.float32)))
        exposed = device.empty(bedrock.shape) if into is None else into
        run = CELLS_AN_ITEM if device.is_cpu else 1
        varies = factor.size > 1
        program = device.program(__file__, "strata.cl", {"STRATA_FIELD": 1} if varies else None)
        program.launch(
            "strata_expose",
            -(-bedrock.size // run),
            *(bedrock, self._kept("datum", self._datum), self._kept("bases", self._bases)),
            *(self._kept(name, values), factor, exposed),
            *(np.int32(self._lift), np.int32(len(values)), np.int32(self._total), per_total),
            *(np.int32(bedrock.size), np.int32(run)),
            local=(4,) if device.is_cpu else None,
        )
        return exposed

    def _kept(self, name: str, values: NDArray[np.generic]) -> DeviceArray:
        """Return an array on the device, where it stays."""
        assert self._device is not None
        if name not in self._held:
            self._held[name] = self._device.upload(values)
        return self._held[name]


def _within(depth: NDArray[np.int32], total: int, per_total: np.float32) -> NDArray[np.int32]:
    """Return the position in a column that repeats; see ``strata.cl``."""
    turns = (depth.astype(np.float32) * per_total).astype(np.int32)
    rest = depth - turns * np.int32(total)
    rest = np.where(rest < 0, rest + np.int32(total), rest)
    rest = np.where(rest >= total, rest - np.int32(total), rest)
    return rest.astype(np.int32)
