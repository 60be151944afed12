"""The contract suite over every operator that is registered."""

from __future__ import annotations

import pytest

from terrakit.registry import default_registry
from terrakit.testing import Check, contract_checks, examine

CHECKS = [
    check
    for operator in default_registry().operators()
    if default_registry().owner(operator).is_built_in
    for check in contract_checks(operator)
]


@pytest.mark.parametrize("check", CHECKS, ids=repr)
def test_operator(check: Check) -> None:
    examine(check)
