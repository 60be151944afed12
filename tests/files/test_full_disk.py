"""A write that fails leaves the old files whole, the new ones absent and no rubbish."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest

from terrakit.errors import OutputError
from terrakit.heightfield import Heightfield
from terrakit.running import Run
from terrakit_files import terrakit_exporters


@pytest.mark.parametrize("kind", terrakit_exporters(), ids=lambda kind: kind.name)
def test_full_disk(tmp_path, monkeypatch, kind):
    path = tmp_path / f"a{kind.suffix}"
    path.write_bytes(b"the old file")

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    terrain = Heightfield(np.arange(81.0).reshape(9, 9), 1.0)
    with pytest.raises(OutputError, match=r"no space left on the disk"):
        kind().export(terrain, path, Run())
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == b"the old file"


@pytest.mark.parametrize("kind", terrakit_exporters(), ids=lambda kind: kind.name)
def test_odd_names(tmp_path, kind):
    terrain = Heightfield(np.arange(81.0).reshape(9, 9), 1.0)
    for name in ("with blank", "-lead", "a'b\"c", "ü\nä", "x" * 150):
        files = kind().export(terrain, tmp_path / f"{name}{kind.suffix}", Run())
        assert all(file.is_file() for file in files)
        assert files[0].name == f"{name}{kind.suffix}"
