"""A picture of the terrain: shaded relief from above, north up, or a view of it as a block."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.atomic import write_bytes
from terrakit.errors import InputError, OutputError
from terrakit.heightfield import Heightfield
from terrakit.layers import ALBEDO
from terrakit.operators import Exporter
from terrakit.parameters import parameter

if TYPE_CHECKING:
    from PIL.Image import Image

    from terrakit.running import Run

FORMATS = {".png": "PNG", ".webp": "WEBP", ".jpg": "JPEG", ".jpeg": "JPEG"}

SMOOTH = 2.5
"""A PNG in full colour beyond this many times the limit is full of detail."""


class Preview(Exporter):
    """Write a shaded relief in the Swiss manner as PNG, WebP or JPEG."""

    name: ClassVar[str] = "preview"
    uses: ClassVar[tuple[str, ...]] = (*ALBEDO, "sediment", "water_depth")
    cites: ClassVar[tuple[str, ...]] = (
        "Anderson 1982",
        "Imhof 1982",
        "Mark 1992",
        "Kennelly & Stewart 2006",
    )
    suffix: ClassVar[str] = ".png"
    suffixes: ClassVar[tuple[str, ...]] = tuple(FORMATS)
    fields: ClassVar[int] = 24
    bytes_a_sample: ClassVar[float] = 2.0

    width: int = parameter(1024, "Longest side of the picture, pixels.", ge=16, le=16384)
    view: Literal["map", "perspective"] = parameter(
        "map", "From above with north up, or as a block seen from one side, with its water."
    )
    view_direction: float = parameter(
        18.0,
        "Where the viewer looks in perspective, clockwise from north.",
        unit="deg",
        ge=0.0,
        le=360.0,
    )
    style: Literal["hypsometric", "colour"] = parameter(
        "hypsometric", "Tints by height, or the ground's own colour where it has albedo layers."
    )
    sea_level: float | None = parameter(
        None, "Height of the water in tints by height; without it that of the recipe.", unit="m"
    )
    azimuth: float = parameter(
        315.0, "Where the light comes from, clockwise from north.", unit="deg", ge=0.0, le=360.0
    )
    altitude: float = parameter(
        45.0, "How high the light stands above the horizon.", unit="deg", gt=0.0, le=90.0
    )
    exaggeration: float | None = parameter(
        None,
        "Factor on heights; without it 1 in perspective, and by the slopes in shading a map.",
        gt=0.0,
        le=1000.0,
    )
    max_kilobytes: int = parameter(
        3000,
        "A PNG beyond this size gets fewer pixels and colours.",
        ge=16,
        le=1_000_000,
        advanced=True,
    )

    def export(self, surface: Heightfield, path: Path, run: Run) -> list[Path]:
        """Write the picture; the extension chooses its format."""
        path = Path(path)
        kind = FORMATS.get(path.suffix.lower())
        if kind is None:
            raise OutputError(f"{path.name}: no picture; use {', '.join(FORMATS)}")
        picture = self.draw(surface, run.sea_level)
        run.check()
        content = _small_png(picture, self.max_kilobytes * 1000) if kind == "PNG" else None
        return [write_bytes(path, content or _encoded(picture, kind))]

    def draw(self, terrain: Heightfield, sea_level: float | None = None) -> Image:
        """Return the picture; ``sea_level`` (m) counts where the parameter is not given."""
        from PIL import Image as Images

        from terrakit.color import linear_color

        colours = None
        if self.style == "colour":
            if not all(name in terrain for name in ALBEDO):
                raise InputError(
                    "preview: style = colour needs the layers albedo_red, albedo_green and "
                    "albedo_blue; texture the terrain first, or use style = hypsometric"
                )
            colours = linear_color(terrain)

        # Shade near the size of the picture, so that large terrains cost no more than small ones.
        step = max(1, max(terrain.shape) // self.width)
        colours = None if colours is None else _block_means(colours, step)
        sea_level = sea_level if self.sea_level is None else self.sea_level
        if self.view == "perspective":
            return Images.fromarray(self._block(terrain, step, sea_level, colours))
        from terrakit.shading import relief_image

        height = _block_means(terrain.elevation, step)
        relief = relief_image(
            height,
            terrain.spacing * step,
            sea_level,
            self.azimuth,
            self.altitude,
            self.exaggeration,
            colours,
        )
        return _at_most(Images.fromarray(relief), self.width)

    def _block(
        self,
        terrain: Heightfield,
        step: int,
        sea_level: float | None,
        colours: NDArray[np.float32] | None,
    ) -> NDArray[np.uint8]:
        """Return the view of the terrain as a block, 9 to 5."""
        from terrakit.perspective import perspective_image

        layers = {
            name: _block_means(terrain.layer(name), step)
            for name in ("water_depth", "sediment")
            if name in terrain
        }
        return perspective_image(
            _block_means(terrain.elevation, step),
            terrain.spacing * step,
            sea_level,
            self.azimuth,
            self.altitude,
            1.0 if self.exaggeration is None else self.exaggeration,
            colours,
            size=(self.width, max(1, round(self.width * 5 / 9))),
            direction=self.view_direction,
            water_depth=layers.get("water_depth"),
            sediment=layers.get("sediment"),
        )


def _small_png(picture: Image, limit: int) -> bytes:
    """Return a PNG within ``limit`` bytes, giving up what the eye misses least.

    In smooth pictures that is the last levels of each channel and some pixels; 256 colours would
    show as bands. In pictures full of detail nobody sees the 256 colours.
    """
    from PIL import Image as Images

    longest = max(picture.size)
    content = _encoded(picture, "PNG")
    if limit < len(content) < SMOOTH * limit:
        for share, step in ((1.0, 2), (0.875, 3), (0.875, 4), (0.75, 3), (0.75, 4)):
            levels = [min(255, (level + step // 2) // step * step) for level in range(256)]
            content = _encoded(_at_most(picture, round(longest * share)).point(levels * 3), "PNG")
            if len(content) <= limit:
                return content
    if len(content) <= limit:
        return content
    sample = picture.resize((256, 256), Images.Resampling.NEAREST)
    palette = sample.quantize(256, method=Images.Quantize.MEDIANCUT, kmeans=1)
    share = 1.0
    while True:
        smaller = _at_most(picture, max(16, round(longest * share)))
        few = smaller.quantize(palette=palette, dither=Images.Dither.NONE)
        content = _encoded(few, "PNG")
        if len(content) <= limit or share < 0.05:
            return content
        share *= min(0.95, (limit / len(content)) ** 0.5)


def _encoded(picture: Image, kind: str) -> bytes:
    stream = io.BytesIO()
    settings = {} if kind == "PNG" else {"quality": 88}
    picture.save(stream, kind, **settings)
    return stream.getvalue()


def _at_most(picture: Image, longest: int) -> Image:
    from PIL import Image as Images

    share = longest / max(picture.size)
    if share >= 1.0:
        return picture
    width, height = (max(1, round(side * share)) for side in picture.size)
    return picture.resize((width, height), Images.Resampling.LANCZOS)


def _block_means(values: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    if step == 1:
        return values
    rows, cols = (max(1, n // step) for n in values.shape[:2])
    kept = values[: rows * step, : cols * step]
    blocks = kept.reshape(rows, kept.shape[0] // rows, cols, kept.shape[1] // cols, -1)
    means: NDArray[np.float32] = blocks.mean(axis=(1, 3), dtype=np.float32)
    return means.reshape(rows, cols, *values.shape[2:])
