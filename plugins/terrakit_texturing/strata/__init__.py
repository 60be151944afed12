"""Beds of rock under the ground: level, tilted, folded, broken by faults."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from terrakit.errors import ParameterError
from terrakit.formula import Formula, Place, fbm, floor, fraction, sine
from terrakit.heightfield import Heightfield
from terrakit.operators import Texture
from terrakit.parameters import Maskable, Seed, parameter
from terrakit.running import Run
from terrakit.strata import MOST_BEDS, Bed, Strata

COUNTRY = (
    Bed(material="limestone", thickness=40.0),
    Bed(material="marl", thickness=60.0),
    Bed(material="sandstone", thickness=50.0),
    Bed(material="shale", thickness=70.0),
)


class LayStrata(Texture):
    """Lay beds of rock under the terrain, which every later erosion meets as it cuts down.

    The height of the ground is not changed. The layer ``strata_datum`` is where the top of the
    column lies, and the beds follow below it::

        d = top + tan(dip) s + A sin(2 pi u / L) + w n(x / W) - throw floor(v / D)

    ``s`` runs against the direction of dip, ``u`` across the folds and ``v`` across the faults.
    Running water multiplies its rate by a bed's erodibility; frost, wind and chemistry by
    1 - hardness; thermal erosion lets rock stand as steep as its angle of repose. Loose material
    (the layer ``sediment``) lies on top of it all.

    References
    ----------
    B. Benes and R. Forsbach, "Layered data representation for visual simulation of terrain
    erosion", 2001. M. J. Selby, Zeitschrift fuer Geomorphologie 24, 1980. L. S. Sklar and W. E.
    Dietrich, Geology 29, 2001.
    """

    name = "strata"
    uses = ("sediment",)
    writes = ("strata_datum", "sediment")
    cites = ("Benes & Forsbach 2001", "Selby 1980", "Sklar & Dietrich 2001")
    locality = "pointwise"
    turning: ClassVar = None
    fields = 8

    beds: list[Bed] = parameter(
        list(COUNTRY),
        "From the top down: material and thickness (m), and hardness, repose_angle (deg) or "
        "erodibility where they differ from the material's own.",
    )
    repeated: bool = parameter(
        True, "Whether the column begins again below its lowest bed and above its uppermost."
    )
    top: float = parameter(
        0.0,
        "Height of the top of the column in the middle of the world.",
        unit="m",
        ge=-1e6,
        le=1e6,
    )
    dip: float = parameter(
        0.0, "How steeply the beds are tilted; 3 to 10 makes cuestas.", unit="deg", ge=0, le=80
    )
    dip_direction: float = parameter(
        90.0, "Where the beds go down to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    fold_amplitude: float = parameter(
        0.0, "How far folds lift and lower the beds.", unit="m", ge=0, le=1e5
    )
    fold_wavelength: float = parameter(
        3000.0, "Distance from one arch of the folds to the next.", unit="m", gt=0, le=1e7
    )
    fold_direction: float = parameter(
        0.0, "Along which the folds run, clockwise from north.", unit="deg", ge=-360, le=360
    )
    warp_amplitude: float = parameter(
        10.0, "How far the beds swell and sink without order.", unit="m", ge=0, le=1e5
    )
    warp_wavelength: float = parameter(2000.0, "Size of those swells.", unit="m", gt=0, le=1e7)
    fault_throw: float = parameter(
        0.0, "How far each fault drops the beds beyond it.", unit="m", ge=0, le=1e5
    )
    fault_spacing: float = parameter(2500.0, "Distance between faults.", unit="m", gt=0, le=1e7)
    fault_direction: float = parameter(
        30.0, "Along which the faults run, clockwise from north.", unit="deg", ge=-360, le=360
    )
    soil_depth: Maskable | None = parameter(
        None,
        "Loose material on top, part of the height; without it what there is stays.",
        unit="m",
        ge=0,
        le=1e4,
    )
    seed: Seed = parameter(0, "Another number or word gives other swells.")

    presets: ClassVar = {
        "mesas": {
            "beds": [
                Bed(material="sandstone", thickness=45.0, hardness=0.9, repose_angle=78.0),
                Bed(material="shale", thickness=130.0),
                Bed(material="limestone", thickness=35.0),
                Bed(material="mudstone", thickness=120.0),
            ],
        },
        "cuestas": {
            "beds": [
                Bed(material="limestone", thickness=50.0),
                Bed(material="marl", thickness=110.0),
            ],
            "dip": 4.0,
        },
        "hogbacks": {
            "beds": [
                Bed(material="quartzite", thickness=40.0),
                Bed(material="shale", thickness=140.0),
            ],
            "dip": 35.0,
        },
        "folded": {"fold_amplitude": 400.0, "fold_wavelength": 3500.0},
        "badlands": {
            "beds": [
                Bed(material="mudstone", thickness=8.0),
                Bed(material="siltstone", thickness=4.0, erodibility=0.7),
            ],
            "warp_amplitude": 3.0,
        },
    }

    def texture(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain with beds under it."""
        if not 1 <= len(self.beds) <= MOST_BEDS:
            raise ParameterError(
                f"beds: a column of {len(self.beds)}; must be 1 to {MOST_BEDS} beds"
            )
        place = Place(surface.grid, run, surface)
        (datum,) = place.computed(self._datum(place))
        layers = {"strata_datum": datum}
        if self.soil_depth is not None:
            soil = np.asarray(self.value("soil_depth", surface), dtype=np.float32)
            layers["sediment"] = np.broadcast_to(soil, surface.shape)
        column = Strata(beds=tuple(self.beds), repeated=self.repeated)
        return surface.with_layers(**layers).with_strata(column)

    def _datum(self, place: Place) -> Formula:
        """Return the height of the top of the column."""
        _, down = place.around(None, self.dip_direction)
        datum = self.top - math.tan(math.radians(self.dip)) * down
        if self.fold_amplitude > 0:
            across, _ = place.around(None, self.fold_direction)
            turn = fraction(across / self.fold_wavelength) * (2.0 * math.pi)
            datum = datum + self.fold_amplitude * sine(turn)
        if self.warp_amplitude > 0:
            words = place.words(self.name, self.seed)
            try:
                octaves = place.octaves("gradient", self.warp_wavelength, 3, words)
            except ParameterError as error:
                raise ParameterError(f"warp_{error}") from None
            swells = fbm(octaves)
            datum = datum + self.warp_amplitude * swells
        if self.fault_throw > 0:
            beyond, _ = place.around(None, self.fault_direction)
            datum = datum - self.fault_throw * floor(beyond / self.fault_spacing + 0.5)
        return datum
