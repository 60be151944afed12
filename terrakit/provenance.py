"""What files say about where they came from."""

from __future__ import annotations


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution, or ``unknown``."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"


def terrakit_version() -> str:
    """Return the version of the installed terrakit, or ``unknown``."""
    return version_of("terrakit")
