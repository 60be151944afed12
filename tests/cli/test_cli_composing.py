"""Filters, branches and nested steps on the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

PLUGIN = '''
    """A filter that mixes, one that follows a step, and a generator with a size of its own."""

    import numpy as np

    from terrakit import (
        Filter, Generator, Grid, Heightfield, Maskable, Run, Source, StepName, hookimpl, parameter
    )


    class Mingle(Filter):
        """Mix two terrains."""

        name = "mingle"
        other: Source = parameter(0.0, "The other terrain.", unit="m", ge=-1e6, le=1e6)
        share: Maskable = parameter(0.5, "How much of the other.", ge=0, le=1)

        def apply(self, surface, run):
            """Return the mixture."""
            other = run.terrain(self.other, surface.grid).elevation
            share = np.asarray(self.value("share", surface), dtype=np.float32)
            height = surface.elevation
            return surface.with_layers(elevation=height + share * (other - height))


    class Alike(Filter):
        """Take the grid of a step."""

        name = "alike"
        changes_grid = True
        like: StepName = parameter(..., "The step.")

        def grid_after(self, grid):
            """Return None."""
            return None

        def apply(self, surface, run):
            """Return flat ground."""
            grid = run.named(self.like).grid
            return Heightfield.on_grid(grid, np.zeros(grid.shape, dtype=np.float32))


    class Slab(Generator):
        """Make flat ground of a size."""

        name = "slab"
        portrait = 640.0

        def generate(self, grid, run):
            """Return the spacing as a height."""
            height = np.full(grid.shape, grid.spacing, dtype=np.float32)
            return Heightfield.on_grid(grid, height)


    @hookimpl
    def terrakit_filters():
        return [Mingle, Alike]


    @hookimpl
    def terrakit_generators():
        return [Slab]
'''
RECIPE = """\
size = 2000.0
samples = 33

[[step]]
use = "fbm"

[[step]]
use = "fbm"
name = "other"
seed = 4

[[step]]
use = "npz"
file = "other.npz"

[[step]]
use = "mingle"
input = "fbm"
other = "other"

[[step]]
use = "npz"
"""


@pytest.fixture
def line(terrakit):
    """Return the command line with the plugin and two terrains."""
    terrakit.plugin("terrakit-mingle", PLUGIN)
    for name, seed in (("a", "1"), ("b", "2")):
        terrakit(
            "generate", "fbm", f"{name}.npz", "--samples", "17", "--seed", seed,
            "--device", "numpy",
        ).worked()  # fmt: skip
    return terrakit


def heights(line, name: str) -> np.ndarray:
    return np.load(line.folder / name)["elevation"]


@pytest.mark.parametrize(
    ("options", "other", "share"),
    [
        (["--other", "b.npz"], "b", 0.5),
        (["--other", "b.npz.elevation", "--share", "0.25"], "b", 0.25),
        (["--other", "100"], 100.0, 0.5),
        (["--other", '[{ use = "fbm", seed = 9 }, { use = "mingle", other = "b.npz" }]'], None, 0),
    ],
)
def test_filter_takes_a_number_a_file_or_a_table(line, options, other, share):
    line("filter", "mingle", "a.npz", "out.npz", *options, "--device", "numpy").worked()
    made, a = heights(line, "out.npz"), heights(line, "a.npz")
    if other is None:
        assert not np.array_equal(made, a)
        return
    wanted = heights(line, f"{other}.npz") if isinstance(other, str) else np.float32(other)
    assert np.array_equal(made, a + np.float32(share) * (wanted - a))


def test_a_table_on_the_command_line_equals_the_steps(line):
    line(
        "filter", "mingle", "a.npz", "out.npz", "--seed", "2", "--device", "numpy",
        "--other", '{ use = "fbm" }',
    ).worked()  # fmt: skip
    a, b = heights(line, "a.npz"), heights(line, "b.npz")  # made with seed 2
    assert np.array_equal(heights(line, "out.npz"), a + np.float32(0.5) * (b - a))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mingle", "--other", "c.npz"], ["mingle: other = 'c.npz'", "no such file"]),
        (["mingle", "--other", "hills"], ["other = 'hills'", "no such file"]),
        (["mingle", "--other", '{ use = "fmb" }'], ["other: no operator 'fmb'", "fbm?"]),
        (["mingle", "--other", '{ use = "fbm", octaves = 99 }'], ["other: fbm: octaves = 99"]),
        (["mingle", "--other", '{ use = "thermal" }'], ["begin with a generator"]),
        (["mingle", "--other", "small.npz"], ["'small.npz': lies on 9x9", "resample"]),
        (["mingle", "--share", "b.npz.rain"], ["share = 'b.npz.rain'", "no layer 'rain'"]),
        (["alike", "--like", "nothing"], ["like = 'nothing'", "no such file"]),
        (["alike"], ["like is missing"]),
        (["mingel"], ["no filter 'mingel'", "mingle"]),
    ],
)
def test_what_is_no_terrain_is_refused(line, arguments, words):
    small = ["generate", "fbm", "small.npz", "--samples", "9", "--device", "numpy"]
    line(*small).worked()
    name, *options = arguments
    line("filter", name, "a.npz", "out.npz", *options, "--device", "numpy").refused(*words)
    assert not (line.folder / "out.npz").exists()


def test_a_filter_that_changes_the_grid(line):
    small = ["generate", "fbm", "small.npz", "--samples", "9", "--device", "numpy"]
    line(*small).worked()
    line("filter", "alike", "a.npz", "out.npz", "--like", "small.npz").worked()
    assert heights(line, "out.npz").shape == (9, 9)


def test_filters_are_listed_described_and_checked(line):
    assert "mingle" in line("list", "filter").worked().out
    said = line("describe", "mingle").worked().out
    assert "(filter, terrakit-mingle 1.0)" in said
    assert 'use = "mingle"' in said
    schema = json.loads(line("describe", "mingle", "--json").worked().out)
    assert schema["x-kind"] == "filter"
    help_ = line("filter", "mingle", "--help").worked().out.lower()
    assert "number|file|table" in help_
    assert "number|layer|table" in help_
    assert "mingle" in line("filter", "--help").worked().out


def test_a_generator_is_made_at_its_size(line):
    for options, spacing in (
        (["--samples", "65"], 10.0),
        (["--samples", "65x33"], 10.0),
        (["--samples", "5", "--size", "8"], 2.0),
        (["--samples", "5", "--spacing", "3"], 3.0),
    ):
        line("generate", "slab", "slab.npz", *options, "--device", "numpy").worked()
        assert heights(line, "slab.npz").max() == spacing
    assert json.loads(line("describe", "slab", "--json").worked().out)["x-portrait"] == 640.0


def test_a_recipe_with_branches_runs_and_validates(line):
    line.recipe(RECIPE)
    said = line("validate", "hills.toml", "--json").worked().out
    steps = json.loads(said)["recipe"]["step"]
    assert [step.get("input") for step in steps] == [None, None, "other", "fbm", "mingle"]
    line("run", "hills.toml", "--device", "numpy").worked()
    other, mixed = heights(line, "hills/other.npz"), heights(line, "hills/hills.npz")
    line(
        "run", "hills.toml", "--device", "numpy", "--out", "nested",
        "--set", 'mingle.other={ use = "fbm", seed = 4 }',
    ).worked()  # fmt: skip
    assert np.array_equal(mixed, heights(line, "nested/hills.npz"))
    line(
        "run", "hills.toml", "--device", "numpy", "--out", "deeper",
        "--set", 'mingle.other={ use = "fbm" }', "--set", "mingle.other.seed=4",
    ).worked()  # fmt: skip
    assert np.array_equal(mixed, heights(line, "deeper/hills.npz"))
    line(
        "run", "hills.toml", "--device", "numpy", "--out", "whole", "--set", "mingle.share=1.0"
    ).worked()
    assert np.allclose(heights(line, "whole/hills.npz"), other, atol=1e-3)
    line("run", "hills.toml", "--set", "mingle.other=others").refused(
        "step 4 'mingle'", "other = 'others'", "did you mean other?"
    )
    line("run", "hills.toml", "--set", "mingle.input=npz").refused("'npz' writes files")


def test_names_in_a_recipe_are_never_files(line):
    line.recipe(RECIPE)
    line("run", "hills.toml", "--set", "mingle.other=b.npz").refused("no step 'b'")
