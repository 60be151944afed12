"""NumPy archives that hold a terrain whole: what goes in comes out bit for bit."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from terrakit.atomic import atomic_path
from terrakit.errors import InputError
from terrakit.heightfield import Heightfield
from terrakit.operators import Exporter
from terrakit.parameters import parameter
from terrakit.provenance import terrakit_version

if TYPE_CHECKING:
    from terrakit.running import Run
    from terrakit.strata import Strata

RESERVED = ("spacing", "origin", "crs", "strata", "terrakit")
EPOCH = (1980, 1, 1, 0, 0, 0)
UNIX = 3


class Npz(Exporter):
    """Write elevation, layers, strata, spacing, origin and CRS as a NumPy archive."""

    name: ClassVar[str] = "npz"
    suffix: ClassVar[str] = ".npz"
    bytes_a_sample: ClassVar[float] = 40.0

    compress: bool = parameter(
        False, "Pack the arrays: smaller, slower, and bytes that depend on the zlib in use."
    )

    def export(self, surface: Heightfield, path: Path, run: Run) -> list[Path]:
        """Write the archive; the importer ``numpy`` reads it back."""
        path = Path(path)
        taken = [name for name in surface if name in RESERVED]
        if taken:
            raise InputError(f"npz: layer {taken[0]!r}: the name is the format's own; rename it")
        method = zipfile.ZIP_DEFLATED if self.compress else zipfile.ZIP_STORED
        about = {
            "terrakit": np.array(terrakit_version()),
            "spacing": np.array(surface.spacing),
            "origin": np.array(surface.origin),
            **({"crs": np.array(surface.crs)} if surface.crs else {}),
            **({"strata": _column(surface.strata)} if surface.strata else {}),
        }
        with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", method) as archive:
            for name in (*about, *surface):
                run.check()
                member = zipfile.ZipInfo(f"{name}.npy", EPOCH)
                member.compress_type, member.create_system = method, UNIX
                member.external_attr = 0o644 << 16
                values = about[name] if name in about else surface.layer(name)
                with archive.open(member, "w", force_zip64=True) as stream:
                    npy.write_array(stream, np.asanyarray(values), (1, 0), allow_pickle=False)
        return [path]


def _column(strata: Strata) -> NDArray[Any]:
    """Return the beds as the text that the archive holds."""
    return np.array(json.dumps(strata.to_dict(), sort_keys=True))
