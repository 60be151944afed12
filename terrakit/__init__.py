"""terrakit: terrain from recipes. Same recipe, same bytes.

Everything public is here; it is loaded when it is first asked for, so that importing the package
costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrakit.api import analyze, apply, erode, export, generate, load, run, texture
    from terrakit.errors import (
        Cancelled,
        DeviceError,
        InputError,
        KernelError,
        OutputError,
        ParameterError,
        PluginError,
        RecipeError,
        ResourceError,
        TerrakitError,
    )
    from terrakit.heightfield import Grid, Heightfield
    from terrakit.hookspecs import hookimpl
    from terrakit.mesh import TriMesh
    from terrakit.operators import Erosion, Exporter, Filter, Generator, Importer, Texture
    from terrakit.parameters import (
        FilePath,
        FromLayer,
        Maskable,
        Schedule,
        Seed,
        StepName,
        parameter,
    )
    from terrakit.recipe import load_recipe
    from terrakit.running import Progress, Run
    from terrakit.sources import Chain, Source, Steps

_HOMES = {
    "terrakit.api": "analyze apply erode export generate load run texture",
    "terrakit.errors": "Cancelled DeviceError InputError KernelError OutputError ParameterError "
    "PluginError RecipeError ResourceError TerrakitError",
    "terrakit.heightfield": "Grid Heightfield",
    "terrakit.hookspecs": "hookimpl",
    "terrakit.mesh": "TriMesh",
    "terrakit.operators": "Erosion Exporter Filter Generator Importer Texture",
    "terrakit.parameters": "FilePath FromLayer Maskable Schedule Seed StepName parameter",
    "terrakit.recipe": "load_recipe",
    "terrakit.running": "Progress Run",
    "terrakit.sources": "Chain Source Steps",
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = [  # noqa: RUF022  (sorted as people read, case aside)
    "analyze",
    "apply",
    "Cancelled",
    "Chain",
    "DeviceError",
    "erode",
    "Erosion",
    "export",
    "Exporter",
    "FilePath",
    "Filter",
    "FromLayer",
    "generate",
    "Generator",
    "Grid",
    "Heightfield",
    "hookimpl",
    "Importer",
    "InputError",
    "KernelError",
    "load",
    "load_recipe",
    "Maskable",
    "OutputError",
    "parameter",
    "ParameterError",
    "PluginError",
    "Progress",
    "RecipeError",
    "ResourceError",
    "run",
    "Run",
    "Schedule",
    "Seed",
    "Source",
    "StepName",
    "Steps",
    "TerrakitError",
    "texture",
    "Texture",
    "TriMesh",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("terrakit")
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module 'terrakit' has no attribute {name!r}")
    return getattr(importlib.import_module(home), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
