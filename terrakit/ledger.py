"""Mass accounting: what there was, what came, what left, what is there, and what is missing.

Every erosion opens an account for each store that it touches, in cubic metres, and closes it with
the volume that it measured at the end. The residual is not computed from the parts that it
checks, so it shows what the scheme lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

STORES = ("rock", "sediment", "water")
ROUNDING = "rounding"
"""Under what an account holds what rounding changed between two operators."""


@dataclass
class Account:
    """One store, in cubic metres."""

    start: float
    came: dict[str, float] = field(default_factory=dict)
    left: dict[str, float] = field(default_factory=dict)
    end: float | None = None
    moved: float = 0.0

    @property
    def residual(self) -> float:
        """Volume that is unaccounted for; positive where the end has more than it should."""
        if self.end is None:
            raise RuntimeError("the account is still open")
        return self.end - (self.start + sum(self.came.values()) - sum(self.left.values()))

    def book(self, name: str, volume: float) -> None:
        """Book what came (> 0) or left (< 0) under one name, as one sum of either sign."""
        total = self.came.pop(name, 0.0) - self.left.pop(name, 0.0) + volume
        if total:
            (self.came if total > 0 else self.left)[name] = abs(total)

    def to_dict(self) -> dict[str, Any]:
        """Return the account as JSON holds it."""
        return {
            "start": self.start,
            "came": dict(self.came),
            "left": dict(self.left),
            "end": self.end,
            "moved": self.moved,
            "residual": self.residual,
        }


class Ledger:
    """The accounts of one step, by store: ``rock`` (with all loose material), ``water`` ..."""

    def __init__(self) -> None:
        self.accounts: dict[str, Account] = {}

    def open(self, store: str, volume: float) -> None:
        """Open an account with the volume (m3) that is there before the first step."""
        self.accounts[store] = Account(float(volume))

    def came(self, store: str, source: str, volume: float) -> None:
        """Book a volume (m3) that came in from ``source``, such as uplift or rain."""
        booked = self.accounts[store].came
        booked[source] = booked.get(source, 0.0) + float(volume)

    def left(self, store: str, sink: str, volume: float) -> None:
        """Book a volume (m3) that left through ``sink``, such as a border."""
        booked = self.accounts[store].left
        booked[sink] = booked.get(sink, 0.0) + float(volume)

    def close(self, store: str, volume: float, moved: float) -> None:
        """Close an account with the volume (m3) measured at the end and the volume moved."""
        account = self.accounts[store]
        account.end = float(volume)
        account.moved = float(moved)

    def follow(self, later: Ledger, rounding: Callable[[], float]) -> None:
        """Go on with the accounts of what was done next to the same ground.

        What came, left and moved is added up; an account begins where the first began and ends
        where the last ended. Between two of them the ground was rounded to float32, and counted in
        other quanta perhaps: a gap that this explains is booked as ``rounding``. Any other gap
        is nobody's, and stays to be seen in the residual.

        Parameters
        ----------
        later
            Accounts, all of them closed.
        rounding
            Asked for the largest gap (m3) that rounding explains, where there is a gap.
        """
        for store, account in later.accounts.items():
            mine = self.accounts.get(store)
            if mine is None:
                mine = self.accounts[store] = Account(account.start)
            elif mine.end is not None:
                gap = account.start - mine.end
                if gap and abs(gap) <= rounding():
                    mine.book(ROUNDING, gap)
            came, left = dict(account.came), dict(account.left)
            mine.book(ROUNDING, came.pop(ROUNDING, 0.0) - left.pop(ROUNDING, 0.0))
            for source, volume in came.items():
                self.came(store, source, volume)
            for sink, volume in left.items():
                self.left(store, sink, volume)
            mine.end = account.end
            mine.moved += account.moved

    @property
    def is_closed(self) -> bool:
        """Whether every account that was opened has its end booked."""
        return all(account.end is not None for account in self.accounts.values())

    def to_dict(self) -> dict[str, Any]:
        """Return every account as JSON holds it."""
        return {store: account.to_dict() for store, account in self.accounts.items()}
