"""Strata: beds of rock that erosion meets one after the other as it cuts down.

A surface carries a column of beds (:class:`Strata`) and the layer ``strata_datum``, the height of
the column's top at every point, which dips, folds and breaks. :class:`Exposure` tells an erosion
which bed it meets.
"""

from __future__ import annotations

from terrakit.strata.column import MOST_BEDS, Bed, Strata
from terrakit.strata.exposure import Exposure

__all__ = ["MOST_BEDS", "Bed", "Exposure", "Strata"]
