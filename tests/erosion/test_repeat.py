"""A loop of steps: what it runs is what the steps are written out, and it is one piece of work."""

from __future__ import annotations

import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terrakit
from terrakit import (
    Cancelled,
    Erosion,
    Filter,
    Grid,
    Heightfield,
    InputError,
    Maskable,
    ParameterError,
    RecipeError,
    Run,
    Schedule,
    Steps,
    parameter,
)
from terrakit.compute import choose_device
from terrakit.execute import execute
from terrakit.ledger import Account, Ledger
from terrakit.parameters import Seed
from terrakit.passes import rounding_of, volume_under
from terrakit.pipeline import run_recipe
from terrakit.recipe import load_recipe
from terrakit.registry import Plugin, Registry
from terrakit.results import ResultCache
from terrakit.running import Progress
from terrakit.schema import operator_schema, recipe_schema
from terrakit.sources import files_within, operators_within, references_within
from terrakit.testing import broken_contracts, rough_terrain
from terrakit_erosion.repeat import Repeat
from terrakit_erosion.stream_power import StreamPower
from terrakit_erosion.thermal import Thermal

TERRAIN = rough_terrain((33, 30))
CREEP = Thermal(distance=20.0)
RIVERS = StreamPower(duration=2e4, time_step=1e4, uplift_rate=0.0, erodibility=1e-4)


class Lower(Filter):
    """Lower the ground, now more, now less."""

    name = "lower"
    by: Maskable = parameter(1.0, "By how much.", unit="m", ge=-1e4, le=1e4)

    def apply(self, surface: Any, run: Run) -> Any:
        """Return lower ground."""
        by = np.asarray(self.value("by", surface), dtype=np.float32)
        NOTED.append((-1.0, run.words("lower")))
        return surface.with_layers(elevation=surface.elevation - by)


class Shower(Erosion):
    """Dig a metre out of fifty places."""

    name = "shower"

    def erode(self, surface: Any, run: Run) -> Any:
        """Return the surface with holes in it."""
        places = np.random.default_rng(run.words("shower")).permutation(surface.elevation.size)
        height = surface.elevation.copy()
        for _ in run.steps(1):
            height.ravel()[places[:50]] -= np.float32(1)
        run.ledger.open("rock", volume_under(surface))
        dug = surface.with_layers(elevation=height)
        run.ledger.left("rock", "rain", volume_under(surface) - volume_under(dug))
        run.ledger.close("rock", volume_under(dug), 50.0)
        return dug


class Note(Erosion):
    """Move nothing, and note what it is told."""

    name = "note"
    level: Maskable = parameter(0.0, "A number to note.", ge=-1e9, le=1e9)
    lasting: int = parameter(4, "How many sweeps.", ge=0)
    seed: Seed = parameter(0, "Another number.")

    def erode(self, surface: Any, run: Run) -> Any:
        """Return the surface, after noting values, words and where it is."""
        run.ledger.open("rock", volume_under(surface))
        for sweep in run.steps(self.lasting):
            value = self.value("level", surface, sweep / self.lasting)
            NOTED.append((float(np.mean(value)), run.words("note", self.seed)))
            run.offer(lambda: surface)
        run.ledger.close("rock", volume_under(surface), 0.0)
        return surface


class Leak(Erosion):
    """Lose ground and say nothing of it."""

    name = "leak"

    def erode(self, surface: Any, run: Run) -> Any:
        """Return lower ground with a ledger of the ground that was."""
        volume = volume_under(surface)
        run.ledger.open("rock", volume)
        run.ledger.close("rock", volume, 0.0)
        return surface.with_layers(elevation=surface.elevation - np.float32(1))


class OnGrids(Repeat):
    """Run a list of steps that take no mesh."""

    surfaces = (Heightfield,)


NOTED: list[tuple[float, tuple[int, int]]] = []


@pytest.fixture(autouse=True)
def _forget() -> None:
    NOTED.clear()


@pytest.fixture(params=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> Any:
    info = choose_device("numpy" if request.param == "numpy" else None)
    if request.param == "opencl" and not info.is_opencl:
        pytest.skip("no OpenCL device")
    return info


@pytest.fixture(scope="module")
def registry() -> Registry:
    known = Registry(third_parties=False)
    operators: list[type[Any]] = [Lower, Note, Leak]
    known._loaded.append(Plugin("tests", "tests", "1", __name__, operators=operators))
    return known


def eroded(operator: Any, surface: Any, device: Any = "numpy", **how: Any) -> tuple[Any, Run]:
    run = Run(how.pop("seed", 5), device, **how).for_step(operator.name)
    return execute(operator, surface, run), run


def in_turn(surface: Any, device: Any, *operators: Any) -> Any:
    for operator in operators:
        surface, _ = eroded(operator, surface, device)
    return surface


def bits(surface: Any) -> dict[str, bytes]:
    return {name: surface.layer(name).tobytes() for name in surface}


def test_the_contract_is_kept_with_three_kinds_inside() -> None:

    group = [
        {"use": "height_mask"},
        {"use": "thermal", "distance": 10.0},
        {"use": "clamp", "low": -20.0, "high": 60.0},
    ]
    assert broken_contracts(OnGrids, {"times": 2, "steps": group}) == {}


# --- what it runs -----------------------------------------------------------------------------


def test_once_is_the_steps_written_out(device: Any) -> None:
    first = RIVERS if device == choose_device("numpy") else Lower(by="mask_a")
    terrain = TERRAIN.with_layers(mask_a=np.abs(TERRAIN.elevation) % 3)
    once, _ = eroded(Repeat(times=1, steps=[first, CREEP]), terrain, device)
    assert bits(once) == bits(in_turn(terrain, device, first, CREEP))


def test_three_times_are_three_steps(device: Any) -> None:
    thrice, run = eroded(Repeat(times=3, steps=CREEP), TERRAIN, device)
    assert bits(thrice) == bits(in_turn(TERRAIN, device, CREEP, CREEP, CREEP))
    moved = 0.0
    surface = TERRAIN
    for _ in range(3):
        surface, part = eroded(CREEP, surface, device)
        moved += part.ledger.accounts["rock"].moved
    account = run.ledger.accounts["rock"]
    assert account.moved == pytest.approx(moved, rel=1e-12)
    assert account.start == pytest.approx(volume_under(TERRAIN), abs=1e-9)
    assert account.end == pytest.approx(volume_under(thrice), abs=rounding_of(thrice))


def test_turns_are_not_the_same_as_one_after_the_other() -> None:
    """Ten short turns end elsewhere than one long turn each, and so does the other order."""
    tenth = RIVERS.portion(0.0, 0.1), CREEP.portion(0.0, 0.1)
    turns, _ = eroded(Repeat(times=10, steps=list(tenth)), TERRAIN)
    apart = in_turn(TERRAIN, "numpy", RIVERS, CREEP)
    turned, _ = eroded(Repeat(times=10, steps=list(tenth[::-1])), TERRAIN)
    change = np.abs(apart.elevation - TERRAIN.elevation).mean()
    assert np.abs(turns.elevation - apart.elevation).mean() > 0.01 * change
    assert np.abs(turns.elevation - turned.elevation).mean() > 0


def test_every_pass_draws_its_own_numbers() -> None:
    showers, _ = eroded(Repeat(times=3, steps=Shower()), TERRAIN)
    again, _ = eroded(Repeat(times=3, steps=Shower()), TERRAIN)
    same_numbers = in_turn(TERRAIN, "numpy", Shower(), Shower(), Shower())
    other, _ = eroded(Repeat(times=3, steps=Shower()), TERRAIN, seed=6)
    assert bits(showers) == bits(again)
    assert bits(showers) != bits(same_numbers)
    assert bits(showers) != bits(other)
    fallen = showers.elevation - TERRAIN.elevation
    assert (np.abs(fallen) > 0.5).sum() > 2 * 50  # not the same places thrice


def test_numbers_of_the_ground_stay_so_that_years_in_a_loop_are_years() -> None:
    """Rivers wind as they did: four passes of a quarter are the whole, but for its rounding."""
    whole, _ = eroded(StreamPower(duration=8e4, time_step=1e4), TERRAIN)
    quarter = StreamPower(duration=2e4, time_step=1e4)
    turns, run = eroded(Repeat(times=4, steps=quarter), TERRAIN)
    change = np.abs(whole.elevation - TERRAIN.elevation).mean()
    assert np.abs(turns.elevation - whole.elevation).max() < 1e-4 * change
    assert run.ledger.accounts["rock"].came["uplift"] > 0


def test_filters_follow_the_same_rule_in_every_pass() -> None:
    eroded(Repeat(times=3, steps=[Lower(by=0.0), Note(lasting=1)]), TERRAIN)
    assert len({words for value, words in NOTED if value == -1}) == 1
    assert len({words for value, words in NOTED if value == 0}) == 3


def test_streams_of_passes_never_meet() -> None:
    inner = Repeat(times=3, steps=[Note(lasting=1), Note(lasting=1, seed=1)])
    eroded(Repeat(times=4, steps=inner), TERRAIN)
    drawn = [words for _, words in NOTED]
    assert len(drawn) == len(set(drawn)) == 24
    assert drawn[0] == Run(5).words("note")
    assert drawn[1] == Run(5).words("note", 1)
    NOTED.clear()
    eroded(Repeat(times=4, steps=Repeat(times=1, steps=Note(lasting=1))), TERRAIN)
    nested = [words for _, words in NOTED]
    NOTED.clear()
    eroded(Repeat(times=4, steps=Note(lasting=1)), TERRAIN)
    assert nested == [words for _, words in NOTED]  # a loop of one changes nothing


def test_loops_in_loops_are_the_passes_multiplied() -> None:
    nested, run = eroded(Repeat(times=2, steps=Repeat(times=2, steps=CREEP)), TERRAIN)
    flat, other = eroded(Repeat(times=4, steps=CREEP), TERRAIN)
    assert bits(nested) == bits(flat)
    assert run.ledger.to_dict() == other.ledger.to_dict()


def test_meshes_are_taken_if_every_step_takes_them(device: Any) -> None:
    mesh = rough_terrain((9, 9)).to_mesh()
    twice, run = eroded(Repeat(times=2, steps=CREEP), mesh, device)
    assert np.array_equal(twice.vertices, in_turn(mesh, device, CREEP, CREEP).vertices)
    assert run.ledger.accounts["rock"].residual == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(InputError, match="repeat: works on a Heightfield, not a TriMesh"):
        eroded(Repeat(steps=[CREEP, RIVERS]), mesh)


def test_nothing_is_done_no_times() -> None:
    told: list[Progress] = []
    result, run = eroded(Repeat(times=0, steps=RIVERS), TERRAIN, on_progress=told.append)
    assert result is TERRAIN
    assert run.ledger.accounts["rock"].residual == 0.0
    assert [progress.fraction for progress in told] == [1.0]


# --- one piece of work ------------------------------------------------------------------------


def test_schedules_run_over_the_whole_loop() -> None:
    ramp = Schedule(at=[0.0, 1.0], value=[0.0, 8.0])
    eroded(Repeat(times=2, steps=Note(level=ramp, lasting=4)), TERRAIN)
    assert [value for value, _ in NOTED] == [0, 1, 2, 3, 4, 5, 6, 7]
    NOTED.clear()
    inner = Repeat(times=2, steps=Note(level=ramp, lasting=2))
    eroded(Repeat(times=2, steps=inner), TERRAIN)
    assert [value for value, _ in NOTED] == [0, 1, 2, 3, 4, 5, 6, 7]
    flat = Heightfield(np.zeros((5, 5)), 1.0)
    lowered, _ = eroded(Repeat(times=4, steps=Lower(by=ramp)), flat)
    assert lowered.elevation[0, 0] == -(0 + 2 + 4 + 6)  # filters see where their pass begins


def test_nested_terrain_is_made_once_and_stays_the_same() -> None:
    """A mask of noise does not change from pass to pass, nor with the seed of the pass."""
    noise = {"use": "fbm", "amplitude": 10.0, "offset": 30.0, "wavelength": 90.0}
    masked = Thermal(talus_angle=noise, distance=20.0)
    thrice, _ = eroded(Repeat(times=3, steps=masked), TERRAIN)
    assert bits(thrice) == bits(in_turn(TERRAIN, "numpy", masked, masked, masked))
    told: list[str] = []
    inside = Thermal(talus_angle=[noise, {"use": "thermal", "iterations": 2}], iterations=1)
    run = Run(5, "numpy", on_progress=lambda progress: told.append(progress.step))
    execute(Repeat(times=5, steps=inside), TERRAIN, run)
    # Of fifteen reports in all, those of the mask came once, and all bear the loop's name
    assert set(told) == {"repeat"}
    assert len(told) <= 5 * 2 + 3


def test_layers_go_on_from_pass_to_pass() -> None:
    thrice, _ = eroded(Repeat(times=3, steps=RIVERS), TERRAIN)
    once, _ = eroded(RIVERS, TERRAIN)
    assert thrice.layer("erosion").mean() > 1.5 * once.layer("erosion").mean()
    assert (thrice.layer("erosion") >= once.layer("erosion")).all()  # the first pass is the same


def test_progress_runs_once_over_the_whole() -> None:
    told: list[Progress] = []
    loop = Repeat(times=3, steps=[Note(lasting=4), Lower(by=0.0), Note(lasting=2)])
    eroded(loop, TERRAIN, on_progress=told.append)
    fractions = [progress.fraction for progress in told]
    assert fractions == sorted(set(fractions))
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    assert min(f for f in fractions if f > 0.32) == pytest.approx(1 / 3, abs=1e-5)
    assert {progress.step for progress in told} == {"repeat"}


def test_a_cancel_is_answered_between_and_inside_the_steps() -> None:
    for stop_at in (0.0, 0.4, 0.9):
        after: list[float] = []
        run = Run(5, "numpy")

        def stop(told: Progress, at: float = stop_at, run: Run = run, after: Any = after) -> None:
            if told.fraction >= at:
                after.append(told.fraction)
                run.cancel()

        run.on_progress = stop
        with pytest.raises(Cancelled):
            execute(Repeat(times=4, steps=[CREEP, Lower(by=0.1)]), TERRAIN, run)
        assert len(after) <= 2


def test_finishing_now_keeps_the_passes_that_were_done(device: Any) -> None:
    run = Run(5, device).for_step("repeat")

    def stop(told: Progress) -> None:
        if told.fraction >= 0.5:
            run.finish_now()

    run.on_progress = stop
    half = execute(Repeat(times=4, steps=CREEP), TERRAIN, run)
    assert bits(half) == bits(in_turn(TERRAIN, device, CREEP, CREEP))
    account = run.ledger.accounts["rock"]
    assert account.residual == pytest.approx(0.0, abs=1e-6)
    assert account.end == pytest.approx(volume_under(half), abs=rounding_of(half))


def test_finishing_now_does_not_begin_another_step() -> None:
    run = Run(5, "numpy").for_step("repeat")
    run.on_progress = lambda told: run.finish_now() if told.fraction >= 0.25 else None
    execute(Repeat(times=2, steps=[Note(lasting=4), Note(lasting=4, seed=2)]), TERRAIN, run)
    assert len(NOTED) <= 5


def test_previews_are_handed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terrakit.running.PREVIEW_SECONDS", 0.0)
    seen: list[Any] = []
    run = Run(5, "numpy", on_preview=seen.append)
    execute(Repeat(times=3, steps=[Note(lasting=2), Lower(by=1.0)]), TERRAIN, run)
    assert len(seen) == 3 * (2 + 1)  # from inside, and after each pass
    assert seen[-1].elevation.mean() == pytest.approx(TERRAIN.elevation.mean() - 3, abs=1e-4)


# --- the ledger -------------------------------------------------------------------------------


def test_what_rivers_carry_out_and_uplift_brings_is_added_up() -> None:
    rising = StreamPower(duration=2e4, time_step=1e4, uplift_rate=1e-3)
    result, run = eroded(Repeat(times=3, steps=[rising, CREEP]), TERRAIN)
    account = run.ledger.accounts["rock"]
    _, once = eroded(rising, TERRAIN)
    lifted = once.ledger.accounts["rock"].came["uplift"]
    assert account.came["uplift"] == pytest.approx(3 * lifted, rel=0.05)
    assert any(name.startswith("border ") for name in account.left)
    assert abs(account.residual) < 1e-9 * account.moved
    assert account.end == pytest.approx(volume_under(result), abs=rounding_of(result))


def test_what_a_filter_changes_is_booked_under_its_name() -> None:
    result, run = eroded(Repeat(times=2, steps=[Lower(by=2.0), CREEP, Lower(by=-0.5)]), TERRAIN)
    account = run.ledger.accounts["rock"]
    area = TERRAIN.elevation.size * TERRAIN.cell_area
    assert account.left["filter lower"] == pytest.approx(4.0 * area, rel=1e-5)
    assert account.came["filter lower"] == pytest.approx(1.0 * area, rel=1e-5)
    assert account.residual == pytest.approx(0.0, abs=1e-6 * area)
    assert account.end == pytest.approx(volume_under(result), abs=rounding_of(result))


def test_rounding_on_high_ground_is_booked_and_no_more_than_that() -> None:
    high = TERRAIN.with_layers(elevation=TERRAIN.elevation + np.float32(8000.3))
    _, run = eroded(Repeat(times=4, steps=CREEP), high)
    account = run.ledger.accounts["rock"]
    flows = {**account.came, **account.left}
    assert set(flows) == {"rounding"}
    assert 0 < flows["rounding"] < rounding_of(high)
    assert abs(account.residual) < 1e-9 * account.start


def test_what_a_step_loses_in_silence_stays_in_the_residual() -> None:
    _, run = eroded(Repeat(times=3, steps=[Leak(), CREEP]), TERRAIN)
    lost = TERRAIN.elevation.size * TERRAIN.cell_area * 1.0
    assert run.ledger.accounts["rock"].residual == pytest.approx(-3 * lost, rel=1e-4)


def test_accounts_follow_each_other() -> None:
    whole = Ledger()
    for start, came, left, end in ((10.0, 4.0, 1.0, 13.0), (13.5, 1.0, 2.0, 12.5)):
        part = Ledger()
        part.open("rock", start)
        part.came("rock", "uplift", came)
        part.left("rock", "sea", left)
        part.close("rock", end, 2.0)
        whole.follow(part, lambda: 0.6)
    came = {"uplift": 5.0, "rounding": 0.5}
    assert whole.accounts["rock"] == Account(10.0, came, {"sea": 3.0}, 12.5, 4.0)
    assert whole.accounts["rock"].residual == 0.0
    late = Ledger()
    late.open("rock", 13.5)
    late.close("rock", 13.5, 0.0)
    whole.follow(late, lambda: 0.6)
    assert whole.accounts["rock"].residual == pytest.approx(1.0)


# --- in recipes, JSON, Python -----------------------------------------------------------------

RECIPE = """
size = 320.0
samples = 33

[[step]]
use = "fbm"
amplitude = 80.0
wavelength = 200.0

[[step]]
use = "repeat"
name = "loop"
times = 3

[[step.steps]]
use = "stream_power"
duration = 2e4
time_step = 1e4

[[step.steps]]
use = "thermal"
talus_angle = { layer = "fbm.elevation", at = [-50.0, 50.0], low = 20.0, high = 40.0 }
distance = 20.0
"""


def recipe_of(*steps: dict[str, Any], loop: Any = None, registry: Any = None, **how: Any) -> Any:
    table = {"use": "repeat", "name": "loop", "times": 2, "steps": list(steps), **(loop or {})}
    document = {"size": 320.0, "samples": 33, "step": [{"use": "fbm"}, table]}
    return load_recipe(document, how.get("settings"), registry)


def test_a_recipe_runs_as_the_same_steps_written_out(tmp_path: Path) -> None:
    (tmp_path / "loop.toml").write_text(RECIPE, encoding="utf-8")
    recipe = load_recipe(tmp_path / "loop.toml")
    assert recipe.steps[1].names == ("fbm",)
    report = run_recipe(recipe, Run(0, "numpy"), tmp_path / "out").report
    spelled = report["recipe"]["step"][1]["steps"]
    assert [table["use"] for table in spelled] == ["stream_power", "thermal"]
    assert spelled[0]["area_exponent"] == 0.45
    assert "Braun & Willett 2013" in report["steps"][1]["cites"]
    assert report["steps"][1]["ledger"]["rock"]["came"]["uplift"] > 0
    again = {key: value for key, value in report["recipe"].items() if key != "name"}
    again = json.loads(json.dumps(again))
    assert load_recipe(again).steps[1].operator == recipe.steps[1].operator

    surface = run_recipe(recipe, Run(0, "numpy")).surface
    document = tomllib.loads(RECIPE)
    inline = document["step"][1]["steps"]
    once = load_recipe({**document, "step": [document["step"][0], *inline]})
    document["step"][1]["times"] = 1
    assert bits(run_recipe(load_recipe(document), Run(0, "numpy")).surface) == bits(
        run_recipe(once, Run(0, "numpy")).surface
    )
    assert bits(surface) != bits(run_recipe(once, Run(0, "numpy")).surface)


def test_inline_tables_and_python_lists_are_the_same() -> None:
    inline = tomllib.loads('steps = [ { use = "thermal", distance = 20.0 } ]')
    single = tomllib.loads('[steps]\nuse = "thermal"\ndistance = 20.0')
    assert Repeat(**inline) == Repeat(**single) == Repeat(steps=[CREEP]) == Repeat(steps=CREEP)
    assert Repeat(steps=Steps.read(CREEP)) == Repeat(steps=CREEP)
    loop = Repeat(steps=[RIVERS, Repeat(steps=CREEP)])
    assert Repeat(**json.loads(json.dumps(loop.model_dump(mode="json")))) == loop
    assert pickle.loads(pickle.dumps(loop)) == loop
    assert hash(loop) == hash(Repeat(steps=[RIVERS, Repeat(steps=CREEP)]))
    assert str(loop.steps) == "stream_power > repeat"
    assert [o.name for o in operators_within(loop)] == [
        "repeat",
        "stream_power",
        "repeat",
        "thermal",
    ]


def test_what_steps_declare_the_loop_declares() -> None:
    loop = Repeat(steps=[RIVERS, CREEP])
    assert set(loop.writes) >= {"elevation", "drainage_area", "erosion", "sediment"}
    assert loop.fields > max(RIVERS.fields, CREEP.fields)
    assert loop.surfaces == (Heightfield,)
    assert Repeat(steps=CREEP).surfaces == Thermal.surfaces
    assert Repeat.writes == ("elevation",)
    reading = Steps.read([{"use": "slope_mask"}])
    assert "elevation" in Repeat(steps=reading).reads


def test_names_and_files_inside_are_found() -> None:
    loop = Repeat(
        steps=[
            {"use": "thermal", "talus_angle": "hills.elevation"},
            {"use": "repeat", "steps": [{"use": "image_mask", "picture": "a.png"}]},
            {"use": "blend", "other": {"use": "fbm", "amplitude": "lake"}},
        ]
    )
    found = {(r.path, r.text, r.role) for r in references_within(loop) if r.text != "mask_image"}
    assert ("steps[1] thermal: talus_angle", "hills.elevation", "layer") in found
    assert ("steps[3] blend: other: fbm: amplitude", "lake", "terrain") in found
    assert list(files_within(loop)) == [("steps[2] repeat: steps[1] image_mask: picture", "a.png")]


def test_settings_reach_into_the_steps() -> None:
    tables = [{"use": "thermal"}, {"use": "terrace"}, {"use": "thermal", "distance": 5.0}]
    recipe = recipe_of(
        *tables,
        settings={
            "loop.times": 7,
            "loop.steps.1.distance": 9.0,
            "loop.steps.terrace.bench_height": 12.0,
            "loop.steps.3": {"use": "thermal", "distance": 1.0},
        },
    )
    loop = recipe.steps[1].operator
    assert loop.times == 7
    assert [getattr(o, "distance", o.name) for o in loop.steps.operators] == [9.0, "terrace", 1.0]
    assert loop.steps.operators[1].bench_height == 12.0
    assert tables[0] == {"use": "thermal"}
    for key, message in (
        ("loop.steps.thermal.distance", "'steps' has no single 'thermal'; say which of: 1 thermal"),
        ("loop.steps.4.distance", "no single '4'"),
        ("loop.steps.1.distanc", r"steps\[1\] thermal: unknown parameter 'distanc'"),
    ):
        with pytest.raises(RecipeError, match=message):
            recipe_of(*tables, settings={key: 3.0})


def test_the_cache_knows_what_is_inside(tmp_path: Path, registry: Registry) -> None:
    cache = ResultCache(tmp_path)

    def noted(times: int = 2, **changes: Any) -> int:
        NOTED.clear()
        table = {"use": "note", "lasting": 1, **changes}
        recipe = recipe_of(table, loop={"times": times}, registry=registry)
        run_recipe(recipe, Run(0, "numpy"), cache=cache, registry=registry)
        return len(NOTED)

    assert [noted(), noted(), noted(level=1.0), noted(times=3), noted()] == [2, 0, 2, 3, 0]


def nested(depth: int) -> Any:
    table: Any = {"use": "thermal"}
    for _ in range(depth):
        table = {"use": "repeat", "steps": [table]}
    return table


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([], "repeat: steps: a list of 0 operators; must be 1 to 100"),
        ([{"use": "thermal"}] * 101, "steps: a list of 101 operators"),
        ([{"use": "thermal"}, {"use": "thermal", "talus_angle": 95}],
         r"repeat: steps\[2\] thermal: talus_angle = 95: must be 0 <= talus_angle < 90 deg"),
        ([{"use": "thremal"}], r"steps\[1\] no operator 'thremal' \(did you mean thermal\?\)"),
        ([{"use": "fbm"}], r"steps\[1\] fbm: would discard the terrain; name an erosion"),
        ([{"use": "thermal"}, {"use": "npz"}], r"steps\[2\] npz: an exporter cannot stand inside"),
        ([{"use": "numpy"}], r"steps\[1\] numpy: an importer cannot stand inside another step"),
        ([{"use": "resample", "spacing": 5.0}], r"steps\[1\] resample: changes the samples"),
        ([{"use": "thermal", "name": "a"}], r"steps\[1\] thermal: unknown parameter 'name'"),
        ([{"use": "thermal", "input": "a"}], r"steps\[1\] thermal: unknown parameter 'input'"),
        ([{"distance": 3.0}], r'steps\[1\] use is missing; say { use = "thermal" }'),
        ({"distance": 3.0}, r"steps\[1\] use is missing"),
        ("thermal", r"steps\[1\] 'thermal': must be a table such as { use = \"thermal\" }"),
        ([3], r"steps\[1\] 3: must be a table"),
        (None, r"steps = None: steps\[1\] None: must be a table such as"),
        (nested(9), "nested more than 8 deep"),
        ([nested(2), {"use": "repeat", "steps": []}], r"steps\[2\] repeat: steps: a list of 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_repeated_is_refused_by_its_place(steps: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Repeat(steps=steps)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("times", "message"),
    [(-1, "times = -1: must be 0 <= times"), (1.5, "times = 1.5"), (10**9, "times <= 100000")],
)
def test_how_often_has_bounds(times: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Repeat(times=times, steps=CREEP)


def test_a_recipe_names_the_place_of_what_is_wrong(tmp_path: Path, registry: Registry) -> None:
    def refused(*tables: dict[str, Any]) -> str:
        with pytest.raises(terrakit.TerrakitError) as caught:
            run_recipe(recipe_of(*tables, registry=registry), Run(0, "numpy"), registry=registry)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    steep = {"use": "thermal", "talus_angle": 95}
    assert "step 2 'loop': steps[2] thermal: talus_angle = 95: must be" in refused(CREEP_, steep)
    lake = {"use": "thermal", "talus_angle": "lake.elevation"}
    assert "step 2 'loop': steps[1] thermal: talus_angle = 'lake.elevation': no step" in refused(
        lake
    )
    lost = {"use": "thermal", "talus_angle": "mask_a"}
    assert "step 2 'loop': steps[2] thermal: talus_angle = 'mask_a': the terrain has no" in refused(
        CREEP_, lost
    )
    away = {"use": "image_mask", "picture": "../a.png"}
    assert "step 2 'loop': steps[1] image_mask: picture = '../a.png': leaves" in refused(away)
    absent = {"use": "image_mask", "picture": "a.png"}
    assert "steps[1] image_mask: picture = 'a.png': no such file" in refused(absent)


CREEP_ = {"use": "thermal", "distance": 5.0}


def test_the_schema_lists_what_may_be_repeated() -> None:
    schema = recipe_schema(Registry(third_parties=False))
    json.dumps(schema["$defs"]["Steps"])
    shown = schema["$defs"]["Steps"]["anyOf"][0]["oneOf"]
    named = {entry["$ref"].rpartition("step_")[2] for entry in shown}
    assert {"thermal", "repeat", "terrace", "slope_mask"} <= named
    assert not {"fbm", "npz", "numpy", "resample", "crop"} & named
    assert schema["$defs"]["step_repeat"]["properties"]["steps"]["$ref"] == "#/$defs/Steps"
    assert "steps" in schema["$defs"]["step_repeat"]["required"]
    own = operator_schema(Repeat)
    assert own["properties"]["steps"]["description"].endswith(".")
    assert own["x-writes"] == ["elevation"]


def test_a_terrain_of_another_step_is_named_from_inside() -> None:
    grid = Grid((33, 30), 10.0)
    hard = Heightfield.on_grid(grid, np.full(grid.shape, 60.0))
    by_name = Repeat(times=2, steps=Thermal(talus_angle="hard.elevation", distance=20.0))
    by_number = Repeat(times=2, steps=Thermal(talus_angle=60.0, distance=20.0))
    terrain = Heightfield.on_grid(grid, TERRAIN.elevation)
    named, _ = eroded(by_name, terrain, earlier={"hard": hard})
    assert bits(named) == bits(eroded(by_number, terrain)[0])
