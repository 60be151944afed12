"""Sums of octaves of noise: every way in which terrains are made of them.

Each function takes :class:`Octaves` and returns a formula. What a sum is divided by depends on
its parameters alone, never on the map, so that tiles agree.
"""

from __future__ import annotations

from collections.abc import Callable

from terrakit.formula.expression import Formula, Loop, Noise, Number, as_formula
from terrakit.formula.functions import absolute, clamp, minimum, square, where
from terrakit.formula.lattice import Lattice

Body = Callable[..., list[Formula]]
HALF = 0.5
"""Noise of which products are normalised: ground where every octave is at half its range."""


class Octaves:
    """Octaves of noise at a place, and the numbers that go with each of them.

    Parameters
    ----------
    lattice
        Where the octaves lie.
    wavelengths
        Side of a cell of each octave, metres.
    gain
        How high each octave is, relative to the one before.
    east, north
        Displacement of the place, metres; None where there is none.
    """

    def __init__(
        self,
        lattice: Lattice,
        wavelengths: list[float],
        gain: float,
        east: Formula | None = None,
        north: Formula | None = None,
    ) -> None:
        self.lattice = lattice
        self.wavelengths = wavelengths
        self.gain = gain
        self.heights = [gain**k for k in range(len(wavelengths))]
        self.east = east
        self.north = north
        self.loop = Loop(len(wavelengths))

    def table(self, values: list[float]) -> Formula:
        """Return a number that is another one in every octave."""
        return self.loop.table(values)

    @property
    def height(self) -> Formula:
        """Return the height of an octave: 1, gain, gain squared ..."""
        return self.table(self.heights)

    @property
    def share(self) -> Formula:
        """Return the share of an octave in the sum of all heights."""
        total = sum(self.heights)
        return self.table([height / total for height in self.heights])

    @property
    def wavelength(self) -> Formula:
        """Return the side of an octave's lattice cells, metres."""
        return self.table(self.wavelengths)

    @property
    def is_first(self) -> Formula:
        """Return 1 in the first octave, else 0."""
        return self.table([1.0] + [0.0] * (len(self.wavelengths) - 1))

    def joined(self, other: Octaves) -> Octaves:
        """Return other octaves of the same number, as part of this sum."""
        other.loop = self.loop
        return other

    def noise(self, east: Number | None = None, north: Number | None = None) -> Formula:
        """Return an octave's noise, perhaps displaced by metres."""
        return Formula("noise", self._moved(east, north), Noise(self.lattice, self.loop))

    def slope(
        self, east: Number | None = None, north: Number | None = None
    ) -> tuple[Formula, Formula, Formula]:
        """Return an octave's noise and what it gains a lattice cell east and north."""
        noise = Formula("noise", self._moved(east, north), Noise(self.lattice, self.loop, True))
        value, along, across = (Formula("part", (noise,), part) for part in range(3))
        return value, along, across

    def sum(self, start: list[Number], body: Body) -> list[Formula]:
        """Return what the states are after all octaves.

        Parameters
        ----------
        start
            The states before the first octave.
        body
            Given the states, returns them after one more octave.
        """
        if self.loop.body:
            raise ValueError("these octaves are summed already; ask the place for others")
        self.loop.start = tuple(as_formula(value) for value in start)
        states = [self.loop.state(index) for index in range(len(start))]
        self.loop.body = tuple(body(*states))
        return [self.loop.result(index) for index in range(len(start))]

    def _moved(self, east: Number | None, north: Number | None) -> tuple[Formula, ...]:
        if east is None or north is None:
            return () if self.east is None else (self.east, self.north)  # type: ignore[return-value]
        if self.east is None or self.north is None:
            return as_formula(east), as_formula(north)
        return self.east + east, self.north + north


def fbm(octaves: Octaves) -> Formula:
    """Return fractional Brownian motion, within -1 to 1 (Musgrave 1989)."""
    share, noise = octaves.share, octaves.noise()
    return octaves.sum([0.0], lambda total: [total + share * noise])[0]


def turbulence(octaves: Octaves) -> Formula:
    """Return a sum of magnitudes, 0 to 1: sharp valleys, round hills (Perlin 1985)."""
    share, noise = octaves.share, octaves.noise()
    return octaves.sum([0.0], lambda total: [total + share * absolute(noise)])[0]


def billow(octaves: Octaves) -> Formula:
    """Return turbulence about its middle, -1 to 1: cushions, clouds, old dunes."""
    share, noise = octaves.share, octaves.noise()
    return octaves.sum([0.0], lambda total: [total + share * (absolute(noise) * 2.0 - 1.0)])[0]


def ridged_multifractal(octaves: Octaves, offset: float, gain: float) -> Formula:
    """Return ridges on which finer ridges sit, 0 to 1 (Musgrave 1994).

    Parameters
    ----------
    octaves
        The octaves.
    offset
        Height from which the magnitude of the noise is taken; 1 gives the sharpest ridges.
    gain
        How strongly an octave shows where the one before is high.
    """
    height, noise = octaves.height, octaves.noise()
    most = sum(octaves.heights) * max(offset, abs(offset - 1.0)) ** 2

    def body(total: Formula, weight: Formula) -> list[Formula]:
        signal = square(offset - absolute(noise)) * weight
        return [total + signal * height, clamp(signal * gain, 0.0, 1.0)]

    return octaves.sum([0.0, 1.0], body)[0] * (1.0 / most)


def hybrid_multifractal(octaves: Octaves, offset: float, gain: float) -> Formula:
    """Return smooth valleys and rough heights, about 0 to 1 (Musgrave 1994)."""
    height, noise = octaves.height, octaves.noise()

    def body(total: Formula, weight: Formula) -> list[Formula]:
        signal = minimum(weight, 1.0) * (noise + offset) * height
        return [total + signal, signal * gain]

    total, weight = 0.0, 1.0
    for step in octaves.heights:
        signal = min(weight, 1.0) * (HALF + offset) * step
        total, weight = total + signal, signal * gain
    return octaves.sum([0.0, 1.0], body)[0] * (1.0 / total)


def heterogeneous_terrain(octaves: Octaves, offset: float) -> Formula:
    """Return ground that is rougher the higher it is, about 0 to 1 (Musgrave 1994)."""
    height, noise, first = octaves.height, octaves.noise(), octaves.is_first

    def body(total: Formula) -> list[Formula]:
        return [total + (noise + offset) * where(first > 0.5, 1.0, height * total)]

    total = 0.0
    for octave, step in enumerate(octaves.heights):
        total += (HALF + offset) * (step * total if octave else 1.0)
    return octaves.sum([0.0], body)[0] * (1.0 / total)


def multifractal(octaves: Octaves, offset: float) -> Formula:
    """Return a product of octaves, about 0 to 1: plains here, mountains there (Musgrave 1994)."""
    height, noise = octaves.height, octaves.noise()
    # Divided octave by octave, so that a small offset cannot run out of numbers
    scale = octaves.table([1.0 / max(HALF * step + offset, 1e-6) for step in octaves.heights])
    return octaves.sum([1.0], lambda product: [product * ((height * noise + offset) * scale)])[0]


def slope_damped(octaves: Octaves, damping: float) -> Formula:
    """Return fBm whose detail fades on slopes, -1 to 1: it looks weathered (Quilez 2008)."""
    share, height = octaves.share, octaves.height
    noise, along, across = octaves.slope()

    def body(total: Formula, east: Formula, north: Formula) -> list[Formula]:
        east, north = east + height * along, north + height * across
        steep = square(east) + square(north)
        return [total + share * noise / (1.0 + steep * damping), east, north]

    return octaves.sum([0.0, 0.0, 0.0], body)[0]


def swiss(octaves: Octaves, warp: float) -> Formula:
    """Return ridges whose flanks are drawn down the slope, 0 to 1 (de Carpentier 2007)."""
    reach = warp * octaves.wavelengths[0]

    def body(total: Formula, weight: Formula, east: Formula, north: Formula) -> list[Formula]:
        noise, along, across = octaves.slope(east * reach, north * reach)
        total = total + weight * (1.0 - absolute(noise))
        pull = weight * noise
        weight = weight * octaves.gain * clamp(total, 0.0, 1.0)
        return [total, weight, east - pull * along, north - pull * across]

    return octaves.sum([0.0, 1.0, 0.0, 0.0], body)[0] * (1.0 / sum(octaves.heights))


def jordan(octaves: Octaves, warp: float, damping: float) -> Formula:
    """Return squared noise, warped and damped by its own slopes, 0 to 1 (de Carpentier 2007)."""
    height, wavelength = octaves.height, octaves.wavelength

    def body(total: Formula, east: Formula, north: Formula) -> list[Formula]:
        noise, along, across = octaves.slope(east * wavelength * warp, north * wavelength * warp)
        steep = (square(east) + square(north)) * damping
        total = total + height * square(noise) / (1.0 + steep)
        return [total, east + noise * along, north + noise * across]

    return octaves.sum([0.0, 0.0, 0.0], body)[0] * (1.0 / sum(octaves.heights))


def variable_lacunarity(octaves: Octaves, east: Octaves, north: Octaves, warp: float) -> Formula:
    """Return fBm whose octaves are distorted by noise, -1 to 1 (Musgrave 1994).

    ``east`` and ``north`` are octaves of the same wavelengths and other seeds, which move each
    octave by ``warp`` of its own wavelength; where they stretch it, lacunarity is lower.
    """
    share, reach = octaves.share, octaves.table([warp * w for w in octaves.wavelengths])
    moved = (octaves.joined(east).noise(), octaves.joined(north).noise())
    noise = octaves.noise(moved[0] * reach, moved[1] * reach)
    return octaves.sum([0.0], lambda total: [total + share * noise])[0]
