"""In which order a graph of formulas is computed: the same for both languages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from terrakit.formula.expression import Formula, Loop


@dataclass(eq=False)
class LoopPlan:
    """One loop: what it needs from outside, and its body in order."""

    loop: Loop
    inside: list[Formula]
    """What is another value in every octave, arguments first."""
    captured: list[Formula]
    """What the body uses from outside."""
    level: int = 0


@dataclass(eq=False)
class Plan:
    """Everything that some formulas need, arguments first.

    Parameters
    ----------
    results
        The formulas that are asked for.
    """

    results: Sequence[Formula]
    outside: list[Formula] = field(default_factory=list)
    loops: list[LoopPlan] = field(default_factory=list)
    levels: dict[int, int] = field(default_factory=dict)
    """How many loops deep a formula outside of loops depends on others, by identity."""

    def __post_init__(self) -> None:
        known: dict[Loop, LoopPlan] = {}

        def needed(formula: Formula) -> Iterable[Formula]:
            if formula.op != "loop":
                return formula.args
            loop = formula.data[0]
            if loop not in known:
                known[loop] = _planned(loop)
            return (*loop.start, *known[loop].captured)

        self.outside = ordered(self.results, needed)
        for formula in self.outside:
            below = [self.levels[id(f)] for f in needed(formula) if not f.is_leaf]
            level = max(below, default=0)
            if formula.op == "loop":
                plan = known[formula.data[0]]
                if plan not in self.loops:
                    plan.level = level + 1
                    self.loops.append(plan)
                level = plan.level
            self.levels[id(formula)] = level


def _planned(loop: Loop) -> LoopPlan:
    order = ordered(loop.body, lambda formula: formula.args)
    following: dict[int, bool] = {}
    for formula in order:
        own = formula.op in ("state", "table") and formula.data[0] is loop
        own = own or (formula.op == "noise" and formula.data.loop is loop)
        following[id(formula)] = own or any(following[id(arg)] for arg in formula.args)
    inside = [f for f in order if following[id(f)]]
    used = [arg for f in inside for arg in f.args] + list(loop.body)
    captured = {id(f): f for f in used if not following[id(f)]}
    return LoopPlan(loop, inside, list(captured.values()))


def ordered(
    roots: Iterable[Formula], needed: Callable[[Formula], Iterable[Formula]]
) -> list[Formula]:
    """Return everything that ``roots`` need, each once, after what it needs itself."""
    order: list[Formula] = []
    done: set[int] = set()
    for root in roots:
        waiting = [(root, iter(needed(root)))] if id(root) not in done else []
        done.add(id(root))
        while waiting:
            formula, rest = waiting[-1]
            following = next((f for f in rest if id(f) not in done), None)
            if following is None:
                order.append(formula)
                waiting.pop()
            else:
                done.add(id(following))
                waiting.append((following, iter(needed(following))))
    return order
