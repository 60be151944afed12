"""Mass accounting: what there was, what came, what left, what is there, and what is missing.

Every erosion opens an account for each store that it touches, in cubic metres, and closes it with
the volume that it measured at the end. The residual is not computed from the parts that it
checks, so it shows what the scheme lost.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

STORES = ("rock", "sediment", "water")


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

    @property
    def is_closed(self) -> bool:
        """Whether every account that was opened has its end booked."""
        return all(account.end is not None for account in self.accounts.values())

    def to_dict(self) -> dict[str, Any]:
        """Return every account as JSON holds it."""
        return {store: account.to_dict() for store, account in self.accounts.items()}
