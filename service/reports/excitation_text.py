"""A planned experiment as a table for the terminal, and as rows of a CSV file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.table import Table

from monitor_core.excitation import Experiment, warnings
from monitor_core.wording import percent

UNITS = {"torque": "N m", "speed": "rad/s", "angle": "rad"}
REFERENCE = {"speed": "speed_reference_rad_s", "angle": "angle_reference_rad"}


def as_csv(experiment: Experiment) -> Iterator[str]:
    """Lines of the file: time, the predicted torque, speed and angle, and the reference where one is followed."""
    motion, task = experiment.motion, experiment.task
    columns = {
        "t_s": np.arange(len(motion.torque)) * task.plant.interval_s,
        "torque_Nm": motion.torque[:, 0],
        "speed_rad_s": motion.speed[:, 0],
        "angle_rad": motion.angle[:, 0],
    }
    if experiment.trial.reference is not None:
        columns[REFERENCE[task.command]] = experiment.trial.reference[0 if task.command == "angle" else 1]
    yield ",".join(columns) + "\n"
    for row in zip(*columns.values(), strict=True):
        yield ",".join(f"{value:.9g}" for value in row) + "\n"


def print_text(experiment: Experiment, axis: str, console: Console) -> None:
    """Course, limits, crest factors, predicted standard deviations, and warnings."""
    task, signal = experiment.task, experiment.trial.signal
    s, h = task.schedule, task.plant.interval_s
    console.print(
        f"{axis}: {s.samples} samples, {s.samples * h:.4g} s: {s.N * h:.4g} s to warm up, {s.periods}"
        f" period{'s' if s.periods > 1 else ''} of {s.N * h:.4g} s, {s.fade * h:.4g} s to fade out"
    )
    console.print(
        f"{len(signal.lines)} lines from {signal.frequency_hz[0]:.3g} to {signal.frequency_hz[-1]:.4g} Hz,"
        f" torque {signal.rms:.3g} N m rms"
    )
    crests = experiment.crests
    console.print(
        f"crest factor {crests['optimised']:.2f} (random phases {crests['random']:.2f},"
        f" Schroeder's {crests['Schroeder']:.2f})\n"
    )
    console.print(_limits(experiment))
    console.print(_accuracy(experiment))
    if experiment.held:
        console.print(f"held at their nominal values: {', '.join(experiment.held)}")
    for sentence in (*_gained(experiment), *warnings(experiment)):
        console.print(f"- {sentence}", soft_wrap=True)


def _limits(experiment: Experiment) -> Table:
    table = Table("", "largest", "limit", "used", box=None, pad_edge=False)
    limits, used = experiment.task.limits.by_name(), experiment.used
    peaks = {name: np.abs(getattr(experiment.motion, name)).max() for name in UNITS}
    for name, unit in UNITS.items():
        if not np.isfinite(limits[name]):
            table.add_row(name, f"{peaks[name]:.4g} {unit}", "none", "")
            continue
        binds = "  binds" if experiment.trial.fitted.binding == name else ""
        table.add_row(
            name,
            f"{peaks[name]:.4g} {unit}",
            f"{limits[name]:.4g} {unit}",
            f"{100 * used[name]:.1f} %{binds}",
        )
    return table


def _accuracy(experiment: Experiment) -> Table:
    compared = experiment.flat is not experiment.accuracy
    table = Table(
        "parameter", "predicted sd", *(["with a flat spectrum"] if compared else []), box=None, pad_edge=False
    )
    accuracy, flat = experiment.accuracy, experiment.flat
    for name, sd, other in zip(
        accuracy.names, accuracy.standard_deviations, flat.standard_deviations, strict=True
    ):
        table.add_row(name, percent(sd), *([percent(other)] if compared else []))
    return table


def _gained(experiment: Experiment) -> Iterator[str]:
    if not experiment.task.find:
        return
    if experiment.flat is experiment.accuracy:
        yield "A flat spectrum is the best that was found within these limits."
        return
    each = ", ".join(f"{name} {gain:.2g}" for name, gain in experiment.gains.items())
    yield f"The spectrum is made for what is to be found: so many times as accurate as a flat one: {each}."
