"""Build ``docs/reference`` from what the operators declare: ``python docs/build_reference.py``.

Nothing in that folder is written by hand. With ``--check`` nothing is written at all: the exit
code is 1 and the files are named where the folder is not what it would be.
"""

from __future__ import annotations

import argparse
import inspect
import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from terrakit.cli.describe import snippet
from terrakit.layers import VOCABULARY
from terrakit.operators import Operator
from terrakit.parameters import bounds_text, is_maskable, is_source, type_text, unit_of
from terrakit.registry import Registry
from terrakit.schema import recipe_schema

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "docs" / "reference"
TITLES = {
    "generator": "Generators",
    "filter": "Filters",
    "erosion": "Erosion",
    "texture": "Textures",
    "importer": "Importers",
    "exporter": "Exporters",
}
LOCALITY = {
    "pointwise": "each sample by itself",
    "stencil": "a neighbourhood of each sample",
    "global": "the whole terrain",
}


def main() -> int:
    """Write the reference, or check it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if out of date")
    chosen = parser.parse_args()
    pages = reference_pages()
    outdated = stale_files(pages)
    if chosen.check:
        for name in outdated:
            sys.stderr.write(f"docs/reference/{name} is stale\n")
        if outdated:
            sys.stderr.write("run: python docs/build_reference.py\n")
        return 1 if outdated else 0
    FOLDER.mkdir(exist_ok=True)
    for name in outdated:
        if name in pages:
            (FOLDER / name).write_text(pages[name], encoding="utf-8", newline="\n")
        else:
            (FOLDER / name).unlink()
    sys.stdout.write(f"{len(pages)} files, {len(outdated)} changed\n")
    return 0


def reference_pages() -> dict[str, str]:
    """Return every file of the reference by its name."""
    registry = Registry(third_parties=False)
    operators = registry.operators()
    pages = {f"{operator.name}.md": operator_page(operator) for operator in operators}
    pages["README.md"] = contents_page(operators)
    pages["layers.md"] = layers_page(operators)
    pages["recipe.schema.json"] = json.dumps(recipe_schema(registry), indent=1) + "\n"
    return pages


def stale_files(pages: dict[str, str]) -> list[str]:
    """Return the names of the files that are missing, too many or different."""
    present = {path.name: path for path in FOLDER.iterdir()} if FOLDER.is_dir() else {}
    different = (
        name
        for name, text in pages.items()
        if name not in present
        or _content(name, present[name].read_text("utf-8")) != _content(name, text)
    )
    return sorted({*different, *(present.keys() - pages.keys())})


def _content(name: str, text: str) -> Any:
    """Return what counts in a file: of JSON the content, not the order of its keys."""
    return json.loads(text) if name.endswith(".json") else text


def contents_page(operators: list[type[Operator]]) -> str:
    """Return the list of all operators."""
    lines = ["# Reference", "", _generated(), ""]
    for kind, title in TITLES.items():
        lines += [f"## {title}", ""]
        lines += [
            f"- [{operator.name}]({operator.name}.md): {operator.summary()}"
            for operator in operators
            if operator.kind == kind
        ]
        lines.append("")
    lines += [
        "## Shared",
        "",
        "- [layers](layers.md): the vocabulary of layers, and who reads and writes them.",
        "- [recipe.schema.json](recipe.schema.json): JSON Schema of a recipe, for editors.",
    ]
    return _page(lines)


def layers_page(operators: list[type[Operator]]) -> str:
    """Return the vocabulary of layers."""
    lines = [
        "# Layers",
        "",
        _generated(),
        "",
        "A layer is a float32 field of the terrain's own shape. A name that ends in `_` is a",
        "family: `material_` stands for `material_grass`, `material_rock` and so on.",
        "",
        "| layer | unit | meaning | written by | read or used by |",
        "|---|---|---|---|---|",
    ]
    for kind in VOCABULARY.values():
        written = [o for o in operators if any(_belongs(n, kind.name) for n in o.writes)]
        taken = [o for o in operators if any(_belongs(n, kind.name) for n in (*o.reads, *o.uses))]
        cells = (f"`{kind.name}`", kind.unit, kind.meaning, _links(written), _links(taken))
        lines.append(f"| {' | '.join(cells)} |")
    return _page(lines)


def operator_page(operator: type[Operator]) -> str:
    """Return the page of one operator."""
    lines = [f"# {operator.name}", "", _generated(), "", *_markdown(inspect.getdoc(operator) or "")]
    lines += ["", "## In a recipe", "", "```toml", *snippet(operator), "```", ""]
    if operator.model_fields:
        lines += [
            "## Parameters",
            "",
            "| parameter | default | allowed | meaning |",
            "|---|---|---|---|",
            *(_row(name, field) for name, field in operator.model_fields.items()),
            "",
        ]
    if operator.presets:
        lines += ["## Presets", "", "| preset | sets |", "|---|---|"]
        lines += [f"| `{name}` | {_settings(given)} |" for name, given in operator.presets.items()]
        lines.append("")
    lines += ["## Facts", "", *_facts(operator)]
    return _page(lines)


def _facts(operator: type[Operator]) -> Iterator[str]:
    yield f"- **Kind**: {operator.kind}"
    if operator.kind not in ("generator", "importer"):
        yield f"- **Works on**: {', '.join(surface.__name__ for surface in operator.surfaces)}"
    for title, names in (
        ("Reads", operator.reads),
        ("Uses if there", operator.uses),
        ("Writes", operator.writes),
    ):
        if names:
            yield f"- **{title}**: " + ", ".join(f"[`{name}`](layers.md)" for name in names)
    suffixes = getattr(operator, "suffixes", ()) or filter(None, [getattr(operator, "suffix", "")])
    shown = ", ".join(f"`{suffix}`" for suffix in suffixes)
    if shown:
        yield f"- **Extensions**: {shown}"
    if operator.kind in ("generator", "filter", "erosion", "texture"):
        same = "yes" if operator.parity == "exact" else f"no ({operator.parity})"
        yield f"- **Same bytes on every device**: {same}"
        yield f"- **Looks at**: {LOCALITY.get(operator.locality, operator.locality)}"
    yield f"- **Memory at its peak**: about {operator.fields * 4} bytes a sample"
    if operator.cites:
        yield f"- **Papers**: {'; '.join(operator.cites)}"
    page = _own_readme(operator)
    if page is not None:
        yield f"- **More**: [{page.as_posix()}](../../{page.as_posix()})"


def _own_readme(operator: type[Operator]) -> Path | None:
    """Return the README beside the operator's code, if it has one."""
    module = operator.__module__.split(".")
    for top in ("plugins", "adapters"):
        for depth in (2, 1):
            page = Path(top, *module[:depth], "README.md")
            if len(module) >= depth and (REPOSITORY / page).is_file():
                return page
    return None


def _row(name: str, field: FieldInfo) -> str:
    allowed = bounds_text(field).replace("x", name) or type_text(field.annotation)
    if bounds_text(field) and is_maskable(field.annotation):
        allowed += "; maskable"
    if bounds_text(field) and is_source(field.annotation):
        allowed += "; or a terrain"
    unit = unit_of(field)
    if field.is_required():
        default = "must be given"
    elif field.default is None:
        default = f"none ({unit})" if unit else "none"
    else:
        shown = field.default if isinstance(field.default, BaseModel) else _plain(field.default)
        default = f"`{json.dumps(shown, default=str)}` {unit}".rstrip()
    return f"| `{name}` | {default} | {_cell(allowed)} | {_cell(field.description or '')} |"


def _settings(given: dict[str, Any]) -> str:
    return ", ".join(f"`{k} = {json.dumps(_plain(v))}`" for k, v in given.items()) or "the defaults"


def _plain(value: Any) -> Any:
    """Return a value with the models in it, such as beds of rock, as the tables that they are."""
    return to_jsonable_python(value, exclude_none=True)


def _markdown(docstring: str) -> Iterator[str]:
    """Return a docstring as Markdown: roles and double colons are Sphinx's, headings fit."""
    for line in docstring.splitlines():
        line = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", line)
        yield re.sub(r"(?<=\S)::$", ":", line)


def _belongs(declared: str, name: str) -> bool:
    return declared == name or (name.endswith("_") and declared.startswith(name))


def _links(operators: Iterable[type[Operator]]) -> str:
    return ", ".join(f"[{operator.name}]({operator.name}.md)" for operator in operators)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _generated() -> str:
    return "<!-- Generated by docs/build_reference.py; do not edit. -->"


def _page(lines: Iterable[str]) -> str:
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    raise SystemExit(main())
