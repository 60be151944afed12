"""The version that files are marked with."""

from __future__ import annotations


def terrakit_version() -> str:
    """Return the version of the installed terrakit, or ``unknown``."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("terrakit")
    except PackageNotFoundError:
        return "unknown"
