"""Parameters, layers, ledger, quanta, seeds and the run: the small contracts of the core."""

from __future__ import annotations

import threading
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrakit import (
    Cancelled,
    Erosion,
    FromLayer,
    Heightfield,
    Maskable,
    ParameterError,
    PluginError,
    Run,
    Schedule,
    parameter,
)
from terrakit.execute import execute
from terrakit.layers import VOCABULARY, covers, layer_kind
from terrakit.ledger import Ledger
from terrakit.quanta import Quanta
from terrakit.registry import Registry, check_declaration
from terrakit.running import seed_words


class Sample(Erosion):
    """Do nothing, with many parameters."""

    name = "sample"
    presets: ClassVar = {"steep": {"angle": 60.0}}
    angle: Maskable = parameter(33.0, "An angle.", unit="deg", ge=0, lt=90)
    count: int = parameter(5, "A number.", ge=1, le=10)
    optional: int | None = parameter(None, "Perhaps a number.", ge=0)
    switch: bool = parameter(False, "On or off.")
    size: float = parameter(1.0, "A length.", unit="m", gt=0, le=100)

    def erode(self, surface: Any, run: Run) -> Any:
        """Return the surface."""
        for _ in run.steps(self.count):
            pass
        return surface


TERRAIN = Heightfield(np.arange(16.0).reshape(4, 4), 1.0, layers={"mask_a": np.ones((4, 4)) / 2})


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"angel": 3.0}, r"sample: unknown parameter 'angel' \(did you mean angle\?\)"),
        ({"angle": 90.0}, r"angle = 90.0: must be 0 <= angle < 90 deg"),
        ({"angle": float("nan")}, "angle = nan"),
        ({"angle": True}, "angle = True"),
        ({"count": 0}, "must be 1 <= count <= 10"),
        ({"count": 1.5}, "count = 1.5: must be a whole number"),
        ({"count": "ten"}, "count = 'ten': must be a whole number"),
        ({"count": True}, "count = True"),
        ({"optional": -1}, "optional"),
        ({"switch": 1}, "switch = 1: must be true or false"),
        ({"size": 0}, "0 < size <= 100 m"),
        ({"size": 10**400}, "size"),
        ({"angle": {"at": [0, 1], "value": [1]}}, "angle"),
        ({"angle": {"layer": "mask_a", "low": 0.0, "high": 95.0}}, "angle"),
    ],
)
def test_wrong_settings_are_named_with_their_limits(given_: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Sample(**given_)
    assert "\n" not in str(caught.value)


def test_whole_floats_count_as_whole_numbers() -> None:
    assert Sample(count=1e1).count == 10  # type: ignore[arg-type]
    assert Sample(optional=1e3).optional == 1000  # type: ignore[arg-type]


def test_operators_are_frozen_equal_and_hashable() -> None:
    one, two = Sample(angle=20.0), Sample(angle=20.0)
    assert one == two
    assert hash(one) == hash(two)
    with pytest.raises(Exception, match="frozen"):
        one.angle = 3.0  # type: ignore[misc]


def test_presets_give_way_to_settings() -> None:
    assert Sample.from_settings({"preset": "steep"}, "x").angle == 60.0
    assert Sample.from_settings({"preset": "steep", "angle": 10.0}, "x").angle == 10.0
    with pytest.raises(ParameterError, match="known: steep"):
        Sample.from_settings({"preset": "sheer"}, "x")


def test_maskable_values_resolve() -> None:
    assert Sample(angle=20.0).value("angle", TERRAIN) == 20.0
    schedule = Schedule(at=[0.0, 0.5], value=[10.0, 30.0])
    assert Sample(angle=schedule).value("angle", TERRAIN, 0.25) == 20.0
    assert Sample(angle=schedule).value("angle", TERRAIN, 1.0) == 30.0
    field = Sample(angle=FromLayer(layer="mask_a", low=10.0, high=30.0)).value("angle", TERRAIN)
    assert np.asarray(field).tolist() == np.full((4, 4), 20.0).tolist()
    assert np.asarray(Sample(angle="mask_a").value("angle", TERRAIN)).max() == 0.5
    with pytest.raises(ParameterError, match="mask_b"):
        Sample(angle="mask_b").value("angle", TERRAIN)
    wild = TERRAIN.with_layers(mask_a=np.full((4, 4), 91.0))
    with pytest.raises(ParameterError, match="91"):
        Sample(angle="mask_a").value("angle", wild)


@pytest.mark.parametrize(
    "knots",
    [([0.0, 0.0], [1.0, 2.0]), ([0.5, 0.2], [1.0, 2.0]), ([0.0, 1.1], [1.0, 2.0]), ([], [])],
)
def test_schedules_rise_from_zero_to_one(knots: tuple[list[float], list[float]]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  (any validation error)
        Schedule(at=knots[0], value=knots[1])


def test_vocabulary_and_families() -> None:
    assert all(kind.unit and kind.meaning.endswith(".") for kind in VOCABULARY.values())
    assert layer_kind("material_grass") is VOCABULARY["material_"]
    assert layer_kind("material_") is None
    assert layer_kind("nonsense") is None
    assert covers(("material_",), "material_rock")
    assert not covers(("material_",), "mask_rock")
    assert covers(("elevation",), "elevation")


def test_ledger_residual_is_what_is_missing() -> None:
    ledger = Ledger()
    ledger.open("rock", 100.0)
    ledger.came("rock", "uplift", 5.0)
    ledger.came("rock", "uplift", 5.0)
    ledger.left("rock", "border north", 20.0)
    assert not ledger.is_closed
    with pytest.raises(RuntimeError, match="open"):
        _ = ledger.accounts["rock"].residual
    ledger.close("rock", 89.0, 30.0)
    assert ledger.is_closed
    assert ledger.to_dict()["rock"] == {
        "start": 100.0,
        "came": {"uplift": 10.0},
        "left": {"border north": 20.0},
        "end": 89.0,
        "moved": 30.0,
        "residual": -1.0,
    }


@settings(max_examples=60, derandomize=True, deadline=None)
@given(
    low=st.floats(-11000, 1e5),
    relief=st.floats(0.0, 1e5),
    spacing=st.floats(1e-3, 1e4),
)
def test_counts_come_back_as_heights(low: float, relief: float, spacing: float) -> None:
    before = np.linspace(low, low + relief, 40, dtype=np.float32).reshape(5, 8)
    quanta = Quanta.fitting(before, spacing)
    counts = quanta.count(before)
    assert np.abs(counts.astype(np.int64)).max() <= 2**29 + 2
    assert quanta.height(before, counts, counts).tobytes() == before.tobytes()
    moved = quanta.height(before, counts, counts + 1)
    step = np.spacing(np.abs(before).astype(np.float32)) + quanta.quantum
    assert (np.abs(moved.astype(np.float64) - before) <= 2 * step).all()
    volume = float(before.sum(dtype=np.float64)) * spacing**2
    assert abs(quanta.volume(counts, spacing**2) - volume) <= quanta.quantum * 40 * spacing**2


def test_quantum_follows_from_the_spacing_alone() -> None:
    low, high = np.zeros((3, 3), np.float32), np.full((3, 3), 4000.0, np.float32)
    assert Quanta.fitting(low, 10.0) == Quanta.fitting(high, 10.0)
    assert Quanta.fitting(low, 10.0).quantum == 2.0**-15


# --- seeds and runs ---------------------------------------------------------------------------


def test_seeds_that_look_alike_differ() -> None:
    seeds = [-1, 2**32 - 1, 2**64, 7, "7", "", 0, -7, "-1"]
    assert len({seed_words(seed) for seed in seeds}) == len(seeds)
    assert seed_words("a", "b") != seed_words("ab")
    for wrong in (True, 1.5, None):
        with pytest.raises(ParameterError, match="seed"):
            Run(wrong)  # type: ignore[arg-type]


def test_seed_words_are_the_same_for_ever() -> None:
    import hashlib

    digest = hashlib.blake2b(b"int:42\0str:fbm\0", digest_size=8).digest()
    assert seed_words(42, "fbm") == (
        int.from_bytes(digest[:4], "little"),
        int.from_bytes(digest[4:], "little"),
    )


def test_steps_report_and_stop() -> None:
    told: list[float] = []
    run = Run(on_progress=lambda p: told.append(p.fraction))
    assert list(run.steps(4)) == [0, 1, 2, 3]
    assert told == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert list(run.steps(0)) == []
    run.finish_now()
    assert list(run.steps(4)) == []
    run.cancel()
    with pytest.raises(Cancelled):
        list(run.steps(4))


def test_child_shares_cancel_but_not_the_ledger() -> None:
    run = Run()
    child = run.for_step("one")
    child.ledger.open("rock", 1.0)
    assert not run.ledger.accounts
    run.cancel()
    with pytest.raises(Cancelled):
        child.check()


def test_previews_are_made_only_for_someone_who_watches() -> None:
    seen: list[Any] = []
    Run().offer(lambda: pytest.fail("nobody watches"))
    run = Run(on_preview=seen.append)
    run.offer(lambda: TERRAIN)
    run.offer(lambda: TERRAIN)  # too soon for another
    assert seen == [TERRAIN]


def test_operators_run_in_threads() -> None:
    from terrakit import erode, generate

    results: list[bytes] = []

    def work() -> None:
        terrain = generate("fbm", 33, run=Run(3))
        results.append(erode(terrain, "thermal", distance=30.0, run=Run(3)).elevation.tobytes())

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    assert len(set(results)) == 1


# --- the border -------------------------------------------------------------------------------


def returning(value: Any) -> Erosion:
    class Rogue(Sample):
        """Return whatever it was told to."""

        name = "rogue"

        def erode(self, surface: Any, run: Run) -> Any:
            if isinstance(value, BaseException):
                raise value
            return value(surface) if callable(value) else value

    return Rogue()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (None, "returned None"),
        ("terrain", "must be a terrain"),
        (np.zeros((3, 3, 3)), r"ndarray \(3, 3, 3\)"),
        (lambda s: Heightfield(np.zeros((5, 5)), 1.0), "changed the grid"),
        (lambda s: Heightfield(s.elevation, 2.0), "changed the grid"),
        (lambda s: s.with_layers(rain=s.elevation), "'rain', which it does not declare"),
        (lambda s: s.without_layers("mask_a"), "dropped layer 'mask_a'"),
        (SystemExit(0), "tried to end the program"),
        (ZeroDivisionError("x"), "raised ZeroDivisionError at"),
    ],
)
def test_rubbish_is_stopped_at_the_border(value: Any, message: str) -> None:
    with pytest.raises(PluginError, match=message) as caught:
        execute(returning(value), TERRAIN, Run())
    assert "rogue" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_ctrl_c_stays_ctrl_c() -> None:
    with pytest.raises(KeyboardInterrupt):
        execute(returning(KeyboardInterrupt()), TERRAIN, Run())


# --- the registry -----------------------------------------------------------------------------


def test_registry_names_suggests_and_sorts() -> None:
    registry = Registry(third_parties=False)
    assert registry.get("thermal").name == "thermal"
    assert registry.get("terrakit:thermal") is registry.get("thermal", "erosion")
    with pytest.raises(ParameterError, match="did you mean thermal"):
        registry.get("thermall")
    with pytest.raises(ParameterError):
        registry.get("thermal", "generator")
    names = [(o.kind, o.name) for o in registry.operators("erosion")]
    assert names == sorted(names)
    assert registry.owner(registry.get("fbm")).is_built_in


def test_declarations_are_checked() -> None:
    class Nameless(Sample):
        """Have no usable name."""

        name = "No Name"

    class Foreign(Sample):
        """Write a layer that nobody knows."""

        name = "foreign"
        writes = ("gold",)

    for operator, message in ((Nameless, "lower_case"), (Foreign, "vocabulary"), (int, "Erosion")):
        with pytest.raises(TypeError, match=message):
            check_declaration(operator, Erosion)
