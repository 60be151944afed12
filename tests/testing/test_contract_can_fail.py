"""The contract suite finds what it is there to find: one broken operator a promise."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from terrakit import Exporter, Generator, Grid, Heightfield, Importer, Run, Texture, TriMesh
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
