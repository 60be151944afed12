"""A meandering river's bed: bends with a cut bank outside and a point bar inside, in a plain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from terrakit.formula import (
    Formula,
    Place,
    absolute,
    as_formula,
    clamp,
    cosine,
    exp,
    floor,
    linear_step,
    maximum,
    minimum,
    power,
    smoothstep,
    sqrt,
    square,
    where,
)
from terrakit.formula.expression import Loop
from terrakit.parameters import parameter
from terrakit_generators.landforms.landform import FINEST, Landform

SKEWNESS, FATNESS = 1.0 / 32.0, 1.0 / 192.0
"""How much bends lean upstream, and how blunt they are (Parker, Diplas & Akiyama 1983)."""
PERIOD = 3
"""Wavelengths after which the river repeats itself."""
PIECES = 20
"""Pieces of a wavelength: parabolas that meet without a corner."""
ROUNDS = 2
"""Newton steps to the nearest point of a piece."""
FAR = 1e30
"""Square metres."""


class Meander(Landform):
    """Let a river meander across a plain: pools and cut banks outside its bends, bars inside.

    The axis follows Kinoshita's curve; with the way ``s`` along it, its direction is::

        theta(s) = theta_0 sin(phi) + theta_0^3 (J_f cos(3 phi) - J_s sin(3 phi)),
        phi = 2 pi s / L

    and no two bends are quite alike. With ``e`` the distance to the axis in half widths, outwards
    in bends, and ``b`` the curvature relative to that of a full bend::

        z = offset - depth (3 + |b|) / 4 (1 - |e'|^2.5),   e' = e - 0.45 b (1 - e^2)

    Low levees follow the banks; scroll bars show where bends were before, and scars where the
    river ran long ago.

    Notes
    -----
    The distance to the axis is taken to pieces of a curve that repeats after three wavelengths.
    Beyond the centres of its bends it has creases, as the distance to any curve has.

    References
    ----------
    R. Kinoshita, "An investigation of channel deformation in Ishikari River", 1961. G. Parker,
    P. Diplas and J. Akiyama, "Meander bends of high amplitude", Journal of Hydraulic Engineering
    109, 1983. L. Leopold and M. G. Wolman, "River meanders", GSA Bulletin 71, 1960.
    """

    name = "meander"
    cites = ("Kinoshita 1961", "Parker, Diplas & Akiyama 1983", "Leopold & Wolman 1960")
    fields: ClassVar[int] = 6
    portrait: ClassVar[float] = 2400.0

    river_width: float = parameter(60.0, "Width of the river.", unit="m", gt=0, le=1e6)
    depth: float = parameter(
        4.0, "Depth of the bed in bends, below the plain.", unit="m", ge=0, le=1e5
    )
    wavelength: float = parameter(
        720.0,
        "From one bend to the next but one, as the crow flies; 10 to 14 widths in nature.",
        unit="m",
        gt=0,
        le=1e6,
    )
    swing: float = parameter(
        78.0, "Greatest angle between the river and its valley.", unit="deg", ge=0, le=115
    )
    direction: float = parameter(
        100.0, "Where the river flows to, clockwise from north.", unit="deg", ge=-360, le=360
    )
    slope: float = parameter(0.03, "How steeply the plain falls.", unit="deg", ge=0, le=60)
    scars: int = parameter(2, "How many old courses have left their scars.", ge=0, le=4)

    presets: ClassVar = {
        "lowland": {},
        "brook": {"river_width": 6.0, "depth": 1.2, "wavelength": 70.0, "slope": 0.3, "scars": 1},
        "tortuous": {"swing": 108.0, "scars": 3},
    }

    def height(self, place: Place) -> Formula:
        """Return the height of the plain and of the bed in it."""
        roughness = place.value(self, "roughness")
        share = minimum(roughness, 1.0)
        wave, width = self.wavelength, self.river_width
        bent = self.warped(place, 3.0 * wave, roughness * (0.35 * wave), 2, "belt")
        right, ahead = bent.around(self.center, self.direction)
        plain = self.unevenness(place, 1.5 * wave, 9, "plain") * (0.25 * self.depth)
        ground = as_formula(0.0)
        for scar in range(self.scars):
            course = self._course(place, f"scar {scar}")
            aside, curvature = course.nearest(right + (0.3 * (scar % 2) - 0.15) * wave, ahead)
            seen = place.noise(
                "gradient",
                max(0.9 * wave, FINEST),
                place.words(f"meander scar {scar} seen", self.seed),
            )
            filled = smoothstep(-0.1, 0.25, seen) * (0.45 - 0.1 * scar) * share
            ground = minimum(ground, self._bed(aside, curvature) * filled)
            ground = ground + self._bars(aside, curvature) * (filled * self.depth * 0.8)
        aside, curvature = self._course(place, "river").nearest(right, ahead)
        beside = maximum(absolute(aside) - 0.5 * width, 0.0)
        near = linear_step(0.0, 2.0 * width, beside)
        banks = self._bars(aside, curvature) * self.depth + exp(beside * (-0.9 / width)) * (
            0.16 * self.depth
        ) * smoothstep(0.0, 0.35 * width, beside)
        height = (ground + plain) * near + banks * share + self._bed(aside, curvature)
        return self.ground(place, height - ahead * math.tan(math.radians(self.slope)))

    def _bed(self, aside: Formula, curvature: Formula) -> Formula:
        """Return the height of the river's bed, 0 beside it."""
        e = clamp(aside * (2.0 / self.river_width), -1.0, 1.0)
        e = e + curvature * (1.0 - e * e) * 0.45
        deep = (absolute(curvature) * 0.25 + 0.75) * self.depth
        return deep * (power(absolute(e), 2.5) - 1.0)

    def _bars(self, aside: Formula, curvature: Formula) -> Formula:
        """Return the height of scroll bars inside of bends, in depths of the river."""
        beside = absolute(aside) * (1.0 / self.river_width) - 0.5
        inside = clamp(where(aside > 0.0, curvature, -curvature) * 1.6 - 0.35, 0.0, 1.0)
        scrolls = 0.5 - cosine(beside * (2.0 * math.pi / 0.42)) * 0.5
        fading = exp(maximum(beside, 0.0) * -0.55) * linear_step(0.0, 0.2, beside)
        return scrolls * inside * fading * 0.16

    def _course(self, place: Place, stream: str) -> Course:
        """Return a course of the river; another stream of random numbers gives another one."""
        bends = 2 * PERIOD
        words = [place.words(f"{self.name} {stream} {bend}", self.seed) for bend in range(bends)]
        vary = [(low / 2**32 - 0.5, high / 2**32 - 0.5) for low, high in words]
        return Course.kinoshita(self.swing, self.wavelength, vary)


@dataclass(frozen=True)
class Course:
    """A curve of parabolas, which repeats itself after a period ahead.

    Parameters
    ----------
    period
        Metres ahead after which it repeats itself.
    pieces
        Of each: start ahead and right, to its end, half the bend in its middle, curvature at its
        start and what it gains.
    """

    period: float
    pieces: list[tuple[float, ...]]

    @classmethod
    def kinoshita(cls, swing: float, wavelength: float, vary: list[tuple[float, float]]) -> Course:
        """Return Kinoshita's curve.

        Parameters
        ----------
        swing
            Greatest angle against the valley, degrees.
        wavelength
            Metres ahead, in the mean.
        vary
            How each bend differs in swing and in length, each -0.5 to 0.5.
        """
        fine = 24
        count = PERIOD * PIECES * fine
        swings = [math.radians(swing) * (1.0 + 0.3 * a) for a, _ in vary]
        lengths = [1.0 + 0.5 * b for _, b in vary]
        total, bends = sum(lengths), len(vary)
        # The way along the river at which each bend begins, as shares of the period
        starts = [sum(lengths[:bend]) / total for bend in range(bends)]
        points, angles = [(0.0, 0.0)], []
        for step in range(count):
            share = (step + 0.5) / count
            bend = max(k for k in range(bends) if starts[k] <= share)
            within = (share - starts[bend]) * total / lengths[bend]
            phi = math.pi * (bend + within)
            # Between the middles of two bends one swing goes over into the other
            other = swings[(bend + (1 if within > 0.5 else -1)) % bends]
            blend = 0.5 - 0.5 * math.cos(math.pi * abs(within - 0.5))
            most = swings[bend] * (1.0 - blend) + other * blend
            angle = most * math.sin(phi) + most**3 * (
                FATNESS * math.cos(3.0 * phi) - SKEWNESS * math.sin(3.0 * phi)
            )
            angles.append(angle)
            a, r = points[-1]
            points.append((a + math.cos(angle), r + math.sin(angle)))
        # Turn it so that it comes back to its axis, and scale it to its period
        end_ahead, end_right = points[-1]
        length = math.hypot(end_ahead, end_right)
        scale = PERIOD * wavelength / length
        c, s = end_ahead / length * scale, end_right / length * scale
        nodes = [(c * a + s * r, c * r - s * a) for a, r in points[::fine]]
        middle = sum(r for _, r in nodes[1:]) / (len(nodes) - 1)
        nodes = [(a, r - middle) for a, r in nodes[:-1]]
        turn = math.atan2(end_right, end_ahead)
        headings = [
            0.5 * (angles[k * fine - 1] + angles[k * fine]) - turn for k in range(len(nodes))
        ]
        period = PERIOD * wavelength
        return cls(period, cls._pieces(nodes, headings, period, swing, wavelength))

    @staticmethod
    def _pieces(
        nodes: list[tuple[float, float]],
        headings: list[float],
        period: float,
        swing: float,
        wavelength: float,
    ) -> list[tuple[float, ...]]:
        """Return the pieces of a period, and of enough of the next ones on both sides."""
        count = len(nodes)
        # Curvature of the sine-generated curve where it bends most, for comparison
        greatest = max(math.radians(swing), 0.05) * 2.0 * math.pi / wavelength * 0.7
        chords = []
        for k in range(count):
            (a0, r0), (a1, r1) = nodes[k], nodes[(k + 1) % count]
            a1 += period if k == count - 1 else 0.0
            chords.append((a1 - a0, r1 - r0))
        curvatures = []
        for k in range(count):
            length = 0.5 * (math.hypot(*chords[k - 1]) + math.hypot(*chords[k]))
            bend = 0.5 * (headings[(k + 1) % count] - headings[k - 1])
            curvatures.append(max(-1.0, min(1.0, bend / length / greatest)))
        pieces = []
        margin = 3 * count // (4 * PERIOD)
        for piece in range(-margin, count + margin):
            k, turns = piece % count, piece // count
            (a, r), (da, dr) = nodes[k], chords[k]
            length = math.hypot(da, dr)
            h0, h1 = headings[k], headings[(k + 1) % count]
            bend_a = 0.5 * length * (math.cos(h0) - math.cos(h1))
            bend_r = 0.5 * length * (math.sin(h0) - math.sin(h1))
            gain = curvatures[(k + 1) % count] - curvatures[k]
            ahead = a + (turns - 0.5) * period
            pieces.append((ahead, r, da, dr, bend_a, bend_r, curvatures[k], gain))
        return pieces

    def nearest(self, right: Formula, ahead: Formula) -> tuple[Formula, Formula]:
        """Return metres right of the course, and its curvature there, 1 turning right."""
        ahead = ahead - floor(ahead * (1.0 / self.period) + 0.5) * self.period
        loop = Loop(len(self.pieces))
        tables = [loop.table([float(piece[n]) for piece in self.pieces]) for n in range(8)]
        start_a, start_r, along_a, along_r, bend_a, bend_r, curvature, gain = tables
        shortest = loop.table([1.0 / (p[2] ** 2 + p[3] ** 2) for p in self.pieces])
        loop.start = (as_formula(FAR), as_formula(0.0), as_formula(0.0))
        best, aside, bend = (loop.state(state) for state in range(3))
        a, r = ahead - start_a, right - start_r
        t = clamp((a * along_a + r * along_r) * shortest, 0.0, 1.0)
        for step in range(ROUNDS + 1):
            sag = t * (1.0 - t)
            from_a = a - along_a * t - bend_a * sag
            from_r = r - along_r * t - bend_r * sag
            lean = 1.0 - t * 2.0
            to_a, to_r = along_a + bend_a * lean, along_r + bend_r * lean
            if step == ROUNDS:
                break
            # Newton towards the foot of the perpendicular
            ahead_of = from_a * to_a + from_r * to_r
            speed = square(to_a) + square(to_r)
            rate = speed + (from_a * bend_a + from_r * bend_r) * 2.0
            t = clamp(t + ahead_of / maximum(rate, speed * 0.1), 0.0, 1.0)
        squared = square(from_a) + square(from_r)
        distance = sqrt(squared)
        sided = where(from_r * to_a - from_a * to_r < 0.0, -distance, distance)
        closer = squared < best
        loop.body = (
            where(closer, squared, best),
            where(closer, sided, aside),
            where(closer, curvature + gain * t, bend),
        )
        return loop.result(1), loop.result(2)
