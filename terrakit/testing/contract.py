"""Which checks an operator has to pass, and how they run under pytest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from terrakit.operators import Operator
from terrakit.testing import composition, declaration, erosion, files, results
from terrakit.testing.trial import ContractBroken, NotApplicable, Trial

DECLARATION = (
    declaration.declares_itself,
    declaration.defaults_are_within_bounds,
    declaration.presets_are_valid,
    declaration.schema_builds,
    declaration.settings_survive_a_recipe,
    declaration.parameters_mean_the_same_everywhere,
    declaration.unknown_parameters_are_refused,
    declaration.values_out_of_bounds_are_refused,
)
RESULT = (
    results.same_seed_gives_same_bytes,
    results.same_bytes_in_another_process,
    results.seed_decides,
    results.writes_what_it_declares,
    results.reference_equals_opencl,
    results.work_groups_do_not_matter,
    results.awkward_terrain_is_survived,
    results.tile_equals_whole,
)
COMPOSED = (
    erosion.maskable_parameters_take_layers,
    erosion.wrong_layers_are_refused,
    composition.terrain_parameters_take_terrain,
    composition.wrong_terrains_are_refused,
    composition.unknown_steps_are_refused,
)
SURFACE = (
    declaration.other_surfaces_are_refused,
    results.input_is_untouched,
    results.turning_turns_the_result,
    *COMPOSED,
)
CHECKS: dict[str, tuple[Callable[[Trial], None], ...]] = {
    "generator": (*DECLARATION, *RESULT, *COMPOSED, results.far_away_is_as_sharp),
    "filter": (
        *DECLARATION,
        *RESULT,
        *SURFACE,
        erosion.idle_settings_change_nothing,
        erosion.cancel_is_answered,
        erosion.finish_now_keeps_what_is_there,
        composition.grid_is_as_announced,
        composition.layers_come_along,
        composition.small_terrain_is_no_trap,
    ),
    "erosion": (
        *DECLARATION,
        *RESULT,
        *SURFACE,
        erosion.schedules_take_effect,
        erosion.ledger_closes,
        erosion.ledger_agrees_with_the_surface,
        erosion.idle_settings_change_nothing,
        erosion.progress_rises_to_one,
        erosion.cancel_is_answered,
        erosion.finish_now_keeps_what_is_there,
        erosion.refines,
    ),
    "texture": (
        *DECLARATION,
        *RESULT,
        *SURFACE,
        erosion.elevation_is_untouched,
        erosion.weights_sum_to_one,
    ),
    "importer": (
        *DECLARATION,
        files.junk_is_refused,
        files.cut_files_are_refused,
        files.same_file_gives_same_bytes,
    ),
    "exporter": (
        *DECLARATION,
        files.writes_only_what_it_lists,
        files.same_surface_gives_same_files,
        files.surface_survives_its_export,
        files.failing_write_leaves_nothing,
        files.corners_come_back,
    ),
}
"""The checks by the kind of operator."""


@dataclass(frozen=True)
class Check:
    """One promise of the contract, tried on one operator: call it."""

    trial: Trial
    examine: Callable[[Trial], None]

    @property
    def name(self) -> str:
        """The promise in words, such as ``ledger_closes``."""
        return self.examine.__name__

    def __call__(self) -> None:
        """Raise :class:`ContractBroken` or :class:`NotApplicable`, or return."""
        self.examine(self.trial)

    def __repr__(self) -> str:
        return f"{self.trial.name}-{self.name}"


def contract_checks(
    operator: type[Operator],
    settings: Mapping[str, Any] | None = None,
    device: str | None = None,
) -> list[Check]:
    """Return every check that an operator has to pass.

    Parameters
    ----------
    operator
        The operator's class; it need not be registered.
    settings
        Parameters for the trials; by default the operator's own ``trial``.
    device
        Name of the device to compare with the NumPy reference.
    """
    chosen = operator.trial if settings is None else settings
    trial = Trial(operator, dict(chosen), device)
    return [Check(trial, examine) for examine in CHECKS.get(operator.kind, DECLARATION)]


def broken_contracts(
    operator: type[Operator], settings: Mapping[str, Any] | None = None
) -> dict[str, str]:
    """Run every check and return what is broken, by the name of the check."""
    broken = {}
    for check in contract_checks(operator, settings):
        try:
            check()
        except NotApplicable:
            continue
        except AssertionError as error:
            broken[check.name] = str(error)
    return broken


class OperatorContract:
    """A pytest class with one test a check; subclass it and set ``operator``.

    ::

        class TestRipple(OperatorContract):
            operator = Ripple
    """

    operator: ClassVar[type[Operator]]
    settings: ClassVar[Mapping[str, Any] | None] = None
    """In place of the operator's own ``trial``."""

    def pytest_generate_tests(self, metafunc: Any) -> None:
        """Make a test of every check."""
        if "check" in metafunc.fixturenames:
            checks = contract_checks(self.operator, self.settings)
            metafunc.parametrize("check", checks, ids=[check.name for check in checks])

    def test_contract(self, check: Check) -> None:
        """Hold the operator to one promise."""
        examine(check)


def examine(check: Check) -> None:
    """Run a check under pytest: an exemption is a skip, a breach a failure of one line."""
    import pytest

    try:
        check()
    except NotApplicable as exempt:
        pytest.skip(str(exempt))
    except ContractBroken as breach:
        pytest.fail(str(breach), pytrace=False)
