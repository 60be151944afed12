"""A ridge: a sharp crest of summits and saddles, with spurs and ravines on both sides."""

from __future__ import annotations

from typing import ClassVar

from terrakit.formula import Formula, Place, absolute, clamp, maximum, power, smooth_maximum
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import Landform


class Ridge(Landform):
    """Raise a mountain ridge: summits and saddles along it, spurs and ravines across.

    With ``d`` the distance to the crest and ``a`` metres along it from the middle::

        z = offset + height (1 - (2 a / length)^2)^(1/2) s^concavity,
        s = 1 - 2 d / (width (1 - (2 a / length)^2)^(1/2))
    """

    name = "ridge"
    portrait: ClassVar[float] = 9000.0

    crest_height: float = parameter(
        900.0, "Height of the crest above the land around.", unit="m", ge=0, le=1e5
    )
    ridge_width: float = parameter(3600.0, "Width from foot to foot.", unit="m", gt=0, le=1e6)
    length: float = parameter(8000.0, "Length from end to end.", unit="m", gt=0, le=1e7)
    concavity: float = parameter(
        1.2, "Shape of its sides: 1 is even, more is hollow, steepest at the crest.", ge=0.5, le=4
    )
    saddles: float = parameter(0.3, "Depth of the saddles, as a share of the height.", ge=0, le=0.9)
    direction: float = parameter(
        35.0, "Where its crest runs to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    winding: float = parameter(1.0, "How much its crest winds: 0 is straight.", ge=0, le=2)

    presets: ClassVar = {
        "alpine": {},
        "rounded": {"crest_height": 350.0, "concavity": 0.8, "saddles": 0.15},
        "hogsback": {"crest_height": 250.0, "ridge_width": 900.0, "saddles": 0.1, "winding": 0.3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the ridge."""
        roughness = place.value(self, "roughness")
        width, height = self.ridge_width, self.crest_height
        rough = self.warped(place, 0.45 * width, roughness * (0.085 * width), 5)
        right, along = self.course(rough, self.direction, 1.5 * width, 0.2 * self.winding * width)
        share = along * (2.0 / self.length)
        taper = power(maximum(1.0 - share * share, 0.0), 0.5)
        words = place.words(f"{self.name} summits", self.seed)
        finer = 1.0 / (0.55 * width)
        summits = (
            absolute(place.noise_at("gradient", along * finer, 0.3, words)) * 0.9
            + absolute(place.noise_at("gradient", along * (2.3 * finer), 7.7, words)) * 0.45
        )
        crest = 1.0 - (1.0 - clamp(summits, 0.0, 1.0)) * self.saddles * roughness
        # Spurs branch off from the crest as ravines do from a river, the other way up
        distance = self.drained(
            rough,
            absolute(right),
            0.6 * width,
            roughness,
            4,
            0.42,
            "spurs",
            rough.around(self.center, self.direction)[::-1],
        )
        foot = maximum(taper * (0.5 * width), 1e-6 * width)
        rise = clamp(1.0 - distance / foot, 0.0, 1.0)
        body = power(rise, self.concavity) * crest * taper
        detail = self.unevenness(place, 0.2 * width, 8, "rocks", 0.7) * (body * 0.14 + 0.004)
        plain = self.unevenness(place, width, 9, "plain") * 0.05
        return self.ground(place, (smooth_maximum(body, 0.0, 1e-6) + detail + plain) * height)
