"""Default choice of monitored parameters for the demo: a few that its motion distinguishes.

Candidates are, in this order, the torque constant, the reciprocal of the last inertia, and the first friction that
brakes a steady rotation.  A candidate is chosen if a number of samples of the demo determine it well enough beside the
others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import TORQUE, AxisModel, Drive
from service.simulation.planned_motion import stiffness

SAMPLES = 200
"""The memory of the estimator at its default forgetting factor."""
WORST = 0.1
"""Largest relative standard deviation of what is taken."""

_STEP = 1e-4
_CANCELLED = 1e-6


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
