"""Recipes that describe no run: one line that names the place, the value and the way out."""

from __future__ import annotations

import json
import resource

import numpy as np
import pytest

HEADER = "size = 2000.0\nsamples = 33\n"
FBM = '[[step]]\nuse = "fbm"\n'


def run(terrakit, text: str | bytes, *arguments: str, **more):
    path = terrakit.folder / "hills.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    before = sorted(p.name for p in terrakit.folder.iterdir())
    outcome = terrakit("run", "hills.toml", "--device", "numpy", *arguments, **more)
    if outcome.code:
        assert sorted(p.name for p in terrakit.folder.iterdir()) == before
    return outcome


@pytest.mark.parametrize(
    ("text", "words"),
    [
        pytest.param(b"", ["empty"], id="empty"),
        pytest.param(b"  \n\n", ["empty"], id="blank"),
        pytest.param(b"# only this\n", ["no [[step]]"], id="comment"),
        pytest.param(b"size = 1\xff\n", ["byte 8", "UTF-8"], id="latin-1"),
        pytest.param("size = 1".encode("utf-16"), ["UTF-8"], id="utf-16"),
        pytest.param(b"size = 1\0\n", ["line 1"], id="nul"),
        pytest.param(b'title = "open\nsize = 3\n', ["line 1"], id="unclosed"),
        pytest.param(b"<!doctype html><html>", ["line 1", "TOML"], id="html"),
        pytest.param(b'{"size": 3}', ["line 1", "TOML"], id="json"),
        pytest.param(b"size: 3\n", ["line 1", "TOML"], id="yaml"),
        pytest.param(b"\x89PNG\r\n\x1a\n", ["UTF-8"], id="png"),
        pytest.param(b"a = " + b"[" * 5000 + b"]" * 5000, ["deep"], id="deep"),
        pytest.param(b"size = 1" + b"0" * 5000, ["4300"], id="long number"),
        pytest.param(b"a = 1\n" * 400000, ["2400000 bytes"], id="large"),
        pytest.param(b"size = 1\nsize = 2\n", ["line 2"], id="duplicate"),
        pytest.param(b"step = 3\n", ["[[step]]"], id="step is a number"),
        pytest.param(b"steps = [1]\n", ["did you mean step?"], id="steps"),
        pytest.param(b"[[step]]\n", ["step 1", "use"], id="no use"),
        pytest.param(b"[[step]]\nuse = 3\n", ["step 1", "use"], id="use is a number"),
        pytest.param(b'format = 2\n[[step]]\nuse = "fbm"\n', ["format 2", "this is 1"], id="newer"),
    ],
)
def test_no_recipe(terrakit, text, words):
    run(terrakit, text).refused("hills.toml", *words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sizes = 3.0\n" + HEADER + FBM, ["sizes", "did you mean size?"]),
        (HEADER + FBM + "octavs = 3\n", ["step 1 'fbm'", "octavs", "did you mean octaves?"]),
        (HEADER + FBM + '[[step]]\nuse = "thermel"\n', ["step 2", "did you mean thermal?"]),
        (HEADER + FBM + 'preset = "hill"\n', ["preset = 'hill'", "hills"]),
        (HEADER + '[[step]]\nuse = "thermal"\n', ["step 1", "begin with a generator"]),
        (HEADER + FBM + FBM, ["step 2 'fbm_2'", "discard", "step 1 'fbm'", 'other = "fbm"']),
        (
            HEADER + FBM + 'name = "x"\n' + '[[step]]\nuse = "thermal"\nname = "x"\n',
            ["steps 1 and 2", "'x'"],
        ),
        (HEADER + FBM + 'name = "a.b"\n', ["a.b", "without dots"]),
        (FBM, ["fbm needs an extent"]),
        ("size = 3.0\n" + FBM, ["size", "spacing", "samples"]),
        (HEADER + "spacing = 3.0\n" + FBM, ["size, spacing, samples"]),
        ("samples = 33\nspacing = 0.0\n" + FBM, ["spacing = 0", "> 0"]),
        ("samples = 33\nspacing = -1.0\n" + FBM, ["spacing = -1"]),
        ("samples = 33\nspacing = nan\n" + FBM, ["spacing = nan"]),
        ("samples = 1\nspacing = 1.0\n" + FBM, ["samples = 1", ">= 2"]),
        ("samples = [3, 4, 5]\nspacing = 1.0\n" + FBM, ["samples", "one number or two"]),
        ("size = 1e9\nspacing = 1e-3\n" + FBM, ["size", "raise spacing"]),
        ("samples = 1000000\nspacing = 1.0\n" + FBM, ["1000000x1000000", "--max-cells"]),
        ("seed = 1.5\n" + HEADER + FBM, ["seed = 1.5", "an integer or text"]),
        ("seed = true\n" + HEADER + FBM, ["seed = True"]),
        ("seed = [1]\n" + HEADER + FBM, ["seed = [1]"]),
        ("seed = inf\n" + HEADER + FBM, ["seed = inf"]),
        (HEADER + FBM + '[[step]]\nuse = "npz"\n' * 2, ["'npz' and 'npz_2'", "hills.npz"]),
        (HEADER + FBM + '[[step]]\nuse = "npz"\nfile = "run.json"\n', ["run.json"]),
    ],
)
def test_wrong_key_or_order(terrakit, text, words):
    run(terrakit, text).refused("hills", *words)


@pytest.mark.parametrize(
    "value",
    [
        '"ten"',
        "true",
        "[1]",
        "1.5",
        "2001-01-01",
        "{a = 1}",
        "-1",
        "1e12",
        "nan",
        "inf",
        "1" + "0" * 400,
    ],
)
def test_wrong_value_of_a_whole_number(terrakit, value):
    text = HEADER + FBM + '[[step]]\nuse = "thermal"\niterations = ' + value
    outcome = run(terrakit, text)
    outcome.refused("hills.toml", "step 2 'thermal'", "iterations = ", "0 <= ", "<= 100000")


@pytest.mark.parametrize(
    "value",
    [
        "-1.0",
        "90.0",
        "nan",
        "true",
        "[3.0]",
        "{ layer = 3 }",
        "{ at = [0.0, 2.0], value = [1.0, 2.0] }",
        '{ layer = "sediment", low = 0.0, high = 91.0 }',
    ],
)
def test_wrong_value_of_a_maskable(terrakit, value):
    text = HEADER + FBM + '[[step]]\nuse = "thermal"\ntalus_angle = ' + value
    run(terrakit, text).refused("hills.toml", "step 2 'thermal'", "talus_angle")


def test_a_missing_layer_names_the_step(terrakit):
    text = HEADER + FBM + '[[step]]\nuse = "thermal"\ntalus_angle = "mask_north"\n'
    run(terrakit, text, "-q").refused("hills", "step 2 'thermal'", "mask_north", "no such layer")


def test_whole_floats_are_whole_numbers(terrakit):
    step = '[[step]]\nuse = "thermal"\niterations = 1e1\n'
    run(terrakit, HEADER + FBM + step).worked()
    assert (
        json.loads((terrakit.folder / "hills/run.json").read_text())["recipe"]["step"][1][
            "iterations"
        ]
        == 10
    )


def test_no_iterations_copies_the_input(terrakit):
    plain = HEADER + FBM + '[[step]]\nuse = "npz"\n'
    idle = HEADER + FBM + '[[step]]\nuse = "thermal"\niterations = 0\n[[step]]\nuse = "npz"\n'
    heights = []
    for text in (plain, idle):
        run(terrakit, text).worked()
        heights.append(np.load(terrakit.folder / "hills/hills.npz")["elevation"])
    assert np.array_equal(*heights)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("thermal.iterations=x", ["step 2 'thermal'", "iterations = 'x'"]),
        ("thermal.iteration=3", ["did you mean iterations?"]),
        ("termal.iterations=3", ["no step 'termal'", "did you mean thermal?"]),
        ("sample=3", ["did you mean samples?"]),
        ("thermal.use=nothing", ["nothing"]),
        ("thermal.name=x", ["name"]),
        ("samples=1\nseed=3", ["samples"]),
        ("thermal.iterations=" + "[" * 4000, ["iterations"]),
    ],
)
def test_wrong_settings(terrakit, setting, words):
    text = HEADER + FBM + '[[step]]\nuse = "thermal"\n'
    run(terrakit, text, "--set", setting).refused(*words)


def test_too_large_for_memory(terrakit):
    text = "samples = 100000\nspacing = 1.0\n" + FBM
    run(terrakit, text, "--max-cells", "10000000000").refused("10000000000", "GB", "free", "fbm")


def test_too_large_for_a_limit_of_memory(terrakit):
    text = "samples = 9000\nspacing = 1.0\n" + FBM + '[[step]]\nuse = "slope_height"\n'

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))

    run(terrakit, text, preexec_fn=limit).refused("slope_height", "81000000 samples", "GB free")


@pytest.mark.parametrize(
    "file",
    [
        "../secret.npy",
        "/etc/passwd",
        "~/secret.npy",
        "/dev/zero",
        "http://example.org/a.npy",
        "a/../../secret.npy",
        "C:/a.npy",
        "\\\\\\\\host\\\\share\\\\a.npy",
        "link/secret.npy",
        "",
    ],
)
def test_a_recipe_reads_only_beside_itself(terrakit, file):
    np.save(terrakit.folder.parent / "secret.npy", np.zeros((33, 33), np.float32))
    (terrakit.folder / "link").symlink_to(terrakit.folder.parent)
    text = f'[[step]]\nuse = "numpy"\nfile = "{file}"\n'
    run(terrakit, text).refused("hills", "'numpy'", "file")


@pytest.mark.parametrize("file", ["../a.npz", "/tmp/a.npz", "~/a.npz", "http://a/b.npz"])
def test_a_recipe_writes_only_into_its_folder(terrakit, file):
    text = HEADER + FBM + f'[[step]]\nuse = "npz"\nfile = "{file}"\n'
    run(terrakit, text).refused("hills.toml", "step 2 'npz'", file)


def test_nothing_in_a_recipe_is_expanded(terrakit):
    text = HEADER + FBM + '[[step]]\nuse = "npz"\nfile = "$HOME {0} %s `id`.npz"\n'
    run(terrakit, text).worked()
    assert (terrakit.folder / "hills" / "$HOME {0} %s `id`.npz").is_file()


def test_paths_of_the_user_may_be_anywhere(terrakit):
    (terrakit.folder.parent / "far").mkdir()
    np.save(terrakit.folder.parent / "far/a.npy", np.zeros((33, 33), np.float32))
    text = '[[step]]\nuse = "numpy"\nfile = "a.npy"\nspacing = 3.0\n[[step]]\nuse = "npz"\n'
    run(terrakit, text).refused("a.npy", "no such file")
    run(
        terrakit,
        text,
        "--set",
        "numpy.file=../far/a.npy",
        "--set",
        f"npz.file={terrakit.folder.parent}/far/b.npz",
    ).worked()
    assert (terrakit.folder.parent / "far/b.npz").is_file()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("missing.toml", ["no such recipe"]),
        (".", ["is a folder"]),
        ("/dev/zero", ["regular file"]),
        ("x" * 300, ["too long"]),
    ],
)
def test_no_such_recipe(terrakit, name, words):
    terrakit("run", name).refused(*words)


SEEDS = ("-1", "4294967295", "18446744073709551616", "word", "Ärger", "7", '"7"', "-0.5e", "0")


def test_seeds_do_not_clash(terrakit):
    commands = [
        ["generate", "fbm", f"{i}.npz", "--samples", "9", "--device", "numpy", "--seed", seed]
        for i, seed in enumerate(SEEDS)
    ]
    assert terrakit.many(commands) == [0] * len(SEEDS)
    heights = {
        np.load(terrakit.folder / f"{i}.npz")["elevation"].tobytes() for i in range(len(SEEDS))
    }
    assert len(heights) == len(SEEDS)
    terrakit("generate", "fbm", "a.npz", "--seed", "1.5").refused("1.5", "an integer or text")


def test_a_recipe_cannot_raise_the_importers_limit(terrakit):
    np.save(terrakit.folder / "a.npy", np.zeros((40, 40), np.float32))
    step = '[[step]]\nuse = "numpy"\nfile = "a.npy"\nspacing = 10.0\nmax_cells = 100000000000\n'
    terrakit.recipe(step)
    terrakit("run", "hills.toml", "--max-cells", "100").refused("a.npy", "1,600", "100")
    terrakit("run", "hills.toml").worked()
