"""Plot of a planned experiment: its motion within the limits, its spectrum, its predicted accuracy."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from monitor_core.excitation import Experiment

_INK, _LIMIT, _FLAT, _BAND = "#1f4e79", "#b3261e", "#9aa5b1", "#e8eef4"
_STYLE = {"linewidth": 0.8, "color": _INK}


def as_picture(experiment: Experiment, title: str, form: str) -> bytes:
    """The picture as "png" or "svg"."""
    figure = Figure(figsize=(11, 8.2), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left", fontsize=13)
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.7, 1)))
    _course(np.asarray(left.subplots(3, 1, sharex=True)), experiment)
    spectrum, bars = np.asarray(right.subplots(2, 1, height_ratios=(1, 1.2)))
    _spectrum(spectrum, experiment)
    _bars(bars, experiment)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=9)
    out = BytesIO()
    figure.savefig(out, format=form, dpi=130, metadata={"Date": None} if form == "svg" else None)
    return out.getvalue()


def _course(rows: np.ndarray, experiment: Experiment) -> None:
    motion, task = experiment.motion, experiment.task
    t = np.arange(len(motion.torque)) * task.plant.interval_s
    limits = task.limits.by_name()
    each = (
        ("torque", motion.torque, "torque [N m]"),
        ("speed", motion.speed, "speed [rad/s]"),
        ("angle", motion.angle, "angle [rad]"),
    )
    for axes, (name, signal, label) in zip(rows, each, strict=True):
        evaluated = t[task.schedule.evaluated]
        axes.axvspan(evaluated[0], evaluated[-1], color=_BAND, linewidth=0)
        axes.plot(t, signal[:, 0], **_STYLE)
        if np.isfinite(limits[name]):
            for limit in (-limits[name], limits[name]):
                axes.axhline(limit, color=_LIMIT, linewidth=1.2, linestyle="--")
        axes.set_ylabel(label)
        axes.margins(x=0)
        axes.set_title(_used(experiment, name), loc="right", fontsize=9)
    rows[0].set_title("shaded: whole periods", loc="left", fontsize=9)
    rows[-1].set_xlabel("time [s]")


def _used(experiment: Experiment, name: str) -> str:
    share = experiment.used[name]
    if not np.isfinite(experiment.task.limits.by_name()[name]):
        return "no limit"
    binds = ", binds" if experiment.trial.fitted.binding == name else ""
    return f"{100 * share:.0f} % of the limit{binds}"


def _spectrum(axes: Axes, experiment: Experiment) -> None:
    signal = experiment.trial.signal
    axes.vlines(signal.frequency_hz, 0, signal.amplitudes, color=_INK, linewidth=1)
    axes.plot(signal.frequency_hz, signal.amplitudes, ".", color=_INK, markersize=3)
    axes.set_xlim(0, float(signal.frequency_hz.max()) * 1.05)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("amplitude of torque [N m]")
    axes.set_title(f"spectrum; crest factor {experiment.crests['optimised']:.2f}", loc="left", fontsize=10)


def _bars(axes: Axes, experiment: Experiment) -> None:
    names, sd = experiment.accuracy.names, 100 * experiment.accuracy.standard_deviations
    known = [int(i) for i in np.argsort(-sd) if np.isfinite(sd[i])]
    rows, widest = range(len(known)), sd[known].copy()
    axes.barh(rows, sd[known], color=_INK, height=0.55, label="this spectrum")
    compared = None
    if experiment.flat is not experiment.accuracy:
        compared = flat = 100 * experiment.flat.standard_deviations[known]
        axes.plot(flat, rows, "d", color=_LIMIT, markersize=5, label="flat spectrum")
        axes.legend(fontsize=8, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        widest = np.maximum(widest, flat)
    for row, i in enumerate(known):
        other = "" if compared is None else f" (flat {compared[row]:.2g} %)"
        axes.annotate(f"  {sd[i]:.2g} %{other}", (widest[row], row), va="center", fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(sd[known].min(initial=np.inf) / 3, widest.max(initial=0.0) * 40)
    axes.set_yticks(rows, [names[i] + (" *" if names[i] in experiment.task.find else "") for i in known])
    axes.set_xlabel("predicted standard deviation [%]" + (";  * to be found" if experiment.task.find else ""))
    axes.set_title("what it will tell", loc="left", fontsize=10)
