"""Arithmetic that a user wrote: computed as written, never run, refused in one line."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run
from terrakit.formula import Place
from terrakit.formula.parsing import FUNCTIONS, check_text, formula_at, refuse_not_finite
from terrakit.heightfield import Layer

GRID = Grid((29, 31), 10.0, (-140.0, 150.0))
NAMES = ("x", "y")


def computed(text: str, device: str | None = "numpy", **define: str | float) -> NDArray[np.float32]:
    check_text(text, define, NAMES)
    place = Place(GRID, Run(3, device))
    x, y = place.around([0.0, 0.0])
    formula = formula_at(place, text, define, {"x": lambda: x, "y": lambda: y}, "test", 0)
    (values,) = place.computed(formula)
    return np.asarray(values if isinstance(values, np.ndarray) else values.download())


def places() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, cols = GRID.shape
    x = -140.0 + 10.0 * np.arange(cols)
    y = 150.0 - 10.0 * np.arange(rows)
    return np.meshgrid(x, y)


MEANINGS: dict[str, Callable[..., object]] = {
    "x + 2*y - 3": lambda x, y: x + 2 * y - 3,
    "-x/4 - +y": lambda x, y: -x / 4 - y,
    "x**2 - y**3/100": lambda x, y: x**2 - y**3 / 100,
    "(abs(x) + 1)**-2*1000": lambda x, y: (abs(x) + 1) ** -2.0 * 1000,
    "abs(x)**1.5": lambda x, y: abs(x) ** 1.5,
    "2**(y/50)": lambda x, y: 2 ** (y / 50),
    "2**-3**2": lambda x, y: 2.0**-9 + 0 * x,
    "x % 30": lambda x, y: x % 30,
    "x // 30": lambda x, y: x // 30,
    "-x % 7.5": lambda x, y: -x % 7.5,
    "10*(x > 20)": lambda x, y: 10 * (x > 20),
    "x if 0 < y <= 50 else -y": lambda x, y: np.where((y > 0) & (y <= 50), x, -y),
    "1 if not (x > 0 or y > 0) and x != -50 else 2": lambda x, y: np.where(
        ~((x > 0) | (y > 0)) & (x != -50), 1, 2
    ),
    "5*(x == 20)": lambda x, y: 5 * (x == 20),
    "round(x/8)": lambda x, y: np.floor(x / 8 + 0.5),
    "ceil(x/8) + sign(y)": lambda x, y: np.ceil(x / 8) + np.sign(y),
    "sin(x/30)*cos(y/40) + tan(x/200)": lambda x, y: (
        np.sin(x / 30) * np.cos(y / 40) + np.tan(x / 200)
    ),
    "asin(x/200) + acos(y/200) + atan(x) + atan2(y, x + 0.5)": lambda x, y: (
        np.arcsin(x / 200) + np.arccos(y / 200) + np.arctan(x) + np.arctan2(y, x + 0.5)
    ),
    "exp(x/50) + log(abs(y) + 1) + log2(abs(y) + 1) + log10(abs(y) + 1)": lambda x, y: (
        np.exp(x / 50) + np.log(abs(y) + 1) + np.log2(abs(y) + 1) + np.log10(abs(y) + 1)
    ),
    "sinh(x/90) + cosh(y/90) + tanh(x/90)": lambda x, y: (
        np.sinh(x / 90) + np.cosh(y / 90) + np.tanh(x / 90)
    ),
    "min(x, y, 40) + max(x, -y)": lambda x, y: np.minimum(np.minimum(x, y), 40) + np.maximum(x, -y),
    "clamp(x, -20, 33) + floor(y/7)": lambda x, y: np.clip(x, -20, 33) + np.floor(y / 7),
    "lerp(x, y, 0.25) + hypot(x, y) + sqrt(abs(x))": lambda x, y: (
        x + (y - x) * 0.25 + np.hypot(x, y) + np.sqrt(abs(x))
    ),
    "100*smoothstep(-50, 50, x)": lambda x, y: (lambda t: 100 * t**3 * (t * (6 * t - 15) + 10))(
        np.clip((x + 50) / 100, 0, 1)
    ),
    "pi + tau + e": lambda x, y: math.pi + math.tau + math.e + 0 * x,
}


@pytest.mark.parametrize("text", MEANINGS)
def test_means_what_it_says(text: str) -> None:
    expected = np.broadcast_to(np.asarray(MEANINGS[text](*places()), dtype=float), GRID.shape)
    assert computed(text) == pytest.approx(expected, rel=3e-5, abs=3e-4)


def test_every_function_is_tried_above() -> None:
    assert all(any(f"{name}(" in text for text in MEANINGS) for name in FUNCTIONS)


def test_device_gives_the_bits_of_the_reference() -> None:
    text = " + ".join(f"({text})" for text in MEANINGS if "**3" not in text)
    text += " + k*fbm(90, 4) + ridged(60, octaves=3, gain=0.6) + noise(40, 'value')"
    reference, ours = (computed(text, device, k="3 + billow(70)") for device in ("numpy", None))
    assert np.array_equal(reference.view(np.int32), ours.view(np.int32))


def test_definitions_are_names_for_parts() -> None:
    plain = computed("(x + 1)*(x + 1) + 5")
    assert np.array_equal(plain, computed("a*a + b", a="x + c", b=5.0, c=1))


def test_each_call_is_a_noise_of_its_own_and_a_name_is_one_noise() -> None:
    assert np.abs(computed("fbm(100) - fbm(100)")).max() > 0.1
    assert not computed("n - n", n="fbm(100)").any()
    first = computed("fbm(100)")
    assert np.array_equal(first, computed("fbm(100) + 0*fbm(50)"))


REFUSED = {
    "": "is no arithmetic",
    "import os": "is no arithmetic",
    "__import__('os').system('x')": "is no arithmetic",
    "().__class__": "is no arithmetic",
    "open('x')": "no such function",
    "x.real": "is no arithmetic",
    "x[0]": "is no arithmetic",
    "[1 for q in x]": "is no arithmetic",
    "lambda: 1": "is no arithmetic",
    "(k := 3)": "is no arithmetic",
    "f'{x}'": "is no arithmetic",
    "'a'": "is no number",
    "True": "is no number",
    "1j": "is no number",
    "x^2": r"\*\*",
    "x & y": "is no arithmetic",
    "z + 1": "no such name",
    "sin": "is a function",
    "sin(1, 2)": "sin takes 1 arguments, not 2",
    "sin(a=1)": "plain arguments",
    "max(*x)": "plain arguments",
    "x if y else 1": "must be a comparison",
    "x in y": "is no arithmetic",
    "1/0": "is too large, or infinite",
    "0/0": "is no number",
    "1e39": "is too large",
    "9" * 400: "is too large",
    "sqrt(-1)": "is no number",
    "fbm(x)": "wavelength must be a number",
    "fbm(0)": "wavelength must be a number",
    "fbm()": "needs a wavelength",
    "fbm(90, 99)": "octaves must be a number from 1 to 24",
    "fbm(90, 2.5)": "whole number",
    "fbm(90, 4, octaves=4)": "each once",
    "noise(90, 'cellular_f9')": "did you mean cellular_f",
    "sin(" * 150 + "x" + ")" * 150: "deep",
    "(" * 1500 + "x": "is no arithmetic",
    "-" * 3000 + "x": "is no arithmetic|deep",
    "+".join("x" * 300): "deep",
    "+".join(["(" + "+".join("x" * 50) + ")"] * 12): "more than 1000",
    "x " * 3000: "at most 4000",
    "+".join(["noise(9)"] * 40): "more than 32 noises",
    "a\0b": "is no arithmetic",
    "\ud800": "is no arithmetic",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: ascii(text[:24]))
def test_what_is_no_arithmetic_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(ParameterError, match=REFUSED[text]) as refusal:
        check_text(text, {}, NAMES)
    message = str(refusal.value)
    assert message.startswith("formula = ")
    assert "\n" not in message
    assert len(message) < 500


def test_towers_of_powers_end_at_once() -> None:
    started = time.process_time()
    check_text("9.0**9**9", {}, NAMES)  # a float that overflows when it is computed
    with pytest.raises(ParameterError, match="too large"):
        check_text("9**999", {}, NAMES)
    assert not np.isfinite(computed("9**9**9")).any()
    assert time.process_time() - started < 5.0


def test_depth_is_bounded_through_definitions_too() -> None:
    deep = {f"a{k}": "+".join([f"a{k + 1}"] + ["x"] * 40) for k in range(18)} | {"a18": 1.0}
    with pytest.raises(ParameterError, match="in all|deep"):
        check_text("a0", deep, NAMES)


@pytest.mark.parametrize(
    ("define", "reason"),
    [
        ({"a": "b", "b": "a"}, r"define.a: is defined by itself \(a > b > a\)"),
        ({"1a": 1.0}, "is no name"),
        ({"sin": 1.0}, "means something already"),
        ({"x": 1.0}, "means something already"),
        ({"a": "import os"}, "define.a = 'import os'"),
        ({f"a{k}": f"a{k + 1}" for k in range(99)}, "more than 20 definitions"),
    ],
)
def test_definitions_are_judged_too(define: dict[str, str | float], reason: str) -> None:
    with pytest.raises(ParameterError, match=reason):
        check_text("x", define, NAMES)


def test_a_message_says_where_in_the_text_it_is_wrong() -> None:
    with pytest.raises(ParameterError, match=r"at character 9, 'y.q'"):
        check_text("x + 1 + y.q", {}, NAMES)
    with pytest.raises(ParameterError, match="did you mean sqrt"):
        check_text("sqrtt + 1", {}, NAMES)


@pytest.mark.parametrize(
    "text",
    ["log(x)", "1/(x - 10)", "sqrt(x)", "x**0.5", "asin(x)", "exp(x)", "x**99"],
)
def test_no_number_stays_no_number_until_it_is_told(text: str) -> None:
    values = computed(text)
    wrong = ~np.isfinite(values)
    assert 0 < wrong.sum() < wrong.size
    with pytest.raises(ParameterError, match=f"{wrong.sum()} of {wrong.size} heights are not"):
        refuse_not_finite(GRID, Layer(values), text)
    refuse_not_finite(GRID, Layer(np.where(wrong, 0, values)), text)


def test_order_of_names_and_blanks_do_not_matter() -> None:
    assert np.array_equal(computed(" x\n +  y "), computed("x+y"))
