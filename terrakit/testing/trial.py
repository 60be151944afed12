"""One operator on trial: how the checks run it, and how they say what is broken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from terrakit.compute import NUMPY, choose_device
from terrakit.errors import TerrakitError
from terrakit.execute import grid_under
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Erosion, Filter, Generator, Importer, Operator, Surface, Texture
from terrakit.running import Run
from terrakit.testing.subjects import irregular_mesh, rough_terrain, with_layers

if TYPE_CHECKING:
    from terrakit.compute import DeviceInfo


class ContractBroken(AssertionError):  # noqa: N818  (reads as the verdict that it is)
    """One sentence: which promise, of which operator, with the value that was measured."""


class NotApplicable(Exception):  # noqa: N818  (reads as the verdict that it is)
    """The operator's declaration exempts it from this check; the message quotes it."""


@dataclass(frozen=True)
class Trial:
    """An operator with the settings and the device that it is tried with.

    Parameters
    ----------
    operator
        The operator's class.
    settings
        In place of defaults; by default the operator's own ``trial``.
    device_name
        The device to compare with the NumPy reference; the best one without it.
    """

    operator: type[Operator]
    settings: Mapping[str, Any] = field(default_factory=dict)
    device_name: str | None = None

    @property
    def name(self) -> str:
        """How messages call it."""
        return self.operator.name or self.operator.__name__

    @property
    def device(self) -> DeviceInfo:
        """The device that a user would get."""
        return choose_device(self.device_name)

    def broken(self, promise: str) -> ContractBroken:
        """Return the error for a broken promise."""
        return ContractBroken(f"{self.name}: {promise}")

    def made(self, **changes: Any) -> Operator:
        """Return the operator with the trial's settings and these changes."""
        try:
            return self.operator(**{**self.settings, **changes})
        except TerrakitError as error:
            raise self.broken(f"refuses the settings that it declares: {error}") from error

    def apply(
        self,
        subject: Any,
        *,
        device: DeviceInfo | None = None,
        run: Run | None = None,
        seed: int | str = 7,
        operator: Operator | None = None,
        work_group: int | None = None,
    ) -> Any:
        """Run the operator as :func:`terrakit.execute.execute` does, but judge nothing."""
        operator = operator or self.made()
        run = run or Run(seed, device or self.device, work_group=work_group)
        run = run.for_step(self.name) if not run.step else run
        try:
            with run.watching(grid_under(subject)), np.errstate(all="warn"):
                result = verb(operator)(subject, run)
                if isinstance(result, Heightfield):
                    for name in result:  # a device array moves now, not in the check
                        result.layer(name)
                return result
        except (TerrakitError, AssertionError):
            raise
        except Exception as error:
            text = " ".join(str(error).split())
            raise self.broken(f"raised {type(error).__name__} ({text})") from error

    def applied(self, subject: Any, **how: Any) -> Any:
        """Run the operator where a refusal is a breach too."""
        try:
            return self.apply(subject, **how)
        except TerrakitError as error:
            raise self.broken(f"refuses {described(subject)}: {error}") from error

    def subjects(self, shape: tuple[int, int] = (33, 33)) -> Iterator[tuple[str, Any]]:
        """Yield a fresh grid, or a fresh rough surface of each type that it works on."""
        if issubclass(self.operator, Generator):
            yield "grid", Grid(shape, 10.0)
            return
        for kind in self.operator.surfaces:
            yield kind.__name__, self.surface(kind, shape)

    def surface(self, kind: type, shape: tuple[int, int] = (33, 33)) -> Surface:
        """Return a fresh rough surface of this type with the layers that the operator wants."""
        bare = irregular_mesh() if issubclass(kind, TriMesh) else rough_terrain(shape)
        return with_layers(self.operator, bare)

    def needs(self, condition: bool, reason: str) -> None:
        """Raise NotApplicable unless ``condition`` holds."""
        if not condition:
            raise NotApplicable(f"{self.name}: {reason}")

    def other_device(self) -> DeviceInfo:
        """Return the OpenCL device to compare with the reference."""
        self.needs(self.device.is_opencl, "there is no OpenCL device here")
        return self.device

    def reference(self) -> DeviceInfo:
        """Return the NumPy reference."""
        return NUMPY


def verb(operator: Operator) -> Callable[[Any, Run], Any]:
    """Return the one method that makes an operator of its kind what it is."""
    if isinstance(operator, Generator):
        return operator.generate
    if isinstance(operator, Filter):
        return operator.apply
    if isinstance(operator, Erosion):
        return operator.erode
    if isinstance(operator, Texture):
        return operator.texture
    if isinstance(operator, Importer):
        return operator.load
    export: Callable[..., Any] = operator.export  # type: ignore[attr-defined]
    return lambda subject, run: export(*subject, run)


def described(subject: Any) -> str:
    """Return a subject as a message names it."""
    if isinstance(subject, (Grid, Heightfield)):
        return "x".join(map(str, subject.shape)) + " samples"
    return repr(subject)[:80]


def difference(first: Surface, second: Surface) -> str:
    """Return how two surfaces differ, in words, or an empty string where every bit is equal."""
    names = list(dict.fromkeys((*first, *second)))
    for name in names:
        if name not in first or name not in second:
            return f"layer {name} is on one side only"
        a, b = first.layer(name), second.layer(name)
        if a.shape != b.shape:
            return f"{name} has shape {a.shape} and {b.shape}"
        unequal = a.view(np.int32) != b.view(np.int32)
        if unequal.any():
            place = tuple(int(i) for i in np.argwhere(unequal)[0])
            gap = float(np.nanmax(np.abs(a.astype(np.float64) - b)))
            return (
                f"{int(unequal.sum())} of {unequal.size} values of {name} differ, by up to "
                f"{gap:.3g}, first at {place}: {a[place]!r} and {b[place]!r}"
            )
    if isinstance(first, TriMesh) and isinstance(second, TriMesh):
        unequal = first.vertices != second.vertices
        if unequal.any():
            return f"{int(unequal.any(axis=1).sum())} vertices differ"
    return ""


@contextmanager
def refusing(trial: Trial, what: str) -> Iterator[list[str]]:
    """Check that the block raises a TerrakitError of one line; yields a list with its message."""
    message: list[str] = []
    try:
        yield message
    except TerrakitError as error:
        message.append(str(error))
        if "\n" in message[0] or not message[0]:
            raise trial.broken(f"refuses {what} in several lines: {message[0]!r}") from error
    except AssertionError:
        raise
    except Exception as error:
        raise trial.broken(f"answers {what} with {type(error).__name__}: {error}") from error
    else:
        raise trial.broken(f"accepts {what}")
