"""Checks of what erosions promise: every cubic metre booked, idle at rest, stoppable, physical."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import Cancelled, TerrakitError
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Exporter, Generator, Importer, Operator, Surface
from terrakit.parameters import FromLayer, Schedule, bounds_of, is_maskable, within
from terrakit.quanta import FINENESS
from terrakit.running import Progress, Run
from terrakit.testing.subjects import (
    SHAPES,
    Level,
    Ramp,
    rough_terrain,
    smooth_terrain,
    with_layers,
)
from terrakit.testing.trial import Trial, difference, refusing

LOST = 1e-9
"""Largest share of the volume moved, or there, that a ledger may not account for."""
REFINEMENT = 0.35
"""How much of the change may differ when the samples are doubled, root mean square."""


def ledger_closes(trial: Trial) -> None:
    """Start, what came, what left and end of every store agree, and rough ground moved."""
    for kind, subject in trial.subjects():
        run = Run(7, trial.device).for_step(trial.name)
        trial.applied(subject, run=run)
        if not run.ledger.accounts:
            raise trial.broken("opens no account in run.ledger")
        check_ledger(trial, run, f"rough {kind}")
        if not any(account.moved > 0 for account in run.ledger.accounts.values()):
            raise trial.broken(f"ledger says that nothing moved on a rough {kind}")


def ledger_agrees_with_the_surface(trial: Trial) -> None:
    """The volume under the surface, measured before and after, is what the ledger says."""
    subjects = (
        [with_layers(trial.operator, rough_terrain(shape)) for shape in SHAPES[1:4]]
        if Heightfield in trial.operator.surfaces
        else []
    )
    subjects += [trial.surface(kind) for kind in trial.operator.surfaces if kind is TriMesh]
    for surface in subjects:
        run = Run(7, trial.device).for_step(trial.name)
        result = trial.applied(surface, run=run)
        account = run.ledger.accounts.get("rock")
        if account is None or account.end is None:
            raise trial.broken("has no closed account 'rock' in run.ledger")
        for when, booked, measured in (
            ("start", account.start, surface),
            ("end", account.end, result),
        ):
            volume, slack = _volume(measured)
            if not abs(volume - booked) <= slack:
                raise trial.broken(
                    f"ledger has {booked:.9g} m3 of rock at the {when}, under the surface there "
                    f"are {volume:.9g} (rounding explains {slack:.3g})"
                )


def check_ledger(trial: Trial, run: Run, what: str) -> None:
    """Raise ContractBroken unless every account of the run is closed without residual."""
    if not run.ledger.is_closed:
        raise trial.broken(f"{what}: leaves its ledger open")
    for store, account in run.ledger.accounts.items():
        flows = (*account.came.values(), *account.left.values())
        allowed = LOST * max(abs(account.start), account.moved, *(abs(f) for f in flows), 0.0)
        if not abs(account.residual) <= allowed:
            raise trial.broken(
                f"{what}: {account.residual:.6g} m3 of {store} are unaccounted for "
                f"(start {account.start:.6g}, moved {account.moved:.6g})"
            )


def idle_settings_change_nothing(trial: Trial) -> None:
    """With the settings declared as ``idle``, every layer comes back with its bits."""
    settings = [dict(trial.operator.idle)] if trial.operator.idle else []
    field = trial.operator.model_fields.get("iterations")
    if field is not None and within(field, 0.0, 0.0):
        settings.append({"iterations": 0})
    trial.needs(bool(settings), "declares no idle settings")
    for idle in settings:
        for kind, subject in trial.subjects():
            run = Run(7, trial.device).for_step(trial.name)
            result = trial.applied(subject, operator=trial.made(**idle), run=run)
            for name in subject:
                if not np.array_equal(
                    subject.layer(name).view(np.int32), result.layer(name).view(np.int32)
                ):
                    raise trial.broken(f"with {idle} it changes {name} of a {kind}")
            if isinstance(subject, TriMesh) and not np.array_equal(
                subject.vertices, result.vertices
            ):
                raise trial.broken(f"with {idle} it moves vertices")
            check_ledger(trial, run, f"with {idle}")


def progress_rises_to_one(trial: Trial) -> None:
    """Progress is reported, never falls and ends at 1."""
    for kind, subject in trial.subjects():
        told: list[float] = []

        def note(progress: Progress, told: list[float] = told) -> None:
            told.append(progress.fraction)

        run = Run(7, trial.device, on_progress=note)
        trial.applied(subject, run=run)
        if not told:
            raise trial.broken(f"reports no progress on a {kind}; loop with run.steps(n)")
        if told != sorted(told):
            place = next(i for i in range(1, len(told)) if told[i] < told[i - 1])
            raise trial.broken(f"progress falls from {told[place - 1]:.3f} to {told[place]:.3f}")
        if told[-1] != 1.0:
            raise trial.broken(f"progress ends at {told[-1]:.3f}, not at 1")


def cancel_is_answered(trial: Trial) -> None:
    """A cancel from the first report raises Cancelled before another step is done."""
    for kind, subject in trial.subjects():
        after: list[Progress] = []
        run = Run(7, trial.device)

        def stop(progress: Progress, run: Run = run, after: list[Progress] = after) -> None:
            after.append(progress)
            run.cancel()

        run.on_progress = stop
        try:
            trial.apply(subject, run=run)
        except Cancelled:
            pass
        except TerrakitError as error:
            raise trial.broken(f"answers a cancel with {type(error).__name__}") from error
        else:
            trial.needs(bool(after), "reports no progress from which to cancel")
            raise trial.broken(f"was cancelled on a {kind} and finished all the same")
        if len(after) > 2:
            raise trial.broken(f"made {len(after) - 1} more steps after it was cancelled")


def finish_now_keeps_what_is_there(trial: Trial) -> None:
    """Asked to finish at the first report, it returns a valid surface with a closed ledger."""
    for kind, subject in trial.subjects():
        after: list[float] = []
        run = Run(7, trial.device).for_step(trial.name)

        def stop(progress: Progress, run: Run = run, after: list[float] = after) -> None:
            after.append(progress.fraction)
            run.finish_now()

        run.on_progress = stop
        result = trial.applied(subject, run=run)
        for name in result:
            if not np.isfinite(result.layer(name)).all():
                raise trial.broken(f"asked to finish, it returns a {kind} with {name} not finite")
        check_ledger(trial, run, "asked to finish")
        if len(after) > 3:
            raise trial.broken(f"made {len(after) - 2} more steps after it was asked to finish")


def refines(trial: Trial) -> None:
    """Twice the samples of the same smooth terrain give the same change, within a tolerance."""
    tolerance = getattr(trial.operator, "refinement_tolerance", REFINEMENT)
    trial.needs(tolerance is not None, "declares refinement_tolerance = None")
    trial.needs(Heightfield in trial.operator.surfaces, "works on meshes only")
    settings = {k: None for k in ("iterations",) if _optional(trial.operator, k)}
    operator = trial.made(**{**(trial.operator.turning or {}), **settings})
    changes = []
    for samples, spacing in ((33, 20.0), (65, 10.0)):
        terrain = with_layers_smooth(trial.operator, smooth_terrain((samples, samples), spacing))
        result = trial.applied(terrain, operator=operator)
        change = result.elevation.astype(np.float64) - terrain.elevation
        changes.append(change[:: (samples - 1) // 32, :: (samples - 1) // 32])
    coarse, fine = changes
    size = float(np.sqrt((fine**2).mean()))
    if size == 0:
        raise trial.broken("changes nothing on smooth ground with slopes of 50 degrees")
    gap = float(np.sqrt(((coarse - fine) ** 2).mean())) / size
    if gap > tolerance:
        raise trial.broken(
            f"with twice the samples the change differs by {gap:.2f} of itself, more than "
            f"{tolerance:g}: something is counted in samples instead of metres"
        )


def maskable_parameters_take_layers(trial: Trial) -> None:
    """A constant layer, step or chain gives the bytes of the number; varying ones are taken."""
    names = maskable(trial.operator)
    trial.needs(bool(names), "has no maskable parameter")
    for kind, _ in trial.subjects():
        for name in names:
            low, value = two_values(trial, name)
            plain = _driven(trial, kind, name, value, value)
            for what, same in _constant(kind, value):
                gap = difference(plain, _driven(trial, kind, name, value, same))
                if gap:
                    raise trial.broken(f"{name} = {value:g} and {what}: {gap}")
            for varying in _varying(kind, low, value):
                result = _driven(trial, kind, name, value, varying)
                for layer in result:
                    if not np.isfinite(result.layer(layer)).all():
                        raise trial.broken(f"{name} = {varying!r}: {layer} is not finite")


def schedules_take_effect(trial: Trial) -> None:
    """A schedule is followed through the run, not read once at its start."""
    names = maskable(trial.operator)
    trial.needs(bool(names), "has no maskable parameter")
    for kind, _ in trial.subjects():
        for name in names:
            low, value = two_values(trial, name)
            ends = [
                trial.applied(_fresh(trial, kind), operator=trial.made(**{name: v}))
                for v in (value, low)
            ]
            if not difference(*ends):  # not what decides the result here
                continue
            schedule = Schedule(at=[0.0, 0.01, 1.0], value=[value, low, low])
            result = trial.applied(_fresh(trial, kind), operator=trial.made(**{name: schedule}))
            if not difference(ends[0], result):
                raise trial.broken(f"{name}: a schedule counts only with its first value")


def wrong_layers_are_refused(trial: Trial) -> None:
    """A layer or step that is not there, or leaves the bounds, is refused by parameter's name."""
    names = maskable(trial.operator)
    trial.needs(bool(names), "has no maskable parameter")
    for kind, _ in trial.subjects():
        for name in names:
            wrong: list[Any] = ["mask_that_is_not_there", "step_that_is_not_there.elevation"]
            if bounds_of(trial.operator.model_fields[name]):
                wrong.append("wild" if kind == "grid" else "mask_out_of_bounds")
                if kind != "TriMesh":
                    wrong.append(Ramp(low=-3e38, high=3e38))
            for value in wrong:
                with refusing(trial, f"{name} = {value!r}") as message:
                    subject, run = _masked(trial, kind, 0.0)
                    trial.apply(subject, operator=trial.made(**{name: value}), run=run)
                if name not in message[0]:
                    raise trial.broken(f"does not name {name} when refusing it: {message[0]}")


def elevation_is_untouched(trial: Trial) -> None:
    """A texture never changes the height of the ground."""
    for kind, subject in trial.subjects():
        result = trial.applied(subject)
        if not np.array_equal(subject.elevation, result.elevation):
            raise trial.broken(f"changes the elevation of a {kind}")


def weights_sum_to_one(trial: Trial) -> None:
    """Material weights lie within 0 to 1 and sum to 1 within 1e-6."""
    for _, subject in trial.subjects():
        result = trial.applied(subject)
        names = [name for name in result if name.startswith("material_") and name not in subject]
        trial.needs(bool(names), "writes no material_ layers")
        total: NDArray[Any] = np.zeros(result.elevation.shape)
        for name in names:
            weight = result.layer(name).astype(np.float64)
            if weight.min() < 0 or weight.max() > 1:
                raise trial.broken(f"{name} is {weight.min():g} to {weight.max():g}, not 0 to 1")
            total += weight
        error = float(np.abs(total - 1).max())
        if error > 1e-6:
            raise trial.broken(f"material weights sum to 1 only within {error:.3g}")


def maskable(operator: type[Operator]) -> list[str]:
    """Return the parameters that take a layer, a schedule or a chain."""
    if issubclass(operator, (Importer, Exporter)):
        return []
    return [n for n, f in operator.model_fields.items() if is_maskable(f.annotation)]


def with_layers_smooth(operator: type[Operator], terrain: Heightfield) -> Surface:
    """Return a terrain with the layers that the operator reads, each constant in space."""
    noisy = with_layers(operator, terrain, used=False)
    return noisy.with_layers(
        **{
            name: np.full(terrain.shape, np.float32(noisy.layer(name).mean()))
            for name in noisy
            if name != "elevation"
        }
    )


def _volume(surface: Surface) -> tuple[float, float]:
    """Return the volume under a surface and how far rounding may move it, cubic metres."""
    if isinstance(surface, TriMesh):
        size = float(surface.areas.sum()) * max(1.0, float(np.abs(surface.heights).max()))
        return surface.volume, 1e-9 * size
    height = surface.elevation.astype(np.float64)
    quantum = surface.spacing * 2.0**-FINENESS
    a_sample = quantum + float(np.spacing(np.float32(np.abs(height).max())))
    return float(height.sum()) * surface.cell_area, a_sample * height.size * surface.cell_area


def _optional(operator: type[Operator], name: str) -> bool:
    field = operator.model_fields.get(name)
    return field is not None and field.default is None


def _fresh(trial: Trial, kind: str) -> Any:
    return next(subject for name, subject in trial.subjects() if name == kind)


def two_values(trial: Trial, name: str) -> tuple[float, float]:
    """Return a lower value than the usual one, and the usual one, both exact in float32."""
    field = trial.operator.model_fields[name]
    now = getattr(trial.made(), name)
    value = float(np.float32(now if isinstance(now, (int, float)) else 0.5))
    for low in (0.5 * value, value - 1.0, value + 1.0, 2.0 * value):
        low = float(np.float32(low))
        if low != value and within(field, min(low, value), max(low, value)):
            return low, value
    raise trial.broken(f"{name}: there is no other value within bounds near {value:g}")


def _driven(trial: Trial, kind: str, name: str, value: float, given: Any) -> Any:
    """Return the result where a maskable parameter is ``given``; see :func:`_masked`."""
    subject, run = _masked(trial, kind, value)
    return trial.applied(subject, operator=trial.made(**{name: given}), run=run)


def _constant(kind: str, value: float) -> list[tuple[str, Any]]:
    """Return everything that means ``value`` everywhere, on the subjects of :func:`_masked`."""
    flat = Schedule(at=[0.0, 1.0], value=[value, value])
    if kind == "grid":
        return [
            ("a flat step", "value"),
            ("a layer of a step", "value.mask_value"),
            ("a scaled step", FromLayer(layer="ramp", low=value, high=value)),
            ("a flat chain", Level(offset=value)),
            ("a flat schedule", flat),
        ]
    given: list[tuple[str, Any]] = [
        ("a layer of that value", "mask_value"),
        ("a scaled layer", FromLayer(layer="mask_ramp", low=value, high=value)),
        ("a flat schedule", flat),
        ("a layer of a step", "value.mask_value"),
    ]
    return given if kind == "TriMesh" else [*given, ("a flat chain", Level(offset=value))]


def _varying(kind: str, low: float, value: float) -> list[Any]:
    """Return what means ``low`` here and ``value`` there, or now and then."""
    ramp = "ramp" if kind == "grid" else "mask_ramp"
    given: list[Any] = [
        FromLayer(layer=ramp, low=low, high=value),
        Schedule(at=[0.0, 0.5, 1.0], value=[low, value, low]),
    ]
    return given if kind == "TriMesh" else [*given, Ramp(low=low, high=value)]


def _masked(trial: Trial, kind: str, value: float) -> tuple[Any, Run]:
    """Return a subject with layers to name, and a run with steps to name."""
    subject = _fresh(trial, kind)
    ground: Surface = subject
    if isinstance(subject, Grid):
        ground = Heightfield.on_grid(subject, np.zeros(subject.shape, dtype=np.float32))
    shape = ground.elevation.shape
    ramp = np.linspace(0.0, 1.0, int(np.prod(shape)), dtype=np.float32).reshape(shape)
    layers = {
        "mask_value": np.full(shape, np.float32(value)),
        "mask_ramp": ramp,
        "mask_out_of_bounds": np.where(ramp > 0.5, np.float32(3e38), np.float32(-3e38)),
    }
    ground = ground.with_layers(**layers)
    earlier = {"value": ground}
    if isinstance(ground, Heightfield):
        steps = {"value": "mask_value", "ramp": "mask_ramp", "wild": "mask_out_of_bounds"}
        earlier = {s: ground.with_layers(elevation=layers[layer]) for s, layer in steps.items()}
    run = Run(7, trial.device, earlier=earlier)
    return (subject if issubclass(trial.operator, Generator) else ground), run
