"""Numbers as text, whole arrays at a time.

Every number gets a row of bytes of one width, padded with zero bytes that are dropped when the
rows are joined; digits come four at a time out of a table. This writes some 10 million numbers a
second, where ``"%.9g" % x`` writes one.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

WIDTH = 22
"""Bytes of one decimal number: sign, 8 digits, point, 12 digits."""

_FULL, _LEADING, _TRAILING = 0, 10_000, 20_000


def decimals(values: NDArray[np.floating]) -> Bytes:
    """Return float32 numbers as decimals of 9 significant digits, shape (n, :data:`WIDTH`).

    Nine digits are what it takes to read the same float32 back. Trailing zeros are dropped.
    """
    number = np.asarray(values, dtype=np.float32).ravel()
    size = np.abs(number).astype(np.float64)
    odd = np.flatnonzero(((size < 1e-4) & (size > 0)) | (size >= 1e7))
    size[odd] = 0.0
    # Nine significant digits: 12 digits after the point for 1e-4, 2 for 1e6.
    places = np.full(number.size, 12, dtype=np.int64)
    for exponent in range(-3, 7):
        places -= size >= 10.0**exponent
    scale = _powers()[places]
    digits = np.floor(size * scale + 0.5).astype(np.uint64)
    unit = scale.astype(np.uint64)
    whole = digits // unit
    fraction = (digits - whole * unit) * _powers().astype(np.uint64)[12 - places]

    high = whole // np.uint64(10_000)
    low = whole - high * np.uint64(10_000)
    first = fraction // np.uint64(100_000_000)
    rest = fraction - first * np.uint64(100_000_000)
    second = rest // np.uint64(10_000)
    third = rest - second * np.uint64(10_000)

    table = _groups()
    text = np.empty((number.size, WIDTH), np.uint8)
    text[:, 0] = np.where((number < 0) & (digits > 0), ord("-"), 0)
    groups = (
        (1, high + np.uint64(_LEADING)),
        (5, low + np.where(high > 0, np.uint64(_FULL), np.uint64(_LEADING))),
        (10, first + np.where(rest > 0, np.uint64(_FULL), np.uint64(_TRAILING))),
        (14, second + np.where(third > 0, np.uint64(_FULL), np.uint64(_TRAILING))),
        (18, third + np.uint64(_TRAILING)),
    )
    for start, group in groups:
        text[:, start : start + 4] = table[group].view(np.uint8).reshape(-1, 4)
    text[:, 8] |= (whole == 0).astype(np.uint8) * np.uint8(ord("0"))
    text[:, 9] = np.where(fraction > 0, ord("."), 0)

    # Below 1e-4 or from 1e7 on there are few numbers, and they need an exponent.
    for index in odd:
        word = b"%.9g" % float(number[index])
        text[index] = np.frombuffer(word.ljust(WIDTH, b"\0"), np.uint8)
    return text


def whole_numbers(number: NDArray[np.uint64]) -> Bytes:
    """Return numbers below 10**12 as text of shape (n, 12) with zero bytes in front."""
    rest, low = number // np.uint64(10_000), number % np.uint64(10_000)
    high, middle = rest // np.uint64(10_000), rest % np.uint64(10_000)
    table = _groups()
    groups = np.empty((number.size, 3), np.uint32)
    groups[:, 0] = table[high + np.uint64(_LEADING)]
    groups[:, 1] = table[middle + np.where(high > 0, np.uint64(_FULL), np.uint64(_LEADING))]
    groups[:, 2] = table[low + np.where(rest > 0, np.uint64(_FULL), np.uint64(_LEADING))]
    return groups.view(np.uint8).reshape(-1, 12)


def joined(rows: Bytes) -> bytes:
    """Return the rows one after the other, without their zero bytes."""
    return rows.tobytes().translate(None, b"\0")


@functools.lru_cache(maxsize=1)
def _groups() -> NDArray[np.uint32]:
    """Four digits as four bytes: full, without leading zeros, without trailing zeros."""
    number = np.arange(10_000)
    full = np.stack([number // 10**place % 10 for place in (3, 2, 1, 0)], axis=-1)
    text = (full + ord("0")).astype(np.uint8)
    leading = np.where(np.cumsum(full, axis=1) > 0, text, 0)
    trailing = np.where(np.cumsum(full[:, ::-1], axis=1)[:, ::-1] > 0, text, 0)
    together = np.concatenate((text, leading, trailing)).astype(np.uint8)
    return np.ascontiguousarray(together).view(np.uint32).ravel()


@functools.lru_cache(maxsize=1)
def _powers() -> NDArray[np.float64]:
    return np.array([10.0**exponent for exponent in range(13)])
