"""Runs the steps inside a step: one piece of work with one progress, one clock and one ledger.

What wraps other operators, such as a loop, holds them in a parameter of type
:class:`~terrakit.sources.Steps` and runs them with :class:`Passes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrakit.errors import InputError, ParameterError, ResourceError
from terrakit.ledger import Ledger
from terrakit.mesh import TriMesh
from terrakit.operators import Erosion, Filter, Surface
from terrakit.quanta import Quanta
from terrakit.running import Run
from terrakit.sources import Steps

if TYPE_CHECKING:
    from terrakit.operators import Operator

TICKS = 1_000_000
"""Parts into which the progress of nested work is divided."""


@dataclass(frozen=True)
class Pass:
    """One pass of the steps."""

    number: int
    """Which random numbers it draws; 0 draws what the steps would on their own."""
    start: float
    """How much of the time is over when it begins, 0 to 1: where schedules stand."""
    end: float
    effort: float = 1.0
    """How long it takes, compared with the others: for the progress."""


class Passes:
    """Nested steps at work, pass after pass.

    ::

        passes = Passes(run, [Pass(n, n / times, (n + 1) / times) for n in range(times)])
        for each in passes:
            surface = passes.through(each, self.steps, surface)
        passes.close(surface)

    It reports one progress from 0 to 1, is cancelled between the operators and inside them, and
    ends early when asked to finish: after the operator that is at work. Schedules run over the
    whole of it, erosions draw other random numbers in every pass (unless those belong to the
    ground), nested terrain is made once, and all that the operators book becomes one ledger.

    Parameters
    ----------
    run
        The run of the operator that holds the steps.
    passes
        What is to be done, in order.
    """

    def __init__(self, run: Run, passes: Sequence[Pass]) -> None:
        self.run = run
        self._passes = passes
        self._effort = sum(each.effort for each in passes)
        self._done = 0.0
        self._told = -1
        _ = run.device  # opened once, here, and not by every child

    def __iter__(self) -> Iterator[Pass]:
        """Yield the passes, fewer if the run is asked to finish."""
        for each in self._passes:
            self.run.check()
            if self.run.is_finishing:
                break
            yield each
            self._done += each.effort
        self._tell(TICKS)

    def through(
        self,
        each: Pass,
        steps: Steps,
        surface: Surface,
        *,
        ledger: Ledger | None = None,
        earlier: Mapping[str, Surface] | None = None,
        preview: Callable[[Surface], Surface] | None = None,
    ) -> Surface:
        """Return the surface after the steps.

        Parameters
        ----------
        each
            Which pass this is.
        steps
            The operators.
        surface
            What they work on.
        ledger
            Where it is booked; by default in the run's.
        earlier
            Surfaces that their parameters may name; by default the run's.
        preview
            Makes of an unfinished surface what whoever watches is to see.

        Raises
        ------
        TerrakitError
            What an operator raises, with its place in the list.
        """
        ledger = self.run.ledger if ledger is None else ledger
        count = len(steps.operators)
        for index, operator in enumerate(steps.operators):
            if index and self.run.is_finishing:
                break
            begun = self._done + each.effort * index / count
            child = self._child(operator, each, begun, each.effort / count)
            if earlier is not None:
                child.earlier = earlier
            if preview is not None and self.run.on_preview is not None:
                child.on_preview = _shown_as(self.run.on_preview, preview)
            surface = _worked_on(operator, steps.place("steps", index), surface, child, ledger)
            self.run._previewed = child._previewed
            self._tell(self._ticks(begun + each.effort / count))
        return surface

    def close(self, surface: Surface) -> None:
        """Close the run's ledger, also where nobody booked anything."""
        if "rock" not in self.run.ledger.accounts:
            volume = volume_under(surface)
            self.run.ledger.open("rock", volume)
            self.run.ledger.close("rock", volume, 0.0)

    def _child(self, operator: Operator, each: Pass, begun: float, effort: float) -> Run:
        """Return the run for one operator in one pass."""
        run = self.run
        child = run.for_step(f"{run.step}: {operator.name}" if run.step else operator.name)
        child._started = run._started
        child._chained = run._chained
        child.span = run.moment(each.start), run.moment(each.end)
        if isinstance(operator, Erosion):  # filters and textures go by a rule, always the same
            child.passes = (*run.passes, each.number)
        else:
            child.passes = ()
        if run.on_progress is not None:
            child.on_progress = lambda told: self._tell(
                self._ticks(begun + effort * min(1.0, told.fraction))
            )
        return child

    def _ticks(self, effort: float) -> int:
        return round(TICKS * effort / self._effort) if self._effort else TICKS

    def _tell(self, ticks: int) -> None:
        """Report how far the whole is, unless that was said already."""
        if ticks > self._told:
            self._told = ticks
            self.run._report(min(ticks, TICKS), TICKS)


def volume_under(surface: Surface) -> float:
    """Return the volume (m3) between a surface and the plane at 0 m, as a ledger counts it."""
    if isinstance(surface, TriMesh):
        return surface.volume
    quanta = Quanta.fitting(surface.elevation, surface.spacing)
    return quanta.volume(quanta.count(surface.elevation), surface.cell_area)


def rounding_of(surface: Surface) -> float:
    """Return how far rounding to float32 and counting in quanta may move a volume, m3."""
    if isinstance(surface, TriMesh):
        size = float(surface.areas.sum()) * max(1.0, float(np.abs(surface.heights).max()))
        return 1e-9 * size
    height = surface.elevation
    quantum = Quanta.fitting(height, surface.spacing).quantum
    a_sample = quantum + float(np.spacing(np.abs(height).max()))
    return a_sample * height.size * surface.cell_area


def _worked_on(
    operator: Operator, place: str, surface: Surface, run: Run, ledger: Ledger
) -> Surface:
    """Return what one operator makes of a surface, booked in ``ledger``."""
    from terrakit.execute import execute

    try:
        result: Surface = execute(operator, surface, run)
    except (ParameterError, InputError, ResourceError) as error:
        raise type(error)(f"{place}{error}") from error
    if isinstance(operator, Filter):  # it keeps no ledger, yet ground comes and goes
        before, after = volume_under(surface), volume_under(result)
        run.ledger.open("rock", before)
        run.ledger.close("rock", after, 0.0)
        run.ledger.accounts["rock"].book(f"filter {operator.name}", after - before)
    ledger.follow(run.ledger, lambda: rounding_of(surface))
    return result


def _shown_as(
    show: Callable[[Surface], None], preview: Callable[[Surface], Surface]
) -> Callable[[Surface], None]:
    return lambda surface: show(preview(surface))


__all__ = ["Pass", "Passes", "rounding_of", "volume_under"]
