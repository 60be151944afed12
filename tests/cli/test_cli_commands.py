"""What each command does when all is well."""

from __future__ import annotations

import json

import numpy as np
import pytest


def test_run_writes_files_and_says_how(terrakit):
    terrakit.recipe()
    done = terrakit("run", "hills.toml").worked()
    assert done.out.splitlines() == ["hills/hills.npz", "hills/run.json"]
    said = done.err.splitlines()
    assert said[0].startswith("device  ")
    assert [line.split("  ")[0] for line in said[1:]] == ["fbm", "thermal", "npz"]
    assert all(line.split("  ")[1].endswith(" s") for line in said[1:])
    assert json.loads((terrakit.folder / "hills/run.json").read_text())["recipe"]["seed"] == 7


def test_run_options(terrakit):
    terrakit.recipe()
    common = ("run", "hills.toml", "--device", "numpy", "--no-cache")
    done = terrakit(
        *common,
        "--out",
        "here",
        "--seed",
        "word",
        "--json",
        "--set",
        "samples=17",
        "--set",
        "thermal.talus_angle=20",
    ).worked()
    report = json.loads(done.out)
    assert report["recipe"]["seed"] == "word"
    assert report["recipe"]["step"][1]["talus_angle"] == 20
    assert report["files"] == ["here/hills.npz", "here/run.json"]
    assert np.load(terrakit.folder / "here/hills.npz")["elevation"].shape == (17, 17)


def test_a_missing_seed_is_printed(terrakit):
    terrakit.recipe((terrakit.recipe().read_text()).replace("seed = 7\n", ""))
    assert "seed  0" in terrakit("run", "hills.toml", "--device", "numpy").worked().err


def test_a_second_run_comes_from_the_cache(terrakit):
    terrakit.recipe()
    first = ("run", "hills.toml", "--device", "numpy", "--seed", "cached")
    terrakit(*first).worked()
    again = terrakit(*first).worked()
    assert again.err.count("from the cache") == 2
    assert "from the cache" not in terrakit(*first, "--no-cache").worked().err


def test_quiet_says_nothing_and_verbose_more(terrakit):
    terrakit.recipe()
    for arguments in (["-q", "run", "hills.toml"], ["run", "hills.toml", "--quiet"]):
        done = terrakit(*arguments, "--device", "numpy").worked()
        assert (done.out, done.err) == ("", "")
    assert "unaccounted" in terrakit("run", "hills.toml", "-v", "--device", "numpy").worked().err


def test_debug_shows_the_traceback(terrakit):
    done = terrakit("run", "missing.toml", "--debug")
    assert done.code == 2
    assert "Traceback" in done.err


def test_validate_writes_nothing(terrakit):
    terrakit.recipe()
    assert "hills: valid" in terrakit("validate", "hills.toml").worked().out
    report = json.loads(terrakit("validate", "hills.toml", "--json").worked().out)
    assert report["samples"] == [33, 33]
    assert report["memory"]["thermal"] > 0
    assert [p.name for p in terrakit.folder.iterdir()] == ["hills.toml"]


def test_schema_accepts_recipes_and_refuses_others(terrakit):
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(terrakit("validate", "--schema").worked().out)
    validator = jsonschema.Draft202012Validator(schema)
    good = {"size": 10.0, "samples": 33, "step": [{"use": "fbm"}, {"use": "thermal"}]}
    assert validator.is_valid(good)
    assert not validator.is_valid({**good, "sample": 3})
    assert not validator.is_valid({**good, "step": [{"use": "fbm", "octavs": 2}]})


def test_schema_has_every_operator_and_no_null(terrakit):
    schema = json.loads(terrakit("validate", "--schema").worked().out)
    listed = json.loads(terrakit("list", "--json").worked().out)
    names = {entry["name"] for entry in listed if entry["kind"] != "recipe"}
    assert {
        ref["$ref"].removeprefix("#/$defs/step_")
        for ref in schema["properties"]["step"]["items"]["oneOf"]
    } == names
    assert '"null"' not in json.dumps(schema)
    thermal = schema["$defs"]["step_thermal"]["properties"]
    assert thermal["use"] == {"const": "thermal", "description": "The operator."}
    assert thermal["talus_angle"]["exclusiveMaximum"] == 90


def test_list_and_plugins(terrakit):
    out = terrakit("list", "erosion").worked().out
    assert "thermal" in out
    assert "fbm" not in out
    plugins = json.loads(terrakit("plugins", "--json").worked().out)
    assert {p["state"] for p in plugins} == {"works"}
    assert "terrakit_usd" in {p["module"] for p in plugins}


def test_describe_every_operator(terrakit):
    from terrakit.registry import default_registry

    said = terrakit("describe", "thermal").worked().out
    for word in ("talus_angle", "33", "deg", "0 <=", "scree", "sediment", "Musgrave", "[[step]]"):
        assert word in said
    schema = json.loads(terrakit("describe", "thermal", "--json").worked().out)
    assert schema["properties"]["talus_angle"]["unit"] == "deg"
    names = [operator.name for operator in default_registry().operators()]
    assert terrakit.many([["describe", name] for name in names]) == [0] * len(names)


def test_flags_follow_from_declarations(terrakit):
    from terrakit.registry import default_registry

    verbs = {
        "generator": "generate",
        "filter": "filter",
        "erosion": "erode",
        "texture": "texture",
    }
    for kind, verb in verbs.items():
        for operator in default_registry().operators(kind)[-1:]:
            said = terrakit(verb, operator.name, "--help").worked().out
            for name in operator.model_fields:
                assert f"-{name.replace('_', '-')}" in said


def test_generate_erode_texture_convert(terrakit):
    numpy_ = ("--device", "numpy")
    terrakit(
        "generate",
        "fbm",
        "a.npz",
        "--samples",
        "33x17",
        "--spacing",
        "30",
        "--preset",
        "hills",
        "--fbm-seed",
        "word",
        "--octaves",
        "3",
        *numpy_,
    ).worked()
    assert np.load(terrakit.folder / "a.npz")["elevation"].shape == (17, 33)
    for angle in ("20", "2e1", "{at = [0.0, 1.0], value = [30.0, 20.0]}"):
        terrakit(
            "erode",
            "thermal",
            "a.npz",
            "b.npz",
            "--talus-angle",
            angle,
            "--border",
            "open",
            *numpy_,
        ).worked()
    terrakit("texture", "slope_height", "b.npz", "c.npz", *numpy_).worked()
    terrakit(
        "erode",
        "thermal",
        "c.npz",
        "d.npz",
        "--iterations",
        "1",
        *numpy_,
        "--talus-angle",
        "{layer='material_rock', low=10.0, high=40.0}",
    ).worked()
    terrakit("convert", "c.npz", "c.obj").worked()
    assert (terrakit.folder / "c.obj").stat().st_size > 1000
    terrakit("erode", "thermal", "a.npz", "e.npz", "--talus-angle", "mask_none", *numpy_).refused(
        "mask_none", "no such layer"
    )


def test_generate_has_the_extent_of_size(terrakit):
    terrakit(
        "generate", "fbm", "a.npz", "--size", "640", "--samples", "33", "--device", "numpy"
    ).worked()
    facts = json.loads(terrakit("info", "a.npz", "--json").worked().out)
    assert facts["spacing"] == 20
    assert facts["extent"] == {"west": 0, "east": 640, "south": 0, "north": 640}
    assert facts["problems"] == []


def test_info_preview_analyze(terrakit, terrain):
    said = terrakit("info", terrain).worked().out
    for word in ("65", "spacing", "extent", "elevation", "albedo_red", "problems"):
        assert word in said
    terrakit("preview", terrain, "picture.png").worked()
    assert (terrakit.folder / "picture.png").read_bytes().startswith(b"\x89PNG")
    terrakit("preview", terrain).worked()
    assert (terrakit.folder / "hills.npz.preview.png").exists()
    assert "verdict: " in terrakit("analyze", terrain).worked().out


def test_analyze_fails_noise_only_when_strict(terrakit):
    noise = np.random.default_rng(0).normal(0, 30, (97, 97))
    np.save(terrakit.folder / "noise.npy", noise.astype(np.float32))
    common = ("analyze", "noise.npy", "--set", "spacing=30.0")
    assert json.loads(terrakit(*common, "--json").worked().out)["verdict"] == "fail"
    assert terrakit(*common, "--strict").code == 1


def test_analyze_a_recipe(terrakit):
    terrakit.recipe()
    report = json.loads(terrakit("analyze", "hills.toml", "--device", "numpy", "--json").out)
    assert report["shape"] == [33, 33]
    assert [p.name for p in terrakit.folder.iterdir()] == ["hills.toml"]


def test_importer_parameters_pass_through(terrakit, terrain):
    np.save(terrakit.folder / "a.npy", np.load(terrain)["elevation"])
    facts = json.loads(terrakit("info", "a.npy", "--in", "spacing=25", "--json").worked().out)
    assert facts["spacing"] == 25
    for arguments in (["a.npy", "--spacing", "25"], ["--spacing=25", "--json", "a.npy"]):
        facts = json.loads(terrakit("info", "--json", *arguments).worked().out)
        assert facts["spacing"] == 25
    terrakit("analyze", "--spacing", "25", "a.npy").worked()
    terrakit("convert", "a.npy", "--spacing", "25", "b.npz", "-v").worked()
    terrakit("info", "a.npy", "--jsn").refused("a.npy", "jsn")
    terrakit("info", "a.npy", "--in", "spacin=25").refused("a.npy", "spacin", "did you mean")


def test_doctor(terrakit):
    done = terrakit("doctor", "--json").worked()
    report = json.loads(done.out)
    assert report["devices"]
    assert report["versions"]["pyopencl"]
    checked = {
        (check["operator"], check["surface"]): check["verdict"] for check in report["checks"]
    }
    assert checked["fbm", "grid"] == "same"
    assert checked["thermal", "mesh"] == "same"
    assert report["bandwidth"] > 1e8


def test_doctor_finds_a_kernel_that_differs(terrakit):
    terrakit.plugin(
        "tk-wrong",
        """
        import numpy as np
        from terrakit import Generator, Heightfield, hookimpl

        class Wrong(Generator):
            '''Give another terrain on a device.'''
            name = "wrong"
            def generate(self, grid, run):
                return Heightfield.on_grid(
                    grid, np.full(grid.shape, 0.0 if run.device is None else 1.0))

        @hookimpl
        def terrakit_generators():
            return [Wrong]
        """,
    )
    done = terrakit("doctor")
    assert done.code == 1
    (line,) = [line for line in done.out.splitlines() if line.startswith("wrong")]
    assert "differs" in line
    assert "1155 of 1155" in line


def test_a_shipped_recipe_runs_again_beside_the_folder_it_wrote(terrakit):
    arguments = ("run", "hills", "--set", "samples=17", "--set", "stream_power.duration=1e5")
    terrakit(*arguments).worked()
    assert (terrakit.folder / "hills").is_dir()
    terrakit(*arguments).worked()
    terrakit("analyze", "hills", "--set", "samples=33").worked()


def test_the_sea_of_a_recipe_reaches_its_steps(terrakit):
    text = """
        size = 4000.0
        samples = 41
        sea_level = 0.0
        [[step]]
        use = "fbm"
        [[step]]
        use = "stream_power"
        duration = 1e5
        [[step]]
        use = "npz"
    """
    terrakit.recipe(text)
    terrakit("run", "hills.toml").worked()
    after = np.load(terrakit.folder / "hills/hills.npz")["elevation"]
    terrakit("run", "hills.toml", "--out", "dry", "--set", "stream_power.duration=0").worked()
    before = np.load(terrakit.folder / "dry/hills.npz")["elevation"]
    sea = before < 0
    assert sea.any()
    np.testing.assert_array_equal(after[sea], before[sea])
    assert (after[~sea] != before[~sea]).mean() > 0.9
