"""Loose material that slides over bedrock, sweep by sweep, in NumPy and on a device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrakit_erosion.thermal import reference
from terrakit_erosion.thermal.ground import Counts, Floats, ring_of

if TYPE_CHECKING:
    from terrakit.compute import Device, DeviceArray
    from terrakit.strata import Exposure


class NumPySliding:
    """Heights and bedrock that change from sweep to sweep.

    Parameters
    ----------
    height, bed
        Height of the ground and of the bedrock, quanta.
    scheme
        ``flux`` or ``proportional``.
    share
        Share of the excess that a sweep moves.
    open_border
        Whether material may leave over the edge of the map.
    """

    def __init__(
        self, height: Counts, bed: Counts, scheme: str, share: float, open_border: bool
    ) -> None:
        self.height: Any = height
        self.bed: Any = bed.copy()
        self._exported = ring_of(height.shape)
        self._shares = (share * 2 / 3, share / 6)
        self._share = share
        self._flux = scheme == "flux"
        self._open = open_border
        self._talus = self._rock = np.zeros(height.shape, dtype=np.int32)
        self._softness = np.ones(height.shape, dtype=np.float32)

    def rest_loose(self, limit: Counts) -> None:
        """Set the difference to an axial neighbour at which loose material rests, quanta."""
        self._talus = np.broadcast_to(limit, self.height.shape)

    def rest_rock(self, limit: Counts) -> None:
        """Set the difference to an axial neighbour at which bedrock holds, quanta."""
        self._rock = np.broadcast_to(limit, self.height.shape)

    def rest_beds(self, exposure: Exposure, scale: float) -> None:
        """Take the angle of the bed that crops out; ``scale`` turns tangents into quanta."""
        repose = exposure.field("repose", self.bed)
        assert isinstance(repose, np.ndarray)
        self._rock = reference.limit_of(repose, scale)

    def soften(self, softness: Floats) -> None:
        """Set how much of what bedrock would give it does give, 0 to 1."""
        self._softness = np.broadcast_to(softness, self.height.shape)

    def sweep(self) -> None:
        """Let everything slide once."""
        exported = self._exported if self._open else None
        axial, diagonal = self._shares if self._flux else (1.0, 1.0)
        if self._flux:
            weight = reference.hold(self.height, self.bed, self._talus, axial, diagonal, self._open)
            rock_weight = self._softness
        else:
            weight, rock_weight = reference.hold_shares(
                self.height,
                self.bed,
                self._talus,
                self._rock,
                self._softness,
                self._share,
                self._open,
            )
        self.height = reference.slide(
            self.height,
            self.bed,
            self._talus,
            self._rock,
            weight,
            rock_weight,
            axial,
            diagonal,
            exported,
        )

    def ends(self) -> tuple[Counts, Counts, NDArray[np.int64]]:
        """Return the height, the bedrock, and what left through the borders."""
        return self.height, self.bed, self._exported


class OpenCLSliding:
    """The same on a device, where everything stays; see :class:`NumPySliding`."""

    def __init__(
        self,
        height: Counts,
        bed: Counts,
        scheme: str,
        share: float,
        open_border: bool,
        device: Device,
    ) -> None:
        self._device = device
        self._program = device.program(__file__, "thermal.cl", {"THERMAL_LAYERED": 1})
        self.height: Any = device.upload(height)
        self.bed: Any = device.upload(bed)
        self._after = device.empty(height.shape, np.int32)
        self._exported = device.upload(
            ring_of(height.shape) if open_border else np.zeros(1, np.int64)
        )
        self._share = np.float32(share)
        self._shares = np.float32(share * 2 / 3), np.float32(share / 6)
        self._flux = scheme == "flux"
        self._open = np.int32(open_border)
        self._size = np.int32(height.shape[0]), np.int32(height.shape[1])
        self._talus = device.empty(height.shape, np.int32)
        self._rock = device.empty(height.shape, np.int32)
        self._softness = device.full(height.shape, 1.0)
        self._weight = device.empty(height.shape)
        self._rock_weight = self._softness if self._flux else device.empty(height.shape)
        self._repose: DeviceArray | None = None

    def rest_loose(self, limit: Counts) -> None:
        """Set the difference to an axial neighbour at which loose material rests, quanta."""
        self._set(self._talus, limit)

    def rest_rock(self, limit: Counts) -> None:
        """Set the difference to an axial neighbour at which bedrock holds, quanta."""
        self._set(self._rock, limit)

    def rest_beds(self, exposure: Exposure, scale: float) -> None:
        """Take the angle of the bed that crops out; ``scale`` turns tangents into quanta."""
        if self._repose is None:
            self._repose = self._device.empty(self.height.shape)
        exposure.field("repose", self.bed, into=self._repose)
        count = self.height.size
        self._program.launch(
            "thermal_limit", count, self._repose, self._rock, np.float32(scale), np.int32(count)
        )

    def soften(self, softness: Floats) -> None:
        """Set how much of what bedrock would give it does give, 0 to 1."""
        self._set(self._softness, softness)

    def sweep(self) -> None:
        """Let everything slide once."""
        ends = (self._open, *self._size)
        ground = self.height, self.bed
        if self._flux:
            shares = self._shares
            self._launch("thermal_hold", *ground, self._talus, self._weight, *shares, *ends)
        else:
            shares = np.float32(1), np.float32(1)
            rests = self._talus, self._rock, self._softness
            weights = self._weight, self._rock_weight
            self._launch("thermal_hold_shares", *ground, *rests, *weights, self._share, *ends)
        self._launch(
            "thermal_slide",
            *(self.height, self._after, self.bed, self._talus, self._rock),
            *(self._weight, self._rock_weight, self._exported, *shares, *ends),
        )
        self.height, self._after = self._after, self.height

    def ends(self) -> tuple[Counts, Counts, NDArray[np.int64]]:
        """Return the height, the bedrock, and what left through the borders."""
        height = self.height.download()
        left = self._exported.download() if self._open else ring_of(height.shape)
        return height, self.bed.download(), left

    def _launch(self, name: str, *arguments: Any) -> None:
        rows, cols = self.height.shape
        self._program.launch(
            name,
            (rows,) if self._device.is_cpu else (rows, cols),
            *arguments,
            local=(4,) if self._device.is_cpu else None,
        )

    def _set(self, field: DeviceArray, values: NDArray[Any]) -> None:
        """Fill a field with a number, or copy one into it."""
        if values.ndim == 0:
            self._device.fill(field, values.item())
        else:
            self._device.write(field, np.ascontiguousarray(values, dtype=field.dtype))


Sliding = NumPySliding | OpenCLSliding


def sliding(
    height: Counts,
    bed: Counts,
    scheme: str,
    share: float,
    open_border: bool,
    device: Device | None,
) -> Sliding:
    """Return the ground, ready to slide, on ``device`` or, where that is None, in NumPy."""
    if device is None:
        return NumPySliding(height, bed, scheme, share, open_border)
    return OpenCLSliding(height, bed, scheme, share, open_border, device)
