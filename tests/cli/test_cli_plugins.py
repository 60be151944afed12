"""Plugins of others, installed as pip would: broken, hostile, clashing."""

from __future__ import annotations

import json

import numpy as np
import pytest

GENERATOR = """\
import os, sys, time
import numpy as np
from terrakit import Generator, Grid, Heightfield, hookimpl, parameter

class Flat(Generator):
    '''Give level ground.'''
    name = "{name}"
    height: float = parameter(1.0, "Height of the ground.", unit="m")
    def generate(self, grid, run):
        {body}

@hookimpl
def terrakit_generators():
    return [Flat]
"""
FLAT = "return Heightfield.on_grid(grid, np.full(grid.shape, self.height))"

TEXTURE = """\
import numpy as np
from terrakit import Texture, hookimpl

class Bad(Texture):
    '''Do what it should not.'''
    name = "bad"
    writes = ("wetness",)
    def texture(self, surface, run):
        {body}

@hookimpl
def terrakit_textures():
    return [Bad]
"""


def generator(body: str = FLAT, name: str = "flat") -> str:
    return GENERATOR.format(body=body, name=name)


def make(terrakit, name="flat", *arguments):
    return terrakit(
        "generate", name, "out.npz", "--samples", "9", "--device", "numpy", "-q", *arguments
    )


def test_a_plugin_is_used_like_a_built_in(terrakit):
    terrakit.plugin("tk-flat", generator())
    make(terrakit, "flat", "--height", "3").worked()
    assert np.load(terrakit.folder / "out.npz")["elevation"].max() == 3
    make(terrakit, "tk-flat:flat").worked()
    assert "flat" in terrakit("list").worked().out
    terrakit.recipe('size = 10.0\nsamples = 5\n[[step]]\nuse = "flat"\n')
    terrakit("run", "hills.toml", "--device", "numpy").worked()
    record = json.loads((terrakit.folder / "hills/run.json").read_text())
    assert record["versions"]["tk-flat"] == "1.0"


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        ("raise RuntimeError('at import')", "at import"),
        ("import sys\nsys.exit(0)", "tried to end the program"),
        ("raise SystemExit('bye')", "tried to end the program"),
        ("def broken(:", "SyntaxError"),
        ("import a_package_that_is_missing", "a_package_that_is_missing"),
        ("from terrakit import nothing_of_that_name", "nothing_of_that_name"),
        (
            "from terrakit import hookimpl\n@hookimpl\ndef terrakit_generatorz():\n    return []\n",
            "did you mean terrakit_generators?",
        ),
        (
            "from terrakit import hookimpl\n@hookimpl\ndef terrakit_generators(colour):\n"
            "    return []\n",
            "colour",
        ),
        (
            "from terrakit import hookimpl\n@hookimpl\ndef terrakit_generators():\n"
            "    return None\n",
            "must be a list",
        ),
        (
            "from terrakit import hookimpl\n@hookimpl\ndef terrakit_generators():\n"
            "    return [3]\n",
            "Generator subclass",
        ),
        (generator().replace("'''Give level ground.'''", "pass"), "docstring"),
        (generator().replace('"flat"', '"Flat!"'), "lower_case"),
        (
            generator().replace('parameter(1.0, "Height of the ground.", unit="m")', "1.0"),
            "description",
        ),
    ],
    ids=[
        "raises",
        "exits",
        "exits with text",
        "syntax",
        "dependency",
        "attribute",
        "hook name",
        "hook argument",
        "none",
        "no class",
        "no docstring",
        "name",
        "no description",
    ],
)
def test_a_broken_plugin_harms_nobody(terrakit, source, problem):
    terrakit.plugin("tkbad-x", source, entry="flat")
    make(terrakit, "fbm").worked()
    done = terrakit("list").worked()
    assert "thermal" in done.out
    (line,) = done.err.splitlines()
    assert line.startswith("terrakit: warning: plugin tkbad-x 1.0: ")
    assert problem in line
    (broken,) = [
        p
        for p in json.loads(terrakit("plugins", "--json").worked().out)
        if p["distribution"] == "tkbad-x"
    ]
    assert broken["state"] == "broken"
    assert problem in broken["problem"]
    outcome = make(terrakit, "flat")
    assert outcome.code == 1
    assert "plugin tkbad-x 1.0" in outcome.err


@pytest.mark.parametrize(
    "source", ["import time\ntime.sleep(600)", "import os\nos.abort()"], ids=["hangs", "aborts"]
)
def test_a_plugin_that_is_not_named_is_not_loaded(terrakit, source):
    terrakit.plugin("tkbad-x", source)
    terrakit.recipe()
    terrakit("run", "hills.toml", "--device", "numpy").worked()
    make(terrakit, "fbm").worked()
    terrakit("info", "out.npz").worked()
    assert "tkbad" not in terrakit("--no-plugins", "plugins").worked().out
    assert "tkbad" not in terrakit("plugins", "--disable", "tkbad-x").worked().out
    assert "fbm" in terrakit("list", env={"TERRAKIT_DISABLE": "tkbad-x"}).worked().out


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("return None", "None"),
        ("return 'rock'", "'rock'"),
        ("return [1]", "[1]"),
        ("return np.zeros((3, 3, 3), np.float32)", "(3, 3, 3)"),
        ("return Heightfield(np.zeros((3, 3)), 1.0)", "(3, 3)"),
        ("return Heightfield.on_grid(grid, np.full(grid.shape, np.nan))", "not finite"),
        ("return Heightfield.on_grid(grid, np.zeros(grid.shape, complex))", "complex"),
        ("return Heightfield.on_grid(grid, np.zeros((0, 0)))", "0x0"),
        (
            "flat = np.zeros(grid.shape); return Heightfield.on_grid(grid, flat, {'rain': flat})",
            "'rain'",
        ),
        ("raise RuntimeError('no hills today')", "no hills today"),
        ("1 / 0", "ZeroDivisionError"),
        ("sys.exit(0)", "tried to end the program"),
    ],
)
def test_what_a_generator_returns_is_checked(terrakit, body, problem):
    terrakit.plugin("tkbad-x", generator(body))
    outcome = make(terrakit)
    assert outcome.code in (1, 2)
    outcome.refused(problem, code=outcome.code)
    assert "flat" in outcome.err
    assert not (terrakit.folder / "out.npz").exists()


def test_a_plugin_that_fails_is_named(terrakit):
    terrakit.plugin("tkbad-x", generator("1 / 0"))
    make(terrakit).refused("plugin tkbad-x 1.0", "flat", "tkbad_x.py:", code=1)


@pytest.mark.parametrize("dtype", ["'>f8'", "np.float16", "np.int16", "bool"])
def test_any_real_type_is_taken(terrakit, dtype):
    terrakit.plugin(
        "tk-odd",
        generator(
            f"values = np.ones(grid.shape, {dtype}); values.flags.writeable = False; "
            "return Heightfield.on_grid(grid, values)"
        ),
    )
    make(terrakit).worked()
    assert (np.load(terrakit.folder / "out.npz")["elevation"] == 1).all()


def test_ctrl_c_inside_a_plugin_stays_ctrl_c(terrakit):
    terrakit.plugin("tkbad-x", generator("raise KeyboardInterrupt"))
    assert make(terrakit).code == 130


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("surface.elevation[0] = 9; return surface", "read-only"),
        (
            "same = surface.elevation; "
            "return surface.with_layers(elevation=same + 1, wetness=same)",
            "elevation",
        ),
        ("return surface.with_layers(rain=surface.elevation)", "rain"),
        ("return surface.to_mesh()", "grid"),
    ],
    ids=["mutates", "changes the height", "undeclared", "another surface"],
)
def test_a_texture_keeps_what_it_was_given(terrakit, body, problem):
    terrakit.plugin("tkbad-x", TEXTURE.format(body=body))
    make(terrakit, "fbm").worked()
    outcome = terrakit("texture", "bad", "out.npz", "b.npz", "--device", "numpy", "-q")
    outcome.refused("plugin tkbad-x 1.0", problem, code=1)


def test_a_clash_names_both(terrakit):
    terrakit.plugin("tk-one", generator())
    terrakit.plugin("tk-two", generator("return Heightfield.on_grid(grid, np.zeros(grid.shape))"))
    make(terrakit).refused("tk-one 1.0", "tk-two 1.0", "tk-two:flat", code=1)
    make(terrakit, "tk-two:flat").worked()
    assert np.load(terrakit.folder / "out.npz")["elevation"].max() == 0
    make(terrakit, "flat", "--disable", "tk-two")
    terrakit(
        "--disable", "tk-two", "generate", "flat", "out.npz", "--samples", "9", "--device", "numpy"
    ).worked()


def test_a_built_in_cannot_be_replaced(terrakit):
    make(terrakit, "fbm").worked()
    before = (terrakit.folder / "out.npz").read_bytes()
    terrakit.plugin("tk-fake", generator(name="fbm"))
    make(terrakit, "fbm").worked()
    assert (terrakit.folder / "out.npz").read_bytes() == before
    make(terrakit, "tk-fake:fbm").worked()
    assert (terrakit.folder / "out.npz").read_bytes() != before


def test_a_plugin_that_changes_the_world_changes_no_result(terrakit):
    arguments = ("run", "hills.toml", "--device", "numpy", "--no-cache")
    terrakit.recipe()
    terrakit(*arguments).worked()
    before = (terrakit.folder / "hills/hills.npz").read_bytes()
    terrakit.plugin(
        "tkbad-x",
        generator()
        + """
import locale, random, signal, warnings
for name in ("de_DE.UTF-8", "C"):
    try:
        locale.setlocale(locale.LC_ALL, name)
        break
    except locale.Error:
        pass
np.random.seed(0)
random.seed(0)
np.seterr(all="raise")
os.chdir("/")
os.environ["TZ"] = "Asia/Tokyo"
os.environ["LC_ALL"] = "de_DE.UTF-8"
signal.signal(signal.SIGINT, signal.SIG_IGN)
np.set_printoptions(precision=1)
""",
    )
    terrakit.recipe(terrakit.recipe().read_text() + '[[step]]\nuse = "noop"\n')
    terrakit(*arguments).refused("noop")  # it was loaded to look for the name
    terrakit.recipe()
    terrakit.at_start("import terrakit.registry as r\nr.default_registry().plugins()")
    terrakit(*arguments).worked()
    assert (terrakit.folder / "hills/hills.npz").read_bytes() == before


def test_strict_makes_a_broken_plugin_an_error(terrakit):
    terrakit.plugin("tkbad-x", "raise RuntimeError('at import')")
    for arguments in (["--strict", "list"], ["list", "--strict"]):
        terrakit(*arguments).refused("plugin tkbad-x 1.0", "at import", "--strict")


OBSERVER = """\
from pathlib import Path
from terrakit import hookimpl

@hookimpl
def terrakit_step_done(step, report):
    with open("seen.txt", "a") as stream:
        stream.write(f"{step} {report.get('cached')}\\n")

@hookimpl
def terrakit_run_finished():
    raise RuntimeError("the screen fell off")
"""


def test_an_observer_sees_every_run_and_cannot_stop_it(terrakit):
    terrakit.recipe()
    terrakit.plugin("tk-watch", OBSERVER, entry="observer_watch")
    done = terrakit("run", "hills.toml", "--no-cache").worked()
    seen = (terrakit.folder / "seen.txt").read_text().splitlines()
    assert seen == ["fbm False", "thermal False", "npz None"]
    assert "tk-watch" in done.err
    assert "the screen fell off" in done.err
