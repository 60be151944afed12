"""New heights from old ones, by arithmetic that the user writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar, Self

from pydantic import model_validator

from terrakit.errors import ParameterError
from terrakit.formula import Formula, FormulaFilter, Place, arctangent, hypot
from terrakit.formula.parsing import check_text, formula_at, refuse_not_finite
from terrakit.heightfield import Grid, Layer
from terrakit.layers import VOCABULARY
from terrakit.parameters import Seed, parameter

NAMES = ("z", "x", "y", "r", "theta", "east", "north", *sorted(VOCABULARY))


class _Names(Mapping[str, Callable[[], Formula]]):
    """What names stand for at a place: coordinates, the height, layers of the terrain."""

    def __init__(self, place: Place, ground: Formula) -> None:
        self.place = place
        self.ground = ground

    def __getitem__(self, name: str) -> Callable[[], Formula]:
        return lambda: self._meaning(name)

    def __iter__(self) -> Iterator[str]:
        return iter(NAMES)

    def __len__(self) -> int:
        return len(NAMES)

    def _meaning(self, name: str) -> Formula:
        if name in ("z", "elevation"):
            return self.ground
        if name in ("x", "y", "r", "theta"):
            x, y = self.place.around()
            if name == "r":
                return hypot(x, y)
            if name == "theta":
                return arctangent(y, x)
            return x if name == "x" else y
        if name in ("east", "north"):
            return self.place.x if name == "east" else self.place.y
        if self.place.surface is None or self.place.is_displaced:
            raise ParameterError(
                f"formula: layer {name!r} is not at hand inside of another step; make it a step "
                "of its own"
            )
        return self.place.layer(name)


class Reshape(FormulaFilter):
    """Compute every height from the one that is there, by a formula of your own.

    ``z`` is the height; layers go by their names (``sediment``, ``mask_rock``). The rest is as in
    ``expression``: ``x`` and ``y`` are metres east and north of the middle of the world, ``r`` and
    ``theta`` distance and angle from it, ``east`` and ``north`` metres from the world's origin.
    """

    name = "reshape"
    fields = 4
    trial: ClassVar = {"formula": "z*0.8 + 12*fbm(300, 4) + z*z/4e4"}
    turning: ClassVar = {"formula": "z*0.8 + 30*sin(z/40)"}
    idle: ClassVar = {"formula": "z"}

    formula: str = parameter(
        ..., "New height in metres, of z, layers, x, y, + - * / **, sin, sqrt, max, fbm(...) ..."
    )
    define: dict[str, float | str] = parameter(
        {}, "Names of your own for numbers or parts of the formula: { k = 'sqrt(x*x + 1)' }."
    )
    seed: Seed = parameter(0, "Another number or word gives other noise.")

    presets: ClassVar = {
        "mirror": {"formula": "-z"},
        "exaggerate": {"formula": "z*1.5"},
        "roughen": {"formula": "z + 8*fbm(120, 6)"},
    }

    @model_validator(mode="after")
    def _is_arithmetic(self) -> Self:
        try:
            check_text(self.formula, self.define, NAMES)
        except ParameterError as error:
            raise ValueError(str(error)) from None
        return self

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the new height at a place where it was ``ground``."""
        names = _Names(place, ground)
        return formula_at(place, self.formula, self.define, names, self.name, self.seed)

    def check_result(self, grid: Grid, elevation: Layer) -> None:
        """Raise ParameterError where the formula divides by zero or the like."""
        refuse_not_finite(grid, elevation, self.formula)
