"""A planned experiment: the table for the terminal, and the CSV file."""

from collections.abc import Iterator, Mapping
from io import StringIO

import numpy as np
from rich.console import Console
from rich.table import Table

from monitor_core.excitation import PlannedExperiment, warnings
from monitor_core.wording import percent
from service.config.unit_names import UNITS

QUANTITIES = ("torque", "speed", "angle")


def as_csv(experiment: PlannedExperiment, torques: Mapping[str, float], angles: Mapping[str, float]) -> str:
    """Time, the predicted torque, speed and angle, and the reference where one is followed.

    ``torques``, ``angles``: columns of the torque and of the angle, with their factors.
    """
    motion, task = experiment.motion, experiment.task
    columns = {
        "t_s": np.arange(len(motion.torque)) * task.plant.interval_s,
        **{name: factor * motion.torque for name, factor in torques.items()},
        "speed_rad_s": motion.speed,
        **{name: factor * motion.angle for name, factor in angles.items()},
    }
    if task.command == "speed":
        columns["speed_reference_rad_s"] = experiment.trial.reference[1]
    if task.command == "angle":
        reference = experiment.trial.reference[0]
        columns |= {name.replace("angle", "angle_reference"): factor * reference for name, factor in angles.items()}
    out = StringIO()
    rows = np.column_stack(list(columns.values()))
    np.savetxt(out, rows, "%.9g", ",", header=",".join(columns), comments="")
    return out.getvalue()


def print_text(experiment: PlannedExperiment, axis: str, console: Console) -> None:
    """Time course, limits, crest factor, predicted standard deviations, and warnings."""
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
    console.print(f"crest factor {experiment.crest:.2f}\n")
    console.print(_limits(experiment))
    console.print(_accuracy(experiment))
    if experiment.held:
        console.print(f"held at their nominal values: {', '.join(experiment.held)}")
    for sentence in (*_gained(experiment), *warnings(experiment)):
        console.print(f"- {sentence}", soft_wrap=True)


def _limits(experiment: PlannedExperiment) -> Table:
    table = Table("", "largest", "limit", "used", box=None, pad_edge=False)
    limits, used = experiment.task.limits.by_name(), experiment.used
    for name in QUANTITIES:
        peak, unit, limit, share = np.abs(getattr(experiment.motion, name)).max(), UNITS[name], "none", ""
        if np.isfinite(limits[name]):
            limit = f"{limits[name]:.4g} {unit}"
            binds = "  binds" if experiment.trial.fitted.binding == name else ""
            share = f"{100 * used[name]:.1f} %{binds}"
        table.add_row(name, f"{peak:.4g} {unit}", limit, share)
    return table


def _accuracy(experiment: PlannedExperiment) -> Table:
    accuracy, flat = experiment.accuracy, experiment.flat
    compared = [] if flat is accuracy else ["with a flat spectrum"]
    table = Table("parameter", "predicted sd", *compared, box=None, pad_edge=False)
    deviations = zip(accuracy.names, accuracy.standard_deviations, flat.standard_deviations, strict=True)
    for name, sd, other in deviations:
        table.add_row(name, percent(sd), *([percent(other)] if compared else []))
    return table


def _gained(experiment: PlannedExperiment) -> Iterator[str]:
    if not experiment.task.find:
        return
    if experiment.flat is experiment.accuracy:
        yield "A flat spectrum is the best that was found within these limits."
        return
    each = ", ".join(f"{name} {gain:.2g}" for name, gain in experiment.gains.items())
    yield f"The spectrum is shaped for what is to be found. Times as accurate as with a flat one: {each}."
