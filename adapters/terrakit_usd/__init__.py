"""OpenUSD: stages with mesh, masks, texture and material."""

from __future__ import annotations

from terrakit.hookspecs import hookimpl
from terrakit.operators import Exporter
from terrakit_usd.exporter import Usd


@hookimpl
def terrakit_exporters() -> list[type[Exporter]]:
    """Return the exporter of usda, usdc and usdz."""
    return [Usd]
