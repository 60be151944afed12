"""Tectonic plates: continents, oceans and the belts where plates meet."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import Device, exact
from terrakit.errors import ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.noise import source as noise_source
from terrakit.operators import Generator
from terrakit.parameters import Seed, parameter
from terrakit.running import Run, seed_words
from terrakit.world import FINE, parts
from terrakit_generators.plates.reference import FAR_REACH, LAYERS, Sites

TURNS = ((1.0, 0.0), (0.8, 0.6), (5 / 13, 12 / 13), (-8 / 17, 15 / 17), (21 / 29, -20 / 29))
"""Cosine and sine of each octave's turn: rational, so that no library decides their bits."""
ONE = 2**32
"""One lattice cell in the fixed point of lattice positions."""
JITTER = 0.75
"""Share of its cell in which a site may lie; below 0.8 five by five cells hold the nearest six."""
LARGEST_WEIGHT = 0.5
"""Largest weight of a site in the power distance, square plate sizes."""
MOST_CELLS = 2**20
LACUNARITY = 2.03
WARP_EXPONENT, CRUST_EXPONENT, RIDGE_EXPONENT = 0.8, 0.75, 0.8
"""Hurst exponents of borders, coasts and ranges."""
BLEND, FLOOR_BLEND = 0.12, 0.05
"""Softness of the change of crust and of ocean floor between plates, plate sizes."""
CRUST_SLOPE = 2.9
"""Change of the crust's share a plate size, across the border of a continental plate."""
COOLING_TIME = 7e7
"""Years after which the ocean floor is about as deep as it gets (Parsons & Sclater 1977)."""
CRUST_THICKNESS = 35e3
BUOYANCY = 0.16
"""Share of a thickening of the crust that shows at the surface: 1 - 2800 / 3330."""
BELT_AREA = 1.7724538509055159 * (0.75 + 0.25 / 0.4)
"""Area under the profile of a belt of width 1 and height 1."""


class Plates(Generator):
    """Lay out moving plates, with ranges, trenches, rifts and ridges where they meet.

    Plates are the power cells of a jittered lattice of the world, seen through a warp. Each turns
    about its own pole, and at a boundary with normal n (from a to b) and tangent t::

        v_p(x) = u_p + omega_p z x (x - c_p)
        convergence = (v_a - v_b) . n,    shear = (v_a - v_b) . t
        uplift = 0.16 h convergence p(distance / width) / (width integral of p)
        p(z) = 3/4 exp(-z^2) + 1/4 exp(-0.16 z^2)

    Continents that meet raise a range, an ocean that goes under raises an arc behind a trench,
    continents that part sink into a rift, and the floor of oceans that part sinks with the square
    root of its age; where plates slide there is shear and no relief. What a place gets is a mean
    over its nearest plates, weighted by the chance that two of them are its nearest, so no crease
    shows where the second nearest changes.

    Notes
    -----
    ``uplift`` is the rising part alone, never negative: ready as the ``uplift_rate`` of
    ``stream_power``. Heights are what a map of this scale shows; erosion has to carve them.

    References
    ----------
    B. Parsons and J. G. Sclater, J. Geophysical Research 82, 1977. Y. Cortial, A. Peytavie,
    E. Galin and E. Guerin, "Procedural tectonic planets", Computer Graphics Forum 38, 2019.
    R. L. Plackett, Applied Statistics 24, 1975.
    """

    name = "plates"
    portrait = 8e6
    cites = ("Parsons & Sclater 1977", "Cortial et al. 2019", "Plackett 1975")
    fields = 16
    writes = LAYERS
    trial: ClassVar = {
        "plate_size": 300.0,
        "warp": 40.0,
        "warp_wavelength": 200.0,
        "boundary_width": 50.0,
        "shelf_width": 40.0,
        "octaves": 3,
    }

    plate_size: float = parameter(
        2e6, "Mean distance between the middles of plates.", unit="m", gt=0, le=1e8
    )
    size_variation: float = parameter(
        0.7, "How unlike in size plates are; with 0 all are about equal.", ge=0, le=1
    )
    warp: float = parameter(
        4e5, "How far borders wander from straight lines.", unit="m", ge=0, le=1e8
    )
    warp_wavelength: float = parameter(
        1.5e6, "Length of the largest bends of the borders.", unit="m", gt=0, le=1e8
    )
    octaves: int = parameter(
        8, "Layers of ever finer detail; each is finer by the lacunarity.", ge=1, le=24
    )
    continental_share: float = parameter(0.4, "Share of plates that carry a continent.", ge=0, le=1)
    coast_variation: float = parameter(
        0.6, "How freely coasts leave the borders of their plates.", ge=0, le=2
    )
    plate_speed: float = parameter(
        0.05, "Usual speed of a plate; with 0 nothing collides.", unit="m/yr", ge=0, le=10
    )
    boundary_width: float = parameter(
        1.2e5, "Half the width of the belt of a collision.", unit="m", gt=0, le=1e7
    )
    shelf_width: float = parameter(
        1e5, "Width of the shallow sea around continents.", unit="m", gt=0, le=1e7
    )
    continent_height: float = parameter(
        500.0, "Height of the interior of continents.", unit="m", ge=0, le=1e5
    )
    ocean_depth: float = parameter(5500.0, "Depth of old ocean floor.", unit="m", ge=0, le=1e5)
    ridge_depth: float = parameter(
        2500.0, "Depth of the crests of mid-ocean ridges.", unit="m", ge=0, le=1e5
    )
    mountain_height: float = parameter(
        7000.0,
        "Height of the highest ranges, above the land around, where plates close fast.",
        unit="m",
        ge=0,
        le=1e5,
    )
    trench_depth: float = parameter(
        4000.0, "Depth of trenches below the ocean floor.", unit="m", ge=0, le=1e5
    )
    rift_depth: float = parameter(
        1200.0, "Depth of rifts below the land around.", unit="m", ge=0, le=1e5
    )
    hill_height: float = parameter(
        600.0, "Height of hills and basins away from the belts.", unit="m", ge=0, le=1e5
    )
    seed: Seed = parameter(0, "Another number or word gives other plates.")

    presets: ClassVar = {
        "archipelago": {"continental_share": 0.15, "coast_variation": 1.1, "plate_size": 1.2e6},
        "pangaea": {"continental_share": 0.7, "plate_size": 3e6},
    }

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return continents and oceans on ``grid``."""
        if self.warp > self.plate_size:
            raise ParameterError(
                f"warp = {self.warp:g}: must not exceed plate_size = {self.plate_size:g} m; "
                "lower it or raise plate_size"
            )
        place = self._lattice_row(grid, self.plate_size, (1.0, 0.0), (0, 0), "plate_size")
        sites = self._sites(grid, np.array(place), run)
        lattice, weight, seeds = self._noises(grid, run)
        settings = self._settings()
        device = run.device
        made: dict[str, Any]
        if device is None:
            from terrakit_generators.plates.reference import plates

            made = plates(
                grid.shape, lattice, weight, seeds, self.octaves, np.array(place), sites, settings
            )
        else:
            made = _on_device(
                device, grid, lattice, weight, seeds, self.octaves, np.array(place), sites, settings
            )
        elevation = made.pop("elevation")
        return Heightfield.on_grid(grid, elevation, made)

    def _settings(self) -> NDArray[np.float32]:
        """Return what the kernel is told, lengths in plate sizes; named in the reference."""
        size = self.plate_size
        belt = self.boundary_width / size
        shelf = CRUST_SLOPE * self.shelf_width / size
        return np.array(
            [
                self.warp / size,
                size,
                self.plate_speed,
                min(max(0.5 * belt, 0.005), 0.1),
                BLEND,
                belt,
                self.coast_variation,
                shelf,
                0.01 + 0.8 * shelf,
                self.continent_height,
                self.ocean_depth,
                min(self.ridge_depth, self.ocean_depth),
                self.mountain_height,
                self.trench_depth,
                self.rift_depth,
                self.hill_height,
                self.plate_speed * COOLING_TIME / size,
                self.plate_speed * BUOYANCY * CRUST_THICKNESS / (BELT_AREA * self.boundary_width),
                FLOOR_BLEND,
            ],
            dtype=np.float32,
        )

    def _noises(
        self, grid: Grid, run: Run
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.uint32]]:
        """Return positions, weights and seeds of the octaves of all four noises in turn."""
        groups = (
            ("warp east", self.warp_wavelength, WARP_EXPONENT, 2.0),
            ("warp north", self.warp_wavelength, WARP_EXPONENT, 2.0),
            ("crust", 0.6 * self.plate_size, CRUST_EXPONENT, 2.0),
            ("ridges", 2.5 * self.boundary_width, RIDGE_EXPONENT, 1.0),
        )
        lattice: list[list[int]] = []
        weights: list[float] = []
        seeds: list[int] = []
        for group, longest, exponent, height in groups:
            words = run.words(self.name, self.seed)
            lacunarity = np.array([LACUNARITY], dtype=np.float32)
            gain = float(exact.power(lacunarity, -exponent)[0])
            shares = [gain**octave for octave in range(self.octaves)]
            weights += [height * share / sum(shares) for share in shares]
            wavelength = longest
            for octave in range(self.octaves):
                shift = seed_words(*words, group, "shift", octave)
                seeds += seed_words(*words, group, octave)
                turn = TURNS[octave % len(TURNS)]
                lattice.append(self._lattice_row(grid, wavelength, turn, shift, "octaves"))
                wavelength /= LACUNARITY
        return (
            np.array(lattice, dtype=np.int64),
            np.array(weights, dtype=np.float32),
            np.array(seeds, dtype=np.uint32),
        )

    def _lattice_row(
        self,
        grid: Grid,
        wavelength: float,
        turn: tuple[float, float],
        shift: tuple[int, int],
        blamed: str,
    ) -> list[int]:
        """Return u at the first sample, per column and per row, and the same of v, in 32.32."""
        step = grid.spacing / wavelength * ONE
        if step >= 2**52:
            raise ParameterError(
                f"{blamed} = {getattr(self, blamed):g}: a length of {wavelength:g} m is far below "
                f"the spacing of {grid.spacing:g} m; "
                + ("use fewer octaves" if blamed == "octaves" else "raise it")
            )
        cosine, sine = turn
        c, s = round(cosine * step), round(sine * step)
        x, y = (divmod(parts(along, grid.spacing), FINE) for along in grid.north_west)
        u = x[0] * c - y[0] * s + (x[1] * c - y[1] * s) // FINE + (shift[0] << 16)
        v = x[0] * s + y[0] * c + (x[1] * s + y[1] * c) // FINE + (shift[1] << 16)
        return [_wrapped(value) for value in (u, c, s, v, s, -c)]

    def _sites(self, grid: Grid, place: NDArray[np.int64], run: Run) -> Sites:
        """Return the sites of every lattice cell that a sample of the grid may look at."""
        rows, cols = grid.shape
        warp = int(2.0 * self.warp / self.plate_size * ONE) + ONE // 2**20
        margin = FAR_REACH
        low_i = int((place[0] - warp) >> 32) - margin
        high_i = int((place[0] + (cols - 1) * place[1] + warp) >> 32) + margin
        low_j = int((place[3] + (rows - 1) * place[5] - warp) >> 32) - margin
        high_j = int((place[3] + warp) >> 32) + margin
        shape = high_j - low_j + 1, high_i - low_i + 1
        if shape[0] * shape[1] > MOST_CELLS:
            raise ParameterError(
                f"plate_size = {self.plate_size:g}: {shape[0]} x {shape[1]} plates on this "
                f"terrain, at most {MOST_CELLS}; raise it"
            )
        j, i = np.meshgrid(
            np.arange(low_j, high_j + 1), np.arange(low_i, high_i + 1), indexing="ij"
        )

        def drawn(what: str) -> NDArray[np.float32]:
            words = seed_words(*run.words(self.name, self.seed), what)
            return exact.uniform(exact.hashed(words, i, j)).ravel()

        one = np.float32(1.0)
        margin_of_cell = np.float32(0.5 * (1.0 - JITTER))
        direction, pace = drawn("direction"), np.float32(0.4) + drawn("pace")
        weight = drawn("weight") * np.float32(LARGEST_WEIGHT * self.size_variation)
        words = seed_words(*run.words(self.name, self.seed), "identity")
        table = np.stack(
            (
                margin_of_cell + drawn("east") * np.float32(JITTER),
                margin_of_cell + drawn("north") * np.float32(JITTER),
                weight,
                pace * exact.sine(direction + np.float32(0.25)),
                pace * exact.sine(direction),
                (drawn("spin") * np.float32(2.0) - one) * np.float32(0.8),
                (drawn("type") < np.float32(self.continental_share)).astype(np.float32),
                drawn("age"),
            ),
            axis=-1,
        ).astype(np.float32)
        identity = (exact.hashed(words, i, j) >> np.uint32(8)).astype(np.int32).ravel()
        return Sites((low_i, low_j), shape, table, identity)


def _on_device(
    device: Device,
    grid: Grid,
    lattice: NDArray[np.int64],
    weight: NDArray[np.float32],
    seeds: NDArray[np.uint32],
    octaves: int,
    place: NDArray[np.int64],
    sites: Sites,
    settings: NDArray[np.float32],
) -> dict[str, NDArray[np.float32]]:
    """Return every layer, made by ``plates.cl``."""
    rows, cols = grid.shape
    made = device.empty((len(LAYERS), rows, cols))
    own = Path(__file__).with_name("plates.cl").read_text("utf-8")
    source = noise_source() + "\n" + own
    device.program_from_source("plates.cl", source).launch(
        "plates_make",
        (rows,) if device.is_cpu else grid.shape,
        made,
        device.upload(lattice),
        device.upload(weight),
        device.upload(seeds),
        device.upload(place),
        device.upload(sites.table),
        device.upload(sites.identity),
        device.upload(settings),
        np.int32(octaves),
        np.int32(sites.first[0]),
        np.int32(sites.first[1]),
        np.int32(sites.shape[1]),
        np.int32(rows),
        np.int32(cols),
        local=(4,) if device.is_cpu else None,
    )
    device.finish()
    return dict(zip(LAYERS, made.download(), strict=True))


def _wrapped(value: int) -> int:
    """Return an integer as the signed 64-bit number with the same low bits."""
    return (value + 2**63) % 2**64 - 2**63
