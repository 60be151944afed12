"""The contract suite over every operator that ships."""

from __future__ import annotations

import pytest

from terrakit.registry import default_registry
from terrakit.testing import Check, contract_checks, examine

KNOWN: dict[str, str] = {}
"""Breaches that somebody has still to mend, by operator and check; a mended one must leave."""

CHECKS = [
    pytest.param(
        check,
        id=repr(check),
        marks=[pytest.mark.xfail(reason=KNOWN[repr(check)])] if repr(check) in KNOWN else [],
    )
    for operator in default_registry().operators()
    if default_registry().owner(operator).is_built_in
    for check in contract_checks(operator)
]


@pytest.mark.parametrize("check", CHECKS)
def test_operator(check: Check) -> None:
    examine(check)


def test_every_kind_of_operator_is_tried() -> None:
    assert {o.kind for o in default_registry().operators()} == {
        "generator",
        "filter",
        "erosion",
        "texture",
        "importer",
        "exporter",
    }
