"""The command line as a black box: a child process, its exit code, what it says and leaves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

RECIPE = """\
size = 2000.0
samples = 33
seed = 7

[[step]]
use = "fbm"

[[step]]
use = "thermal"
iterations = 4

[[step]]
use = "npz"
"""


@dataclass
class Outcome:
    """How a child process ended."""

    code: int
    out: str
    err: str

    def refused(self, *words: str, code: int = 2) -> Outcome:
        """Assert the form of a refusal, and that it says every one of ``words``."""
        assert self.code == code, self
        lines = self.err.strip().splitlines()
        assert 1 <= len(lines) <= 3, self.err
        assert lines[-1].startswith("terrakit: error: "), self.err
        assert "Traceback" not in self.err
        for word in words:
            assert word.lower() in self.err.lower(), (word, self.err)
        return self

    def worked(self) -> Outcome:
        """Assert that the child did what it was asked."""
        assert self.code == 0, self
        assert "Traceback" not in self.err
        return self


@dataclass
class CommandLine:
    """Runs ``python -m terrakit`` in a folder of the test."""

    folder: Path
    environment: dict[str, str] = field(default_factory=dict)

    def __call__(self, *arguments: str | bytes | Path, timeout: float = 60, **more: Any) -> Outcome:
        child = self.start(*arguments, **more)
        try:
            out, err = child.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            child.kill()
            child.communicate()
            raise
        return Outcome(
            child.returncode, (out or b"").decode(errors="replace"), err.decode(errors="replace")
        )

    def start(
        self, *arguments: str | bytes | Path, env: Mapping[str, str | None] = {}, **more: Any
    ) -> subprocess.Popen[bytes]:
        environment: dict[str, str] = {**os.environ, **self.environment}
        for key, value in env.items():
            environment.pop(key, None)
            if value is not None:
                environment[key] = value
        settings: dict[str, Any] = {
            "cwd": self.folder,
            "env": environment,
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
        }
        command: Sequence[Any] = [sys.executable, "-m", "terrakit", *arguments]
        return subprocess.Popen(command, **(settings | more))

    def many(self, commands: list[list[str]]) -> list[int]:
        """Run many commands in one child and return their exit codes."""
        script = (
            "import json, sys\nfrom terrakit.cli.program import run\n"
            "codes = [run(command) for command in json.loads(sys.argv[1])]\n"
            "print(json.dumps(codes), file=sys.stderr)"
        )
        child = subprocess.run(
            [sys.executable, "-c", script, json.dumps(commands)],
            cwd=self.folder,
            env={**os.environ, **self.environment},
            capture_output=True,
            text=True,
            check=True,
        )
        codes: list[int] = json.loads(child.stderr.splitlines()[-1])
        return codes

    def recipe(self, text: str = RECIPE, name: str = "hills.toml") -> Path:
        """Write a recipe into the folder."""
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def plugin(
        self,
        distribution: str,
        source: str,
        *,
        module: str | None = None,
        entry: str = "operators",
        group: str = "terrakit",
    ) -> None:
        """Install a plugin as pip would: a module and its dist-info on the path."""
        site = self.folder / "site"
        module = module or distribution.replace("-", "_")
        about = site / f"{distribution.replace('-', '_')}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n"
        )
        (about / "entry_points.txt").write_text(f"[{group}]\n{entry} = {module}\n")
        (site / f"{module}.py").write_text(textwrap.dedent(source))
        self.environment["PYTHONPATH"] = str(site)

    def at_start(self, source: str) -> None:
        """Run ``source`` in every child before anything else."""
        site = self.folder / "site"
        site.mkdir(exist_ok=True)
        (site / "sitecustomize.py").write_text(textwrap.dedent(source))
        self.environment["PYTHONPATH"] = str(site)


@pytest.fixture
def terrakit(tmp_path: Path) -> CommandLine:
    """Return the command line, at work in an empty folder."""
    work = tmp_path / "work"
    work.mkdir()
    return CommandLine(work)


@pytest.fixture(scope="session")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an .npz of 65 x 65 samples with every layer that exporters like."""
    folder = tmp_path_factory.mktemp("terrain")
    line = CommandLine(folder)
    line("generate", "fbm", "bare.npz", "--samples", "65", "--device", "numpy").worked()
    line("texture", "slope_height", "bare.npz", "hills.npz", "--device", "numpy").worked()
    return folder / "hills.npz"


@pytest.fixture
def tmpfs(tmp_path: Path) -> Iterator[Callable[..., Path]]:
    """Return a function that mounts a file system of its own; needs root."""
    mounted: list[Path] = []

    def mount(size: str = "8k") -> Path:
        place = tmp_path / f"disk{len(mounted)}"
        place.mkdir()
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)],
            capture_output=True,
            check=False,
        )
        if done.returncode:
            pytest.skip("may not mount a file system here")
        mounted.append(place)
        return place

    yield mount
    for place in mounted:
        subprocess.run(["umount", "-l", str(place)], check=True)


@pytest.fixture
def read_only(tmpfs: Callable[..., Path]) -> Path:
    """Return a folder in which not even root may write; it holds ``old.txt``."""
    place = tmpfs("64k")
    (place / "old.txt").write_text("old")
    subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
    return place
