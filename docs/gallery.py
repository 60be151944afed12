"""Draw every generator with its defaults, or every preset, as one sheet of pictures.

::

    python docs/gallery.py docs/pictures/generators.webp
    python docs/gallery.py sheet.png --only crater caldera --presets --seed 3 --erode

Each picture is 512 samples a side and as wide as the generator's ``portrait``. ``--erode`` lets
rivers and scree work on it for a while, to see whether a landform still is what it says.
"""

from __future__ import annotations

import argparse
import io
import math
from collections.abc import Iterator
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from terrakit import Grid, Heightfield, Run
from terrakit.atomic import write_bytes
from terrakit.execute import execute
from terrakit.operators import Generator
from terrakit.registry import default_registry
from terrakit.shading import relief_image

SAMPLES = 512
WIDEST = 10000.0
"""Metres a side of a generator without a portrait."""
BY_THE_SEA = ("archipelago", "atoll", "fjord", "island", "plates")
"""Generators whose ground below 0 m is drawn as water."""


def subjects(only: list[str], presets: bool) -> Iterator[tuple[str, Generator]]:
    """Yield a title and a generator for every picture."""
    for kind in default_registry().operators("generator"):
        if only and kind.name not in only:
            continue
        made = kind.from_settings(dict(kind.trial) if _required(kind) else {}, kind.name)
        assert isinstance(made, Generator)
        yield kind.name, made
        for preset in kind.presets if presets else ():
            settings = {"preset": preset}
            yield f"{kind.name}: {preset}", kind.from_settings(settings, kind.name)  # type: ignore[misc]


def picture(generator: Generator, seed: int, erode: bool) -> Image.Image:
    """Return a shaded relief of a generator's terrain."""
    width = generator.portrait or WIDEST
    grid = Grid((SAMPLES, SAMPLES), width / (SAMPLES - 1))
    terrain: Heightfield = execute(generator, grid, Run(seed))
    if erode:
        years = min(2e5, 10.0 * width)  # what is small is young
        for name, settings in (
            ("stream_power", {"duration": years}),
            ("thermal", {"distance": min(100.0, width / 200.0)}),
        ):
            operator = default_registry().get(name)(**settings)
            terrain = execute(operator, terrain, Run(seed))
    sea = 0.0 if generator.name in BY_THE_SEA else None
    return Image.fromarray(relief_image(terrain.elevation, terrain.spacing, sea))


def sheet(pictures: list[tuple[str, Image.Image]], width: int, columns: int) -> Image.Image:
    """Return pictures in rows, each with its title and what a side measures."""
    gap = 8
    side = (width - gap * (columns + 1)) // columns
    rows = math.ceil(len(pictures) / columns)
    font = ImageFont.load_default(max(11, side // 16))
    line = int(font.getbbox("Ag")[3]) + 6
    whole = Image.new("RGB", (width, gap + rows * (side + line + gap)), "#f4f1ec")
    draw = ImageDraw.Draw(whole)
    for index, (title, image) in enumerate(pictures):
        left = gap + (index % columns) * (side + gap)
        top = gap + (index // columns) * (side + line + gap)
        whole.paste(image.resize((side, side), Image.Resampling.LANCZOS), (left, top))
        draw.text((left, top + side + 1), title, fill="#33383c", font=font)
    return whole


def _required(kind: type[Generator]) -> bool:
    return any(field.is_required() for field in kind.model_fields.values())


def _distance(metres: float) -> str:
    return f"{metres / 1000:g} km" if metres >= 1000 else f"{metres:g} m"


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="names of generators")
    parser.add_argument("--presets", action="store_true", help="every preset too")
    parser.add_argument("--erode", action="store_true", help="after rivers and scree")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--width", type=int, default=1600, help="pixels")
    parser.add_argument("--columns", type=int, default=8)
    chosen = parser.parse_args()
    pictures = []
    for title, generator in subjects(chosen.only, chosen.presets):
        across = _distance(generator.portrait or WIDEST)
        image = picture(generator, chosen.seed, chosen.erode)
        pictures.append((f"{title}, {across}", image))
    drawn = sheet(pictures, chosen.width, min(chosen.columns, max(1, len(pictures))))
    stream = io.BytesIO()
    options = {"quality": 80, "method": 6} if chosen.out.suffix == ".webp" else {}
    drawn.save(stream, "WEBP" if chosen.out.suffix == ".webp" else "PNG", **options)
    write_bytes(chosen.out, stream.getvalue())


if __name__ == "__main__":
    main()
