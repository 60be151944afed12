"""The shipped range looks like land to every yardstick, and the noise that it began as does not.

Here it has 257 samples a side, 80 m apart; ``benchmarks/realism.py`` measures all 1025.
"""

from __future__ import annotations

import pytest

import terrakit
from terrakit.analysis import Analysis
from terrakit.execute import execute

SEEDS = (7, 1, 2, 3, 4)


def told(analysis: Analysis) -> list[tuple[str, float, str]]:
    """Return what did not pass."""
    return [(n, analysis.values[n], v) for n, v in analysis.verdicts.items() if v != "pass"]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_alps_are_within_the_bands_of_real_land(seed: int) -> None:
    result = terrakit.run("alps", seed=seed, settings={"samples": 257}, cache=False)
    assert isinstance(result.surface, terrakit.Heightfield)
    analysis = terrakit.analyze(result.surface)
    assert analysis.notes == ()
    assert analysis.count("fail") == 0, told(analysis)
    assert analysis.count("pass") >= len(analysis.verdicts) - 1, told(analysis)

    # An alpine relief, and all of it accounted for
    height = result.surface.elevation
    assert 800 < height.max() - height.min() < 4000
    for entry in result.report["steps"]:
        for account in (entry.get("ledger") or {}).values():
            assert abs(account["residual"]) <= 1e-9 * max(account["moved"], 1.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_noise_that_they_began_as_fails(seed: int) -> None:
    recipe = terrakit.load_recipe("alps", {"samples": 257}).with_seed(seed)
    step = recipe.steps[0]
    assert step.name == "fbm"
    noise = execute(step.operator, recipe.grid, terrakit.Run(seed))
    analysis = terrakit.analyze(noise)
    assert analysis.count("fail") >= 2, told(analysis)
    assert {"pit_fraction", "updown_asymmetry"} <= {
        name for name, verdict in analysis.verdicts.items() if verdict == "fail"
    }
