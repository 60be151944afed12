"""Imports run one way, and every algorithm has its folder."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import terrakit

ROOT = Path(__file__).parents[1]
CORE = ROOT / "terrakit"
TREES = {"plugins": ROOT / "plugins", "adapters": ROOT / "adapters"}
PACKAGES = {
    folder.name: tree
    for tree, place in TREES.items()
    if place.is_dir()
    for folder in place.iterdir()
    if (folder / "__init__.py").is_file()
}
HEAVY = ("PIL", "pxr", "pyopencl", "rasterio", "scipy", "xarray", "matplotlib", "pytest")
CLOSED = ("terrakit.cli", "terrakit.pipeline", "terrakit.recipe", "terrakit.api")
"""Parts of the core on which no operator may lean."""

SOURCES = sorted(
    path
    for place in (CORE, *TREES.values())
    for path in place.rglob("*.py")
    if "template" not in path.parts and not any(part.startswith(".") for part in path.parts)
)


def imports(path: Path) -> Iterator[tuple[str, bool, int]]:
    """Yield every imported module, whether it is loaded with the module, and its line."""
    tree = ast.parse(path.read_text("utf-8"))
    late: set[ast.AST] = set()
    for node in ast.walk(tree):
        typing = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        if typing or isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            late.update(ast.walk(node))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node not in late, node.lineno
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            module = node.module or ""
            yield module, node not in late, node.lineno
            for alias in node.names:
                yield f"{module}.{alias.name}", node not in late, node.lineno


def breaches(where: object, forbidden: object) -> list[str]:
    """Return ``file:line imports module`` for every forbidden import of the chosen files."""
    assert callable(where)
    assert callable(forbidden)
    return [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in SOURCES
        if where(path)
        for module, at_load, line in imports(path)
        if forbidden(path, module, at_load)
    ]


def top(module: str) -> str:
    return module.partition(".")[0]


def owner(path: Path) -> str:
    """Return the package that a file belongs to."""
    place = path.relative_to(ROOT).parts
    return "terrakit" if place[0] == "terrakit" else place[1]


def test_core_imports_no_plugin_and_no_adapter() -> None:
    assert not breaches(
        lambda path: owner(path) == "terrakit", lambda _, module, __: top(module) in PACKAGES
    )


def test_plugins_and_adapters_do_not_import_each_other() -> None:
    assert not breaches(
        lambda path: owner(path) != "terrakit",
        lambda path, module, _: top(module) in PACKAGES and top(module) != owner(path),
    )


def test_operators_do_not_lean_on_the_pipeline_or_the_command_line() -> None:
    assert not breaches(
        lambda path: owner(path) != "terrakit",
        lambda _, module, __: any(module == m or module.startswith(m + ".") for m in CLOSED),
    )


def test_pyopencl_is_imported_by_compute_alone() -> None:
    assert not breaches(
        lambda path: CORE / "compute" not in path.parents,
        lambda _, module, __: top(module) == "pyopencl",
    )


def test_blender_is_imported_by_its_adapter_alone() -> None:
    assert not breaches(
        lambda path: "terrakit_blender" not in path.parts and "blender" not in path.parts,
        lambda _, module, __: top(module) in ("bpy", "bmesh", "mathutils"),
    )


def test_heavy_libraries_are_imported_where_they_are_used() -> None:
    assert not breaches(
        lambda path: path.name != "probe.py",  # a program of its own
        lambda _, module, at_load: at_load and top(module) in HEAVY,
    )


def test_test_suite_is_imported_by_nobody_else() -> None:
    assert not breaches(
        lambda path: CORE / "testing" not in path.parents,
        lambda _, module, __: module.startswith("terrakit.testing"),
    )


@pytest.mark.parametrize("tree", sorted(TREES))
def test_every_operator_has_its_readme_and_its_reference(tree: str) -> None:
    from terrakit.registry import default_registry

    missing = []
    for operator in default_registry().operators():
        package = operator.__module__.split(".")
        if PACKAGES.get(package[0]) != tree:
            continue
        folder = TREES[tree].joinpath(*package)
        if not folder.is_dir():
            folder = folder.parent
        if not (folder / "README.md").is_file():
            missing.append(f"{operator.name}: {folder.relative_to(ROOT)}/README.md")
        if list(folder.glob("*.cl")) and not (folder / "reference.py").is_file():
            missing.append(f"{operator.name}: {folder.relative_to(ROOT)}/reference.py")
    assert not missing


def test_public_names_are_sorted_and_there() -> None:
    assert terrakit.__all__ == sorted(terrakit.__all__, key=str.lower)
    assert len(set(terrakit.__all__)) == len(terrakit.__all__)
    for name in terrakit.__all__:
        assert getattr(terrakit, name) is not None
        assert name in dir(terrakit)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = terrakit.no_such_name


def test_importing_terrakit_loads_nothing_heavy() -> None:
    import subprocess
    import sys

    program = "import sys, terrakit; print(*[m for m in sys.modules if '.' not in m])"
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert not {*HEAVY, "numpy", "pydantic"} & set(told.stdout.decode().split())


def test_kernels_need_no_double_precision() -> None:
    kernels = [path for place in (CORE, *TREES.values()) for path in place.rglob("*.cl")]
    assert kernels
    for path in kernels:
        assert not {"double", "cl_khr_fp64"} & set(path.read_text("utf-8").split()), path.name
