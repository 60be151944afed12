"""The beds under the ground, from the top down."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from terrakit.materials import MATERIALS, Material

MOST_BEDS = 64


class Bed(BaseModel):
    """One bed of rock: what it is, how thick, and how it takes erosion.

    In a recipe ``{ material = "limestone", thickness = 40.0 }``. What is not said is taken from
    :data:`terrakit.materials.MATERIALS`; a material that is not in there needs a hardness.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    material: str
    thickness: float = Field(gt=0, le=1e6)
    hardness: float | None = Field(None, ge=0, le=1)
    repose_angle: float | None = Field(None, gt=0, lt=90)
    erodibility: float | None = Field(None, ge=0, le=1000)

    @model_validator(mode="after")
    def _known(self) -> Bed:
        if not self.material or len(self.material) > 64:
            raise ValueError("material must be a name of 1 to 64 letters")
        if self.material not in MATERIALS and self.hardness is None:
            from terrakit.parameters import suggestion

            hint = suggestion(self.material, list(MATERIALS))
            raise ValueError(f"material {self.material!r} needs a hardness{hint}")
        return self

    @property
    def properties(self) -> Material:
        """What the bed does under erosion, everything filled in."""
        known = MATERIALS.get(self.material)
        hardness = self.hardness if known is None or self.hardness is not None else known.hardness
        assert hardness is not None
        if known is None or self.hardness is not None:
            # As hard as said, so as steep and as slow to cut as rock of that hardness
            repose, erodibility = 33.0 + 50.0 * hardness, 2.0 * (1.0 - hardness)
        else:
            repose, erodibility = known.repose_angle, known.erodibility
        return Material(
            self.material,
            hardness,
            repose if self.repose_angle is None else self.repose_angle,
            erodibility if self.erodibility is None else self.erodibility,
        )


class Strata(BaseModel):
    """A column of beds; the surface's layer ``strata_datum`` says how high its top lies.

    Parameters
    ----------
    beds
        From the top down. The uppermost goes on upward, the lowest downward.
    repeated
        Whether the column begins again below its lowest bed and above its uppermost.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    beds: tuple[Bed, ...] = Field(min_length=1, max_length=MOST_BEDS)
    repeated: bool = False

    @property
    def thickness(self) -> float:
        """Thickness of the whole column, metres."""
        return sum(bed.thickness for bed in self.beds)

    def bases(self, quantum: float) -> NDArray[np.int32]:
        """Return how deep each bed's base lies under the datum, in quanta."""
        depths = np.array(list(accumulate(bed.thickness for bed in self.beds)))
        return np.minimum(np.rint(depths / quantum), 2**30).astype(np.int32)

    def values(self, name: str) -> NDArray[np.float32]:
        """Return one property of every bed.

        Parameters
        ----------
        name
            ``erodibility``, ``softness`` (1 - hardness), ``hardness`` or ``repose`` (the tangent
            of the angle).
        """
        rocks = [bed.properties for bed in self.beds]
        values = {
            "erodibility": [rock.erodibility for rock in rocks],
            "softness": [1.0 - rock.hardness for rock in rocks],
            "hardness": [rock.hardness for rock in rocks],
            "repose": [math.tan(math.radians(rock.repose_angle)) for rock in rocks],
        }[name]
        return np.array(values, dtype=np.float32)

    def to_dict(self) -> dict[str, Any]:
        """Return the column as JSON holds it."""
        return self.model_dump(mode="json", exclude_none=True)

    @classmethod
    def from_dict(cls, kept: dict[str, Any] | None) -> Strata | None:
        """Return the column that :meth:`to_dict` wrote, or None for None."""
        if kept is None:
            return None
        return cls(beds=tuple(Bed(**bed) for bed in kept["beds"]), repeated=kept["repeated"])
