"""The automaton on an OpenCL device; see ``automaton.cl``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import Device, DeviceArray

Counts = NDArray[np.int32]


class OpenCLModel:
    """State of the automaton on the device; parameters as of the NumPy model."""

    def __init__(
        self,
        bedrock: Counts,
        loose: Counts,
        rates: tuple[float, float, float],
        is_open: bool,
        device: Device,
    ) -> None:
        self.device = device
        self.shape = bedrock.shape
        self.bedrock, self.loose = device.upload(bedrock), device.upload(loose)
        self.water = device.zeros(self.shape, np.int32)
        self.load = device.zeros(self.shape, np.int32)
        self.level = device.empty(self.shape, np.int32)
        self.gives, self.carries = device.empty(self.shape), device.empty(self.shape)
        self.rates = tuple(np.float32(rate) for rate in rates)
        self.is_open = np.int32(is_open)
        self._exported = device.zeros(2 * sum(self.shape), np.int64)
        self._sent: dict[str, tuple[Any, DeviceArray]] = {}

    def step(self, rain: Counts, softness: NDArray[np.float32] | DeviceArray) -> None:
        """Let it rain and dissolve, share water and load out, evaporate and lay down."""
        device, (rows, cols) = self.device, self.shape
        varies = rain.size > 1 or softness.size > 1
        program = device.program(
            __file__, "automaton.cl", {"AUTOMATON_FIELDS": 1} if varies else None
        )
        solubility, evaporated, saturation = self.rates
        grid = (rows,) if device.is_cpu else self.shape
        group = (4,) if device.is_cpu else None
        size = np.int32(rows), np.int32(cols)
        program.launch(
            "automaton_wet",
            rows * cols,
            *(self.bedrock, self.loose, self.water, self.load, self.level),
            *(self._on("rain", rain, varies), self._on("softness", softness, varies)),
            *(solubility, np.int32(rows * cols)),
        )
        program.launch(
            "automaton_share",
            grid,
            *(self.level, self.water, self.load, self.gives, self.carries, self.is_open, *size),
            local=group,
        )
        program.launch(
            "automaton_gather",
            grid,
            *(self.level, self.gives, self.carries, self.loose, self.water, self.load),
            *(self._exported, evaporated, saturation, self.is_open, *size),
            local=group,
        )

    def ground(self) -> tuple[Counts, Counts]:
        """Return bedrock and loose ground with what is still dissolved laid down on it."""
        return self.bedrock.download(), self.loose.download() + self.load.download()

    def exported(self) -> tuple[int, int, int, int]:
        """Return the load that left through the northern, southern, western, eastern border."""
        rows, cols = self.shape
        gone = self._exported.download()
        parts = np.split(gone, (cols, 2 * cols, 2 * cols + rows))
        north, south, west, east = (int(part.sum()) for part in parts)
        return north, south, west, east

    def _on(self, name: str, values: Any, varies: bool) -> DeviceArray:
        """Return values on the device; those that stay the same are sent once."""
        if isinstance(values, DeviceArray):
            return values
        kept = self._sent.get(name)
        if kept is None or kept[0] is not values:
            whole = np.broadcast_to(values, self.shape) if varies else values
            kept = self._sent[name] = values, self.device.upload(whole)
        return kept[1]
