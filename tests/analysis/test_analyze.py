import json
import math

import numpy as np
import pytest

from terrakit.analysis import BANDS, analyze
from terrakit.errors import InputError


@pytest.fixture(scope="module")
def land(jacksboro):
    return analyze(jacksboro, 83.0)


# --- real land and noise --------------------------------------------------------------------


def test_real_land_passes_every_band(land):
    assert land.verdict == "pass", [row for row in land.table() if row.verdict != "pass"]
    assert land.notes == ()


@pytest.mark.parametrize("corner", [np.s_[:256, :256], np.s_[-256:, -256:]], ids=["NW", "SE"])
def test_tiles_of_real_land_pass_with_a_warning_at_most(jacksboro, corner):
    tile = analyze(jacksboro[corner], 83.0)
    assert tile.count("pass") >= 16
    assert tile.count("fail") == 0


def test_real_land_upside_down_fails(jacksboro):
    assert analyze(-jacksboro, 83.0).count("fail") >= 2


@pytest.mark.parametrize("hurst", [0.5, 0.6, 0.7, 0.8, 0.9])
@pytest.mark.parametrize("seed", [1, 2])
def test_fractal_noise_fails_two_yardsticks(fractal, hurst, seed):
    noise = analyze(fractal(hurst, seed), 30.0)
    assert noise.count("fail") >= 2
    assert noise.verdicts["pit_fraction"] == noise.verdicts["updown_asymmetry"] == "fail"


def test_white_noise_fails_most():
    noise = analyze(30 * np.random.default_rng(1).standard_normal((256, 256)), 30.0)
    assert noise.count("fail") >= 5
    assert noise.verdicts["checkerboard"] == noise.verdicts["spikes"] == "fail"


# --- artefacts on real land -----------------------------------------------------------------


def rows_of(z):
    return np.indices(z.shape)[0]


ARTEFACTS = {
    "chessboard": (lambda z, rng: z + 10 * (np.indices(z.shape).sum(0) % 2), "checkerboard"),
    "spikes": (lambda z, rng: z + 100 * (rng.random(z.shape) < 0.01), "spikes"),
    "streaks": (lambda z, rng: z + 30 * rng.standard_normal(len(z))[:, None], "bias_m4"),
    "corduroy": (lambda z, rng: z + 10 * (rows_of(z) % 2), "pit_fraction"),
    "terraces": (lambda z, rng: 50 * np.floor(z / 50), "bias_m8"),
    "ledges": (lambda z, rng: 50 * (np.floor(z / 50) + (z / 50 % 1) ** 6), "bias_m8"),
}


@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_artefacts_are_noticed(jacksboro, artefact):
    spoil, yardstick = ARTEFACTS[artefact]
    spoilt = analyze(spoil(jacksboro, np.random.default_rng(1)), 83.0)
    assert spoilt.verdicts[yardstick] in ("warn", "fail")


# --- what cannot be measured ----------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, -4000.0, 8848.0])
def test_a_constant_field_is_mostly_not_measured(height):
    flat = analyze(np.full((40, 60), height, np.float32), 10.0)
    assert flat.verdict == "not measured"
    assert flat.values["slope_max"] == 0.0
    assert flat.values["pit_fraction"] == 0.0
    assert {name for name, value in flat.values.items() if math.isnan(value)} == set(flat.reasons)
    assert len(flat.reasons) >= 13


def test_a_plane_is_not_land():
    plane = analyze(np.indices((64, 80))[1] * 3.0, 10.0)
    assert plane.verdict == "fail"
    assert plane.values["HI_tile"] == pytest.approx(0.5)


ROW, COLUMN = np.indices((48, 60)).astype(float)
ODD_FIELDS = {
    "one spike": np.where((ROW == 20) & (COLUMN == 30), 1000.0, 0.0),
    "one pit": np.where((ROW == 20) & (COLUMN == 30), -1000.0, 0.0),
    "cliff": np.where(COLUMN < 30, 0.0, 3000.0),
    "chessboard": (ROW + COLUMN) % 2,
    "bowl": (ROW - 24) ** 2 + (COLUMN - 30) ** 2,
    "valley": np.abs(COLUMN - 30) * 10 + ROW,
    "hair": 1e-30 * ROW * COLUMN,
    "giant": 1e37 * np.sin(ROW) * np.cos(COLUMN),
    "island": np.maximum(0.0, 100 - (ROW - 24) ** 2 - (COLUMN - 30) ** 2),
    "half flat": np.where(ROW < 24, 0.0, np.random.default_rng(1).standard_normal(ROW.shape)),
}


@pytest.mark.parametrize("spacing", [1e-3, 30.0, 1e6])
@pytest.mark.parametrize("name", ODD_FIELDS)
def test_odd_fields_get_an_answer(name, spacing):
    report = analyze(ODD_FIELDS[name], spacing).to_dict()
    json.dumps(report, allow_nan=False)


@pytest.mark.parametrize("shape", [(32, 32), (32, 90), (77, 41)])
def test_the_smallest_and_oblong_grids_work(fractal, shape):
    small = analyze(fractal(0.7, 1, 96)[: shape[0], : shape[1]], 30.0)
    assert small.shape == shape
    assert any("small tiles scatter" in note for note in small.notes)


@pytest.mark.parametrize("shape", [(31, 64), (64, 31), (1, 1), (0, 0)])
def test_grids_that_are_too_small_are_refused(shape):
    with pytest.raises(InputError, match=rf"{shape[0]} x {shape[1]} .* at least 32 x 32"):
        analyze(np.zeros(shape), 10.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_heights_that_are_not_finite_are_refused(bad):
    z = np.zeros((40, 40))
    z[3, 4] = bad
    with pytest.raises(InputError, match="1 samples are NaN"):
        analyze(z, 10.0)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan, math.inf])
def test_spacings_that_are_no_lengths_are_refused(spacing):
    with pytest.raises(InputError, match="spacing"):
        analyze(np.zeros((40, 40)), spacing)


def test_other_than_two_dimensions_are_refused():
    with pytest.raises(InputError, match="3 dimensions"):
        analyze(np.zeros((40, 40, 3)), 10.0)


# --- the report -----------------------------------------------------------------------------


def test_spacing_is_physical(jacksboro):
    tile = jacksboro[:128, :128]
    near, far = analyze(tile, 20.0), analyze(tile, 80.0)
    assert np.tan(np.radians(near.values["slope_max"])) == pytest.approx(
        4 * np.tan(np.radians(far.values["slope_max"]))
    )
    assert near.values["pit_fraction"] == far.values["pit_fraction"]


def test_the_input_is_left_alone_and_the_answer_repeats(fractal):
    z = fractal(0.7, 1, 64).astype(np.float32)
    before = z.copy()
    z.flags.writeable = False
    first, second = analyze(z, 30.0), analyze(z, 30.0)
    np.testing.assert_array_equal(z, before)
    assert json.dumps(first.to_dict()) == json.dumps(second.to_dict())


def test_turning_the_map_keeps_the_verdict(land, jacksboro):
    turned = analyze(np.rot90(jacksboro), 83.0)
    for name, value in land.values.items():
        assert turned.values[name] == pytest.approx(value, rel=0.15, abs=0.01), name


def test_table_has_a_row_for_every_band(land):
    table = land.table()
    assert [row.name for row in table] == [band.name for band in BANDS]
    assert table[0].passes == "<= 0.05"
    assert table[0].verdict == "pass"
    assert float(table[0].value) == pytest.approx(land.values["pit_fraction"], rel=0.01)


def test_table_says_why_something_was_not_measured():
    row = analyze(np.zeros((40, 40)), 10.0).table()[-7]
    assert (row.name, row.value, row.verdict) == ("HI_tile", "-", "not measured")
    assert "flat" in row.meaning


def test_dictionary_is_strict_json():
    report = analyze(np.zeros((40, 40)), 10.0).to_dict()
    text = json.dumps(report, allow_nan=False)
    assert json.loads(text)["yardsticks"]["beta2"]["value"] is None
    assert report["yardsticks"]["pit_fraction"]["pass"] == [None, 0.05]


def test_analysis_cannot_be_changed(land):
    with pytest.raises(TypeError):
        land.values["spikes"] = 0.0
    with pytest.raises(AttributeError):
        land.spacing = 1.0
