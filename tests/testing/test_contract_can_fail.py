"""The contract suite finds what it is there to find: one broken operator a promise."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from terrakit import (
    Exporter,
    Filter,
    Generator,
    Grid,
    Heightfield,
    Importer,
    InputError,
    Run,
    Source,
    StepName,
    Texture,
    TriMesh,
)
from terrakit.operators import Erosion, Operator
from terrakit.parameters import Maskable, Seed, parameter
from terrakit.testing import (
    NotApplicable,
    OperatorContract,
    broken_contracts,
    check_compass,
    compass_terrain,
    contract_checks,
)


class Scour(Erosion):
    """Carry material from every sample to its neighbours, in whole millimetres."""

    name = "scour"
    locality = "stencil"
    idle: ClassVar = {"iterations": 0}
    refinement_tolerance = None

    iterations: int = parameter(3, "Sweeps over the terrain.", ge=0, le=100)
    share: Maskable = parameter(0.125, "Part of a difference that moves.", ge=0, le=0.2)

    def reach(self, spacing: float) -> int | None:
        """Return 1."""
        return 1

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return smoother ground."""
        start = np.rint(surface.elevation.astype(np.float64) * 1024).astype(np.int64)
        height = start
        for sweep in run.steps(self.iterations):
            share = np.asarray(self.value("share", surface, sweep / self.iterations))
            flows = []
            for axis in (0, 1):
                sides = np.moveaxis(np.broadcast_to(share, height.shape), axis, 0)
                weight = 0.5 * (sides[1:] + sides[:-1])
                gap = np.moveaxis(np.diff(height, axis=axis), axis, 0)
                flows.append(np.moveaxis(np.trunc(weight * gap).astype(np.int64), 0, axis))
            height = height.copy()
            for axis, flow in enumerate(flows):
                widths = [(0, 0), (0, 0)]
                widths[axis] = (1, 1)
                height += np.diff(np.pad(flow, widths), axis=axis)
        area = surface.cell_area / 1024
        run.ledger.open("rock", float(start.sum()) * area)
        run.ledger.close(
            "rock", float(height.sum()) * area, 0.5 * float(np.abs(height - start).sum()) * area
        )
        moved = np.where(height == start, surface.elevation, height / 1024)
        return surface.with_layers(elevation=moved.astype(np.float32))


class Honest(Scour):
    """Keep the whole contract."""

    name = "honest"


class Mutates(Scour):
    """Scribble into a layer of the input, on the host."""

    name = "mutates"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the result, and break the input after it."""
        inside = surface.layer("mask_bystander") if "mask_bystander" in surface else None
        while inside is not None and isinstance(inside.base, np.ndarray):
            inside = inside.base
        if inside is not None and inside.base is None:
            inside.flags.writeable = True
            inside += 1
        return super().erode(surface, run)


class Overwrites(Scour):
    """Let a kernel write into the input, on the device."""

    name = "overwrites"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the result, and break what is on the device."""
        if run.device is not None and len(surface.layers["elevation"].places) > 1:
            run.device.fill(surface.on(run.device), 0)
        return super().erode(surface, run)


class Undeclared(Scour):
    """Write a layer on the quiet."""

    name = "undeclared"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return one layer too many."""
        return super().erode(surface, run).with_layers(wetness=np.zeros(surface.shape))


class Replaces(Scour):
    """Hand on a copy of a layer that is none of its business."""

    name = "replaces"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return a bystander that is another object."""
        result = super().erode(surface, run)
        if "mask_bystander" not in surface:
            return result
        return result.with_layers(mask_bystander=surface.layer("mask_bystander"))


class Deaf(Scour):
    """Declare a seed and never listen to it."""

    name = "deaf"
    seed: Seed = parameter(0, "Another number gives nothing else.")


class Moody(Scour):
    """Depend on the clock."""

    name = "moody"
    parity = "statistical"
    turning: ClassVar = None
    idle: ClassVar = {}
    locality = "global"
    iterations: int = parameter(3, "Sweeps over the terrain.", ge=1, le=100)
    share: float = parameter(0.125, "Part of a difference that moves.", ge=0, le=0.2)  # type: ignore[assignment]

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return something else each time, within a thousandth of a millimetre."""
        result = super().erode(surface, run)
        noise = np.random.default_rng(time.perf_counter_ns()).integers(0, 2, surface.shape)
        bits = result.elevation.view(np.int32) + noise.astype(np.int32)
        return result.with_layers(elevation=bits.view(np.float32))


class Loses(Scour):
    """Lose a thousandth of what is there and own up to it."""

    name = "loses"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return less than there was."""
        result = super().erode(surface, run)
        if self.iterations == 0:
            return result
        volume = float(result.elevation.sum(dtype=np.float64)) * surface.cell_area
        account = run.ledger.accounts["rock"]
        run.ledger.close("rock", volume - 1e-3 * account.moved - 1.0, account.moved)
        return result


class Lies(Scour):
    """Lose material, and book that all is there."""

    name = "lies"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return a terrain that is 1 m lower than the ledger says."""
        result = super().erode(surface, run)
        if self.iterations == 0:
            return result
        return result.with_layers(elevation=result.elevation - np.float32(1.0))


class Leaning(Scour):
    """Visit neighbours in an order that favours one side."""

    name = "leaning"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Move one quantum eastwards wherever the ground falls."""
        result = super().erode(surface, run)
        if self.iterations == 0 or np.abs(result.elevation).max() > 8000:
            return result  # float32 does not hold these counts
        quanta = np.rint(result.elevation.astype(np.float64) * 1024).astype(np.int64)
        falls = quanta[:, :-1] > quanta[:, 1:]
        quanta[:, :-1] -= falls
        quanta[:, 1:] += falls
        area = surface.cell_area / 1024
        account = run.ledger.accounts["rock"]
        run.ledger.close("rock", float(quanta.sum()) * area, account.moved)
        return result.with_layers(elevation=(quanta / 1024).astype(np.float32))


class Stubborn(Scour):
    """Do not ask whether to stop."""

    name = "stubborn"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the result after eight steps, cancelled or not."""
        quiet = Run(run.seed, run.device_info)
        result = super().erode(surface, quiet)
        run.ledger.accounts = quiet.ledger.accounts
        for step in range(9):
            if run.is_finishing:
                break
            run._report(step, 8)
        return result


class Silent(Scour):
    """Report nothing."""

    name = "silent"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the result without a word."""
        quiet = Run(run.seed, run.device_info)
        result = super().erode(surface, quiet)
        run.ledger.accounts = quiet.ledger.accounts
        return result


class Fragile(Scour):
    """Divide by the relief."""

    name = "fragile"

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return NaN on flat ground."""
        result = super().erode(surface, run)
        if np.ptp(surface.elevation) > 0:
            return result
        bad = object.__new__(Heightfield)
        bad.grid, bad._layers = result.grid, dict(result._layers)
        broken = Heightfield(result.elevation, 1.0).layers["elevation"]
        broken._host = np.full(surface.shape, np.nan, np.float32)
        bad._layers["elevation"] = broken
        return bad


class Restless(Scour):
    """Round the heights even when there is nothing to do."""

    name = "restless"
    idle: ClassVar = {"share": 0.0}
    iterations: int = parameter(3, "Sweeps over the terrain.", ge=1, le=100)

    def erode(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return rounded heights."""
        result = super().erode(surface, run)
        height = np.rint(result.elevation.astype(np.float64) * 1024) / 1024
        return result.with_layers(elevation=height.astype(np.float32))


class Farsighted(Scour):
    """Read further than it says."""

    name = "farsighted"

    def reach(self, spacing: float) -> int | None:
        """Return 0 where it is 1."""
        return 0


class Schedules(Scour):
    """Read a schedule once."""

    name = "schedules"

    def value(self, parameter: str, surface: Any, fraction: float = 0.0) -> Any:
        """Return the first value for ever."""
        return super().value(parameter, surface, 0.0)


class Misnamed(Scour):
    """Call a share of differences by the name of an angle."""

    name = "misnamed"
    talus_angle: float = parameter(0.5, "A slope, as a tangent.", unit="m/m", ge=0, le=5)


class Sloppy(Scour):
    """Have a default that its own bounds forbid."""

    name = "sloppy"
    trial: ClassVar = {"depth": 1.0}
    depth: float = parameter(5.0, "A depth beyond its bound.", unit="m", ge=0, le=1)


class Samples(Scour):
    """Count in samples what should be metres."""

    name = "samples"
    refinement_tolerance = 0.35
    idle: ClassVar = {}
    iterations: int = parameter(5, "Sweeps over the terrain.", ge=1, le=100)


BROKEN: list[tuple[type[Operator], set[str]]] = [
    (Mutates, {"input_is_untouched"}),
    (Overwrites, {"input_is_untouched"}),
    (Undeclared, {"writes_what_it_declares"}),
    (Replaces, {"writes_what_it_declares"}),
    (Deaf, {"seed_decides"}),
    (Moody, {"same_seed_gives_same_bytes", "same_bytes_in_another_process"}),
    (Loses, {"ledger_closes"}),
    (Lies, {"ledger_agrees_with_the_surface"}),
    (Leaning, {"turning_turns_the_result"}),
    (Stubborn, {"cancel_is_answered"}),
    (Silent, {"progress_rises_to_one"}),
    (Fragile, {"awkward_terrain_is_survived"}),
    (Restless, {"idle_settings_change_nothing"}),
    (Farsighted, {"tile_equals_whole"}),
    (Schedules, {"schedules_take_effect"}),
    (Misnamed, {"parameters_mean_the_same_everywhere"}),
    (Sloppy, {"defaults_are_within_bounds"}),
    (Samples, {"refines"}),
]

CONSEQUENCES: dict[type[Operator], set[str]] = {
    # The scribbles reach the result, which shares the layer, but not in the other process
    Mutates: {"same_bytes_in_another_process", "turning_turns_the_result"},
    # What it books is wrong on every terrain, however it is measured
    Loses: {
        "ledger_agrees_with_the_surface",
        "awkward_terrain_is_survived",
        "finish_now_keeps_what_is_there",
    },
}
"""Further checks that cannot help failing."""


@pytest.mark.parametrize(("operator", "expected"), BROKEN, ids=lambda v: getattr(v, "name", ""))
def test_broken_operator_fails_the_one_check(operator: type[Operator], expected: set[str]) -> None:
    broken = broken_contracts(operator)
    consequences = CONSEQUENCES.get(operator, set())
    assert expected <= set(broken), broken
    assert set(broken) <= expected | consequences, broken
    for sentence in broken.values():
        assert sentence.startswith(f"{operator.name}: ")
        assert "\n" not in sentence


def test_honest_operator_passes() -> None:
    assert broken_contracts(Honest) == {}


class Drift(Generator):
    """Number the samples from the corner of the tile."""

    name = "drift"
    height: float = parameter(10.0, "Height of the steps.", unit="m", ge=0)

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return a ramp from the corner of the tile, wherever that is."""
        rows, cols = np.indices(grid.shape)
        return Heightfield.on_grid(grid, (self.height * (rows**2 + cols)).astype(np.float32))


class Painter(Texture):
    """Paint weights that do not add up, and level the ground."""

    name = "painter"
    writes = ("material_grass", "material_rock")

    def texture(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return weights whose sum is 0.9, on raised ground."""
        half = np.full(surface.shape, 0.45)
        return surface.with_layers(
            material_grass=half, material_rock=half, elevation=surface.elevation + np.float32(1)
        )


class Torn(Exporter):
    """Write straight to the target, and a note next door."""

    name = "torn"
    suffix = ".torn"

    def export(self, surface: Heightfield, path: Path, run: Run) -> list[Path]:
        """Write heights and the time."""
        try:
            (path.parent.parent / "note.txt").write_text("I was here", encoding="utf-8")
            with open(path, "wb") as stream:
                stream.write(f"{time.perf_counter_ns()}".encode())
                stream.write(surface.elevation.tobytes())
        except OSError as error:
            from terrakit import OutputError

            raise OutputError(str(error)) from error
        return [path]


class Credulous(Importer):
    """Take anything for a terrain."""

    name = "credulous"
    suffixes = (".any",)

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the first byte is printable."""
        return head[0] > 31

    def load(self, path: Path, run: Run) -> Heightfield:
        """Return a terrain of the first nine bytes."""
        values = np.frombuffer(path.read_bytes(), np.uint8)[:9]
        return Heightfield(values.reshape(3, 3), 1.0)


@pytest.mark.parametrize(
    ("operator", "expected"),
    [
        (Drift, {"tile_equals_whole"}),
        (Painter, {"elevation_is_untouched", "weights_sum_to_one", "writes_what_it_declares"}),
        (
            Torn,
            {
                "writes_only_what_it_lists",
                "same_surface_gives_same_files",
                "failing_write_leaves_nothing",
            },
        ),
        (Credulous, {"junk_is_refused"}),
    ],
)
def test_other_kinds_fail_their_checks(operator: type[Operator], expected: set[str]) -> None:
    broken = broken_contracts(operator)
    assert expected <= set(broken), broken
    assert set(broken) <= expected | {"cut_files_are_refused", "junk_is_refused"}, broken


class Smear(Filter):
    """Draw every sample towards the mean of its neighbours, but nowhere below another terrain."""

    name = "smear"
    locality = "stencil"
    idle: ClassVar = {"share": 0.0, "other": -1e6}

    share: Maskable = parameter(0.5, "How far towards the mean.", ge=0, le=1)
    other: Source = parameter(-50.0, "Terrain that stands out.", unit="m", ge=-1e6, le=1e6)
    like: StepName | None = parameter(None, "A step, if any, whose height counts as well.")

    def reach(self, spacing: float) -> int | None:
        """Return 1."""
        return 1

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return smoother ground; the sums are such that no side comes first."""
        near = np.pad(surface.elevation, 1, mode="edge")
        sum_of = (near[:-2, 1:-1] + near[2:, 1:-1]) + (near[1:-1, :-2] + near[1:-1, 2:])
        share = np.asarray(self.shares(surface), dtype=np.float32)
        height = surface.elevation + share * (np.float32(0.25) * sum_of - surface.elevation)
        if self.like is not None:
            height = height + np.float32(self.step(run).elevation.mean())
        height = np.maximum(height, self.ground(surface, run))
        return surface.with_layers(elevation=height)

    def shares(self, surface: Heightfield) -> Any:
        """Return how far to go."""
        return self.value("share", surface)

    def ground(self, surface: Heightfield, run: Run) -> Any:
        """Return the other terrain."""
        return run.terrain(self.other, surface.grid).elevation

    def step(self, run: Run) -> Any:
        """Return the surface of a step."""
        assert self.like is not None
        return run.named(self.like)


class Leans(Smear):
    """Look west alone."""

    name = "leans"
    idle: ClassVar = {}

    def reach(self, spacing: float) -> int | None:
        """Return 2."""
        return 2

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return ground that leans."""
        west = np.pad(surface.elevation, ((0, 0), (1, 0)), mode="edge")[:, :-1]
        return super().apply(surface.with_layers(elevation=west), run)


class Mound(Filter):
    """Raise a mound in the middle of the world, as a filter must."""

    name = "mound"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return ground with a mound."""
        world = self.world(surface, run)
        rows, cols = np.indices(surface.shape)
        west, north = np.subtract(surface.grid.north_west, world.north_west) / world.spacing
        across = np.abs(2 * (cols + round(west)) - world.shape[1] + 1)
        along = np.abs(2 * (rows - round(north)) - world.shape[0] + 1)
        mound = (100 - np.maximum(across, along)).astype(np.float32)
        return surface.with_layers(elevation=surface.elevation + mound)

    def world(self, surface: Heightfield, run: Run) -> Grid:
        """Return where the middle is."""
        assert run.world is not None
        return run.world


class TileMound(Mound):
    """Raise a mound in the middle of whatever is there."""

    name = "tile_mound"

    def world(self, surface: Heightfield, run: Run) -> Grid:
        """Return the tile."""
        return surface.grid


class NumbersOnly(Smear):
    """Take a number, and no terrain."""

    name = "numbers_only"

    def ground(self, surface: Heightfield, run: Run) -> Any:
        """Return the number, or a guess."""
        return np.float32(self.other if isinstance(self.other, float) else 0.0)


class Trusting(Smear):
    """Take the numbers of another terrain, wherever it lies."""

    name = "trusting"

    def ground(self, surface: Heightfield, run: Run) -> Any:
        """Return an elevation that may be of another place."""
        if isinstance(self.other, str) and "." not in self.other:
            found = run.named(self.other)
            return np.asarray(found.elevation).reshape(surface.shape)
        return super().ground(surface, run)


class Unmasked(Smear):
    """Look at the mean of a mask."""

    name = "unmasked"
    idle: ClassVar = {}

    def shares(self, surface: Heightfield) -> Any:
        """Return one number, which a constant mask would not reveal."""
        share = np.asarray(self.value("share", surface), dtype=np.float32)
        return share.max() if share.ndim == 0 else share.max() / np.float32(2)


class Guesses(Smear):
    """Make do without the step that was named."""

    name = "guesses"

    def step(self, run: Run) -> Any:
        """Return any step."""
        return run.earlier.get(str(self.like)) or next(iter(run.earlier.values()))


class Rounds(Smear):
    """Round where there is nothing to do."""

    name = "rounds"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return rounded heights."""
        made = super().apply(surface, run)
        return made.with_layers(elevation=np.rint(made.elevation))


class Crashes(Smear):
    """Count on a second row."""

    name = "crashes"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return ground, if it is large enough."""
        assert surface.elevation[1, 1] is not None
        return super().apply(surface, run)


class Refuses(Crashes):
    """Count on a second row, and say so."""

    name = "refuses"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return ground, if it is large enough."""
        if min(surface.shape) < 2:
            raise InputError(f"the terrain has {surface.shape} samples; needs two rows")
        return super().apply(surface, run)


class Unhurried(Smear):
    """Take its time, and answer no cancel."""

    name = "unhurried"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the result after eight steps."""
        for step in range(8):
            if not run.is_finishing:
                run._report(step, 8)
        return super().apply(surface, run)


class Finer(Filter):
    """Put samples between the samples."""

    name = "finer"
    changes_grid = True
    locality = "global"
    trial: ClassVar = {}

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return the grid of half the spacing."""
        rows, cols = grid.shape
        return Grid((2 * rows - 1, 2 * cols - 1), grid.spacing / 2, grid.origin, grid.crs)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the mean of the neighbours between samples."""
        layers = {name: self.finer(surface.layer(name)) for name in surface}
        grid = Finer.grid_after(self, surface.grid)
        assert grid is not None
        made = Heightfield.on_grid(grid, layers.pop("elevation"))
        return made.with_layers(**{n: self.along(f) for n, f in layers.items()})

    def finer(self, field: Any) -> Any:
        """Return a field of twice the samples; its four corners are summed crosswise."""
        rows, cols = field.shape
        made = np.empty((2 * rows - 1, 2 * cols - 1), dtype=np.float32)
        made[::2, ::2] = field
        made[1::2, ::2] = np.float32(0.5) * (field[1:] + field[:-1])
        made[::2, 1::2] = np.float32(0.5) * (field[:, 1:] + field[:, :-1])
        first, second = field[:-1, :-1] + field[1:, 1:], field[1:, :-1] + field[:-1, 1:]
        made[1::2, 1::2] = np.float32(0.25) * (first + second)
        return made

    def along(self, field: Any) -> Any:
        """Return a layer as it comes along."""
        return field


class Blanks(Finer):
    """Forget what the layers held."""

    name = "blanks"

    def along(self, field: Any) -> Any:
        """Return nothing."""
        return np.zeros_like(field)


class Overshoots(Finer):
    """Let the layers run out of their range."""

    name = "overshoots"

    def along(self, field: Any) -> Any:
        """Return too much."""
        return field * np.float32(3)


class Lost(Finer):
    """Land elsewhere than announced."""

    name = "lost"

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return the grid that there was."""
        return grid


class Hills(Generator):
    """Make ground whose height may differ from place to place."""

    name = "hills"
    amplitude: Maskable = parameter(10.0, "Height of the hills.", unit="m", ge=0, le=1e6)

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return waves along the world's x."""
        first = round(grid.north_west[0] / grid.spacing)
        wave = np.float32(0.125) * ((first + np.arange(grid.shape[1])) % 8).astype(np.float32)
        height = np.asarray(self.height(grid), dtype=np.float32) * wave[None, :]
        return Heightfield.on_grid(grid, np.broadcast_to(height, grid.shape))

    def height(self, grid: Grid) -> Any:
        """Return the amplitude."""
        return self.value("amplitude", grid)


class Stiff(Hills):
    """Read one number of a field."""

    name = "stiff"

    def height(self, grid: Grid) -> Any:
        """Return the last value of the first row, doubled where it is a field."""
        value = np.asarray(self.value("amplitude", grid), dtype=np.float32)
        return value if value.ndim == 0 else value[0, -1] * 2


class Carefree(Hills):
    """Make do without the terrain that was named."""

    name = "carefree"

    def height(self, grid: Grid) -> Any:
        """Return the amplitude, or ten."""
        try:
            return self.value("amplitude", grid)
        except ValueError:
            return 10.0


COMPOSED: list[tuple[type[Operator], set[str]]] = [
    (Smear, set()),
    (Mound, set()),
    (Refuses, set()),
    (Finer, set()),
    (Hills, set()),
    (Leans, {"turning_turns_the_result"}),
    (TileMound, {"tile_equals_whole"}),
    (NumbersOnly, {"terrain_parameters_take_terrain"}),
    (Trusting, {"wrong_terrains_are_refused"}),
    (Unmasked, {"maskable_parameters_take_layers"}),
    (Guesses, {"unknown_steps_are_refused"}),
    (Rounds, {"idle_settings_change_nothing"}),
    (Crashes, {"small_terrain_is_no_trap"}),
    (Unhurried, {"cancel_is_answered"}),
    (Blanks, {"layers_come_along"}),
    (Overshoots, {"layers_come_along"}),
    (Lost, {"grid_is_as_announced"}),
    (Stiff, {"maskable_parameters_take_layers"}),
    (Carefree, {"wrong_layers_are_refused"}),
]


@pytest.mark.parametrize(("operator", "expected"), COMPOSED, ids=lambda v: getattr(v, "name", ""))
def test_filters_and_what_takes_terrain(operator: type[Operator], expected: set[str]) -> None:
    broken = broken_contracts(operator)
    assert set(broken) == expected, broken
    for sentence in broken.values():
        assert sentence.startswith(f"{operator.name}: ")
        assert "\n" not in sentence


@pytest.mark.parametrize("wrong", [np.fliplr, np.flipud, np.transpose, lambda a: np.rot90(a, 2)])
def test_compass_terrain_finds_every_turn(wrong: Callable[[Any], Any]) -> None:
    terrain = compass_terrain()
    check_compass(terrain)
    with pytest.raises(AssertionError, match="highest first"):
        check_compass(Heightfield(wrong(terrain.elevation), 10.0))


def test_exemption_quotes_the_declaration() -> None:
    check = next(c for c in contract_checks(Moody) if c.name == "turning_turns_the_result")
    with pytest.raises(NotApplicable, match="turning = None"):
        check()


class TestHonest(OperatorContract):
    """The class form, as a plugin's author uses it."""

    operator = Honest


def test_class_form_makes_a_test_of_every_check() -> None:
    assert len(contract_checks(Honest)) > 20
    assert TriMesh not in Honest.surfaces
