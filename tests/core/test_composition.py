"""Terrain in parameters and branches in recipes: what is nested equals what is spelled out."""

from __future__ import annotations

import gc
import json
import pickle
import weakref
from collections import Counter
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import terrakit
from terrakit import (
    Chain,
    Exporter,
    Filter,
    FromLayer,
    Generator,
    Grid,
    Heightfield,
    Importer,
    InputError,
    Maskable,
    ParameterError,
    PluginError,
    RecipeError,
    ResourceError,
    Run,
    Source,
    StepName,
    TerrakitError,
    parameter,
)
from terrakit.execute import execute
from terrakit.parameters import Seed
from terrakit.pipeline import check_recipe, memory_of, run_recipe
from terrakit.recipe import Recipe, load_recipe
from terrakit.registry import Plugin, Registry
from terrakit.results import ResultCache
from terrakit.running import active_run
from terrakit.schema import operator_schema, recipe_schema
from terrakit.sources import operators_within

MADE: Counter[str] = Counter()
ALIVE: dict[str, weakref.ref[Any]] = {}


class Bowl(Generator):
    """Dig a bowl in the middle of the world, with a random rim, as deep as a maskable says."""

    name = "bowl"
    portrait = 3000.0
    deep: Maskable = parameter(100.0, "Depth of the bowl.", unit="m", ge=0, le=1e4)
    seed: Seed = parameter(0, "Another number gives another rim.")

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return the bowl; the world decides where its middle is, the seed how it leans."""
        MADE[run.step] += 1
        assert run.world is not None
        west, north = run.world.north_west
        width, height = run.world.size
        x = grid.north_west[0] + np.arange(grid.shape[1]) * grid.spacing - west - width / 2
        y = grid.north_west[1] - np.arange(grid.shape[0]) * grid.spacing - north + height / 2
        tilt = run.words(self.name, self.seed)[0] % 97
        share = (x[None, :] ** 2 + y[:, None] ** 2) / (width**2 + height**2)
        deep = np.asarray(self.value("deep", grid), dtype=np.float64)
        made = Heightfield.on_grid(grid, (deep * (share - 1) + tilt).astype(np.float32))
        ALIVE[run.step] = weakref.ref(made.elevation)
        return made


class Bend(Filter):
    """Bend heights."""

    name = "bend"
    cites = ("Bent 1999",)
    by: float = parameter(2.0, "How much.", ge=0)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return heights that are bent."""
        MADE[run.step] += 1
        height = surface.elevation
        made = surface.with_layers(elevation=height + np.float32(self.by) * np.abs(height))
        ALIVE[run.step] = weakref.ref(made.elevation)
        return made


class Mix(Filter):
    """Mix two terrains."""

    name = "mix"
    other: Source = parameter(0.0, "The other terrain.", unit="m", ge=-1e6, le=1e6)
    share: Maskable = parameter(0.5, "How much of the other.", ge=0, le=1)
    iterations: int = parameter(1, "How often.", ge=1)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the mixture."""
        MADE[run.step] += 1
        height = surface.elevation
        for step in run.steps(self.iterations):
            other = run.terrain(self.other, surface.grid).elevation
            share = np.asarray(self.value("share", surface, step / self.iterations), np.float32)
            height = height + share * (other - height)
        made = surface.with_layers(elevation=height)
        ALIVE[run.step] = weakref.ref(made.elevation)
        return made


class Halve(Filter):
    """Put samples between the samples."""

    name = "halve"
    changes_grid = True
    fields = 1000
    silent: bool = parameter(False, "Whether to keep the new grid a secret.")

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return the grid of half the spacing."""
        rows, cols = grid.shape
        finer = Grid((2 * rows - 1, 2 * cols - 1), grid.spacing / 2, grid.origin, grid.crs)
        return None if self.silent else finer

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return every sample twice."""
        grid = Halve().grid_after(surface.grid)
        assert grid is not None
        layers = {n: surface.layer(n).repeat(2, 0).repeat(2, 1)[:-1, :-1] for n in surface}
        made = Heightfield.on_grid(grid, layers.pop("elevation")).with_layers(**layers)
        ALIVE[run.step] = weakref.ref(made.elevation)
        return made


class Follow(Filter):
    """Take the grid of another step."""

    name = "follow"
    changes_grid = True
    like: StepName = parameter(..., "The step.")

    def grid_after(self, grid: Grid) -> Grid | None:
        """Return None: only a run can tell."""
        return None

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the mean height on the other grid."""
        like = run.named(self.like)
        assert isinstance(like, Heightfield)
        mean = float(surface.elevation.mean())
        return Heightfield.on_grid(like.grid, np.full(like.shape, mean, dtype=np.float32))


class Span(Filter):
    """Raise the ground by the width of the world."""

    name = "span"

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return raised ground."""
        assert run.world is not None
        return surface.with_layers(elevation=surface.elevation + np.float32(run.world.size[0]))


class Sized(Exporter):
    """Write how many samples there are."""

    name = "sized"
    suffix = ".txt"
    bytes_a_sample = 1.0
    asked: ClassVar[list[Grid]] = []

    def check(self, grid: Grid) -> None:
        """Note the grid."""
        self.asked.append(grid)

    def export(self, surface: Heightfield, path: Path, run: Run) -> list[Path]:
        """Write the shape and the sum."""
        path.write_text(f"{surface.shape} {surface.elevation.sum(dtype=np.float64)}")
        return [path]


class Net(Importer):
    """Make a mesh of any file."""

    name = "net"

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Return whether the file says that it is a net."""
        return head[:3] == b"net"

    def load(self, path: Path, run: Run) -> Any:
        """Return a mesh."""
        return Heightfield(np.zeros((5, 5)), 100.0).to_mesh()


OPERATORS: list[type[Any]] = [Bowl, Bend, Mix, Halve, Follow, Span, Sized, Net]
GRID = Grid((33, 33), 100.0)
HEADER: dict[str, Any] = {"size": 3200.0, "samples": 33, "seed": 5}
DEVICES = ["numpy", None]


@pytest.fixture(scope="module")
def registry() -> Registry:
    known = Registry(third_parties=False)
    known._loaded.append(Plugin("tests", "tests", "1", __name__, operators=OPERATORS))
    return known


@pytest.fixture(autouse=True)
def _forget() -> None:
    MADE.clear()
    ALIVE.clear()
    Sized.asked.clear()


@pytest.fixture
def load(registry: Registry) -> Any:
    def loaded(*steps: dict[str, Any], settings: Any = None, **header: Any) -> Recipe:
        head = {k: v for k, v in (HEADER | header).items() if v is not None}
        return load_recipe({**head, "step": list(steps)}, settings, registry)

    return loaded


@pytest.fixture
def made(load: Any, registry: Registry) -> Any:
    def result(*steps: dict[str, Any], device: str | None = "numpy", **how: Any) -> Any:
        out, cache = how.pop("out", None), how.pop("cache", None)
        recipe = load(*steps, **how)
        run = Run(recipe.header.seed, device)
        return run_recipe(recipe, run, out, cache=cache, registry=registry)

    return result


def bits(surface: Any) -> dict[str, bytes]:
    return {name: surface.layer(name).tobytes() for name in surface}


# --- nested equals spelled out ----------------------------------------------------------------


@pytest.mark.parametrize("device", DEVICES)
def test_a_chain_equals_the_same_steps(made: Any, device: str | None) -> None:
    hills = {"use": "fbm", "wavelength": 900.0}
    other = [
        {"use": "fbm", "seed": 8, "wavelength": 1500.0, "amplitude": 300.0},
        {"use": "thermal", "talus_angle": 20.0, "distance": 200.0},
        {"use": "bend", "by": 0.5},
    ]
    nested = made(hills, {"use": "mix", "other": other}, device=device).surface
    spelled = made(
        hills,
        {"name": "a", **other[0]},
        {"name": "b", **other[1]},
        {"name": "c", **other[2]},
        {"use": "mix", "other": "c", "input": "fbm"},
        device=device,
    ).surface
    assert bits(nested) == bits(spelled)
    plain = made(hills, {"use": "mix", "other": 0.0}, device=device).surface
    assert bits(nested) != bits(plain)


@pytest.mark.parametrize("device", DEVICES)
def test_a_chain_in_a_maskable_equals_the_step_that_it_names(made: Any, device: str | None) -> None:
    noise = {"use": "fbm", "amplitude": 10.0, "offset": 30.0, "wavelength": 500.0, "seed": 2}
    hills = {"use": "fbm", "wavelength": 1200.0}
    slide = {"use": "thermal", "distance": 150.0}
    nested = made(hills, {**slide, "talus_angle": noise}, device=device).surface
    named = made(
        {"name": "noise", **noise}, hills, {**slide, "talus_angle": "noise.elevation"},
        device=device,
    ).surface  # fmt: skip
    number = made(hills, {**slide, "talus_angle": 30.0}, device=device).surface
    assert bits(nested) == bits(named)
    assert bits(nested) != bits(number)


def test_the_world_is_the_same_inside_a_chain(made: Any) -> None:
    """What is placed in the middle of the world is, wherever it is made."""
    alone = made({"use": "bowl"}).surface
    inside = made({"use": "fbm"}, {"use": "mix", "other": {"use": "bowl"}, "share": 1.0}).surface
    assert np.allclose(alone.elevation, inside.elevation, atol=1e-3)
    assert alone.elevation.argmin() == alone.elevation.size // 2


def test_generators_take_terrain_too(made: Any) -> None:
    noise = {"use": "fbm", "amplitude": 40.0, "offset": 50.0}
    nested = made({"use": "bowl", "deep": noise}).surface
    for deep in ("fbm", "fbm.elevation"):
        named = made(noise, {"use": "bowl", "deep": deep}).surface
        assert bits(nested) == bits(named)
    flat = made({"use": "bowl", "deep": [{"use": "fbm", "amplitude": 0.0, "offset": 70.0}]}).surface
    assert bits(flat) == bits(made({"use": "bowl", "deep": 70.0}).surface)
    scaled = {"layer": "fbm", "at": [0.0, 100.0], "low": 0.0, "high": 100.0}
    followed = made(noise, {"use": "bowl", "deep": scaled}).surface
    assert np.allclose(followed.elevation, nested.elevation, atol=1e-3)


def test_chains_hold_chains(made: Any) -> None:
    inner = {"use": "mix", "other": {"use": "bowl", "deep": {"use": "fbm", "offset": 1000.0}}}
    nested = made(
        {"use": "fbm"}, {"use": "mix", "other": [{"use": "bowl", "seed": 3}, inner]}
    ).surface
    spelled = made(
        {"use": "fbm", "offset": 1000.0, "name": "depth"},
        {"use": "bowl", "deep": "depth", "name": "deep"},
        {"use": "bowl", "seed": 3},
        {"use": "mix", "other": "deep", "name": "both"},
        {"use": "fbm", "name": "hills"},
        {"use": "mix", "other": "both"},
    ).surface
    assert bits(nested) == bits(spelled)


def test_what_a_nested_erosion_moves_is_not_booked_by_the_outer_step(made: Any) -> None:
    slope = [{"use": "fbm", "wavelength": 300.0}, {"use": "thermal", "distance": 50.0}]
    report = made({"use": "fbm"}, {"use": "mix", "other": slope}).report
    assert report["steps"][1]["ledger"] == {}


# --- one run: made once, in the right place, cancelled with it --------------------------------


def test_a_chain_is_made_once_a_run() -> None:
    mix = Mix(other=Bowl(), share=[Bowl(deep=1.0), Bend(by=0.0)], iterations=7)
    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
    shallow = Heightfield.on_grid(GRID, np.full(GRID.shape, 0.25))
    with pytest.raises(ParameterError, match=r"share: 'bowl > bend' holds .*0 <= share <= 1"):
        mix(terrain)
    MADE.clear()
    mixed = Mix(other=Bowl(), share="half.elevation", iterations=7)(
        terrain, Run(5, "numpy", earlier={"half": shallow})
    )
    assert MADE == {"mix": 1, "mix: bowl": 1}
    bowl = execute(Bowl(), GRID, Run(5, "numpy")).elevation
    assert np.allclose(mixed.elevation, bowl * (1 - 0.75**7), rtol=1e-4)


def test_another_seed_reaches_into_the_chain() -> None:
    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
    one, two = (Mix(other=terrakit_fbm())(terrain, Run(seed, "numpy")) for seed in (1, 2))
    assert bits(one) != bits(two)


def terrakit_fbm() -> Any:
    return Registry(third_parties=False).get("fbm")()


def test_run_terrain_takes_numbers_steps_and_chains() -> None:
    hills = Heightfield.on_grid(GRID, np.arange(33.0 * 33).reshape(33, 33))
    hills = hills.with_layers(mask_a=np.full(GRID.shape, 7.0))
    run = Run(3, "numpy", earlier={"hills": hills, "mesh": hills.to_mesh()})
    assert run.terrain(12.5, GRID).elevation.tolist() == np.full((33, 33), 12.5).tolist()
    assert run.terrain("hills", GRID) is hills
    assert run.terrain("hills.mask_a", GRID).elevation.max() == 7.0
    assert run.named("mesh").elevation.size == hills.elevation.size
    chain = Chain.read([Bowl(), Bend()])
    assert run.terrain(chain, GRID) is run.terrain(chain, GRID)
    other = Grid(GRID.shape, GRID.spacing, (5.0, 5.0))
    assert run.terrain(chain, other).grid == other
    for source, where, message in (
        ("hils", GRID, r"'hils': no step 'hils' \(did you mean hills\?\)"),
        ("hills.mask_b", GRID, r"step 'hills' has no layer 'mask_b' \(did you mean mask_a\?\)"),
        ("hills", other, r"33x33 samples of 100 m from 0, 3200, wanted .* from 5, 5.*resample"),
        ("mesh", GRID, "'mesh': is a mesh"),
        (Chain.read([Bowl(), Halve()]), GRID, "'bowl > halve': ends on 65x65 .* wanted 33x33"),
    ):
        with pytest.raises(ParameterError, match=message) as caught:
            run.terrain(source, where)
        assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="no step 'lake'"):
        run.named("lake")


def test_a_value_of_terrain_needs_a_run_and_a_grid() -> None:
    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
    mix = Mix(share=[Bowl()])
    assert active_run() is None
    with pytest.raises(ParameterError, match="share: 'bowl' needs a run"):
        mix.value("share", terrain)
    with Run(device="numpy").watching(), pytest.raises(ParameterError, match="on a grid"):
        mix.value("share", terrain.to_mesh())
    with pytest.raises(ParameterError, match=r"share = 'a.b': no step 'a'"):
        Mix(share="a.b")(terrain)
    other = Heightfield(np.zeros((5, 5)), 1.0)
    with pytest.raises(ParameterError, match=r"share = 'a.elevation': lies on 5x5"):
        Mix(share="a.elevation")(terrain, Run(earlier={"a": other}))
    assert active_run() is None


def test_the_world_is_given_back() -> None:
    run = Run(device="numpy").for_step("bowl")
    execute(Bowl(), GRID, run)
    assert run.world is None
    larger = Grid((65, 65), 100.0)
    run = Run(device="numpy", world=larger)
    inside = Grid((9, 9), 100.0, (0.0, 6400.0))
    part = execute(Bowl(), inside, run).elevation
    whole = execute(Bowl(), larger, run).elevation
    assert np.array_equal(part, whole[:9, :9])


def test_progress_names_what_is_nested_and_cancel_reaches_it() -> None:
    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
    thermal = Registry(third_parties=False).get("thermal")(iterations=3)
    told: list[str] = []
    run = Run(5, "numpy", on_progress=lambda p: told.append(p.step))
    mix = Mix(other=[terrakit_fbm(), thermal])
    mix(terrain, run)
    assert list(dict.fromkeys(told)) == ["mix", "mix: thermal"]
    run.on_progress = lambda p: run.cancel() if p.step == "mix: thermal" else None
    with pytest.raises(terrakit.Cancelled):
        mix(terrain, run)


# --- chains as values -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "given",
    [
        {"use": "fbm", "wavelength": 300.0},
        [{"use": "fbm"}, {"use": "thermal", "talus_angle": {"use": "fbm", "offset": 33.0}}],
        [{"use": "fbm", "preset": "hills"}],
    ],
)
def test_a_chain_survives_json_and_pickle(given: Any) -> None:
    mix = Mix(other=given)
    written = json.loads(json.dumps(mix.model_dump(mode="json")))
    assert isinstance(written["other"], list)
    assert written["other"][0]["use"] == "fbm"
    assert written["other"][0]["octaves"] == 10
    again = Mix(**written)
    assert again == mix
    assert hash(again) == hash(mix)
    assert pickle.loads(pickle.dumps(mix)) == mix
    assert Mix(other=list(mix.other.operators)) == mix  # type: ignore[union-attr]
    assert mix != Mix(other={"use": "fbm", "wavelength": 301.0})


def test_an_operator_is_a_chain_of_one() -> None:
    fbm = terrakit_fbm()
    assert Mix(other=fbm) == Mix(other=[fbm]) == Mix(other=Chain.read(fbm))
    assert str(Mix(other=[fbm, Bend()]).other) == "fbm > bend"
    assert [o.name for o in operators_within(Mix(other=[Bowl(deep=fbm), Bend()]))] == [
        "mix",
        "bowl",
        "fbm",
        "bend",
    ]


def nested(depth: int) -> Any:
    table: Any = {"use": "fbm"}
    for _ in range(depth):
        table = [{"use": "fbm"}, {"use": "thermal", "talus_angle": table}]
    return table


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"use": "fmb"}, r"mix: other: no operator 'fmb' \(did you mean fbm\?\)"),
        ({"use": "fbm", "wavelength": -1.0}, "mix: other: fbm: wavelength = -1.0: must be 0 <"),
        ({"use": "fbm", "octavs": 1}, r"other: fbm: unknown parameter 'octavs' \(did you mean"),
        ({"use": "fbm", "name": "x"}, "other: fbm: unknown parameter 'name'"),
        ({"use": 3}, "other: use is missing"),
        ([{"wavelength": 3.0}], "other: use is missing"),
        ({"wavelength": 3.0}, "other = .*: must be a number, an earlier step's name or a nested"),
        ([], "other: a list of 0 operators; must be 1 to 100"),
        ([{"use": "fbm"}] * 101, "other: a list of 101 operators"),
        ([3], "other: 3: must be a table such as"),
        ([[{"use": "fbm"}]], "other: .*: must be a table such as"),
        ({"use": "thermal"}, "other: thermal: needs a terrain; begin with a generator"),
        ([{"use": "fbm"}] * 2, "other: fbm: would discard the terrain of 'fbm'"),
        ([{"use": "fbm"}, {"use": "npz"}], "other: npz: an exporter cannot stand inside"),
        ([{"use": "numpy"}], "other: numpy: an importer cannot stand inside"),
        (nested(9), "nested more than 8 deep"),
        (1e7, r"other = 10000000.0: must be -1e\+06 <= other <= 1e\+06 m"),
        (float("nan"), "other = nan: must be a number"),
        (True, "other = True: must be a number"),
        (None, "other = None: must be a number"),
    ],
)
def test_what_is_no_terrain_is_refused_by_its_path(other: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Mix(other=other)
    assert "\n" not in str(caught.value)


def test_too_deep_a_recipe_is_refused(load: Any) -> None:
    with pytest.raises(RecipeError, match=r"step 1 'bowl'.*nested more than 8 deep"):
        load({"use": "bowl", "deep": nested(300)})


# --- recipes with branches --------------------------------------------------------------------

FBM = {"use": "fbm"}
BOWL = {"use": "bowl"}


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (
            [BOWL, FBM],
            "step 2 'fbm' would discard the terrain of step 1 'bowl'; name it in a later step, "
            'e.g. other = "bowl"',
        ),
        (
            [BOWL, FBM, {"use": "bend", "input": "bowl"}],
            "step 3 'bend' would discard the terrain of step 2 'fbm'",
        ),
        ([BOWL, {"use": "npz"}, FBM, BOWL], "step 4 'bowl_2' would discard .* step 3 'fbm'"),
        ([BOWL, FBM, {"use": "mix", "other": "bowls"}], "other = 'bowls': no step 'bowls' .*bowl"),
        ([FBM, {"use": "mix", "other": "bowl"}, BOWL], "step 'bowl' is not yet made"),
        ([FBM, {"use": "mix", "other": "mix"}], "step 'mix' is not yet made"),
        ([FBM, {"use": "bend", "input": "bent"}], r"step 2 'bend': input = 'bent': no step 'bent'"),
        ([FBM, {"use": "bend", "input": "bowl"}, BOWL], "input = 'bowl': step 'bowl' is not yet"),
        ([FBM, {"use": "bend", "input": 1}], "input = 1: must be the name of an earlier step"),
        ([FBM, {"use": "npz"}, {"use": "bend", "input": "npz"}], "'npz' writes files; .*: fbm"),
        ([FBM, {"use": "mix", "share": "fbm"}], r'is a step.*say "fbm.elevation"'),
        ([FBM, {"use": "mix", "share": "fmb.elevation"}], r"share = 'fmb.elevation': no step"),
        ([FBM, {"use": "follow", "like": "fbm.rain"}], "like = 'fbm.rain': must be a step's name"),
        ([FBM, {"use": "follow", "like": "fmb"}], "like = 'fmb': no step 'fmb'"),
        (
            [FBM, {"use": "mix", "other": {"use": "bowl", "deep": "lake"}}],
            "step 2 'mix': other: bowl: deep = 'lake': no step 'lake'",
        ),
        (
            [FBM, {"use": "mix", "other": {"use": "bowl", "deep": -1.0}}],
            "step 2 'mix': other: bowl: deep = -1.0: must be",
        ),
        ([{"use": "numpy", "file": "a.npy", "input": "fbm"}], "numpy reads a file; leave input"),
        ([{"use": "bend"}], "step 1 'bend': bend needs a terrain"),
        ([{"use": "npz"}, BOWL], "step 1 'npz': npz needs a terrain"),
    ],
)
def test_branches_that_lead_nowhere_are_refused_at_load(
    load: Any, steps: list[dict[str, Any]], message: str
) -> None:
    with pytest.raises(RecipeError, match=message) as caught:
        load(*steps)
    assert "\n" not in str(caught.value)


def test_a_step_may_be_called_like_a_layer(made: Any) -> None:
    """A plain text in a maskable is a layer of the terrain itself, whatever steps are called."""
    half = {"use": "fbm", "amplitude": 0.0, "offset": 0.25, "name": "wetness"}
    step = made(half, BOWL, {"use": "mix", "share": "wetness.elevation"}).surface
    assert bits(step) == bits(made(BOWL, {"use": "mix", "share": 0.25}).surface)
    with pytest.raises(ParameterError, match=r"step 3 'mix': share = 'wetness'.*no such layer"):
        made(half, BOWL, {"use": "mix", "share": "wetness"}, {"use": "mix", "other": "wetness"})


def test_run_json_spells_out_inputs_and_makes_the_same_terrain(
    made: Any, registry: Registry
) -> None:
    result = made(
        FBM, BOWL, {"use": "mix", "other": [BOWL, {"use": "bend", "by": 3.0}]},
        {"use": "mix", "other": "fbm", "share": {"use": "fbm", "amplitude": 0.0, "offset": 0.5}},
    )  # fmt: skip
    recipe = dict(result.report["recipe"])
    assert [step.get("input") for step in recipe["step"]] == [None, None, "bowl", "mix"]
    assert recipe["step"][2]["other"][1] == {"use": "bend", "by": 3.0}
    del recipe["name"]
    again = load_recipe(json.loads(json.dumps(recipe)), registry=registry)
    surface = run_recipe(again, Run(5, "numpy"), registry=registry).surface
    assert bits(surface) == bits(result.surface)
    assert "Bent 1999" in result.report["cites"]
    assert "Bent 1999" in result.report["steps"][2]["cites"]
    assert result.report["versions"]["tests"] == "1"


def test_exporters_write_their_input(made: Any, tmp_path: Path) -> None:
    made(
        FBM,
        BOWL,
        {"use": "sized", "file": "bowl.txt"},
        {"use": "halve", "input": "fbm"},
        {"use": "sized", "file": "fine.txt"},
        {"use": "sized", "file": "coarse.txt", "input": "fbm"},
        {"use": "follow", "like": "bowl"},
        out=tmp_path,
    )
    bowl, fbm = made(BOWL).surface, made(FBM).surface
    assert [g.shape for g in Sized.asked[:3]] == [(33, 33), (65, 65), (33, 33)]
    written = {name: (tmp_path / f"{name}.txt").read_text() for name in ("bowl", "fine", "coarse")}
    assert written["bowl"] == f"(33, 33) {bowl.elevation.sum(dtype=np.float64)}"
    assert written["coarse"] == f"(33, 33) {fbm.elevation.sum(dtype=np.float64)}"
    assert written["fine"].startswith("(65, 65) ")


def test_surfaces_that_nobody_names_again_are_let_go(made: Any) -> None:
    alive: dict[str, list[str]] = {}

    class Look(Bend):
        """Note which surfaces are still there."""

        name = "look"

        def apply(self, surface: Heightfield, run: Run) -> Heightfield:
            """Return the surface bent."""
            gc.collect()
            alive[run.step] = sorted(n for n, made in ALIVE.items() if made() is not None)
            return super().apply(surface, run)

    OPERATORS.append(Look)
    try:
        made(
            {"use": "bowl", "name": "a"},
            {"use": "bowl", "name": "b"},
            {"use": "look", "name": "c"},
            {"use": "mix", "name": "d", "other": "a"},
            {"use": "look", "name": "e"},
            {"use": "look", "name": "f"},
        )
    finally:
        OPERATORS.remove(Look)
    assert alive == {"c": ["a", "b"], "e": ["d"], "f": ["e"]}


def test_the_cache_follows_the_branches(made: Any, tmp_path: Path) -> None:
    def steps(**changes: Any) -> list[dict[str, Any]]:
        table = {
            "a": {"use": "bowl"},
            "b": {"use": "bowl", "seed": 1},
            "c": {"use": "bend"},
            "d": {"use": "mix", "other": "a", "share": {"use": "fbm", "amplitude": 0.1}},
        }
        table["d"]["share"]["offset"] = 0.5  # type: ignore[index]
        for path, value in changes.items():
            step, _, key = path.partition("_")
            table[step] = {**table[step], key: value}
        return [{"name": name, **step} for name, step in table.items()]

    def computed(*given: dict[str, Any], **header: Any) -> list[str]:
        MADE.clear()
        made(*given, cache=cache, **header)
        return sorted(name for name in MADE if ":" not in name)

    cache = ResultCache(tmp_path / "cache")
    assert computed(*steps()) == ["a", "b", "c", "d"]
    assert computed(*steps()) == []
    assert computed(*steps(b_deep=50.0)) == ["b", "c", "d"]
    assert computed(*steps(a_deep=50.0)) == ["a", "d"]
    assert computed(*steps(c_by=1.0)) == ["c", "d"]
    changed = {"use": "fbm", "amplitude": 0.1, "offset": 0.4}
    assert computed(*steps(d_share=changed)) == ["d"]
    a, b, c, d = steps()
    assert computed(b, c, a, {**d, "input": "c"}) == []  # the order of branches is not in the key
    assert computed(*steps(), seed=6) == ["a", "b", "c", "d"]
    assert computed(*steps(), origin=[5.0, 0.0]) == ["a", "b", "c", "d"]
    assert computed(a, b, c, {**d, "input": "b"}, {"use": "mix", "other": "c"}) == ["d", "mix"]


def test_the_world_is_the_header_or_else_the_first_terrain(made: Any, tmp_path: Path) -> None:
    """And a result for one world is not taken for that of another."""
    flat = Heightfield(np.zeros((5, 5)), 10.0)
    terrakit.export(flat, tmp_path / "flat.npz")
    read = {"use": "numpy", "file": str(tmp_path / "flat.npz")}
    cache = ResultCache(tmp_path / "cache")
    for header, width in (
        ({"size": 3200.0}, 3200.0),
        ({"size": 1600.0}, 1600.0),
        ({"size": None, "samples": None}, 40.0),
    ):
        for _ in range(2):
            assert (
                made(read, {"use": "span"}, cache=cache, **header).surface.elevation.max() == width
            )
    finer = [{"use": "halve"}, {"use": "span"}]
    assert made(read, *finer, size=None, samples=None).surface.elevation.max() == 40.0


# --- grids ------------------------------------------------------------------------------------


def test_a_generator_is_made_where_the_terrain_before_lies(
    made: Any, load: Any, tmp_path: Path
) -> None:
    dem = terrakit.generate("fbm", (21, 17), 30.0, origin=(500.0, 900.0))
    terrakit.export(dem, tmp_path / "dem.npz")
    read = {"use": "numpy", "file": str(tmp_path / "dem.npz")}
    none: dict[str, Any] = {"size": None, "samples": None}
    mix = {"use": "mix", "other": "numpy"}
    result = made(read, FBM, mix, **none)
    assert result.surface.grid == dem.grid
    assert [s.get("input") for s in result.report["recipe"]["step"]] == [None, "numpy", "fbm"]
    finer = made(read, {"use": "halve"}, FBM, {"use": "mix", "other": "halve"}, **none)
    assert finer.surface.shape == (41, 33)
    chosen = made(
        read, {"use": "halve"}, {**FBM, "input": "numpy"}, {"use": "mix", "other": "numpy"},
        {"use": "follow", "like": "halve"}, **none,
    )  # fmt: skip
    assert chosen.surface.shape == (41, 33)
    with pytest.raises(RecipeError, match="step 1 'fbm': fbm needs an extent"):
        load(FBM, **none)
    # The header's grid comes first, an input of its own before that
    assert made(read, FBM, {"use": "follow", "like": "numpy"}).surface.grid == dem.grid
    with pytest.raises(ParameterError, match=r"step 3 'mix': 'numpy': lies on 21x17.*resample"):
        made(read, FBM, mix)
    assert made(read, {**FBM, "input": "numpy"}, mix).surface.grid == dem.grid
    with pytest.raises(RecipeError, match=r"step 2 'fbm' would discard the terrain of step 1"):
        load(read, FBM, **none)  # its grid alone is no use of a terrain


def test_sizes_are_checked_before_anything_is_made(load: Any) -> None:
    fine = [FBM, *[{"use": "halve"}] * 7]
    recipe = load(*fine)
    assert recipe.grids()["halve_7"].shape == (4097, 4097)
    with pytest.raises(ResourceError, match=r"step 8 'halve_7': halve: 16785409 samples"):
        check_recipe(recipe)
    with pytest.raises(RecipeError, match=r"step 3 'halve_2': 129x129 = 16641 samples > 5000"):
        check_recipe(recipe, max_cells=5000)
    with pytest.raises(RecipeError, match=r"recipe: 33x33 = 1089 samples > 1000"):
        check_recipe(recipe, max_cells=1000)
    grids = recipe.grids()
    assert memory_of(recipe.steps[1], grids) == 65 * 65 * 1000 * 4
    unknown = load(FBM, {"use": "halve", "silent": True}, {"use": "sized"})
    assert unknown.grids() == {"fbm": unknown.grid, "halve": None, "sized": None}
    check_recipe(unknown)
    assert Sized.asked == []


def test_memory_of_what_is_nested_counts(load: Any) -> None:
    recipe = load(FBM, {"use": "mix", "other": [BOWL, {"use": "halve"}]}, samples=4097)
    with pytest.raises(ResourceError, match="step 2 'mix': halve: 16785409 samples"):
        check_recipe(recipe)


def test_a_filter_lands_where_it_said() -> None:
    class Stray(Halve):
        """Say one thing and do another."""

        name = "stray"

        def apply(self, surface: Heightfield, run: Run) -> Heightfield:
            """Return the surface as it is."""
            return surface

    class Wordless(Bend):
        """Change the grid without a word."""

        name = "wordless"

        def apply(self, surface: Heightfield, run: Run) -> Heightfield:
            """Return a part."""
            return Heightfield(surface.elevation[1:], surface.spacing)

    class Loser(Halve):
        """Leave layers behind."""

        name = "loser"

        def apply(self, surface: Heightfield, run: Run) -> Heightfield:
            """Return the elevation alone."""
            made = super().apply(surface, run)
            return Heightfield.on_grid(made.grid, made.elevation)

    class Upset(Halve):
        """Refuse to say where it goes."""

        name = "upset"

        def grid_after(self, grid: Grid) -> Grid | None:
            raise ParameterError("spacing = 0: too fine")

    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape)).with_layers(rain=np.ones(GRID.shape))
    for operator, message in (
        (Stray(), "stray: returned 33x33 .* announced 65x65"),
        (Wordless(), "wordless: changed the grid"),
        (Loser(), "loser: dropped layer 'rain'"),
    ):
        with pytest.raises(PluginError, match=message):
            operator(terrain, Run(device="numpy"))
    with pytest.raises(ParameterError, match="^upset: spacing = 0: too fine$"):
        Upset()(terrain, Run(device="numpy"))
    moved = Halve()(terrain, Run(device="numpy"))
    assert moved.shape == (65, 65)
    assert moved.layer("rain").min() == 1.0


# --- settings, schema, Python -----------------------------------------------------------------


def test_set_takes_tables_and_reaches_into_them(load: Any) -> None:
    steps = [FBM, {"use": "mix", "other": {"use": "bowl", "deep": {"use": "fbm"}}}]
    settings: dict[str, Any] = {"mix.other.deep.offset": 2000.0, "mix.other.seed": 4}
    mix = load(*steps, settings=settings).steps[1].operator
    bowl = mix.other.operators[0]
    assert bowl.seed == 4
    assert bowl.deep.operators[0].offset == 2000.0
    assert steps[1]["other"] == {"use": "bowl", "deep": {"use": "fbm"}}  # not ours to change
    replaced = load(*steps, settings={"mix.other": [{"use": "fbm"}, {"use": "bend"}]})
    assert str(replaced.steps[1].operator.other) == "fbm > bend"
    assert load(*steps, settings={"mix.share": "fbm.elevation"}).steps[1].names == ("fbm",)
    for key in ("mix.share.low", "mix.other.deep.offset.x"):
        with pytest.raises(RecipeError, match=r"is no table here; give all of it"):
            load(*steps, settings={key: 1.0})
    with pytest.raises(RecipeError, match="other: bowl: unknown parameter 'deap'"):
        load(*steps, settings={"mix.other.deap": 1.0})


def test_the_api_takes_surfaces_where_recipes_name_steps(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("terrakit.api.default_registry", lambda: registry)
    a = terrakit.generate("bowl", 33, 100.0, deep=100.0)
    b = terrakit.generate("bowl", 33, 100.0, deep=200.0)
    share = Heightfield.on_grid(a.grid, np.full(a.shape, 0.25))
    mixed = terrakit.apply(a, "mix", other=b, share=share)
    run = Run(earlier={"b": b})
    assert bits(mixed) == bits(terrakit.apply(a, "mix", other="b", share=0.25, run=run))
    assert bits(mixed) == bits(Mix(other=Bowl(deep=200.0), share=0.25)(a))
    followed = terrakit.apply(a, "follow", like=terrakit.generate("bowl", 5, 10.0))
    assert followed.shape == (5, 5)
    depth = Heightfield.on_grid(a.grid, np.full(a.shape, 100.0))
    assert bits(terrakit.generate("bowl", 33, 100.0, deep=depth)) == bits(a)
    with pytest.raises(TerrakitError, match="lies on 33x33"):
        terrakit.generate("bowl", 5, 100.0, deep=depth)


def test_the_schema_knows_filters_branches_and_chains(registry: Registry) -> None:
    schema = recipe_schema(registry)
    steps = schema["$defs"]
    assert steps["step_mix"]["x-kind"] == "filter"
    assert steps["step_mix"]["properties"]["input"]["type"] == "string"
    assert "input" not in steps["step_numpy"]["properties"]
    assert {"$ref": "#/$defs/Chain"} in steps["step_mix"]["properties"]["other"]["anyOf"]
    link = steps["Chain"]["anyOf"][0]
    names = {alternative["$ref"].rpartition("_")[2] for alternative in link["oneOf"]}
    assert {"fbm", "mix", "thermal", "height"} <= names
    assert not {"npz", "numpy", "sized"} & names
    assert operator_schema(Bowl)["x-portrait"] == 3000.0
    assert "x-portrait" not in operator_schema(Mix)
    json.dumps(schema)


def test_a_layer_of_a_step_is_scaled_like_a_layer_of_its_own() -> None:
    terrain = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
    ramp = Heightfield.on_grid(GRID, np.linspace(0, 1, 33 * 33).reshape(33, 33))
    own = terrain.with_layers(mask_ramp=ramp.elevation)
    run = Run(earlier={"a": ramp})
    one = Mix(other=9.0, share=FromLayer(layer="a.elevation", low=0.0, high=0.5))(terrain, run)
    two = Mix(other=9.0, share=FromLayer(layer="mask_ramp", low=0.0, high=0.5))(own, run)
    assert np.array_equal(one.elevation, two.elevation)


def test_a_mesh_is_no_place_for_a_generator(made: Any, tmp_path: Path) -> None:
    (tmp_path / "a.net").write_text("net")
    read = {"use": "net", "file": str(tmp_path / "a.net")}
    with pytest.raises(InputError, match="step 2 'fbm': input = 'net': is a mesh"):
        made(read, FBM, {"use": "mix", "other": "net"}, size=None, samples=None)
    with pytest.raises(ParameterError, match="step 3 'mix': 'net': is a mesh"):
        made(read, FBM, {"use": "mix", "other": "net"})
    slide = {"use": "thermal", "iterations": 2, "talus_angle": {"use": "fbm", "offset": 30.0}}
    with pytest.raises(ParameterError, match="talus_angle: 'fbm' is made on a grid"):
        made(read, slide)
