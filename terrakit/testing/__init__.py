"""The contract that every operator keeps, as tests that any plugin's author runs.

::

    from terrakit.testing import OperatorContract
    from my_plugin import Ripple

    class TestRipple(OperatorContract):
        operator = Ripple

Each check tries one promise: declared once, same seed same bytes, the reference equals OpenCL bit
for bit, the input untouched, the ledger closed, turned terrain gives the turned result, and so on.
What an operator declares (``parity``, ``turning``, ``idle``, ``locality``) is what it is held to.
``Operator.trial`` holds settings for the trials of operators whose defaults take long.
"""

from __future__ import annotations

from terrakit.testing.contract import (
    CHECKS,
    Check,
    OperatorContract,
    broken_contracts,
    contract_checks,
    examine,
)
from terrakit.testing.files import check_compass
from terrakit.testing.subjects import (
    awkward_terrains,
    compass_terrain,
    irregular_mesh,
    rough_terrain,
    smooth_terrain,
)
from terrakit.testing.trial import ContractBroken, NotApplicable, Trial, difference

__all__ = [
    "CHECKS",
    "Check",
    "ContractBroken",
    "NotApplicable",
    "OperatorContract",
    "Trial",
    "awkward_terrains",
    "broken_contracts",
    "check_compass",
    "compass_terrain",
    "contract_checks",
    "difference",
    "examine",
    "irregular_mesh",
    "rough_terrain",
    "smooth_terrain",
]
