"""Thufur: knee-high hummocks of frozen ground, side by side."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, linear_step, maximum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import FINEST, Landform


class Thufur(Landform):
    """Heave the ground into hummocks with narrow troughs between them.

    With ``f1`` and ``f2`` the distances to the nearest and the second nearest of scattered
    middles, in spacings::

        z = offset + hummock_height (1 - variation v) t (2 - t) u (3 - u) / 2,
        t = clamp((f2 - f1) / 0.55, 0, 1),   u = max(0, 1 - f1^2 / 0.72)

    where ``v``, 0 to 1, is another number for each hummock.

    References
    ----------
    E. Schunke and S. C. Zoltai, "Earth hummocks (thufur)", in Advances in Periglacial
    Geomorphology, 1988.
    """

    name = "thufur"
    cites = ("Schunke & Zoltai 1988",)
    portrait: ClassVar[float] = 36.0

    hummock_height: float = parameter(
        0.45, "Height of the largest hummocks above their troughs.", unit="m", ge=0, le=1e3
    )
    spacing: float = parameter(
        1.5, "Distance from one hummock to the next.", unit="m", gt=0, le=1e5
    )
    variation: float = parameter(
        0.5, "How much lower the smallest are than the largest, as a share.", ge=0, le=1
    )

    presets: ClassVar = {
        "meadow": {},
        "tundra": {"hummock_height": 0.8, "spacing": 3.0, "variation": 0.7},
        "palsas": {"hummock_height": 4.0, "spacing": 40.0, "variation": 0.9},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the hummocks."""
        from terrakit.noise import BASES

        roughness = place.value(self, "roughness")
        spacing = max(self.spacing, FINEST)
        moved = self.warped(place, 2.2 * spacing, roughness * (0.22 * spacing), 3)
        words = place.words(f"{self.name} middles", self.seed)

        def cells(feature: str) -> Formula:
            basis = BASES[f"cellular_{feature}"]
            shown = moved.noise(f"cellular_{feature}", spacing, words)
            return (shown + 1.0) * (0.5 * (basis.range or 1.0))

        nearest = cells("f1")
        apart = linear_step(0.0, 0.55, cells("f2_minus_f1"))
        round_top = maximum(1.0 - nearest * nearest * (1.0 / 0.72), 0.0)
        dome = apart * (2.0 - apart) * round_top * (1.5 - round_top * 0.5)
        size = 1.0 - cells("value") * self.variation
        ground = self.unevenness(place, 9.0 * spacing, 5, "ground") * 0.7
        tussocks = self.unevenness(place, 0.3 * spacing, 4, "tussocks") * (dome * 0.12 + 0.02)
        return self.ground(place, (dome * size + ground + tussocks) * self.hummock_height)
