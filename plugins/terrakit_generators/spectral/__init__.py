"""Spectral synthesis: fractal ground with exactly the roughness that was asked for."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.errors import ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Generator
from terrakit.parameters import Seed, parameter
from terrakit.running import Run
from terrakit.world import FINE, parts
from terrakit_generators.spectral import reference

MOST_WAVES = 2048
"""Waves of the shortest length that a period may have, so that memory and time stay in bounds."""
COUNTED_WAVES = 256
"""Waves a period down to which the deviation of heights is measured."""


class Spectral(Generator):
    """Sum the waves of a power spectrum into ground of an exact Hurst exponent.

    All waves that repeat after ``period`` are summed, each with a hash of its wave vector as
    phase::

        z(x) = offset + c sum_k |k|^-(H + 1) cos(2 pi k . x / period + phi_k)

    with c such that the deviation of heights is the amplitude. The power spectrum falls exactly as
    ``|k|^-(2 H + 2)``, so the variogram grows with the distance to the power 2 H. Every sample
    adds up its own waves, first along x, then along y: no transform of the map, so a tile equals
    the whole, and any spacing will do. Half the spacing only adds shorter waves.

    Notes
    -----
    The ground repeats after ``period`` in both directions. Waves below ``shortest_wavelength``, or
    two spacings without it, and below 1/2048 of the period are left out.

    References
    ----------
    R. F. Voss, "Random fractal forgeries", 1985. D. Saupe, "Algorithms for random fractals", in:
    The Science of Fractal Images, 1988.
    """

    name = "spectral"
    cites = ("Voss 1985", "Saupe 1988")
    fields = 16
    portrait = 2e4
    trial: ClassVar = {"period": 500.0, "shortest_wavelength": 15.0}

    amplitude: float = parameter(
        300.0, "Usual height above or below the offset (deviation).", unit="m", ge=0, le=1e6
    )
    period: float = parameter(
        2e4, "Distance after which the ground repeats; the longest wave.", unit="m", gt=0, le=1e8
    )
    hurst_exponent: float = parameter(
        0.85, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    longest_wavelength: float | None = parameter(
        None, "Longest waves that are left in; without it all.", unit="m", gt=0, le=1e8
    )
    shortest_wavelength: float | None = parameter(
        None, "Shortest waves that are left in; without it all.", unit="m", gt=0, le=1e8
    )
    stretch: float = parameter(1.0, "How many times longer than wide hills are.", ge=1, le=100)
    direction: float = parameter(
        0.0,
        "Where stretched hills point, clockwise from north.",
        unit="deg",
        ge=-360,
        le=360,
    )
    offset: float = parameter(0.0, "Height of the middle of the range.", unit="m", ge=-1e6, le=1e6)
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    presets: ClassVar = {
        "rugged": {"hurst_exponent": 0.6},
        "folded": {"stretch": 4.0, "direction": 30.0, "longest_wavelength": 5000.0},
    }

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return the sum of the waves on ``grid``."""
        most, band = self._waves(grid.spacing)
        squeeze = self._squeeze()
        spectrum = reference.spectrum(
            most, band, self.hurst_exponent, squeeze, run.words(self.name, self.seed)
        ) * np.float32(self._height(squeeze))
        rows, cols = grid.shape
        x, y = grid.north_west
        turn_x = reference.turns(self._positions(x, cols, 1, grid.spacing), most)
        turn_y = reference.turns(self._positions(y, rows, -1, grid.spacing), most)
        device = run.device
        if device is None:
            elevation = reference.waves(spectrum, turn_x, turn_y, self.offset)
            return Heightfield.on_grid(grid, elevation)
        program = device.program(__file__, "spectral.cl")
        local = (4,) if device.is_cpu else None
        sums, result = device.empty((2, most + 1, cols)), device.empty(grid.shape)
        program.launch(
            "spectral_along",
            (most + 1,) if device.is_cpu else (most + 1, cols),
            sums,
            device.upload(spectrum),
            device.upload(turn_x),
            np.int32(most),
            np.int32(cols),
            local=local,
        )
        program.launch(
            "spectral_across",
            (rows,) if device.is_cpu else grid.shape,
            result,
            sums,
            device.upload(turn_y),
            np.float32(self.offset),
            np.int32(most),
            np.int32(rows),
            np.int32(cols),
            local=local,
        )
        device.finish()
        return Heightfield.on_grid(grid, result)

    def _waves(self, spacing: float) -> tuple[int, tuple[float, float]]:
        """Return the largest wave number in use and the bounds of the wave vector's length."""
        least, largest = self._band()
        if 2.0 * spacing >= self.period / largest:
            largest = max(0.0, math.ceil(self.period / (2.0 * spacing)) - 1.0)
        # A stretched wave vector is longer than the part that counts
        most = min(MOST_WAVES, math.floor(largest * math.sqrt(self.stretch)))
        nyquist = max(0, math.ceil(self.period / (2.0 * spacing)) - 1)
        return min(most, nyquist), (least, largest)

    def _band(self) -> tuple[float, float]:
        """Return the bounds of the wave vector's length that the parameters ask for."""
        least = self.period / min(self.longest_wavelength or self.period, self.period)
        largest = float(MOST_WAVES)
        if self.shortest_wavelength is not None:
            largest = min(largest, self.period / self.shortest_wavelength)
        if least > COUNTED_WAVES:
            raise ParameterError(
                f"longest_wavelength = {self.longest_wavelength:g}: must be at least 1/"
                f"{COUNTED_WAVES} of period = {self.period:g} m; raise it or lower period"
            )
        if largest < least:
            raise ParameterError(
                f"shortest_wavelength = {self.shortest_wavelength:g}: must not exceed the longest, "
                f"{self.period / least:g} m; lower it"
            )
        return least, largest

    def _squeeze(self) -> tuple[float, float, float]:
        """Return the coefficients of kx^2, kx ky and ky^2 in the squared length."""
        turn = np.array([self.direction / 360.0], dtype=np.float32)
        east = float(exact.sine(turn)[0])
        north = float(exact.sine(turn + np.float32(0.25))[0])
        along, across = self.stretch, 1.0 / self.stretch
        return (
            along * east * east + across * north * north,
            2.0 * (along - across) * east * north,
            along * north * north + across * east * east,
        )

    def _height(self, squeeze: tuple[float, float, float]) -> float:
        """Return the height of a wave of length 1, so that the deviation is the amplitude."""
        least, largest = self._band()
        largest = min(largest, float(COUNTED_WAVES))
        most = math.floor(largest * math.sqrt(self.stretch))
        most = min(most, 2 * COUNTED_WAVES)
        deviation = reference.deviation(most, (least, largest), self.hurst_exponent, squeeze)
        if deviation == 0.0:
            raise ParameterError(
                f"longest_wavelength = {self.longest_wavelength or self.period:g}: no wave of the "
                "period is between it and the shortest; widen the band or raise period"
            )
        return self.amplitude / deviation

    def _positions(self, first: float, count: int, sign: int, spacing: float) -> NDArray[np.uint64]:
        """Return the shares of the period at samples, in parts of 2^64, wrapped."""
        step = round(spacing / self.period * 2**64)
        start = parts(first, spacing) * step // FINE
        return np.array([(start + sign * k * step) % 2**64 for k in range(count)], dtype=np.uint64)
