"""Unity: heightmaps and alphamaps that its import dialog takes as they are."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Exporter
from terrakit_unity.unity_raw import UnityRaw


@hookimpl
def terrakit_exporters() -> list[type[Exporter]]:
    """Return the exporter of RAW heightmaps."""
    return [UnityRaw]
