"""The six kinds of operator, and the border at which what they return is checked.

An operator *is* its parameters: a frozen pydantic model with one verb. From that one declaration
follow recipe keys, command-line flags, help, JSON Schema, documentation and the contract tests.
"""

from __future__ import annotations

import inspect
import math
from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator, model_validator
from pydantic_core.core_schema import ValidationInfo

from terrakit.errors import ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.parameters import check_bounds, explain, multiplied, resolve
from terrakit.sources import is_nested, nested_type

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from terrakit.running import Run

Surface = Heightfield | TriMesh


class Operator(BaseModel):
    """What every operator declares; see :class:`Generator` and its siblings for the verbs."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=False,
    )

    name: ClassVar[str] = ""
    """The word for it everywhere: recipe, command line, folder, test."""
    kind: ClassVar[str] = ""
    """``generator``, ``filter``, ``erosion``, ``texture``, ``importer`` or ``exporter``."""
    surfaces: ClassVar[tuple[type, ...]] = (Heightfield,)
    """The types that it works on."""
    reads: ClassVar[tuple[str, ...]] = ()
    """Layers that must be there; a name that ends in ``_`` stands for its family."""
    uses: ClassVar[tuple[str, ...]] = ()
    """Layers that are used if they are there."""
    writes: ClassVar[tuple[str, ...]] = ()
    """Layers that come out added or changed."""
    cites: ClassVar[tuple[str, ...]] = ()
    """The papers, as ``Author year``."""
    parity: ClassVar[str] = "exact"
    """``exact``: same bytes everywhere; ``statistical``: see the operator's notes for why."""
    fields: ClassVar[int] = 4
    """Float fields of the surface's shape that it holds at its peak, for the memory estimate."""
    locality: ClassVar[str] = "global"
    """``pointwise``, ``stencil`` (see ``reach``) or ``global``."""
    idle: ClassVar[dict[str, Any]] = {}
    """Settings with which it must return its input unchanged; empty where there are none."""
    turning: ClassVar[dict[str, Any] | None] = {}
    """Settings under which turning the terrain turns the result; None where none do."""
    presets: ClassVar[dict[str, dict[str, Any]]] = {}
    """Named parameter sets."""
    trial: ClassVar[dict[str, Any]] = {}
    """Settings for the contract tests, where the defaults take long on a small terrain."""

    def __init__(self, /, **settings: Any) -> None:
        try:
            super().__init__(**settings)
        except ValidationError as error:
            raise ParameterError(
                explain(error, type(self), self.name or type(self).__name__)
            ) from None

    @classmethod
    def from_settings(cls, settings: dict[str, Any], where: str) -> Self:
        """Return the operator with these settings; ``where`` begins the message of an error."""
        settings = dict(settings)
        preset = settings.pop("preset", None) if "preset" not in cls.model_fields else None
        if preset is not None:
            if preset not in cls.presets:
                known = ", ".join(sorted(cls.presets)) or "none"
                raise ParameterError(f"{where}: preset = {preset!r}: not a preset (known: {known})")
            settings = {**cls.presets[preset], **settings}
        try:
            return cls(**settings)
        except ParameterError as error:
            own = f"{cls.name or cls.__name__}: "
            raise ParameterError(f"{where}: {str(error).removeprefix(own)}") from None

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the docstring."""
        return (inspect.getdoc(cls) or "").partition("\n")[0]

    def value(
        self, parameter: str, surface: Surface | Grid, fraction: float = 0.0
    ) -> float | NDArray[np.float32]:
        """Return what a maskable parameter is now: a number, or a field of the surface's shape.

        A generator asks with its grid. Chains are made once a run, on that grid.
        """
        return resolve(self, parameter, surface, fraction)

    def reach(self, spacing: float) -> int | None:
        """Return how many cells around itself one iteration reads; None where it is global."""
        del spacing
        return None

    @model_validator(mode="before")
    @classmethod
    def _as_meant(cls, settings: Any) -> Any:
        """Take 1e3 for 1000 where a whole number is wanted, and nested tables for operators."""
        if not isinstance(settings, dict):
            return settings
        taken = dict(settings)
        for name, value in settings.items():
            field = cls.model_fields.get(name)
            if (
                field is not None
                and field.annotation in (int, int | None)
                and isinstance(value, float)
                and math.isfinite(value)
                and value == int(value)
            ):
                taken[name] = int(value)
            kind = nested_type(field.annotation) if field is not None else None
            if kind is not None and is_nested(value, kind):
                taken[name] = kind.read(value, name)
        return taken

    @field_validator("*", mode="after")
    @classmethod
    def _bounds(cls, value: Any, info: ValidationInfo) -> Any:
        assert info.field_name is not None
        check_bounds(info.field_name, cls.model_fields[info.field_name], value)
        return value


class Generator(Operator):
    """Makes a terrain from nothing but world coordinates, a seed and parameters."""

    kind: ClassVar[str] = "generator"
    writes: ClassVar[tuple[str, ...]] = ("elevation",)
    locality: ClassVar[str] = "pointwise"
    turning: ClassVar[dict[str, Any] | None] = None
    portrait: ClassVar[float | None] = None
    """Metres a side at which its defaults show what it is; None where any size does."""

    @abstractmethod
    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return a new terrain on ``grid``."""
        raise NotImplementedError


class Filter(Operator):
    """Reshapes a terrain by rule: a curve, a blend, a turn, a brush.

    It is no process in nature, so it keeps no ledger. Layers whose values it does not change it
    hands on; if ``changes_grid`` is set it takes every layer along to the new grid.
    """

    kind: ClassVar[str] = "filter"
    reads: ClassVar[tuple[str, ...]] = ("elevation",)
    writes: ClassVar[tuple[str, ...]] = ("elevation",)
    locality: ClassVar[str] = "pointwise"
    changes_grid: ClassVar[bool] = False
    """Whether the result may have another shape, spacing or origin."""

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return the grid of the result for a terrain on ``grid``; None where only a run shows."""
        return grid

    @abstractmethod
    def apply(self, surface: Any, run: Run) -> Any:
        """Return the reshaped surface; the input is not touched."""
        raise NotImplementedError

    def __call__(self, surface: Any, run: Run | None = None) -> Any:
        """Apply with a run of its own: ``Terrace(height=50.0)(terrain)``."""
        from terrakit.execute import execute
        from terrakit.running import Run

        return execute(self, surface, run or Run())


class Erosion(Operator):
    """Moves material on a surface and books every cubic metre in ``run.ledger``."""

    kind: ClassVar[str] = "erosion"
    reads: ClassVar[tuple[str, ...]] = ("elevation",)
    writes: ClassVar[tuple[str, ...]] = ("elevation",)

    refinement_tolerance: ClassVar[float | None] = 0.35
    """How much of the change may differ when the samples are doubled; None where all of it may."""
    lasts: ClassVar[dict[str, float]] = {}
    """Parameters that say how long it works, each with the power of time that it goes with.

    ``{"duration": 1.0}`` for years or iterations, ``{"distance": 0.5}`` for the reach of what
    spreads like diffusion. By them a wrapper shares the time out; see :meth:`portion`.
    """

    @abstractmethod
    def erode(self, surface: Any, run: Run) -> Any:
        """Return the surface after erosion; the input is not touched."""
        raise NotImplementedError

    def portion(self, start: float, end: float) -> Self:
        """Return the erosion with the part of its time from ``start`` to ``end``, 0 to 1.

        What ``lasts`` names is cut down; parts that follow each other take the whole time together.
        Whoever declares none comes back as it is.
        """
        changed: dict[str, Any] = {}
        for name, power in self.lasts.items():
            value, field = getattr(self, name), type(self).model_fields[name]
            if field.annotation in (int, int | None) and value is not None:
                changed[name] = round(value * end) - round(value * start)
            else:
                changed[name] = multiplied(name, field, value, (end - start) ** power)
        return self.model_copy(update=changed) if changed else self

    def __call__(self, surface: Any, run: Run | None = None) -> Any:
        """Erode with a run of its own: ``Thermal(talus_angle=33)(terrain)``."""
        from terrakit.execute import execute
        from terrakit.running import Run

        return execute(self, surface, run or Run())


class Texture(Operator):
    """Adds layers that say what the ground looks like; never changes its height."""

    kind: ClassVar[str] = "texture"
    reads: ClassVar[tuple[str, ...]] = ("elevation",)

    @abstractmethod
    def texture(self, surface: Any, run: Run) -> Any:
        """Return the surface with the declared layers added."""
        raise NotImplementedError


class Importer(Operator):
    """Reads a surface from a file; the content decides, not the extension."""

    kind: ClassVar[str] = "importer"
    writes: ClassVar[tuple[str, ...]] = ("elevation", "valid")
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Extensions, for help and for telling formats apart that have no signature."""

    @classmethod
    @abstractmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the file, of which ``head`` is the beginning, is of this format."""
        raise NotImplementedError

    @abstractmethod
    def load(self, path: Path, run: Run) -> Surface:
        """Return the surface in the file."""
        raise NotImplementedError


class Exporter(Operator):
    """Writes a surface to files, all of them or none."""

    kind: ClassVar[str] = "exporter"
    reads: ClassVar[tuple[str, ...]] = ("elevation",)
    suffix: ClassVar[str] = ""
    """Extension of the main file, with the dot."""
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Further extensions that it writes."""
    bytes_a_sample: ClassVar[float] = 16.0
    """About how much it writes, for the check of the disk before a run."""

    def check(self, grid: Grid) -> None:
        """Raise a TerrakitError if a terrain on ``grid`` cannot be written; called before a run."""
        del grid

    @abstractmethod
    def export(self, surface: Any, path: Path, run: Run) -> list[Path]:
        """Write ``surface`` to ``path`` and return every file written, the main one first."""
        raise NotImplementedError
