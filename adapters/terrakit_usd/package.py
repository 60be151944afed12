"""The usdz container: a zip without compression whose files begin at multiples of 64 bytes."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path

from terrakit.errors import OutputError

ALIGNMENT = 64
LOCAL_HEADER = 30
EXTRA_HEADER = struct.Struct("<HH")
PADDING_ID = 0x1986
LARGEST = 2**32 - 1


def write_usdz(path: Path, members: Sequence[tuple[str, bytes]]) -> None:
    """Write files into a usdz package, the stage first; the bytes do not depend on the time.

    USD's own writer is not used because it reports success when the disk is full.

    Raises
    ------
    OutputError
        If the package would pass the 4 GB that the format allows.
    """
    total = sum(len(content) + 2 * ALIGNMENT + 4 * len(name) + 200 for name, content in members)
    if total > LARGEST:
        raise OutputError(f"{path.name}: {total / 1e9:.1f} GB > 4 GB of usdz; use .usdc")
    with open(path, "wb") as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, content in members:
            entry = zipfile.ZipInfo(name)  # dated 1980-01-01
            entry.create_system = 0
            unpadded = stream.tell() + LOCAL_HEADER + len(name.encode()) + EXTRA_HEADER.size
            padding = -unpadded % ALIGNMENT
            entry.extra = EXTRA_HEADER.pack(PADDING_ID, padding) + bytes(padding)
            archive.writestr(entry, content)
