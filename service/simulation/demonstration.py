"""The axes of the demo with another drive: torque, noises and monitored parameters follow from it.

By default a few parameters are monitored that the motion of the demo distinguishes.  Candidates are, in this order, the
torque constant, the reciprocal of the last inertia, and the first friction that brakes a steady rotation.  A candidate
is chosen if a number of samples of the demo determine it well enough beside the others.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import TORQUE, AxisModel, Drive
from monitor_core.modeling import ModelError, Origin
from service.config import (
    AxisConfig,
    bounds_of,
    drive_of,
    given_values,
    scales_of,
    watched_drive,
    watched_values,
)
from service.config.base_table import SUFFIX
from service.config.drive_sources import Modelled, model_called
from service.simulation.axis import lines_of_motion, motion_of, stiffness

OUTPUT_NOISE = 1e-4  # rad, as in the demo with its own drive
TORQUE_NOISE = 0.04  # of the torque, as there
_USUAL_TORQUE = 1.2  # N m rms: that is what the signals of the demo's DBC are made for

SAMPLES = 200
"""The memory of the estimator at its default forgetting factor."""
WORST = 0.1
"""Largest relative standard deviation of what is taken."""

_STEP = 1e-4
_CANCELLED = 1e-6


def with_drive(axis: AxisConfig, name: str, model: str | None, monitor: Sequence[str]) -> AxisConfig:
    """An axis of the demo with a drive of the library or of a Modelica file.

    Args:
        axis: of the demo; it measures the angle.
        name: of the library, or of a file.
        model: which of the models of the file.
        monitor: parameters to monitor; empty for those that can be distinguished.

    Raises:
        ModelError: it is no drive, lacks values, or none of its parameters can be monitored.
    """
    found = model_called(name, model, "angle")
    engine = _engine(name, found)
    lines = lines_of_motion(axis.sample_interval_s)
    with np.errstate(all="ignore"):
        torque_rms = motion_of(engine, lines).torque_rms
    if not 0 < torque_rms < math.inf:
        raise ModelError("with its values no torque moves it: are they all in SI units?", _origin(name))
    noises = (TORQUE_NOISE * torque_rms, OUTPUT_NOISE)
    turning = model_called(name, model, "speed").drive
    chosen = tuple(monitor) or watchable(engine, turning, lines, torque_rms, noises)
    if not chosen:
        raise ModelError("nothing of it can be watched by the motor's torque and angle", _origin(name))
    drive = {"drive": name, "drive_model": model, "nominal": dict(found.values), "monitor": chosen}
    estimator = {"torque_noise": noises[0], "output_noise": noises[1], "initial_p": {}}
    return axis.model_copy(
        update={
            "model": axis.model.model_copy(update=drive),
            "estimator": axis.estimator.model_copy(update=estimator),
            "torque": axis.torque.model_copy(update={"factor": torque_rms / _USUAL_TORQUE}),
        }
    )


def watching(axis: AxisConfig, monitor: Sequence[str]) -> AxisConfig:
    """The axis with other monitored parameters.

    Raises:
        KeyError, ValueError: one of them is not possible.
    """
    model = axis.model.model_copy(update={"monitor": tuple(monitor)})
    estimator = axis.estimator.model_copy(update={"initial_p": {}})
    changed = axis.model_copy(update={"model": model, "estimator": estimator})
    AxisModel(
        watched_drive(changed), watched_values(changed), model.monitor, scales_of(changed), bounds_of(changed)
    )
    return changed


def usual_fault(axis: AxisConfig) -> str:
    """The default faulty parameter among the monitored ones: a friction if there is one, otherwise the first."""
    braking = set(
        frictions(drive_of(axis, "speed"), AxisModel(drive_of(axis), given_values(axis), ()).nominal)
    )
    return next((name for name in axis.model.monitor if name in braking), axis.model.monitor[0])


def _engine(name: str, found: Modelled) -> AxisModel:
    try:
        return AxisModel(found.drive, found.values, ())
    except (KeyError, ValueError) as error:
        raise ModelError(str(error.args[0]), _origin(name)) from None


def _origin(name: str) -> Origin:
    return Origin(file=name) if name.endswith(SUFFIX) else Origin(name)


# --- what is monitored by default -----------------------------------------------------------------------


def watchable(
    model: AxisModel, turning: Drive, lines: Floats, torque_rms: float, noises: tuple[float, float]
) -> tuple[str, ...]:
    """The names to monitor, up to three.

    Args:
        model: the drive, output angle, with its nominal values.
        turning: the same drive, output speed.
        lines: angular frequencies of the test signal [rad/s] (L,).
        torque_rms: size of the test signal [N m].
        noises: standard deviations per sample of torque [N m] and angle [rad].
    """
    at_lines = torque_rms / np.sqrt(len(lines))
    loudness = np.hypot(noises[0], noises[1] * np.abs(stiffness(model, lines)[0]))
    names, columns = list[str](), list[Floats]()
    for name, base in candidates(model, turning):
        column = _sensitivity(model, base, lines) * at_lines / loudness
        columns.append(np.concatenate([column.real, column.imag]))
        if _spread(columns) < WORST:
            names.append(name)
        else:
            columns.pop()
    return tuple(names)


def candidates(model: AxisModel, turning: Drive) -> Iterator[tuple[str, str]]:
    """(name to monitor, parameter of the drive) of all candidates that exist and are not zero."""
    drive = model.drive
    found = [
        ("", torque_constant(drive)),
        ("1/", last_inertia(drive)),
        ("", next(frictions(turning, model.nominal), None)),
    ]
    for prefix, base in found:
        if base is not None and model.nominal[base] != 0:
            plain = not prefix or base.isidentifier()
            yield prefix + (base if plain else f"({base})"), base


def torque_constant(drive: Drive) -> str | None:
    """The parameter that multiplies only the motor torque."""
    inside, outside = list[str](), set[str]()
    for term in drive.terms:
        names = [name for name, _ in term.powers]
        if term.matrix == "B" and drive.inputs[term.col] == TORQUE:
            inside += names
        elif term.matrix in ("A", "B", "C"):
            outside.update(names)
    return next((name for name in inside if name not in outside), None)


def last_inertia(drive: Drive) -> str | None:
    """The inertia that was drawn last, or the parameter that it is merged into."""
    known = {p.name for p in drive.parameters}
    for p in reversed(drive.drawn or drive.parameters):
        if p.unit == "kg m^2":
            names = (p.name,) if p.name in known else drive.merged_from(p.name)
            return names[-1] if names else None
    return None


def frictions(turning: Drive, values: Mapping[str, float]) -> Iterator[str]:
    """The dampings that brake a steady rotation, of a drive with the speed as output, in its order."""
    rest = turning.matrix("rest", values)[:, 0]
    for p in turning.parameters:
        if p.unit == "N m s/rad":
            change = turning.matrix("A", {**values, p.name: 2 * values[p.name]}) - turning.matrix("A", values)
            # The torques of a damper inside the drive cancel.
            if np.abs(change @ rest).max() > _CANCELLED * (np.abs(change) @ np.abs(rest)).max():
                yield p.name


def _sensitivity(model: AxisModel, name: str, omega: Floats) -> Floats:
    """Relative change of the response (L,), complex, for a relative change of the parameter."""
    changed = {**model.nominal, name: model.nominal[name] * (1 + _STEP)}
    before, after = (stiffness(m, omega)[0] for m in (model, replace(model, nominal=changed)))
    return np.asarray((before - after) / after / _STEP)


def _spread(columns: Sequence[Floats]) -> float:
    """Relative standard deviation of the last parameter, all of them being estimated."""
    S = np.column_stack(columns)
    rest = S[:, -1]
    if S.shape[1] > 1:
        rest = rest - S[:, :-1] @ np.linalg.lstsq(S[:, :-1], rest, rcond=None)[0]
    information = SAMPLES * float(rest @ rest)
    return 1 / np.sqrt(information) if information > 0 else np.inf
