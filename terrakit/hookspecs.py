"""The hooks that a plugin may implement: a table of contents.

A plugin implements any subset, with any subset of the arguments, and marks them with
:data:`hookimpl`. Hooks run once, when plugins are loaded, and (the observers) between steps; the
hot path never goes through them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pluggy

if TYPE_CHECKING:
    from terrakit.operators import Erosion, Exporter, Filter, Generator, Importer, Surface, Texture
    from terrakit.running import Run

hookspec = pluggy.HookspecMarker("terrakit")
hookimpl = pluggy.HookimplMarker("terrakit")


@hookspec
def terrakit_generators() -> list[type[Generator]]:
    """Return a list of Generator subclasses."""
    return []


@hookspec
def terrakit_filters() -> list[type[Filter]]:
    """Return a list of Filter subclasses."""
    return []


@hookspec
def terrakit_erosions() -> list[type[Erosion]]:
    """Return a list of Erosion subclasses."""
    return []


@hookspec
def terrakit_textures() -> list[type[Texture]]:
    """Return a list of Texture subclasses."""
    return []


@hookspec
def terrakit_importers() -> list[type[Importer]]:
    """Return a list of Importer subclasses."""
    return []


@hookspec
def terrakit_exporters() -> list[type[Exporter]]:
    """Return a list of Exporter subclasses."""
    return []


@hookspec
def terrakit_run_started(run: Run, steps: list[str]) -> None:
    """Observe that a recipe starts; ``steps`` are its step names in order."""


@hookspec
def terrakit_step_done(run: Run, step: str, surface: Surface, report: dict[str, Any]) -> None:
    """Observe that a step is done; ``report`` is its entry of ``run.json``."""


@hookspec
def terrakit_run_finished(run: Run, report: dict[str, Any]) -> None:
    """Observe that a recipe is done; ``report`` is the whole of ``run.json``."""
