"""Fractal gradient noise: the plain start of most terrains."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.errors import ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Generator
from terrakit.parameters import Seed, parameter
from terrakit.running import Run, seed_words

TURNS = ((1.0, 0.0), (0.8, 0.6), (5 / 13, 12 / 13), (-8 / 17, 15 / 17), (21 / 29, -20 / 29))
"""Cosine and sine of each octave's turn: rational, so that no library decides their bits."""
ONE = 2**32
"""One lattice cell in the fixed point of lattice positions."""


class Fbm(Generator):
    """Sum octaves of gradient noise into rolling, self-similar ground.

    Each octave is Perlin's improved noise with gradients of any direction, on a lattice that is
    turned and shifted by its own hash, so that octaves never line up at lattice points::

        z(x) = offset + amplitude * sum_k gain^k n_k(lacunarity^k x / wavelength) / sum_k gain^k

    Lattice positions are 64-bit fixed point of the sample's world index: a tile far from the
    origin is as sharp as one at it, and equals the same part of a larger map bit for bit.

    References
    ----------
    K. Perlin, "Improving noise", SIGGRAPH 2002. F. K. Musgrave, C. E. Kolb and R. S. Mace, "The
    synthesis and rendering of eroded fractal terrains", SIGGRAPH 1989.
    """

    name = "fbm"
    cites = ("Perlin 2002", "Musgrave, Kolb & Mace 1989")
    fields = 3

    amplitude: float = parameter(
        1000.0, "Highest possible rise above and fall below the offset.", unit="m", ge=0, le=1e6
    )
    wavelength: float = parameter(
        5000.0, "Distance between the largest hills.", unit="m", gt=0, le=1e8
    )
    octaves: int = parameter(
        10, "Layers of ever finer detail; each is finer by the lacunarity.", ge=1, le=24
    )
    lacunarity: float = parameter(
        1.97, "How much finer each octave is than the one before.", gt=1, le=4
    )
    hurst_exponent: float = parameter(
        0.85, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    gain: float | None = parameter(
        None,
        "Height of each octave relative to the one before (persistence); "
        "without it lacunarity^-hurst_exponent.",
        gt=0,
        le=1,
        advanced=True,
    )
    offset: float = parameter(0.0, "Height of the middle of the range.", unit="m", ge=-1e6, le=1e6)
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    presets: ClassVar = {
        "hills": {"amplitude": 250.0, "wavelength": 3000.0, "hurst_exponent": 0.95},
        "rugged": {"amplitude": 1500.0, "wavelength": 8000.0, "hurst_exponent": 0.65},
    }

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return fractal noise on ``grid``."""
        lattice = self._lattice(grid, run)
        weight = self._weights()
        seeds = np.array(
            [seed_words(*run.words(self.name, self.seed), k) for k in range(self.octaves)],
            dtype=np.uint32,
        ).ravel()
        device = run.device
        if device is None:
            from terrakit_generators.fbm.reference import fractal_sum

            elevation = fractal_sum(grid.shape, lattice, weight, seeds, self.offset)
            return Heightfield.on_grid(grid, elevation)
        rows, cols = grid.shape
        result = device.empty(grid.shape)
        device.program(__file__, "fbm.cl").launch(
            "fbm_sum",
            (rows,) if device.is_cpu else grid.shape,
            result,
            device.upload(lattice),
            device.upload(weight),
            device.upload(seeds),
            np.int32(self.octaves),
            np.float32(self.offset),
            np.int32(rows),
            np.int32(cols),
            local=(4,) if device.is_cpu else None,
        )
        device.finish()
        return Heightfield.on_grid(grid, result)

    def _weights(self) -> NDArray[np.float32]:
        """Return the height of each octave in metres; they sum to the amplitude."""
        if self.gain is None:
            lacunarity = np.array([self.lacunarity], dtype=np.float32)
            gain = float(exact.power(lacunarity, -self.hurst_exponent)[0])
        else:
            gain = self.gain
        share, total = 1.0, 0.0
        shares = []
        for _ in range(self.octaves):
            shares.append(share)
            total += share
            share *= gain
        return np.array([self.amplitude * s / total for s in shares], dtype=np.float32)

    def _lattice(self, grid: Grid, run: Run) -> NDArray[np.int64]:
        """Return, an octave, u at the first sample, per column and per row, and the same of v."""
        x, y = (_in_samples(along, grid.spacing) for along in grid.north_west)
        table = []
        wavelength = self.wavelength
        for octave in range(self.octaves):
            step = grid.spacing / wavelength * ONE
            if step >= 2**52:
                raise ParameterError(
                    f"octaves = {self.octaves}: octave {octave + 1} has a wavelength of "
                    f"{wavelength:g} m, far below the spacing of {grid.spacing:g} m; use fewer"
                )
            cosine, sine = TURNS[octave % len(TURNS)]
            c, s = round(cosine * step), round(sine * step)
            shift = seed_words(*run.words(self.name, self.seed), "shift", octave)
            table.append(
                [
                    *(
                        _wrapped(v)
                        for v in (
                            x[0] * c - y[0] * s + (x[1] * c - y[1] * s) // FINE + (shift[0] << 16),
                            c,
                            s,
                        )
                    ),
                    *(
                        _wrapped(v)
                        for v in (
                            x[0] * s + y[0] * c + (x[1] * s + y[1] * c) // FINE + (shift[1] << 16),
                            s,
                            -c,
                        )
                    ),
                ]
            )
            wavelength /= self.lacunarity
        return np.array(table, dtype=np.int64)


FINE = 2**20
"""Parts of a sample to which an origin between samples is rounded."""


def _in_samples(along: float, spacing: float) -> tuple[int, int]:
    """Return a world coordinate as whole samples and a remainder in parts of a sample."""
    whole, rest = divmod(round(along / spacing * FINE), FINE)
    return whole, rest


def _wrapped(value: int) -> int:
    """Return an integer as the signed 64-bit number with the same low bits."""
    return (value + 2**63) % 2**64 - 2**63
