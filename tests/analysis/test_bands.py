import math

import pytest

from terrakit.analysis.bands import BANDS, Range

NAMES = [band.name for band in BANDS]


def test_seventeen_yardsticks_have_one_band_each():
    assert len(set(NAMES)) == len(NAMES) == 17


@pytest.mark.parametrize("band", BANDS, ids=NAMES)
def test_bands_nest_and_hold_real_land(band):
    assert band.warns.low <= band.passes.low
    assert band.passes.high <= band.warns.high
    assert band.real.low in band.passes
    assert band.real.high in band.passes
    assert band.meaning.endswith(".")
    assert band.source


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(0.15, "pass"), (0.75, "pass"), (0.1, "warn"), (1.0, "warn"), (1.01, "fail"), (-1, "fail")],
)
def test_verdict_on_both_sides_of_each_end(value, verdict):
    assert BANDS[NAMES.index("theta_sa")].verdict(value) == verdict


def test_nan_is_not_measured():
    assert BANDS[0].verdict(math.nan) == "not measured"


def test_ranges_print_without_infinities():
    assert str(Range(high=0.05)) == "<= 0.05"
    assert str(Range(low=0.5)) == ">= 0.5"
    assert str(Range(3.0, 5.5)) == "3 .. 5.5"
