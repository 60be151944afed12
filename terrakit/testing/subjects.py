"""Terrains and meshes on which operators are tried: rough, smooth, awkward and turned."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Grid, Heightfield
from terrakit.layers import layer_kind
from terrakit.mesh import TriMesh
from terrakit.operators import Generator, Operator, Surface
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit.strata import Bed, Strata

SHAPES = ((3, 3), (17, 5), (5, 17), (33, 33), (64, 48), (65, 129))
"""Rows and columns: smallest, narrow, power of two plus one, non-square, more than one group."""
CORNERS = {"north west": 400.0, "north east": 300.0, "south east": 200.0, "south west": 100.0}
"""Heights of the four spikes of :func:`compass_terrain`, metres."""

Turn = Callable[[NDArray[np.float32]], NDArray[np.float32]]

BEDS = Strata(
    beds=(
        Bed(material="limestone", thickness=6.0),
        Bed(material="shale", thickness=9.0),
        Bed(material="sandstone", thickness=4.0),
    ),
    repeated=True,
)
"""Beds thin enough that any rough terrain meets them all."""


class Level(Generator):
    """Make flat ground, to stand in a parameter for the number that is its height."""

    name = "level"
    fields = 1

    offset: float = parameter(0.0, "Height of the ground.", unit="m")

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return flat ground."""
        del run
        return Heightfield.on_grid(grid, np.full(grid.shape, self.offset, dtype=np.float32))


class Ramp(Generator):
    """Make ground that rises from west to east, from one height to another."""

    name = "ramp"
    fields = 1

    low: float = parameter(0.0, "Height of the west.", unit="m")
    high: float = parameter(1.0, "Height of the east.", unit="m")

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return a ramp that nowhere leaves its two heights."""
        del run
        row = np.linspace(self.low, self.high, grid.shape[1])
        row = np.clip(row, min(self.low, self.high), max(self.low, self.high))
        return Heightfield.on_grid(grid, np.broadcast_to(row, grid.shape))


def rough_terrain(
    shape: tuple[int, int] = (33, 33),
    spacing: float = 10.0,
    *,
    relief: float | None = None,
    origin: tuple[float, float] | None = None,
) -> Heightfield:
    """Return steep, irregular ground with pits and ridges, the same in every process."""
    rows, cols = shape
    extent = max(rows, cols) * spacing
    height = _waves(shape, spacing, shortest=2.5 * spacing)
    grain = np.random.default_rng(20).standard_normal(shape)
    height = height / max(float(np.abs(height).max()), 1e-9) + 0.03 * grain
    return Heightfield(height * (0.35 * extent if relief is None else relief), spacing, origin)


def smooth_terrain(shape: tuple[int, int], spacing: float) -> Heightfield:
    """Return steep ground whose shortest wave is a third of its extent, whatever the spacing."""
    extent = (max(shape) - 1) * spacing
    height = _waves(shape, spacing, shortest=extent / 3, origin_rows=shape[0] - 1)
    return Heightfield(height * 0.2 * extent, spacing)


def compass_terrain(shape: tuple[int, int] = (33, 33), spacing: float = 10.0) -> Heightfield:
    """Return flat ground at 10 m with a spike of its own height in each corner.

    North west 400 m, north east 300 m, south east 200 m, south west 100 m: whoever mirrors, turns
    or transposes it is found out.
    """
    height = np.full(shape, 10.0)
    height[0, 0], height[0, -1] = CORNERS["north west"], CORNERS["north east"]
    height[-1, -1], height[-1, 0] = CORNERS["south east"], CORNERS["south west"]
    return Heightfield(height, spacing)


def awkward_terrains(shape: tuple[int, int] = (17, 17)) -> Iterator[tuple[str, Heightfield]]:
    """Yield, by name, terrains on which divisions by zero and lost bits show."""
    flat = np.zeros(shape)
    row, col = np.indices(shape)
    middle = shape[0] // 2, shape[1] // 2
    spike, pit, cliff = flat.copy(), flat.copy(), flat.copy()
    spike[middle] = 500.0
    pit[middle] = -500.0
    cliff[:, middle[1] :] = 2000.0
    rough = rough_terrain(shape).elevation.astype(np.float64)
    rough /= np.abs(rough).max()
    yield "flat ground at 0 m", Heightfield(flat, 10.0)
    yield "flat ground at 1234.5 m", Heightfield(flat + 1234.5, 10.0)
    yield "a spike", Heightfield(spike, 10.0)
    yield "a pit", Heightfield(pit, 10.0)
    yield "a cliff", Heightfield(cliff, 10.0)
    yield "a chequerboard", Heightfield(100.0 * ((row + col) % 2), 10.0)
    yield "1 cm of relief at 5000 m", Heightfield(5000.0 + 0.01 * rough, 10.0)
    yield "ground around 8000 m", Heightfield(8000.0 + 800.0 * rough, 90.0)
    yield "ground around -11000 m", Heightfield(-11000.0 + 800.0 * rough, 90.0)
    yield "relief of 100 km", Heightfield(1e5 * rough, 10.0)
    yield "samples 1 km apart", Heightfield(3000.0 * rough, 1000.0)


def irregular_mesh(size: int = 15, spacing: float = 10.0) -> TriMesh:
    """Return rough ground on uneven triangles, with a hole and a loose vertex."""
    random = np.random.default_rng(5)
    rough = rough_terrain((size, size), spacing)
    mesh = rough.to_mesh()
    vertices = mesh.vertices.copy()
    vertices[:, :2] += random.uniform(-0.3, 0.3, (len(vertices), 2)) * spacing
    middle = (size // 2) * size + size // 2
    faces = mesh.faces[~(mesh.faces == middle).any(axis=1)]
    return TriMesh(vertices, faces)


def with_layers(operator: type[Operator], surface: Surface, *, used: bool = True) -> Surface:
    """Return ``surface`` with every layer that the operator reads (and uses), and one bystander.

    Where ``strata_datum`` is among them, there are beds of rock too.

    The bystander is ``mask_bystander``; the operator must hand it on untouched.
    """
    wanted = (*operator.reads, *(operator.uses if used else ()))
    named = [name + "test" if name.endswith("_") else name for name in wanted]
    fields = {
        name: _field(name, surface, order)
        for order, name in enumerate(named)
        if name != "elevation"
    }
    families = {name for name in named if name.startswith("material_")}
    for name in families:  # weights sum to 1
        fields[name] = np.full(surface.elevation.shape, 1.0 / len(families), dtype=np.float32)
    fields["mask_bystander"] = _field("mask_bystander", surface, 99)
    if "strata_datum" in wanted:
        surface = surface.with_strata(BEDS)
    return surface.with_layers(**fields)


def turns() -> Iterator[tuple[str, Turn, Turn]]:
    """Yield the seven turns and mirrors of a square, each with its inverse."""
    for quarter in (1, 2, 3):
        yield (
            f"turned by {90 * quarter} degrees",
            lambda a, k=quarter: np.rot90(a, k),  # type: ignore[misc]
            lambda a, k=quarter: np.rot90(a, -k),  # type: ignore[misc]
        )
    yield "mirrored east-west", np.fliplr, np.fliplr
    yield "mirrored north-south", np.flipud, np.flipud
    yield "mirrored at its diagonal", np.transpose, np.transpose
    yield (
        "mirrored at its other diagonal",
        lambda a: np.rot90(a, 2).T,
        lambda a: np.rot90(a, 2).T,
    )


def turned(terrain: Heightfield, turn: Turn) -> Heightfield:
    """Return a terrain with every layer turned, its grid still where a new terrain's would be."""
    layers = {name: turn(terrain.layer(name)) for name in terrain if name != "elevation"}
    return Heightfield(
        turn(terrain.elevation), terrain.spacing, layers=layers, strata=terrain.strata
    )


def crop(terrain: Heightfield, top: int, left: int, rows: int, cols: int) -> Heightfield:
    """Return the part of a terrain that begins at sample ``top``, ``left``, at its own place."""
    x, y = terrain.origin
    part = slice(top, top + rows), slice(left, left + cols)
    return Heightfield(
        terrain.elevation[part],
        terrain.spacing,
        (x + left * terrain.spacing, y - top * terrain.spacing),
        terrain.crs,
        {name: terrain.layer(name)[part] for name in terrain if name != "elevation"},
        terrain.strata,
    )


def _waves(
    shape: tuple[int, int], spacing: float, shortest: float, origin_rows: int | None = None
) -> NDArray[np.float64]:
    """Return a sum of plane waves, higher the longer they are, fixed in the world."""
    rows, cols = shape
    random = np.random.default_rng(11)
    y = ((rows - 1 if origin_rows is None else origin_rows) - np.arange(rows)) * spacing
    x = np.arange(cols) * spacing
    longest = 1.2 * (max(rows, cols) - 1) * spacing
    height = np.zeros(shape)
    for share in np.linspace(0.0, 1.0, 12):
        length = longest * (shortest / longest) ** share
        angle, phase = random.uniform(0.0, 2 * np.pi, 2)
        along = np.cos(angle) * x[None, :] + np.sin(angle) * y[:, None]
        height += length / longest * np.sin(2 * np.pi * along / length + phase)
    return height


def _field(name: str, surface: Surface, order: int) -> NDArray[np.float32]:
    """Return plausible values of a layer, by its unit."""
    kind = layer_kind(name)
    low, high = {
        "1": (0.0, 1.0),
        "m": (0.0, 3.0),
        "m/yr": (1e-4, 1e-3),
        "deg": (0.0, 40.0),
        "m2": (100.0, 1e6),
    }.get(kind.unit if kind else "1", (0.0, 1.0))
    random = np.random.default_rng(100 + order)
    if name == "water_depth":  # half of the ground is dry
        low = -high
    field = random.uniform(low, high, surface.elevation.shape)
    return np.maximum(field, 0.0).astype(np.float32)
