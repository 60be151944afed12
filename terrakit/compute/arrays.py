"""An array in the memory of a device."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

if TYPE_CHECKING:
    from terrakit.compute.device import Device


class DeviceArray:
    """A C-contiguous array on a device; nothing moves to or from it unless asked.

    Parameters
    ----------
    device
        The device that owns the memory.
    buffer
        The OpenCL buffer, at least as large as the array.
    """

    __slots__ = ("buffer", "device", "dtype", "shape")

    def __init__(
        self, device: Device, buffer: Any, shape: tuple[int, ...], dtype: DTypeLike
    ) -> None:
        self.device = device
        self.buffer = buffer
        self.shape = shape
        self.dtype: np.dtype[Any] = np.dtype(dtype)

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)

    @property
    def nbytes(self) -> int:
        """Bytes that the elements take."""
        return self.size * self.dtype.itemsize

    def download(self) -> NDArray[Any]:
        """Return a copy on the host."""
        return self.device.download(self)

    def __repr__(self) -> str:
        return f"DeviceArray(shape={self.shape}, dtype={self.dtype}, device={self.device.name!r})"
