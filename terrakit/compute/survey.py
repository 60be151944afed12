"""Looks at a field where it is, so that a check does not move it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from terrakit.compute.arrays import DeviceArray

RUN = 1024
"""Values that a work-item counts."""


def count_not_finite(field: DeviceArray) -> int:
    """Return how many values of a float32 field on a device are infinite or no number."""
    device = field.device
    counter = device.zeros(1, np.int32)
    device.program(__file__, "survey.cl").launch(
        "survey_not_finite",
        -(-field.size // RUN),
        field,
        counter,
        np.int32(field.size),
        np.int32(RUN),
        local=(8,),
    )
    return int(counter.download()[0])
