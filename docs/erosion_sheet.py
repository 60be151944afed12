"""Draw what erosions do: before, after and the difference, from above and in perspective.

::

    python docs/erosion_sheet.py sheet.webp --operator thermal
    python docs/erosion_sheet.py sheet.webp --operator thermal stream_power --samples 513
    python docs/erosion_sheet.py sheet.webp --operator thermal --preset scree --set distance=80
    python docs/erosion_sheet.py sheet.webp --recipe alps

Each operator is shown on the terrain and with the settings of ``SUBJECTS``, unless the command
line says otherwise; of a recipe, *before* is what its first erosion is given. Both sides of a pair
have the same tints, light and frame. Water and loose material are tinted where layers have them.
"""

from __future__ import annotations

import argparse
import io
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

import terrakit
from terrakit import Heightfield, Run
from terrakit.atomic import write_bytes
from terrakit.color import srgb_from_linear
from terrakit.errors import RecipeError, TerrakitError
from terrakit.execute import execute
from terrakit.operators import Erosion
from terrakit.perspective import perspective_image, with_sediment, with_water
from terrakit.pipeline import run_recipe
from terrakit.recipe import load_recipe
from terrakit.registry import default_registry
from terrakit.shading import FLAT, hillshade, hypsometric, relief_image, suggested_exaggeration

LARGEST_FILE = 400_000
GAP = 8
PAPER = "#f4f1ec"
INK = "#33383c"
ERODED = ((0.93, 0.94, 0.95), (0.98, 0.72, 0.47), (0.80, 0.30, 0.10), (0.36, 0.05, 0.05))
LAID_DOWN = ((0.93, 0.94, 0.95), (0.55, 0.75, 0.90), (0.13, 0.42, 0.70), (0.03, 0.14, 0.36))
"""Colours, sRGB, from no change to the end of the scale."""

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Subject:
    """The terrain on which an operator shows what it does, and its settings."""

    steps: tuple[dict[str, Any], ...]
    size: float = 8192.0
    """Metres a side."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    sea_level: float | None = None
    zoom: float = 1.0


@dataclass(frozen=True)
class Pair:
    """A terrain before and after."""

    title: str
    before: Heightfield
    after: Heightfield
    sea_level: float | None = None
    zoom: float = 1.0


def noise(amplitude: float, wavelength: float, **settings: Any) -> dict[str, Any]:
    """Return the step that makes rolling ground of fractal noise."""
    return {"use": "fbm", "amplitude": amplitude, "wavelength": wavelength, **settings}


HILLS = noise(800.0, 6000.0, octaves=10, hurst_exponent=0.9)
MOUNTAINS = (
    noise(1400.0, 6000.0, octaves=10, hurst_exponent=0.9),
    {"use": "stream_power", "duration": 2e5},
)
CLIFFS = (
    noise(900.0, 3000.0, octaves=9, hurst_exponent=0.95),
    {"use": "terrace", "bench_height": 150.0, "sharpness": 0.9},
)
SUBJECTS: dict[str, Subject] = {
    "automaton": Subject((HILLS,), settings={"preset": "thesis_figure"}),
    "droplet": Subject((HILLS,)),
    "hillslope": Subject(MOUNTAINS),
    "hydraulic": Subject((HILLS,), settings={"storm_duration": 3.0}),
    "multiscale": Subject(
        (HILLS,),
        settings={"steps": [{"use": "stream_power", "duration": 3e5, "uplift_rate": 0.0}]},
    ),
    "repeat": Subject(
        (HILLS,),
        settings={
            "times": 10,
            "steps": [
                {"use": "stream_power", "duration": 3e4, "uplift_rate": 0.0},
                {"use": "thermal", "distance": 20.0},
            ],
        },
    ),
    "stream_power": Subject((HILLS,), settings={"duration": 3e5, "uplift_rate": 0.0}),
    "thermal": Subject(CLIFFS, 4096.0, {"distance": 60.0}),
    "weathering": Subject(CLIFFS, 4096.0, {"preset": "frost"}),
    "wind": Subject((noise(3.0, 500.0, octaves=6),), 1024.0, {"preset": "transverse"}),
}
ANYWHERE = Subject((HILLS,))


def made(name: str, samples: int, seed: int, settings: Mapping[str, Any]) -> Pair:
    """Return the terrain of an operator's subject, before and after."""
    registry = default_registry()
    kind = registry.get(name)
    if not issubclass(kind, Erosion):
        raise RecipeError(f"{name}: is no erosion; --operator takes erosions")
    subject = SUBJECTS.get(name, ANYWHERE)
    own = {} if "preset" in settings else subject.settings
    recipe = {
        "size": subject.size,
        "samples": samples,
        "seed": seed,
        "step": [*subject.steps],
    }
    if subject.sea_level is not None:
        recipe["sea_level"] = subject.sea_level
    before = terrakit.run(recipe, seed=seed).surface
    assert isinstance(before, Heightfield)
    run = Run(seed)
    run.sea_level = subject.sea_level
    after = execute(kind.from_settings({**own, **settings}, name), before, run)
    said = ", ".join(f"{key} {spoken(value)}" for key, value in {**own, **settings}.items())
    width = f"{subject.size / 1000:g} km, {samples} samples"
    title = f"{name} ({said}), {width}" if said else f"{name}, {width}"
    return Pair(title, before, after, subject.sea_level, subject.zoom)


def spoken(value: Any) -> str:
    """Return a setting in few words; of steps, which ones."""
    if isinstance(value, list):
        return " + ".join(step["use"] if isinstance(step, dict) else str(step) for step in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def made_by_recipe(source: str, samples: int | None, seed: int | None) -> Pair:
    """Return what a recipe's first erosion is given, and the recipe's result."""
    recipe = load_recipe(source, {} if samples is None else {"samples": samples})
    recipe = recipe if seed is None else recipe.with_seed(seed)
    erosions = [i for i, step in enumerate(recipe.steps) if isinstance(step.operator, Erosion)]
    if not erosions:
        raise RecipeError(f"{source}: has no erosion to show")
    steps = recipe.steps[: erosions[0]]
    given = next(i for i, s in enumerate(steps, 1) if s.name == recipe.steps[erosions[0]].input)
    run = Run(recipe.header.seed)
    before = run_recipe(replace(recipe, steps=steps[:given]), run).surface
    after = run_recipe(recipe, Run(recipe.header.seed)).surface
    if not isinstance(before, Heightfield) or not isinstance(after, Heightfield):
        raise RecipeError(f"{source}: a sheet shows heightfields")
    if before.shape != after.shape:
        raise RecipeError(f"{source}: changes its grid after the first erosion; cannot compare")
    return Pair(recipe.header.title or recipe.name, before, after, recipe.header.sea_level)


def sheet(pair: Pair, width: int) -> Image.Image:
    """Return title, three maps and two views of one pair."""
    font = ImageFont.load_default(18)
    side = (width - 4 * GAP) // 3
    wide = (width - 3 * GAP) // 2
    tall = wide * 5 // 9
    line = 26
    rows, cols = pair.before.shape
    map_size = (side, max(1, side * rows // cols))
    whole = Image.new("RGB", (width, 2 * line + map_size[1] + tall + 3 * GAP), PAPER)
    draw = ImageDraw.Draw(whole)
    draw.text((GAP, GAP), pair.title, fill=INK, font=font)
    top = line + GAP
    tints = common_tints(pair)
    maps = [relief(pair, surface, tint) for surface, tint in tints]
    picture, words = difference(pair)
    titles = ("before", "after", words)
    for index, (image, title) in enumerate(zip((*maps, picture), titles, strict=True)):
        left = GAP + index * (side + GAP)
        whole.paste(Image.fromarray(image).resize(map_size, Image.Resampling.LANCZOS), (left, top))
        draw.text((left, top + map_size[1] + 2), title, fill=INK, font=font)
    legend(whole, (GAP + 2 * (side + GAP) + 10, top + map_size[1] - 18), side // 3)
    top += map_size[1] + line + GAP
    lowest = min(float(s.elevation.min()) for s, _ in tints)
    highest = max(float(s.elevation.max()) for s, _ in tints)
    for index, (surface, tint) in enumerate(tints):
        view = perspective_image(
            surface.elevation,
            surface.spacing,
            pair.sea_level,
            colours=tint,
            size=(wide, tall),
            zoom=pair.zoom,
            heights=(lowest, highest),
            water_depth=water(surface),
        )
        whole.paste(Image.fromarray(view), (GAP + index * (wide + GAP), top))
    return whole


def common_tints(pair: Pair) -> list[tuple[Heightfield, Floats]]:
    """Return both surfaces, each with ground colours on one scale of heights."""
    both = np.concatenate((pair.before.elevation, pair.after.elevation))
    tints = np.split(hypsometric(both, None), 2)
    coloured = []
    for surface, tint in zip((pair.before, pair.after), tints, strict=True):
        if "sediment" in surface:
            tint = with_sediment(tint, surface.layer("sediment"))
        coloured.append((surface, tint))
    return coloured


def relief(pair: Pair, surface: Heightfield, tint: Floats) -> NDArray[np.uint8]:
    """Return a shaded map, of water its surface."""
    factors = [suggested_exaggeration(s.elevation, s.spacing) for s in (pair.before, pair.after)]
    factor = (factors[0] * factors[1]) ** 0.5
    depth = water(surface)
    height = surface.elevation
    if pair.sea_level is not None:
        depth = np.maximum(0.0 if depth is None else depth, pair.sea_level - height)
    if depth is not None:
        tint = with_water(tint, depth)
        height = height + np.maximum(depth, 0.0)
    return relief_image(height, surface.spacing, None, exaggeration=factor, colours=tint)


def water(surface: Heightfield) -> Floats | None:
    """Return the depth of the water, where the surface has any."""
    return surface.layer("water_depth") if "water_depth" in surface else None


def difference(pair: Pair) -> tuple[NDArray[np.uint8], str]:
    """Return a map of the change on a scale that is the same both ways, and what the scale is."""
    change = pair.after.elevation.astype(np.float64) - pair.before.elevation
    scale = rounded(float(np.quantile(np.abs(change), 0.995)) or float(np.abs(change).max()))
    share = np.clip(change / scale, -1.0, 1.0)
    # The root shows small changes too
    colour = diverging(np.sign(share) * np.sqrt(np.abs(share)))
    height = pair.after.elevation
    factor = suggested_exaggeration(height, pair.after.spacing)
    shade = hillshade(height, pair.after.spacing, exaggeration=factor) / np.float32(FLAT)
    colour = colour * np.clip(0.62 + 0.38 * shade, 0.0, 1.15)[..., None]
    words = f"difference, scale ±{scale:g} m (from {change.min():+.3g} to {change.max():+.3g} m)"
    return srgb_from_linear(colour), words


def diverging(share: NDArray[np.float64]) -> Floats:
    """Return linear colours for -1 (eroded) through 0 to 1 (laid down)."""
    at = np.linspace(0.0, 1.0, len(ERODED))
    size = np.abs(share)
    parts = []
    for channel in range(3):
        down, up = (
            np.interp(size, at, [tone[channel] for tone in tones]) for tones in (ERODED, LAID_DOWN)
        )
        coded = np.where(share < 0, down, up)
        parts.append(np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4))
    return np.stack(parts, axis=-1).astype(np.float32)


def rounded(value: float) -> float:
    """Return the next of 1, 2, 5, 10, 20 ... that is not below ``value``."""
    if value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(n * power for n in (1, 2, 5, 10) if n * power >= value * (1 - 1e-9)))


def legend(whole: Image.Image, place: tuple[int, int], width: int) -> None:
    """Draw the scale of the difference: eroded to the left, laid down to the right."""
    bar = diverging(np.broadcast_to(np.linspace(-1.0, 1.0, width), (10, width)))
    draw = ImageDraw.Draw(whole)
    font = ImageFont.load_default(14)
    left, top = place
    box = (left - 6, top - 22, left + width + 6, top + 14)
    draw.rectangle(box, fill=PAPER)
    draw.text((left, top - 20), "eroded", fill=INK, font=font)
    draw.text((left + width, top - 20), "laid down", fill=INK, font=font, anchor="ra")
    whole.paste(Image.fromarray(srgb_from_linear(bar)), place)


def stacked(sheets: list[Image.Image]) -> Image.Image:
    """Return sheets below each other."""
    whole = Image.new("RGB", (sheets[0].width, sum(s.height for s in sheets)), PAPER)
    top = 0
    for one in sheets:
        whole.paste(one, (0, top))
        top += one.height
    return whole


def save(picture: Image.Image, path: Path) -> None:
    """Save the picture, as WebP or JPEG at the best quality that keeps it below 400 kB."""
    kind = {".webp": "WEBP", ".jpg": "JPEG", ".png": "PNG"}.get(path.suffix.lower(), "WEBP")
    for quality in range(90, 20, -5):
        stream = io.BytesIO()
        picture.save(stream, kind, **({} if kind == "PNG" else {"quality": quality}))
        if kind == "PNG" or stream.tell() < LARGEST_FILE:
            break
    write_bytes(path, stream.getvalue())


def setting(text: str) -> tuple[str, Any]:
    """Return ``name=value``, the value as TOML or else as text."""
    name, _, value = text.partition("=")
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name, value


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--operator", nargs="+", default=[], help="names of erosions")
    parser.add_argument("--preset", help="of the operator")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", type=setting)
    parser.add_argument("--recipe", help="a shipped recipe or a .toml file")
    parser.add_argument("--samples", type=int, help="a side, by default 1025 or the recipe's")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--width", type=int, default=1600, help="pixels")
    chosen = parser.parse_args()
    if bool(chosen.operator) == bool(chosen.recipe):
        parser.error("give --operator or --recipe")
    settings = dict(chosen.set)
    if chosen.preset is not None:
        settings["preset"] = chosen.preset
    try:
        if chosen.recipe:
            pairs = [made_by_recipe(chosen.recipe, chosen.samples, chosen.seed)]
        else:
            seed = 7 if chosen.seed is None else chosen.seed
            pairs = [made(name, chosen.samples or 1025, seed, settings) for name in chosen.operator]
    except TerrakitError as error:
        parser.exit(1, f"{error}\n")
    save(stacked([sheet(pair, chosen.width) for pair in pairs]), chosen.out)


if __name__ == "__main__":
    main()
