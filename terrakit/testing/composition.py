"""Checks of how operators fit together: terrain in parameters, other grids, small ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrakit.errors import TerrakitError
from terrakit.heightfield import Grid, Heightfield
from terrakit.layers import covers
from terrakit.operators import Filter, Operator, Surface
from terrakit.parameters import is_source, is_step_name
from terrakit.running import Run
from terrakit.testing.erosion import two_values
from terrakit.testing.subjects import Level, Ramp, crop, rough_terrain, with_layers
from terrakit.testing.trial import Trial, difference, refusing

SMALL = ((1, 1), (1, 9), (9, 1), (2, 2))


def terrain_parameters_take_terrain(trial: Trial) -> None:
    """A number, a flat step, a layer and a flat chain give the same bytes; hills are taken."""
    names = _terrain_parameters(trial)
    for name in names:
        low, value = two_values(trial, name)
        results: list[tuple[str, Any]] = []
        for what, given in (
            ("a number", value),
            ("a flat step", "flat"),
            ("a layer of a step", "hills.mask_flat"),
            ("a flat chain", Level(offset=value)),
        ):
            subject, run = _with_steps(trial, value)
            try:
                made = trial.apply(subject, operator=trial.made(**{name: given}), run=run)
            except TerrakitError as error:
                if what == "a number":  # it may need a terrain that has relief, or a place
                    continue
                raise trial.broken(f"{name}: refuses {what}: {error}") from error
            results.append((what, made))
        for what, result in results[1:]:
            gap = difference(results[0][1], result)
            if gap:
                raise trial.broken(f"{name} = {value:g} m as {results[0][0]} and as {what}: {gap}")
        for what, varying in (("hills", "hills"), ("a ramp", Ramp(low=low, high=value))):
            subject, run = _with_steps(trial, value)
            result = trial.applied(subject, operator=trial.made(**{name: varying}), run=run)
            for layer in result:
                if not np.isfinite(result.layer(layer)).all():
                    raise trial.broken(f"{name} = {what}: {layer} is not finite")


def wrong_terrains_are_refused(trial: Trial) -> None:
    """A step that is not there, lies elsewhere or is a mesh is refused in one line, by its name."""
    names = _terrain_parameters(trial)
    for name in names:
        usual = [_outcome(trial, name, given) for given in ("hills", "flat")]
        if usual[0] is not None and usual[1] is not None and not difference(*usual):
            continue  # with these settings it does not look
        for wrong in ("step_that_is_not_there", "elsewhere", "mesh"):
            subject, run = _with_steps(trial, 1.0)
            with refusing(trial, f"{name} = {wrong!r}") as message:
                trial.apply(subject, operator=trial.made(**{name: wrong}), run=run)
            if wrong not in message[0]:
                raise trial.broken(f"does not name {wrong!r} when refusing it: {message[0]}")


def unknown_steps_are_refused(trial: Trial) -> None:
    """A parameter that is a step's name refuses one that is not there, in one line."""
    fields = trial.operator.model_fields.items()
    names = [name for name, field in fields if is_step_name(field)]
    trial.needs(bool(names), "has no parameter that names a step")
    for name in names:
        subject, run = _with_steps(trial, 1.0)
        with refusing(trial, f"{name} = 'step_that_is_not_there'") as message:
            given = trial.made(**{name: "step_that_is_not_there"})
            trial.apply(subject, operator=given, run=run)
        if "step_that_is_not_there" not in message[0]:
            raise trial.broken(f"does not name the step that it refuses: {message[0]}")


def grid_is_as_announced(trial: Trial) -> None:
    """The result lies on the grid that ``grid_after`` tells beforehand, if it tells any."""
    operator = _filter_of_grids(trial)
    for shape, spacing in (((33, 33), 10.0), ((17, 24), 7.5)):
        terrain = with_layers(trial.operator, rough_terrain(shape, spacing))
        assert isinstance(terrain, Heightfield)
        expected = operator.grid_after(terrain.grid)
        if not operator.changes_grid and expected != terrain.grid:
            raise trial.broken(f"announces {expected}, but declares that it keeps the grid")
        result = trial.applied(terrain, operator=operator)
        if expected is not None and result.grid != expected:
            raise trial.broken(f"announces {expected}, returns {result.grid}")


def layers_come_along(trial: Trial) -> None:
    """Every layer is there on the new grid, with values from its own range."""
    operator = _filter_of_grids(trial)
    trial.needs(operator.changes_grid, "keeps the grid")
    terrain = with_layers(trial.operator, rough_terrain((33, 33)))
    assert isinstance(terrain, Heightfield)
    result = trial.applied(terrain, operator=operator)
    for name in terrain:
        if covers(operator.writes, name):
            continue
        before, after = terrain.layer(name), result.layer(name)
        slack = 0.5 * float(np.ptp(before))
        if float(after.min()) < before.min() - slack or float(after.max()) > before.max() + slack:
            raise trial.broken(
                f"takes {name} along as {after.min():g} to {after.max():g}, it was "
                f"{before.min():g} to {before.max():g}"
            )
        if after.size > 4 and np.ptp(before) > 0 and np.ptp(after) == 0:
            raise trial.broken(f"takes {name} along as {after.flat[0]:g} everywhere")


def small_terrain_is_no_trap(trial: Trial) -> None:
    """Terrain of a sample or a row is worked on or refused in one line, never a crash."""
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    for shape in SMALL:
        whole = with_layers(trial.operator, rough_terrain((9, 9)))
        assert isinstance(whole, Heightfield)
        terrain = crop(whole, 0, 0, *shape)
        try:
            result = trial.apply(terrain)
        except TerrakitError as error:
            if "\n" in str(error):
                raise trial.broken(f"refuses {shape} in several lines: {error}") from error
            continue
        for name in result:
            if not np.isfinite(result.layer(name)).all():
                raise trial.broken(f"makes {name} of {shape[0]}x{shape[1]} samples not finite")


def _filter_of_grids(trial: Trial) -> Filter:
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    operator: Operator = trial.made()
    assert isinstance(operator, Filter)
    return operator


def _terrain_parameters(trial: Trial) -> list[str]:
    fields = trial.operator.model_fields.items()
    names = [name for name, field in fields if is_source(field.annotation)]
    trial.needs(bool(names), "has no parameter that takes a terrain")
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    return names


def _outcome(trial: Trial, name: str, given: Any) -> Any:
    subject, run = _with_steps(trial, 1.0)
    try:
        return trial.apply(subject, operator=trial.made(**{name: given}), run=run)
    except TerrakitError:
        return None


def _with_steps(trial: Trial, value: float) -> tuple[Any, Run]:
    """Return a subject on a grid, and a run with steps to name."""
    subject = next(made for kind, made in trial.subjects() if kind in ("grid", "Heightfield"))
    grid = subject if isinstance(subject, Grid) else subject.grid
    flat = np.full(grid.shape, np.float32(value))
    hills = rough_terrain(grid.shape, grid.spacing, origin=grid.north_west)
    aside = Grid(grid.shape, grid.spacing, (grid.north_west[0] + 0.5 * grid.spacing, 0.0))
    earlier: dict[str, Surface] = {
        "flat": Heightfield.on_grid(grid, flat),
        "hills": hills.with_layers(mask_flat=flat),
        "elsewhere": Heightfield.on_grid(aside, flat),
        "mesh": hills.to_mesh(),
    }
    return subject, Run(7, trial.device, earlier=earlier)
