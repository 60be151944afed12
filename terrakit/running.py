"""What an operator is handed while it works: seed, device, progress, cancel and ledger."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from terrakit.compute.cancellation import watched
from terrakit.errors import Cancelled, ParameterError
from terrakit.ledger import Ledger

if TYPE_CHECKING:
    from terrakit.compute import Device, DeviceInfo
    from terrakit.heightfield import Grid, Heightfield
    from terrakit.operators import Surface
    from terrakit.parameters import Seed
    from terrakit.sources import Chain, Source

PREVIEW_SECONDS = 0.5

_active: ContextVar[Run | None] = ContextVar("terrakit_run", default=None)


def active_run() -> Run | None:
    """Return the run that is at work in this thread, or None outside of one."""
    return _active.get()


@dataclass(frozen=True)
class Progress:
    """How far a step has come."""

    step: str
    done: int
    total: int
    elapsed: float

    @property
    def fraction(self) -> float:
        """Share of the step that is done, 0 to 1."""
        return self.done / self.total if self.total else 1.0


def seed_words(*parts: Seed) -> tuple[int, int]:
    """Return two 32-bit words for any integers and texts: the one mapping of seeds.

    The words are the first eight bytes of the BLAKE2b digest of the parts, each written as
    ``int:<decimal>`` or ``str:<text>`` and ended by a zero byte. So -1 and 2**32 - 1 differ, and
    so do 7 and "7".
    """
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        if isinstance(part, bool) or not isinstance(part, (int, str)):
            raise ParameterError(f"seed = {part!r}: must be an integer or text")
        digest.update(f"{'int' if isinstance(part, int) else 'str'}:{part}".encode() + b"\0")
    words = digest.digest()
    return int.from_bytes(words[:4], "little"), int.from_bytes(words[4:], "little")


class Run:
    """One run of one or more operators.

    Parameters
    ----------
    seed
        Any integer or text; everything random follows from it.
    device
        A device from :func:`terrakit.compute.choose_device`, its name, or None for the best.
        ``"numpy"`` runs the references.
    on_progress
        Called from the working thread whenever a step got further.
    on_preview
        Called now and then with a surface that is not finished yet.
    work_group
        Work-group size for tests.
    sea_level
        Height of the sea of this world, metres; None where there is none.
    world
        Where the whole world lies, of which the terrain may be a tile: what is placed "in the
        middle" is placed in the middle of this. By default the grid of the first terrain.
    earlier
        Surfaces that parameters may name: in a recipe those of earlier steps.
    folder
        Where the paths of a recipe begin, and must stay; None where they are the user's own.
    """

    def __init__(
        self,
        seed: Seed = 0,
        device: DeviceInfo | str | None = None,
        on_progress: Callable[[Progress], None] | None = None,
        on_preview: Callable[[Surface], None] | None = None,
        work_group: int | None = None,
        sea_level: float | None = None,
        world: Grid | None = None,
        earlier: Mapping[str, Surface] | None = None,
        folder: Path | None = None,
    ) -> None:
        seed_words(seed)
        self.seed = seed
        self.on_progress = on_progress
        self.on_preview = on_preview
        self.sea_level = sea_level
        self.world = world
        self.earlier: Mapping[str, Surface] = dict(earlier or {})
        self.folder = folder
        self.span = (0.0, 1.0)
        """The part of a larger work that this is, from 0 to 1: what schedules run over."""
        self.passes: tuple[int, ...] = ()
        """Which pass of which loop this is, outermost first: later ones draw other numbers."""
        self.ledger = Ledger()
        self.step = ""
        self._device = device
        self._work_group = work_group
        self._opened: Device | None = None
        self._cancel = threading.Event()
        self._finish = threading.Event()
        self._started = time.perf_counter()
        self._previewed = 0.0
        self._chained: dict[tuple[int, Grid], tuple[Chain, Heightfield]] = {}

    @property
    def device_info(self) -> DeviceInfo:
        """The device that this run uses."""
        from terrakit.compute import DeviceInfo, choose_device

        if not isinstance(self._device, DeviceInfo):
            self._device = choose_device(self._device)
        return self._device

    @property
    def device(self) -> Device | None:
        """The open OpenCL device, or None where the NumPy reference is to be used."""
        from terrakit.compute import Device

        if self._opened is None and self.device_info.is_opencl:
            self._opened = Device(self.device_info, self._work_group)
        return self._opened

    def words(self, stream: str, seed: Seed = 0, *, lasting: bool = False) -> tuple[int, int]:
        """Return the seed of one stream of random numbers, as two 32-bit words.

        Parameters
        ----------
        stream
            A constant name, usually the operator's; a new stream never shifts another.
        seed
            The operator's own ``seed`` parameter.
        lasting
            Whether the numbers belong to the ground, as its roughness does, and not to an event,
            such as rain: then they stay the same from pass to pass of a loop.
        """
        passes = () if lasting else self.passes
        while passes and not passes[-1]:  # the first pass draws what a step alone would
            passes = passes[:-1]
        return seed_words(self.seed, stream, seed, *passes)

    def moment(self, fraction: float) -> float:
        """Return how much of the whole work is done when this ``fraction`` of the run is."""
        start, end = self.span
        return start + fraction * (end - start)

    def for_step(self, name: str) -> Run:
        """Return a run for one step: its own ledger and clock, the same seed, device and cancel."""
        child = object.__new__(Run)
        child.__dict__.update(self.__dict__)
        child.ledger = Ledger()
        child.step = name
        child._chained = {}
        child._started = time.perf_counter()
        return child

    def steps(self, count: int) -> Iterator[int]:
        """Yield 0 to ``count - 1``: the one loop of every operator.

        It reports progress, raises :class:`~terrakit.errors.Cancelled` when asked to stop, and
        ends early when asked to finish with what is there.
        """
        for index in range(count):
            self.check()
            if self._finish.is_set():
                break
            self._report(index, count)
            yield index
        self._report(count, count)

    def check(self) -> None:
        """Raise :class:`~terrakit.errors.Cancelled` if the user asked to stop."""
        if self._cancel.is_set():
            raise Cancelled("cancelled; nothing was written")

    def cancel(self) -> None:
        """Ask the run to stop and give up what it has; may be called from any thread."""
        self._cancel.set()

    def finish_now(self) -> None:
        """Ask the run to stop and keep what it has; may be called from any thread."""
        self._finish.set()

    @property
    def is_finishing(self) -> bool:
        """Whether the run was asked to finish with what is there."""
        return self._finish.is_set()

    @contextmanager
    def watching(self, grid: Grid | None = None) -> Iterator[None]:
        """Make this the run at work: long launches ask it whether to stop, parameters for terrain.

        Parameters
        ----------
        grid
            Where the work is done: the world, unless the run knows of a larger one.
        """
        token, world = _active.set(self), self.world
        self.world = grid if world is None else world
        try:
            with watched(self.check):
                yield
        finally:
            self.world = world
            _active.reset(token)

    def file(self, text: str) -> Path:
        """Return where a file lies that a parameter names.

        Absolute paths are taken as they are: a recipe that has one is refused when it is read,
        unless the user gave it.

        Raises
        ------
        ParameterError
            If a relative path leaves the recipe's folder.
        """
        path = Path(text).expanduser()
        if self.folder is None or path.is_absolute():
            return path
        inside = (self.folder / path).resolve()
        if not inside.is_relative_to(self.folder.resolve()):
            raise ParameterError(
                f"{text!r}: leaves the recipe's folder; put the file there, or give its whole path "
                "with --set"
            )
        return inside

    def named(self, name: str) -> Surface:
        """Return the surface of an earlier step, wherever it lies.

        Raises
        ------
        ParameterError
            If there is none of that name.
        """
        if name in self.earlier:
            return self.earlier[name]
        from terrakit.parameters import suggestion

        raise ParameterError(f"{name!r}: no step '{name}'{suggestion(name, list(self.earlier))}")

    def terrain(self, source: Source, grid: Grid) -> Heightfield:
        """Return the terrain that a parameter means, on ``grid``.

        Parameters
        ----------
        source
            A height, the name of an earlier step (or ``step.layer``, whose values are then the
            heights), or a chain, which is made here with this run's seed.
        grid
            Where it is wanted.

        Raises
        ------
        ParameterError
            If there is no such step, or it lies elsewhere.
        """
        import numpy as np

        from terrakit.heightfield import Heightfield

        if isinstance(source, (int, float)):
            return Heightfield.on_grid(grid, np.full(grid.shape, source, dtype=np.float32))
        if isinstance(source, str):
            found, layer = look_up(source, self.earlier)
            check_same_place(source, found, grid)
            assert isinstance(found, Heightfield)
            if layer == "elevation":
                return found
            return Heightfield.on_grid(grid, found.layer(layer))
        key = id(source), grid
        if key not in self._chained:
            self._chained[key] = source, self._run_chain(source, grid)
        return self._chained[key][1]

    def _run_chain(self, chain: Chain, grid: Grid) -> Heightfield:
        """Make a chain's terrain, each operator with a ledger and a clock of its own."""
        from terrakit.execute import execute

        subject: Grid | Heightfield = grid
        for operator in chain.operators:
            child = self.for_step(f"{self.step}: {operator.name}" if self.step else operator.name)
            child.on_preview = None
            child.span, child.passes = (0.0, 1.0), ()  # made once, whatever pass asks for it
            subject = execute(operator, subject, child)
        made: Heightfield = subject  # type: ignore[assignment]
        if made.grid != grid:
            raise ParameterError(
                f"'{chain}': ends on {place_of(made.grid)}, wanted {place_of(grid)}; leave out "
                "what changes the grid"
            )
        return made

    def offer(self, make: Callable[[], Surface]) -> None:
        """Hand an unfinished surface to whoever watches; ``make`` is called only if needed."""
        now = time.perf_counter()
        if self.on_preview is not None and now - self._previewed >= PREVIEW_SECONDS:
            self._previewed = now
            self.on_preview(make())

    def _report(self, done: int, total: int) -> None:
        if self.on_progress is not None:
            elapsed = time.perf_counter() - self._started
            self.on_progress(Progress(self.step, done, total, elapsed))


def look_up(text: str, earlier: Mapping[str, Surface]) -> tuple[Surface, str]:
    """Return the surface and the layer that ``step`` or ``step.layer`` names.

    Raises
    ------
    ParameterError
        If there is no such step or layer.
    """
    from terrakit.parameters import suggestion

    if text in earlier:
        return earlier[text], "elevation"
    step, dot, layer = text.rpartition(".")
    if not dot or step not in earlier:
        known = suggestion(step or text, list(earlier))
        raise ParameterError(f"{text!r}: no step '{step or text}'{known}")
    if layer not in earlier[step]:
        known = suggestion(layer, list(earlier[step]))
        raise ParameterError(f"{text!r}: step '{step}' has no layer '{layer}'{known}")
    return earlier[step], layer


def check_same_place(text: str, found: Surface, wanted: Surface | Grid) -> None:
    """Raise ParameterError unless the samples of an earlier surface lie where they are wanted."""
    from terrakit.heightfield import Grid, Heightfield

    if isinstance(wanted, (Grid, Heightfield)):
        grid = wanted if isinstance(wanted, Grid) else wanted.grid
        if not isinstance(found, Heightfield):
            raise ParameterError(f"{text!r}: is a mesh, and a heightfield is wanted here")
        own = found.grid
        if (own.shape, own.spacing, own.origin) != (grid.shape, grid.spacing, grid.origin):
            raise ParameterError(
                f"{text!r}: lies on {place_of(own)}, wanted {place_of(grid)}; bring it there "
                'first: use = "resample" with like = ...'
            )
    elif isinstance(found, Heightfield) or len(found.vertices) != len(wanted.vertices):
        raise ParameterError(f"{text!r}: is not the same mesh; name one of the mesh's own layers")


def place_of(grid: Grid) -> str:
    """Return a grid as a message names it."""
    rows, cols = grid.shape
    west, north = grid.north_west
    return f"{rows}x{cols} samples of {grid.spacing:g} m from {west:g}, {north:g}"
