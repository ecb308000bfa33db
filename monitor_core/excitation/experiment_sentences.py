"""Sentences on what a planned experiment does not determine, and what would help."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.accuracy import FAIR
from monitor_core.excitation.design import Experiment, Task
from monitor_core.excitation.optimal import information, optimal_powers
from monitor_core.excitation.prediction import linear_part
from monitor_core.wording import percent

_MOST_LINES = 80
_WORTH_IT = 1.5
"""A band that makes a standard deviation so much smaller is worth the words."""
_OFF = 0.2
"""Of Coulomb friction: it may well have changed so much since it was configured, with the temperature alone."""


def warnings(experiment: Experiment) -> tuple[str, ...]:
    """Sentences on the end position, on each badly determined parameter, and on pairs that are not distinguished."""
    return (*_ends(experiment), *_poor(experiment), *experiment.accuracy.words())


def _ends(experiment: Experiment) -> Iterator[str]:
    """A torque command does not correct the end position; a controller would."""
    task, plant = experiment.task, experiment.task.plant
    if task.command != "torque" or plant.is_linear:
        return
    torque = experiment.motion.torque
    motions = [replace(plant, coulomb=factor).moved(torque) for factor in (1 - _OFF, 1 + _OFF)]
    away, speed = (max(abs(float(getattr(m, what)[-1, 0])) for m in motions) for what in ("angle", "speed"))
    shares = [share for m in motions for share in task.limits.used(m).items() if share[1] > 1]
    name, share = max(shares, key=lambda pair: pair[1], default=("", 0.0))
    beyond = f", and comes to {100 * share:.0f} % of the {name} limit on its way" if share else ""
    yield (
        f"The torque brings the drive back and to rest with the friction that is configured; with {percent(_OFF)} more"
        f" or less Coulomb friction it ends up to {away:.2g} rad away, at up to {speed:.2g} rad/s{beyond}. Nothing but"
        " friction stops it there: have the controller or the brake take over at the last sample."
    )


def _poor(experiment: Experiment) -> Iterator[str]:
    task, accuracy = experiment.task, experiment.accuracy
    seconds = task.schedule.samples * task.plant.interval_s
    for name, sd in zip(accuracy.names, accuracy.standard_deviations.tolist(), strict=True):
        if sd > FAIR and np.isfinite(sd):
            yield (
                f"{name} cannot be told to better than {percent(sd)} in {seconds:.3g} s:"
                f" {_remedy(task, accuracy.names, name, sd)}."
            )


def _remedy(task: Task, names: tuple[str, ...], name: str, sd: float) -> str:
    longer = f"{(sd / FAIR) ** 2:.2g} times as long a record would tell it to {percent(FAIR)}"
    if names.index(name) not in linear_part(task.estimation.responses(names, task.frequency_hz)):
        return longer
    top = _better_band(task, names, name)
    if top is not None:
        return f"excite up to {top:.2g} Hz ({longer})"
    if name not in task.find:
        return f"put it among what is to be found, or widen the limits ({longer})"
    return f"widen the limits ({longer})"


def _better_band(task: Task, names: tuple[str, ...], name: str) -> float | None:
    """Upper frequency of a spectrum optimised for this parameter, if that helps much."""
    low, high = task.band_hz
    nyquist = 0.5 / task.plant.interval_s
    inside = np.linspace(max(low, task.frequency_hz[0]), high, _MOST_LINES)
    wide = np.concatenate([inside, np.linspace(high, 0.8 * nyquist, _MOST_LINES)[1:]])
    if high >= 0.8 * nyquist:
        return None
    best_inside, there = (_best(task, names, name, lines) for lines in (inside, wide))
    if best_inside is None or there is None or best_inside[0] < _WORTH_IT**2 * there[0]:
        return None
    below = np.cumsum(there[1]) / there[1].sum()
    top = float(wide[np.searchsorted(below, 0.95)])
    return top if top > high else None


def _best(task: Task, names: tuple[str, ...], name: str, lines: Floats) -> tuple[float, Floats] | None:
    """Smallest variance of this parameter, and the powers (L,) for it."""
    responses = task.estimation.responses(names, lines)
    seen = linear_part(responses)
    wanted = np.array([float(names[i] == name) for i in seen])
    if not wanted.any():
        return None
    M = information(responses[:, seen])
    try:
        powers = optimal_powers(M, task.costs(lines), wanted).powers
        covariance = np.linalg.inv(np.tensordot(powers, M, axes=1))
    except np.linalg.LinAlgError:
        return None
    return float(wanted @ np.diag(covariance)), powers
