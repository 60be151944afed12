"""The generated reference and the pages agree with the code."""

from __future__ import annotations

import inspect
import re
import runpy
from pathlib import Path

import pytest

from terrakit import hookspecs

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
PAGES = sorted(
    {
        *REPOSITORY.glob("*.md"),
        *DOCS.rglob("*.md"),
        *(REPOSITORY / "benchmarks").glob("*.md"),
    }
)


def test_reference_is_what_the_declarations_say() -> None:
    builder = runpy.run_path(str(DOCS / "build_reference.py"))
    stale = builder["stale_files"](builder["reference_pages"]())
    assert not stale, f"run python docs/build_reference.py: {stale}"


def test_a_stale_reference_is_noticed(tmp_path: Path) -> None:
    builder = runpy.run_path(str(DOCS / "build_reference.py"))
    expected = builder["reference_pages"]()
    builder["stale_files"].__globals__["FOLDER"] = tmp_path
    for name, text in expected.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert builder["stale_files"](expected) == []
    (tmp_path / "thermal.md").write_text("older", encoding="utf-8")
    (tmp_path / "layers.md").unlink()
    (tmp_path / "gone.md").write_text("of an operator that is no more", encoding="utf-8")
    assert builder["stale_files"](expected) == ["gone.md", "layers.md", "thermal.md"]


@pytest.mark.parametrize("hook", [name for name in dir(hookspecs) if name.startswith("terrakit_")])
def test_every_hook_is_documented_with_its_signature(hook: str) -> None:
    arguments = ", ".join(inspect.signature(getattr(hookspecs, hook)).parameters)
    page = (DOCS / "plugins.md").read_text("utf-8")
    assert f"`{hook}({arguments})`" in page


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_links_lead_to_files(page: Path) -> None:
    prose = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
    broken = [
        target
        for target in re.findall(r"\]\(([^)\s]+)\)", prose)
        if "://" not in target
        and not target.startswith(("#", "mailto:"))
        and not (page.parent / target.partition("#")[0]).exists()
    ]
    assert not broken
