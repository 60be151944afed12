"""What is installed is whole: kernels, recipes, the typing marker and the licence."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path

import pytest

import terrakit

REPOSITORY = Path(__file__).resolve().parents[1]
SUFFIXES = {".py", ".cl", ".toml", ".typed"}


def packaged() -> Iterator[str]:
    """Yield the path, once installed, of everything that the wheel needs."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))
    for folder in project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]:
        package = REPOSITORY / folder
        for path in sorted(package.rglob("*")):
            if path.suffix in SUFFIXES and "__pycache__" not in path.parts:
                yield path.relative_to(package.parent).as_posix()


def installed() -> set[str]:
    """Return what the installed distribution lists; skip where it only points to the sources."""
    found = distribution("terrakit")
    origin = json.loads(found.read_text("direct_url.json") or "{}")
    if origin.get("dir_info", {}).get("editable"):
        pytest.skip("an editable install points to the sources")
    return {path.as_posix() for path in found.files or ()}


def test_wheel_holds_every_source_kernel_and_recipe() -> None:
    missing = set(packaged()) - installed()
    assert not missing


def test_wheel_holds_nothing_else() -> None:
    expected = set(packaged())
    foreign = {
        name
        for name in installed()
        if Path(name).suffix in SUFFIXES and "dist-info" not in name and name not in expected
    }
    assert not foreign


def test_licence_is_installed() -> None:
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in installed())


def test_the_list_of_what_is_needed_is_no_empty_one() -> None:
    names = list(packaged())
    for expected in (
        "terrakit/py.typed",
        "terrakit/recipes/alps.toml",
        "terrakit/compute/exact.cl",
    ):
        assert expected in names
    assert any(name.startswith("terrakit_erosion/") and name.endswith(".cl") for name in names)
    assert not any("template" in name for name in names)


@pytest.mark.parametrize("name", terrakit.__all__)
def test_public_name_is_there(name: str) -> None:
    assert getattr(terrakit, name) is not None


def test_public_names_are_sorted_as_people_read() -> None:
    assert terrakit.__all__ == sorted(terrakit.__all__, key=str.lower)
