"""The place at which a formula is computed: coordinates, noise, layers and other terrains."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from terrakit.errors import ParameterError
from terrakit.formula.expression import Formula, Noise, Number, as_formula, constant
from terrakit.formula.fractal import Octaves
from terrakit.formula.functions import clamp
from terrakit.formula.lattice import Lattice, free_lattice, world_lattice
from terrakit.heightfield import Grid, Heightfield, Layer
from terrakit.parameters import bounds_of
from terrakit.world import sample_axes

if TYPE_CHECKING:
    from terrakit.operators import Operator
    from terrakit.parameters import Seed
    from terrakit.running import Run

FAR = 1e9
"""Bound of a parameter that declares none."""


class Place:
    """Where a formula is computed: every sample of a grid, perhaps displaced.

    Parameters
    ----------
    grid
        Where the samples lie.
    run
        Seed, device and world.
    surface
        The terrain whose layers may be used; None for a generator.
    """

    def __init__(self, grid: Grid, run: Run, surface: Heightfield | None = None) -> None:
        self.grid = grid
        self.run = run
        self.surface = surface
        self.east: Formula | None = None
        self.north: Formula | None = None
        self._leaves: dict[Any, Formula] = {}
        self._held: list[Any] = []

    @property
    def is_displaced(self) -> bool:
        """Whether it is not where the samples are."""
        return self.east is not None

    @property
    def x(self) -> Formula:
        """Metres east of the world's origin."""
        return self._axis(0, 0.0)

    @property
    def y(self) -> Formula:
        """Metres north of the world's origin."""
        return self._axis(1, 0.0)

    def displaced(self, east: Number, north: Number) -> Place:
        """Return the place that lies so many metres east and north of this one."""
        other = Place(self.grid, self.run, self.surface)
        other._leaves, other._held = self._leaves, self._held
        other.east = as_formula(east) if self.east is None else self.east + east
        other.north = as_formula(north) if self.north is None else self.north + north
        return other

    def _bare(self) -> Place:
        """Return this place without the layers of its terrain."""
        if self.surface is None:
            return self
        other = Place(self.grid, self.run)
        other._leaves, other._held = self._leaves, self._held
        other.east, other.north = self.east, self.north
        return other

    def centre(self, given: list[float] | None) -> tuple[float, float]:
        """Return a point of the world: the one that is given, or the middle of the world."""
        if given is not None:
            return float(given[0]), float(given[1])
        world = self.run.world or self.grid
        (west, north), (width, height) = world.north_west, world.size
        return west + width / 2, north - height / 2

    def around(
        self, given: list[float] | None = None, direction: float = 0.0
    ) -> tuple[Formula, Formula]:
        """Return metres to the right and ahead of a point, looking in a direction.

        Parameters
        ----------
        given
            World x, y of the point, metres; the middle of the world without it.
        direction
            Where "ahead" is, degrees clockwise from north: with 0, right is east.
        """
        centre = self.centre(given)
        x, y = self._axis(0, centre[0]), self._axis(1, centre[1])
        turn = math.radians(direction)
        if direction % 360.0 == 0.0:
            return x, y
        cosine, sine = math.cos(turn), math.sin(turn)
        return x * cosine - y * sine, x * sine + y * cosine

    def layer(self, name: str = "elevation") -> Formula:
        """Return a layer of the terrain.

        Raises
        ------
        InputError
            If there is no such layer.
        """
        assert self.surface is not None
        if name not in self.surface:
            self.surface.layer(name)  # raises what there is instead
        return self._field(("layer", name), self.surface.layers[name])

    def value(self, operator: Operator, parameter: str) -> Formula:
        """Return what a maskable parameter of an operator is at this place."""
        from terrakit.sources import Chain

        given = getattr(operator, parameter)
        if isinstance(given, (int, float)):
            return constant(given)
        # What is elsewhere nobody can look at beforehand: it is held within the parameter's bounds
        bounds = bounds_of(type(operator).model_fields[parameter])
        low = bounds.get("minimum", bounds.get("exclusiveMinimum", -FAR))
        high = bounds.get("maximum", bounds.get("exclusiveMaximum", FAR))
        if isinstance(given, Chain) and self.is_displaced:
            return clamp(self.terrain(given, parameter), low, high)
        where = self.surface if self.surface is not None else self.grid
        found = operator.value(parameter, where)
        if isinstance(found, (int, float)):
            return constant(found)
        self._held.append(operator)  # so that no other gets its identity
        field = self._field(("parameter", parameter, id(operator)), Layer(found))
        return clamp(field, low, high) if self.is_displaced else field

    def terrain(self, source: Any, parameter: str) -> Formula:
        """Return the height of another terrain: a number, an earlier step or a chain."""
        from terrakit.formula.operators import FormulaFilter, FormulaGenerator
        from terrakit.sources import Chain

        if isinstance(source, (int, float)):
            return constant(source)
        if isinstance(source, Chain):
            first, *rest = source.operators
            fits = all(
                isinstance(link, FormulaFilter) and not _has_own_layers(link) for link in rest
            )
            if isinstance(first, FormulaGenerator) and fits:
                # A chain knows no layers but its own, whoever asks for it
                inner = self._bare()
                height = first.height(inner)
                for operator in rest:
                    height = operator.height(inner, height)
                return height
        try:
            other = self.run.terrain(source, self.grid)
        except ParameterError as error:
            sign = " =" if isinstance(source, str) else ":"
            raise ParameterError(f"{parameter}{sign} {error}") from None
        self._held.append(source)
        key = source if isinstance(source, str) else id(source)
        return self._field(("terrain", key), other.layers["elevation"])

    def words(self, stream: str, seed: Seed) -> tuple[int, int]:
        """Return the seed of one stream of random numbers."""
        return self.run.words(stream, seed)

    def noise(self, basis: str, wavelength: float, words: tuple[int, int]) -> Formula:
        """Return one octave of noise, within about -1 to 1.

        Parameters
        ----------
        basis
            A name in :data:`terrakit.noise.BASES`.
        wavelength
            Side of a lattice cell, metres.
        words
            Seed, from :meth:`words`.
        """
        moved = () if self.east is None or self.north is None else (self.east, self.north)
        lattice = self._lattice(basis, [wavelength], words)
        return Formula("noise", moved, Noise(lattice, None))

    def noise_at(self, basis: str, u: Number, v: Number, words: tuple[int, int]) -> Formula:
        """Return one octave of noise at a position that is given in lattice cells."""
        from terrakit.noise import BASES

        lattice = free_lattice(basis, BASES[basis].is_skewed, words, self.grid.shape)
        return Formula("noise", (as_formula(u), as_formula(v)), Noise(lattice, None))

    def octaves(
        self,
        basis: str,
        wavelength: float,
        count: int,
        words: tuple[int, int],
        lacunarity: float = 1.97,
        gain: float = 0.5,
    ) -> Octaves:
        """Return octaves of noise to be summed: see :mod:`terrakit.formula.fractal`.

        Parameters
        ----------
        basis
            A name in :data:`terrakit.noise.BASES`.
        wavelength
            Side of a lattice cell of the first octave, metres.
        count
            How many octaves there are.
        words
            Seed, from :meth:`words`.
        lacunarity
            How much finer each octave is than the one before.
        gain
            How high each octave is, relative to the one before.
        """
        wavelengths = [wavelength / lacunarity**k for k in range(count)]
        lattice = self._lattice(basis, wavelengths, words)
        return Octaves(lattice, wavelengths, gain, self.east, self.north)

    def _lattice(self, basis: str, wavelengths: list[float], words: tuple[int, int]) -> Lattice:
        from terrakit.noise import BASES

        return world_lattice(self.grid, basis, BASES[basis].is_skewed, wavelengths, words)

    def _axis(self, axis: int, centre: float) -> Formula:
        key = ("axis", axis, centre)
        if key not in self._leaves:
            values = (sample_axes(self.grid)[axis] - centre).astype(np.float32)
            self._leaves[key] = Formula(("column", "row")[axis], data=values)
        moved = (self.east, self.north)[axis]
        return self._leaves[key] if moved is None else self._leaves[key] + moved

    def _field(self, key: Any, layer: Layer) -> Formula:
        """Return samples as a formula: those that are here, or interpolated elsewhere."""
        if key not in self._leaves:
            self._leaves[key] = Formula("field", data=layer)
        field = self._leaves[key]
        if self.east is None or self.north is None:
            return field
        spacing = self.grid.spacing
        return Formula("sample", (self.east / spacing, self.north / spacing, field))

    def computed(self, *formulas: Formula) -> list[Any]:
        """Return the values of formulas at every sample, on the run's device."""
        device = self.run.device
        if device is None:
            from terrakit.formula.reference import compute

            return list(compute(formulas, self.grid.shape))
        from terrakit.formula.opencl import compute as compute_on

        return list(compute_on(formulas, self.grid.shape, device))


def _has_own_layers(operator: Operator) -> bool:
    """Return whether a parameter follows a layer of the very terrain that the operator works on."""
    from terrakit.sources import references_within

    return any(r.role == "layer" and "." not in r.text for r in references_within(operator))
