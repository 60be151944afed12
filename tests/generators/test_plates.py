"""Plates: cells of the nearest site, rigid motion, and what happens where they meet."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Heightfield, ParameterError, Run
from terrakit_generators.plates import BUOYANCY, CRUST_THICKNESS, Plates
from terrakit_generators.plates import reference as definition

PLAIN: dict[str, Any] = {"warp": 0.0, "size_variation": 0.0, "octaves": 2}
SIZE = 2e6


def made(shape: tuple[int, int] = (96, 128), spacing: float = 8e4, **settings: Any) -> Heightfield:
    seed = settings.pop("run_seed", 4)
    origin = settings.pop("origin", None)
    return Plates(**settings).generate(Grid(shape, spacing, origin), Run(seed))


def points(terrain: Heightfield) -> NDArray[np.float64]:
    x, y = terrain.origin
    rows, cols = terrain.shape
    east, north = np.meshgrid(
        x + np.arange(cols) * terrain.spacing, y - np.arange(rows) * terrain.spacing
    )
    return np.stack((east, north), axis=-1).reshape(-1, 2)


def sites(plates: Plates, terrain: Heightfield) -> tuple[NDArray[np.float64], definition.Sites]:
    """Return the sites' places in the world, metres, and their table."""
    row = plates._lattice_row(terrain.grid, plates.plate_size, (1.0, 0.0), (0, 0), "plate_size")
    found = plates._sites(terrain.grid, np.array(row), Run(4))
    j, i = np.divmod(np.arange(len(found.table)), found.shape[1])
    cell = np.stack((i + found.first[0], j + found.first[1]), axis=-1)
    return (cell + found.table[:, :2].astype(np.float64)) * plates.plate_size, found


def moved(change: Any, **settings: Any) -> dict[str, NDArray[np.float32]]:
    """Return the layers with the motions of the sites changed."""
    plates, grid, run = Plates(**settings), Grid((64, 96), 1e5), Run(4)
    place = np.array(plates._lattice_row(grid, plates.plate_size, (1.0, 0.0), (0, 0), "plate_size"))
    found = plates._sites(grid, place, run)
    table = found.table.copy()
    change(table, found)
    return definition.plates(
        grid.shape,
        *plates._noises(grid, run),
        plates.octaves,
        place,
        dataclasses.replace(found, table=table),
        plates._settings(),
    )


def test_plates_are_the_cells_of_the_nearest_site() -> None:
    from scipy.spatial import cKDTree

    plates = Plates(**PLAIN)
    terrain = made(**PLAIN)
    place, found = sites(plates, terrain)
    distance, index = cKDTree(place).query(points(terrain), k=2)
    clear = distance[:, 1] - distance[:, 0] > 10.0  # metres; lattice positions are rounded
    assert clear.mean() > 0.999
    owner = terrain.layer("plate").ravel()
    assert np.array_equal(owner[clear], found.identity[index[clear, 0]])
    assert np.array_equal(
        terrain.layer("plate_type").ravel()[clear], found.table[index[clear, 0], 6]
    )


def test_boundary_distance_is_that_of_the_nearest_bisector() -> None:
    plates = Plates(**PLAIN)
    terrain = made(**PLAIN)
    place, _ = sites(plates, terrain)
    at = points(terrain)
    square = ((at[:, None, :] - place[None]) ** 2).sum(axis=-1)
    owner = square.argmin(axis=1)
    apart = np.linalg.norm(place[None] - place[owner][:, None, :], axis=-1)
    apart[np.arange(len(at)), owner] = np.inf
    half = (square - square.min(axis=1, keepdims=True)) / (2 * apart)
    half[np.arange(len(at)), owner] = np.inf
    expected = half.min(axis=1)
    assert np.abs(terrain.layer("boundary_distance").ravel() - expected).max() < 20.0


def test_numbers_of_plates_are_the_same_in_every_map() -> None:
    coarse = made((25, 33), 4e4 * 8, origin=(0.0, 0.0))
    fine = made((97, 129), 4e4 * 2, origin=(0.0, 0.0))
    number = fine.layer("plate")
    # A border may run between the sample's two roundings
    assert (number[::4, ::4] == coarse.layer("plate")).mean() > 0.995
    assert (number == np.floor(number)).all()
    assert 0 <= number.min() < number.max() < 2**24
    assert 10 < len(np.unique(number)) < 80


def test_common_motion_raises_nothing() -> None:
    def together(table: NDArray[np.float32], _: object) -> None:
        table[:, 3:6] = (0.7, -0.4, 0.0)

    layers = moved(together)
    for name in ("convergence", "shear", "uplift", "boundary_class"):
        assert not layers[name].any(), name


def test_common_rotation_raises_nothing() -> None:
    def turning(table: NDArray[np.float32], found: definition.Sites) -> None:
        j, i = np.divmod(np.arange(len(table)), found.shape[1])
        x, y = i + table[:, 0], j + table[:, 1]
        table[:, 3], table[:, 4], table[:, 5] = -0.3 * y, 0.3 * x, 0.3

    assert np.abs(moved(turning)["convergence"]).max() < 1e-5 * 0.05
    assert np.abs(moved(lambda *_: None)["convergence"]).max() > 0.02


def test_reversed_motion_turns_collisions_into_rifts() -> None:
    def reverse(table: NDArray[np.float32], _: object) -> None:
        table[:, 3:6] *= -1

    forth, back = moved(lambda *_: None), moved(reverse)
    for name in ("convergence", "shear", "motion_east", "motion_north"):
        assert np.array_equal(forth[name], -back[name]), name
    was, became = forth["boundary_class"], back["boundary_class"]
    assert np.isin(became[was == definition.COLLISION], definition.RIFT).all()
    assert np.isin(became[was == definition.RIDGE], definition.SUBDUCTION).all()
    assert (became[was == definition.TRANSFORM] == definition.TRANSFORM).all()
    assert {1, 2, 3, 4, 5} <= set(np.unique(was).astype(int))


def test_still_plates_do_nothing() -> None:
    terrain = made(plate_speed=0.0)
    for name in ("convergence", "shear", "uplift", "boundary_class", "motion_east"):
        assert not terrain.layer(name).any(), name


def test_uplift_of_a_collision_balances_the_crust_that_comes_in() -> None:
    # Two continents, one closing on the other: all other sites stand still with the second
    def closing(table: NDArray[np.float32], found: definition.Sites) -> None:
        table[:, 6] = 1.0
        table[:, 3:6] = 0.0
        rows, cols = found.shape
        table[:, 0] = table[:, 1] = 0.5
        table.reshape(rows, cols, -1)[:, : -found.first[0] + 1, 3] = 1.0

    settings = {**PLAIN, "coast_variation": 0.0, "boundary_width": 1e5, "plate_speed": 0.04}
    plates, grid = Plates(**settings), Grid((3, 161), 2.5e4, (0.0, 0.3 * SIZE))
    place = np.array(plates._lattice_row(grid, SIZE, (1.0, 0.0), (0, 0), "plate_size"))
    found = plates._sites(grid, place, Run(4))
    table = found.table.copy()
    table[:, 2] = 0.0
    closing(table, found)
    layers = definition.plates(
        grid.shape,
        *plates._noises(grid, Run(4)),
        plates.octaves,
        place,
        dataclasses.replace(found, table=table),
        plates._settings(),
    )
    rising = layers["uplift"][1].astype(np.float64)
    assert int(rising.argmax()) * grid.spacing == pytest.approx(SIZE, abs=grid.spacing)
    assert rising.sum() * grid.spacing == pytest.approx(BUOYANCY * CRUST_THICKNESS * 0.04, rel=0.02)
    assert layers["boundary_class"][1].max() == definition.COLLISION
    assert layers["elevation"][1].argmax() == pytest.approx(rising.argmax(), abs=6)


def test_ocean_floor_sinks_with_the_root_of_its_age() -> None:
    # As above, but oceans that part
    settings = {**PLAIN, "coast_variation": 0.0, "hill_height": 0.0, "continental_share": 0.0}
    plates, grid = Plates(**settings), Grid((3, 81), 2.5e4, (0.0, 0.5 * SIZE))
    place = np.array(plates._lattice_row(grid, SIZE, (1.0, 0.0), (0, 0), "plate_size"))
    found = plates._sites(grid, place, Run(4))
    table = found.table.copy()
    table[:, :2], table[:, 2], table[:, 3:6] = 0.5, 0.0, 0.0
    table.reshape(*found.shape, -1)[:, : -found.first[0] + 1, 3] = -1.0
    layers = definition.plates(
        grid.shape,
        *plates._noises(grid, Run(4)),
        plates.octaves,
        place,
        dataclasses.replace(found, table=table),
        plates._settings(),
    )
    depth = -layers["elevation"][1].astype(np.float64)
    away = SIZE - np.arange(81) * grid.spacing
    part = (away > 1e5) & (away < 5e5)
    sunk = depth[part] - 2500.0
    slope = np.polyfit(np.log(away[part]), np.log(sunk), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.06)
    assert (layers["boundary_class"][1] == definition.RIDGE).any()


def test_ground_has_no_jumps() -> None:
    # With few octaves the ground is smooth: samples four times as dense differ a fourth as much
    settings = {"octaves": 2, "run_seed": 3, "origin": (0.0, 0.0)}
    steps = []
    for factor in (1, 4):
        terrain = made((96 * factor, 96 * factor), 6e4 / factor / 8, **settings)
        for name in ("elevation", "convergence", "uplift"):
            field = terrain.layer(name).astype(np.float64)
            steps.append(max(np.abs(np.diff(field, axis=a)).max() for a in (0, 1)))
    for coarse, fine in zip(steps[:3], steps[3:], strict=True):
        assert fine < 0.4 * coarse


def test_more_continents_make_more_land() -> None:
    land = [
        float(
            np.mean([(made(continental_share=s, run_seed=k).elevation > 0).mean() for k in (1, 2)])
        )
        for s in (0.0, 0.4, 1.0)
    ]
    assert land[0] < 0.1
    assert 0.2 < land[1] < 0.65
    assert land[2] > 0.75


@pytest.mark.parametrize("device", ["numpy", None])
def test_tile_equals_whole(device: str | None) -> None:
    plates, run, spacing = Plates(octaves=3), Run(5, device), 23456.7
    origin = (8.1e8, -3e8)
    whole = plates.generate(Grid((40, 60), spacing, origin), run)
    place = (origin[0] + 21 * spacing, origin[1] - 13 * spacing)
    tile = plates.generate(Grid((17, 30), spacing, place), run)
    for name in whole:
        assert tile.layer(name).tobytes() == whole.layer(name)[13:30, 21:51].tobytes(), name


def test_devices_agree_to_the_bit() -> None:
    grid = Grid((50, 70), 6e4, (-3e8, 2e8))
    for settings in ({}, {"size_variation": 0.0, "warp": 0.0}, {"boundary_width": 1e6}):
        one, other = (Plates(**settings).generate(grid, Run(2, d)) for d in ("numpy", None))
        for name in one:
            assert one.layer(name).tobytes() == other.layer(name).tobytes(), name


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"warp": 3e6}, "warp = 3e[+]06: must not exceed plate_size"),
        ({"plate_size": 1000.0, "warp": 1.0}, "plate_size = 1000: .* raise it"),
        ({"warp_wavelength": 1e-3, "octaves": 24}, "use fewer octaves"),
    ],
)
def test_what_cannot_be_made_is_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        made(**settings)
