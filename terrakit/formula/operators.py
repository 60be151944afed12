"""Generators and filters that are formulas: write the height, and both languages follow."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from terrakit.formula.expression import Formula
from terrakit.formula.place import Place
from terrakit.heightfield import Field, Grid, Heightfield, Layer
from terrakit.operators import Filter, Generator, Operator
from terrakit.running import Run
from terrakit.sources import operators_within

if TYPE_CHECKING:
    from terrakit.compute import DeviceArray


class FormulaGenerator(Generator):
    """A generator whose terrain is a formula of the place.

    It is tile-safe, exact and can be warped and nested without further work::

        class LoneHill(FormulaGenerator):
            def height(self, place):
                x, y = place.around(self.center)
                return self.hill_height * maximum(1.0 - (x * x + y * y) / self.radius**2, 0.0)
    """

    @abstractmethod
    def height(self, place: Place) -> Formula:
        """Return the height at a place, metres."""
        raise NotImplementedError

    def layers(self, place: Place) -> dict[str, Formula]:
        """Return further layers, by the names in ``writes``."""
        del place
        return {}

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return the formula's terrain on ``grid``."""
        place = Place(grid, run)
        formulas = {"elevation": self.height(place), **self.layers(place)}
        layers = dict(zip(formulas, place.computed(*formulas.values()), strict=True))
        _check(self, grid, layers["elevation"])
        return Heightfield.on_grid(grid, layers.pop("elevation"), layers)

    def check_result(self, grid: Grid, elevation: Layer) -> None:
        """Raise ParameterError where its parameters made heights that are not finite.

        Only an operator that can be told to divide by zero needs it; also called where it is
        nested in other formulas, with what they made of it.
        """
        del grid, elevation


class FormulaFilter(Filter):
    """A filter whose terrain is a formula of the place and of the height that was there."""

    @abstractmethod
    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the new height at a place where it was ``ground``, metres."""
        raise NotImplementedError

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the surface with its new height."""
        place = Place(surface.grid, run, surface)
        (elevation,) = place.computed(self.height(place, place.layer()))
        _check(self, surface.grid, elevation)
        return surface.with_layers(elevation=elevation)

    def check_result(self, grid: Grid, elevation: Layer) -> None:
        """Raise ParameterError where its parameters made heights that are not finite."""
        del grid, elevation


def _check(operator: Operator, grid: Grid, elevation: Field | DeviceArray) -> None:
    """Let each formula in an operator judge what came of it."""
    layer = Layer(elevation)
    for link in operators_within(operator):
        if isinstance(link, (FormulaGenerator, FormulaFilter)):
            link.check_result(grid, layer)
