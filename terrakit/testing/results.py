"""Checks of the bytes that come out: same seed, same device or not, same terrain turned or cut."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from terrakit.errors import TerrakitError
from terrakit.formula import FormulaFilter, FormulaGenerator
from terrakit.heightfield import Grid, Heightfield
from terrakit.layers import covers
from terrakit.mesh import TriMesh
from terrakit.operators import Filter, Generator, Surface, Texture
from terrakit.running import Run
from terrakit.testing.child import run_elsewhere
from terrakit.testing.subjects import (
    SHAPES,
    awkward_terrains,
    crop,
    irregular_mesh,
    rough_terrain,
    turned,
    turns,
    with_layers,
)
from terrakit.testing.trial import Trial, difference

WORK_GROUPS = (1, 7, 64, 256)
SEED = 7


def same_seed_gives_same_bytes(trial: Trial) -> None:
    """Twice here, in another thread and in a spawned process: the same bytes."""
    for kind, _ in trial.subjects():
        once, again = (trial.applied(_fresh(trial, kind)) for _ in range(2))
        with ThreadPoolExecutor(1) as threads:
            elsewhere = threads.submit(trial.applied, _fresh(trial, kind)).result()
        for other in (again, elsewhere):
            gap = difference(once, other)
            if gap:
                raise trial.broken(f"same seed, same device, but the second result: {gap}")


def same_bytes_in_another_process(trial: Trial) -> None:
    """A spawned process with another hash seed makes the same bytes."""
    for kind, subject in trial.subjects():
        here = trial.applied(subject)
        gap = difference(here, run_elsewhere(trial, trial.made(), _fresh(trial, kind), SEED))
        if gap:
            raise trial.broken(f"a spawned process with another hash seed made: {gap}")


def seed_decides(trial: Trial) -> None:
    """An operator with a ``seed`` gives something else for another seed, its own or the run's."""
    trial.needs("seed" in trial.operator.model_fields, "declares no parameter 'seed'")
    for kind, subject in trial.subjects():
        first = trial.applied(subject, operator=trial.made(seed=1))
        for what, other in (
            ("its own seed", {"operator": trial.made(seed=2)}),
            ("the run's seed", {"operator": trial.made(seed=1), "seed": SEED + 1}),
        ):
            if not difference(first, trial.applied(_fresh(trial, kind), **other)):
                raise trial.broken(f"another seed ({what}) gives the same {kind}")


def input_is_untouched(trial: Trial) -> None:
    """What is handed in keeps its bytes, on the host and on the device."""
    for kind, subject in trial.subjects():
        if isinstance(subject, Grid):
            continue
        before = {name: subject.layer(name).copy() for name in subject}
        vertices = subject.vertices.copy() if isinstance(subject, TriMesh) else None
        device = Run(SEED, trial.device).device
        if isinstance(subject, Heightfield) and device is not None:
            for name in subject:
                subject.on(device, name)
        for where in dict.fromkeys((trial.device, trial.reference())):
            trial.applied(subject, device=where)
            for name, values in before.items():
                if not np.array_equal(values, subject.layer(name)):
                    raise trial.broken(f"changed {name} of the {kind} that it was given")
                if (
                    isinstance(subject, Heightfield)
                    and device is not None
                    and not np.array_equal(values, subject.on(device, name).download())
                ):
                    raise trial.broken(f"its kernel wrote into {name} that it was given")
            if vertices is not None and not np.array_equal(vertices, subject.vertices):
                raise trial.broken("moved the vertices of the mesh that it was given")


def writes_what_it_declares(trial: Trial) -> None:
    """Declared layers are there and finite; every other layer is the very object handed in."""
    declared = trial.made().writes  # what it holds within may write more than its class
    moves = issubclass(trial.operator, Filter) and trial.operator.changes_grid
    for kind, subject in trial.subjects():
        result = trial.applied(subject)
        if not isinstance(result, (Heightfield, TriMesh)):
            raise trial.broken(f"returned a {type(result).__name__}, not a terrain")
        before: Any = subject
        if isinstance(subject, Grid):
            before = {}
            if not isinstance(result, Heightfield) or result.grid != subject:
                raise trial.broken(f"returned a terrain that is not on the grid {subject}")
        else:
            if type(result) is not type(subject):
                raise trial.broken(f"turned a {kind} into a {type(result).__name__}")
            if isinstance(result, Heightfield) and result.grid != before.grid and not moves:
                raise trial.broken("changed the grid")
        for name in result:
            if covers(declared, name):
                continue
            if name not in before and not (isinstance(result, TriMesh) and name == "elevation"):
                raise trial.broken(f"wrote layer {name!r}, which it does not declare")
            if moves:
                continue  # it takes every layer along, see layers_come_along
            if isinstance(result, Heightfield):
                shared = result.layers[name] is subject.layers[name]
            else:
                shared = np.array_equal(result.layer(name), subject.layer(name))
            if not shared:
                raise trial.broken(f"replaced layer {name!r}, which it does not declare")
        for name in before:
            if name not in result:
                raise trial.broken(f"dropped layer {name!r}")
        for name in declared:
            if not name.endswith("_") and name not in result:
                raise trial.broken(f"declares that it writes {name!r}, and did not")


def reference_equals_opencl(trial: Trial) -> None:
    """The NumPy reference and the device give the same bits on every shape and awkward terrain."""
    _need_exact(trial)
    device = trial.other_device()
    for what, make in _parity_subjects(trial):
        results = [_outcome(trial, make(), d) for d in (trial.reference(), device)]
        _compare(trial, what, *results)


def work_groups_do_not_matter(trial: Trial) -> None:
    """Work-groups of 1, 7, 64 and 256 give the same bits; formulas, which all share one kernel's
    way of numbering its work, are tried with 7, and their engine with all.
    """
    _need_exact(trial)
    device = trial.other_device()
    is_formula = issubclass(trial.operator, (FormulaGenerator, FormulaFilter))
    sizes = WORK_GROUPS[1:2] if is_formula else WORK_GROUPS
    for kind, subject in trial.subjects((33, 47)):
        usual = trial.applied(subject, device=device)
        for size in sizes:
            if size <= device.largest_work_group:
                other = trial.applied(_fresh(trial, kind, (33, 47)), device=device, work_group=size)
                gap = difference(usual, other)
                if gap:
                    raise trial.broken(f"with work-groups of {size} the {kind}: {gap}")


def awkward_terrain_is_survived(trial: Trial) -> None:
    """Flat, spiky, huge, tiny and deep terrains give finite layers and a closed ledger."""
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    from terrakit.testing.erosion import check_ledger

    subjects: list[tuple[str, Any]] = []
    if issubclass(trial.operator, Generator):
        for x, y in ((0.0, 0.0), (1e6, -1e6), (4.5e6, 5.5e6)):
            subjects += [(f"origin {x:g}, {y:g}", Grid((17, 9), 10.0, (x, y)))]
        subjects += [("one sample", Grid((1, 1), 10.0)), ("one row", Grid((1, 9), 10.0))]
        subjects += [("samples 1 km apart", Grid((9, 9), 1000.0))]
        subjects += [("samples 1 cm apart", Grid((9, 9), 0.01))]
    else:
        subjects = [(n, with_layers(trial.operator, t)) for n, t in awkward_terrains()]
    for what, subject in subjects:
        run = Run(SEED, trial.device).for_step(trial.name)
        result = trial.applied(subject, run=run)
        for name in result:
            wrong = int((~np.isfinite(result.layer(name))).sum())
            if wrong:
                raise trial.broken(f"{what}: {wrong} values of {name} are not finite")
        check_ledger(trial, run, what)


def turning_turns_the_result(trial: Trial) -> None:
    """Quarter turns and mirrors of the terrain turn and mirror the result, bit for bit."""
    settings = trial.operator.turning
    trial.needs(settings is not None, "declares turning = None")
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    assert settings is not None
    operator = trial.made(**settings)
    for shape in ((33, 33), (17, 24)):
        terrain = with_layers(trial.operator, rough_terrain(shape))
        assert isinstance(terrain, Heightfield)
        straight = trial.applied(terrain, operator=operator)
        for how, turn, back in turns():
            result = turned(trial.applied(turned(terrain, turn), operator=operator), back)
            gap = difference(straight, result)
            if gap:
                raise trial.broken(f"terrain {how}: {gap}")


def tile_equals_whole(trial: Trial) -> None:
    """A part computed alone, with the declared margin, equals the same part of the whole."""
    locality = trial.operator.locality
    trial.needs(locality != "global", "declares locality = 'global'")
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    trial.needs(not getattr(trial.operator, "changes_grid", False), "changes the grid")
    rounds = 1
    changes: dict[str, Any] = {}
    counts = "iterations" in trial.operator.model_fields
    if not issubclass(trial.operator, (Generator, Texture)) and counts:
        rounds = 3
        changes["iterations"] = rounds
    elif not issubclass(trial.operator, (Generator, Filter, Texture)):
        trial.needs(False, "has no 'iterations' to count")
    operator = trial.made(**changes)
    for spacing, origin in ((10.0, None), (7.3, (1e6, 2e6)), (30.0, (-123456.7, 89.1))):
        margin = 0
        if locality == "stencil":
            reach = operator.reach(spacing)
            if reach is None:
                raise trial.broken("declares locality = 'stencil', but reach() is None")
            margin = rounds * reach
        rows, cols = 12 + 2 * margin, 9 + 2 * margin
        top, left = 11, 14
        whole = Grid((rows + 20, cols + 23), spacing, origin)
        terrain: Any = rough_terrain(whole.shape, spacing, origin=whole.north_west)
        if issubclass(trial.operator, Generator):
            x, y = whole.north_west
            place = (x + left * spacing, y - top * spacing)
            subjects: tuple[Any, Any] = (whole, Grid((rows, cols), spacing, place))
        else:
            terrain = with_layers(trial.operator, terrain)
            subjects = (terrain, crop(terrain, top, left, rows, cols))
        made = [
            trial.applied(subject, operator=operator, run=Run(SEED, trial.device, world=whole))
            for subject in subjects
        ]
        inner = rows - 2 * margin, cols - 2 * margin
        expected = crop(made[0], top + margin, left + margin, *inner)
        gap = difference(expected, crop(made[1], margin, margin, *inner))
        if gap:
            raise trial.broken(f"a tile (spacing {spacing:g} m, margin {margin}): {gap}")


def far_away_is_as_sharp(trial: Trial) -> None:
    """A million metres from the origin there is as much detail as at the origin."""
    near, far = (
        trial.applied(Grid((64, 48), 10.0, origin)).elevation.astype(np.float64)
        for origin in ((0.0, 0.0), (1e6, 1e6))
    )
    detail = [float(np.abs(np.diff(z, 2, axis=1)).mean()) for z in (near, far)]
    trial.needs(detail[0] > 0, "makes flat ground at the origin")
    if not 0.2 < detail[1] / detail[0] < 5.0 or len(np.unique(far)) < 0.5 * len(np.unique(near)):
        raise trial.broken(
            f"detail is {detail[0]:.3g} m at the origin and {detail[1]:.3g} m at 1000 km"
        )


def _fresh(trial: Trial, kind: str, shape: tuple[int, int] = (33, 33)) -> Any:
    return next(subject for name, subject in trial.subjects(shape) if name == kind)


def _need_exact(trial: Trial) -> None:
    trial.needs(trial.operator.parity == "exact", f"declares parity = {trial.operator.parity!r}")


def _parity_subjects(trial: Trial) -> list[tuple[str, Any]]:
    operator = trial.operator
    if issubclass(operator, Generator):
        grids = [Grid(shape, 10.0) for shape in SHAPES]
        grids += [Grid((1, 1), 10.0), Grid((33, 17), 7.3, (1e6, -2e6))]
        return [(f"grid {g.shape}", lambda g=g: g) for g in grids]
    made: list[tuple[str, Any]] = []
    if Heightfield in operator.surfaces:
        for shape in SHAPES:
            name = f"terrain of {shape[0]}x{shape[1]}"
            made.append((name, lambda s=shape: with_layers(operator, rough_terrain(s))))
        bare = rough_terrain((17, 33), 7.3)
        if all(name == "elevation" for name in operator.reads):
            made.append(("terrain without layers", lambda: bare))
        for name, terrain in awkward_terrains():
            made.append((name, lambda t=terrain: with_layers(operator, t)))
    if TriMesh in operator.surfaces:
        made.append(("mesh of a grid", lambda: with_layers(operator, rough_terrain().to_mesh())))
        made.append(("uneven mesh", lambda: with_layers(operator, irregular_mesh(33))))
    return made


def _outcome(trial: Trial, subject: Any, device: Any) -> Surface | str:
    try:
        result: Surface = trial.apply(subject, device=device)
    except (TerrakitError, AssertionError) as error:
        return str(error)
    return result


def _compare(trial: Trial, what: str, first: Surface | str, second: Surface | str) -> None:
    if isinstance(first, str) and isinstance(second, str):
        return
    if isinstance(first, str) or isinstance(second, str):
        told = first if isinstance(first, str) else second
        raise trial.broken(f"{what}: only one of reference and OpenCL refuses it: {told}")
    gap = difference(first, second)
    if gap:
        raise trial.broken(f"{what}: reference and OpenCL: {gap}")
