"""A planned experiment: the table for the terminal, the CSV file, and the picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import BytesIO, StringIO
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from monitor_core.excitation import PlannedExperiment, warnings
from monitor_core.wording import percent
from service.config.unit_names import UNITS
from service.reports.plot_style import on_light

if TYPE_CHECKING:
    from matplotlib.axes import Axes

QUANTITIES = ("torque", "speed", "angle")
REFERENCE = {"speed": "speed_reference_rad_s", "angle": "angle_reference_rad"}


def as_csv(experiment: PlannedExperiment, torques: Mapping[str, float]) -> str:
    """Time, the predicted torque, speed and angle, and the reference where one is followed.

    ``torques``: columns of the torque, with what they are of it.
    """
    motion, task = experiment.motion, experiment.task
    columns = {
        "t_s": np.arange(len(motion.torque)) * task.plant.interval_s,
        **{name: factor * motion.torque for name, factor in torques.items()},
        "speed_rad_s": motion.speed,
        "angle_rad": motion.angle,
    }
    if task.command != "torque":
        columns[REFERENCE[task.command]] = experiment.trial.reference[0 if task.command == "angle" else 1]
    out = StringIO()
    rows = np.column_stack(list(columns.values()))
    np.savetxt(out, rows, "%.9g", ",", header=",".join(columns), comments="")
    return out.getvalue()


def print_text(experiment: PlannedExperiment, axis: str, console: Console) -> None:
    """Course, limits, crest factor, predicted standard deviations, and warnings."""
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
    yield f"The spectrum is made for what is to be found: so many times as accurate as a flat one: {each}."


# --- The picture: its motion within the limits, and its spectrum ------------------------------------------------------


_INK, _LIMIT, _BAND = (on_light(name) for name in ("text", "alarm", "zone"))


def as_picture(experiment: PlannedExperiment, title: str, form: str) -> bytes:
    """The picture as "png" or "svg"."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8.2), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left", fontsize=13)
    motion, spectrum = np.asarray(figure.subfigures(2, 1, height_ratios=(3, 1)))
    _course(np.asarray(motion.subplots(3, 1, sharex=True)), experiment)
    _spectrum(spectrum.subplots(), experiment)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=9)
    out = BytesIO()
    figure.savefig(out, format=form, dpi=130, metadata={"Date": None} if form == "svg" else None)
    return out.getvalue()


def _course(rows: np.ndarray, experiment: PlannedExperiment) -> None:
    motion, task = experiment.motion, experiment.task
    t = np.arange(len(motion.torque)) * task.plant.interval_s
    limits = task.limits.by_name()
    for axes, name in zip(rows, QUANTITIES, strict=True):
        evaluated = t[task.schedule.evaluated]
        axes.axvspan(evaluated[0], evaluated[-1], color=_BAND, linewidth=0)
        axes.plot(t, getattr(motion, name), linewidth=0.8, color=_INK)
        if np.isfinite(limits[name]):
            for limit in (-limits[name], limits[name]):
                axes.axhline(limit, color=_LIMIT, linewidth=1.2, linestyle=(0, (2, 3)))
        axes.set_ylabel(f"{name} [{UNITS[name]}]")
        axes.margins(x=0)
        axes.set_title(_used(experiment, name), loc="right", fontsize=9)
    rows[0].set_title("shaded: whole periods", loc="left", fontsize=9)
    rows[-1].set_xlabel("time [s]")


def _used(experiment: PlannedExperiment, name: str) -> str:
    share = experiment.used[name]
    if not np.isfinite(experiment.task.limits.by_name()[name]):
        return "no limit"
    binds = ", binds" if experiment.trial.fitted.binding == name else ""
    return f"{100 * share:.0f} % of the limit{binds}"


def _spectrum(axes: Axes, experiment: PlannedExperiment) -> None:
    signal = experiment.trial.signal
    axes.vlines(signal.frequency_hz, 0, signal.amplitudes, color=_INK, linewidth=1)
    axes.plot(signal.frequency_hz, signal.amplitudes, ".", color=_INK, markersize=3)
    axes.set_xlim(0, float(signal.frequency_hz.max()) * 1.05)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("amplitude of torque [N m]")
    axes.set_title(f"spectrum; crest factor {experiment.crest:.2f}", loc="left", fontsize=10)
