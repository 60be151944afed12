"""A real DEM goes in, is measured, erodes, and comes out three ways."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import terrakit

SPACING = 83.0


@pytest.fixture(scope="module")
def path() -> Path:
    """The Jacksboro fault, Tennessee: 344 x 403 whole metres at 3 arc seconds."""
    cbook = pytest.importorskip("matplotlib.cbook")
    return Path(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))


@pytest.fixture(scope="module")
def land(path: Path) -> terrakit.Heightfield:
    surface = terrakit.load(path, spacing=SPACING)
    assert isinstance(surface, terrakit.Heightfield)
    return surface


@pytest.fixture(scope="module")
def worn(land: terrakit.Heightfield) -> tuple[terrakit.Heightfield, list[terrakit.Run]]:
    """Two hundred thousand years later, textured."""
    runs = [terrakit.Run(3).for_step(name) for name in ("stream_power", "thermal")]
    surface = terrakit.erode(
        land,
        "stream_power",
        run=runs[0],
        duration=2e5,
        time_step=2e4,
        uplift_rate=1e-4,
        erodibility=2e-6,
    )
    surface = terrakit.erode(surface, "thermal", run=runs[1], talus_angle=20.0)
    return terrakit.texture(surface, "slope_height"), runs


def test_it_is_read_as_it_is(path: Path, land: terrakit.Heightfield) -> None:
    with np.load(path) as archive:
        assert archive["elevation"].dtype == np.int16
        np.testing.assert_array_equal(land.elevation, archive["elevation"])
    assert land.shape == (344, 403)
    assert land.spacing == SPACING
    assert terrakit.analyze(land).verdict == "pass"


def test_it_erodes_and_stays_land(
    land: terrakit.Heightfield, worn: tuple[terrakit.Heightfield, list[terrakit.Run]]
) -> None:
    surface, runs = worn
    change = surface.elevation - land.elevation
    assert -250 < change.min() < -1
    assert change.max() < 100
    assert np.abs(change).mean() > 1
    assert np.corrcoef(surface.elevation.ravel(), land.elevation.ravel())[0, 1] > 0.95
    analysis = terrakit.analyze(surface)
    assert analysis.count("fail") == 0, analysis.table()
    weights = [surface.layer(name) for name in surface if name.startswith("material_")]
    np.testing.assert_allclose(np.sum(weights, axis=0), 1.0, atol=1e-6)
    for run in runs:
        account = run.ledger.accounts["rock"]
        assert account.moved > 0
        assert abs(account.residual) <= 1e-9 * account.start


def test_it_comes_out_as_obj(
    worn: tuple[terrakit.Heightfield, list[terrakit.Run]], tmp_path: Path
) -> None:
    surface, _ = worn
    files = terrakit.export(surface, tmp_path / "land.obj")
    assert all(file.stat().st_size for file in files)
    points = [
        [float(word) for word in line.split()[1:4]]
        for line in (tmp_path / "land.obj").read_text().splitlines()
        if line.startswith("v ")
    ]
    assert len(points) == surface.elevation.size
    ends = np.array(points).T
    spans = sorted(float(np.ptp(axis)) for axis in ends)
    assert spans[0] == pytest.approx(float(np.ptp(surface.elevation)), abs=0.1)
    assert spans[1:] == pytest.approx([343 * SPACING, 402 * SPACING], rel=1e-6)


def test_it_comes_out_as_unity_raw(
    worn: tuple[terrakit.Heightfield, list[terrakit.Run]], tmp_path: Path
) -> None:
    surface, _ = worn
    side = 257
    square = terrakit.Heightfield(surface.elevation[:side, :side], SPACING).with_layers(
        **{n: surface.layer(n)[:side, :side] for n in surface if n.startswith("material_")}
    )
    wide = terrakit.Heightfield(surface.elevation[:300, :300], SPACING)
    for terrain, settings in ((square, {}), (wide, {"resample": True})):
        folder = tmp_path / str(terrain.shape[0])
        folder.mkdir()
        files = terrakit.export(terrain, folder / "land.raw", "unity_raw", **settings)
        assert {file.suffix for file in files} >= {".raw", ".json"}
        about = json.loads((folder / "land.json").read_text())
        counts = np.fromfile(folder / "land.raw", "<u2").reshape(side, side)
        height = terrain.elevation
        share = counts[::-1].astype(np.float64) / 65535
        metres = float(height.min()) + share * float(np.ptp(height))
        if not settings:
            assert np.abs(metres - height).max() < 0.6 * np.ptp(height) / 65535
            assert any(file.suffix == ".png" for file in files)
        assert metres.mean() == pytest.approx(float(height.mean()), abs=1.0)
        assert str(side) in json.dumps(about)


def test_it_comes_out_as_usd(
    worn: tuple[terrakit.Heightfield, list[terrakit.Run]], tmp_path: Path
) -> None:
    surface, _ = worn
    files = terrakit.export(surface, tmp_path / "land.usda")
    assert all(file.stat().st_size for file in files)
    text = (tmp_path / "land.usda").read_text()
    assert text.startswith("#usda 1.0")
    assert "metersPerUnit = 1" in text
    assert "point3f[] points" in text
