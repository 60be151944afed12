"""What the pages show is run: Python, recipes and commands, on small terrains.

A page's blocks run in order in one empty folder and share their names, as a reader would do it. A
block whose first line is ``# name.py`` or ``# name.toml``, or below which the text says "Save it as
`name.toml`", is saved under that name. Python marked ``no-run`` is only compiled.
"""

from __future__ import annotations

import functools
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import terrakit.api
from terrakit.cli.commands import terrakit as command_line
from terrakit.cli.messages import Settings
from terrakit.heightfield import Heightfield
from terrakit.operators import Generator, Importer
from terrakit.recipe import Header, load_recipe
from terrakit.registry import default_registry
from terrakit.testing import rough_terrain

REPOSITORY = Path(__file__).resolve().parents[2]
MOST = 65
"""Samples a side, whatever the page says."""
FENCE = re.compile(r"^```(?P<language>\w+)(?P<marks>[^\n]*)\n(?P<text>.*?)^```$", re.M | re.S)
OPTIONAL = ("bpy", "xarray", "terrakit_hello")
SLOW = ("doctor",)
"""Commands that are parsed and not run."""


@dataclass(frozen=True)
class Block:
    """One fenced block of a page that says what language it is in."""

    page: Path
    line: int
    language: str
    marks: tuple[str, ...]
    text: str
    below: str = ""
    """The text that follows it."""

    @property
    def file(self) -> str | None:
        """The name under which a reader saves it."""
        named = re.match(r"# ([\w.-]+\.(?:py|toml))$", self.text.partition("\n")[0])
        named = named or re.match(r"\s*Save it as `([\w.-]+\.toml)`", self.below)
        return named.group(1) if named else None

    @property
    def place(self) -> str:
        """Page and line."""
        return f"{self.page.relative_to(REPOSITORY)}:{self.line}"


def blocks_of(page: Path) -> Iterator[Block]:
    text = page.read_text("utf-8")
    for found in FENCE.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        marks = tuple(found["marks"].split())
        below = text[found.end() : found.end() + 200]
        yield Block(page, line, found["language"], marks, found["text"], below)


def pages(*patterns: str) -> list[Path]:
    found = sorted({page for pattern in patterns for page in REPOSITORY.glob(pattern)})
    return [page for page in found if "template" not in page.parts]


READ = pages("*.md", "docs/*.md")
OPERATORS = pages("plugins/*/README.md", "plugins/*/*/README.md", "adapters/**/README.md")
REFERENCE = pages("docs/reference/*.md")


@pytest.mark.parametrize("page", READ, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = list(blocks_of(page))
    if not blocks:
        pytest.skip("shows nothing")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(terrakit.api, "run", _small_run(terrakit.api.run))
    monkeypatch.setattr(terrakit.api, "generate", _small_generate(terrakit.api.generate))
    before = set(sys.modules)
    names: dict[str, Any] = {"__name__": "page"}
    try:
        for block in blocks:
            _try(block, names, tmp_path)
    finally:
        for name in set(sys.modules) - before:
            if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
                del sys.modules[name]


@pytest.mark.parametrize(
    "page", [*OPERATORS, *REFERENCE], ids=lambda page: str(page.relative_to(REPOSITORY))
)
def test_recipes_of_operator_pages(page: Path, tmp_path: Path) -> None:
    blocks = [block for block in blocks_of(page) if block.language == "toml"]
    if not blocks:
        pytest.skip("shows no recipe")
    for block in blocks:
        _check_recipe(block, tmp_path)


def _try(block: Block, names: dict[str, Any], folder: Path) -> None:
    if block.file is not None:
        (folder / block.file).write_text(block.text, encoding="utf-8")
    if block.language == "python":
        compiled = compile("\n" * block.line + block.text, block.place, "exec", dont_inherit=True)
        if "no-run" in block.marks or block.file is not None:
            return
        try:
            exec(compiled, names)
        except ModuleNotFoundError as error:
            if error.name not in OPTIONAL:
                raise
    elif block.language == "toml":
        _check_recipe(block, folder)
    elif block.language in ("console", "sh", "shell", "bash"):
        for line in block.text.replace("\\\n", " ").splitlines():
            command = line.removeprefix("$ ").strip()
            if command.startswith("terrakit ") and "no-run" not in block.marks:
                _try_command(command, block)


def _check_recipe(block: Block, folder: Path) -> None:
    """Load a recipe; a part of one is completed first."""
    document = tomllib.loads(block.text)
    if not ({"step"} | set(Header.model_fields)) & set(document):
        return  # a pyproject.toml
    text = block.text
    steps = document.get("step", [])
    kinds = [default_registry().get(step["use"]) for step in steps]
    if not kinds or not issubclass(kinds[0], (Generator, Importer)):
        head, mark, rest = text.partition("[[step]]")
        text = f'{head}\n[[step]]\nuse = "fbm"\n{mark}{rest}'
    for key, value in (("samples", MOST), ("size", 1000.0)):
        present = set(document) & {"size", "spacing", "samples"}
        if len(present) + (key == "size" and "samples" not in document) < 2:
            text = f"{key} = {value}\n{text}"
    completed = folder / f"completed_{block.line}.toml"
    completed.write_text(text, encoding="utf-8")
    load_recipe(completed)


def _try_command(command: str, block: Block) -> None:
    words = shlex.split(command.partition(" | ")[0].partition(" > ")[0], comments=True)[1:]
    settings = Settings()
    try:
        words, run = _small_command(words)
        with command_line.make_context("terrakit", words, obj=settings) as context:
            code = command_line.invoke(context) if run else _parse(command_line, context, words)
    except click.exceptions.Exit as end:
        code = end.exit_code
    except click.ClickException as error:
        pytest.fail(f"{block.place}: {command}: {error.format_message()}")
    assert not isinstance(code, int) or code == 0, f"{block.place}: {command}"


def _parse(command: click.Command, context: click.Context, words: list[str]) -> int:
    """Parse a command line down to its last command without running it."""
    while isinstance(command, click.Group):
        name, found, words = command.resolve_command(context, words)
        assert found is not None, name
        command = found
        context = command.make_context(name, list(words), parent=context)
        if isinstance(command, click.Group):
            words = [*context._protected_args, *context.args]
    return 0


def _small_command(words: list[str]) -> tuple[list[str], bool]:
    """Return a command line for a small terrain, and whether to run it or only to parse it."""
    plain = [word for word in words if not word.startswith("-")]
    name = plain[0] if plain else ""
    if name in SLOW or "--device" in words:
        return words, False
    if name == "run" and load_recipe(plain[1]).grid is not None:
        return [*words, "--set", f"samples={MOST}"], True
    if name == "generate" and len(plain) > 2 and "--help" not in words:
        if "--samples" in words:
            at = words.index("--samples")
            words = [*words[:at], *words[at + 2 :]]
        elif "--size" in words and "--spacing" in words:
            return words, False
        return [*words, "--samples", str(MOST)], True
    return words, True


def _small_run(run: Any) -> Any:
    @functools.wraps(run)
    def small(recipe: Any, *arguments: Any, settings: Any = None, **others: Any) -> Any:
        if load_recipe(recipe, settings).grid is not None:
            settings = {**(settings or {}), "samples": MOST}
        return run(recipe, *arguments, settings=settings, **others)

    return small


def _small_generate(generate: Any) -> Any:
    @functools.wraps(generate)
    def small(name: str, shape: Any = MOST, *arguments: Any, **others: Any) -> Any:
        sides = (shape, shape) if isinstance(shape, int) else shape
        rows, cols = (min(side, MOST) for side in sides)
        return generate(name, (rows, cols), *arguments, **others)

    return small


def test_the_plugin_of_the_page_is_found_and_keeps_the_contract(tmp_path: Path) -> None:
    """Install the page's files as pip would, and try them in a process of their own."""
    blocks = {b.file: b for b in blocks_of(REPOSITORY / "docs" / "plugins.md") if b.file}
    project = tomllib.loads(blocks["pyproject.toml"].text)["project"]
    modules = [name for name in blocks if name.endswith(".py") and not name.startswith("test_")]
    for name in blocks:
        (tmp_path / name).write_text(blocks[name].text, encoding="utf-8")
    installed = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n",
        encoding="utf-8",
    )
    entries = "\n".join(f"{k} = {v}" for k, v in project["entry-points"]["terrakit"].items())
    (installed / "entry_points.txt").write_text(f"[terrakit]\n{entries}\n", encoding="utf-8")
    script = f"""
import importlib, sys
sys.path.insert(0, {str(tmp_path)!r})
from terrakit.registry import default_registry
from terrakit.testing import broken_contracts
mine = [o for o in default_registry().operators() if o.__module__ in {[m[:-3] for m in modules]!r}]
assert mine, [(p.label, p.problem) for p in default_registry().plugins()]
for operator in mine:
    broken = broken_contracts(operator)
    assert not broken, broken
"""
    child = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert child.returncode == 0, child.stderr


def test_blocks_are_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong example of each kind fails."""
    monkeypatch.chdir(tmp_path)
    page = REPOSITORY / "docs" / "made_up.md"
    wrong = [
        Block(page, 1, "python", (), "import terrakit\nterrakit.generate('fmb')\n"),
        Block(page, 1, "toml", (), '[[step]]\nuse = "thermal"\ntalus = 3\n'),
        Block(page, 1, "console", (), "$ terrakit describe nothing_like_it\n"),
        Block(page, 1, "console", (), "$ terrakit doctor --no-such-option\n"),
    ]
    for block in wrong:
        with pytest.raises((Exception, pytest.fail.Exception)):
            _try(block, {}, tmp_path)
    right = Block(page, 1, "toml", (), '[[step]]\nuse = "thermal"\ntalus_angle = 3\n')
    _try(right, {}, tmp_path)


@pytest.fixture(autouse=True)
def _files(tmp_path: Path) -> None:
    """Lay out the files that examples take for granted."""
    terrain = rough_terrain((MOST, MOST), 10.0)
    assert isinstance(terrain, Heightfield)
    np.save(tmp_path / "heights.npy", terrain.elevation)
    for name in ("terrain.npz", "alps.npz", "dem.npz", "island.npz"):
        terrakit.api.export(terrain, tmp_path / name)
