"""The paper's Figures 5 and 6 of the reference experiment, for the documentation: pictures and the numbers in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from docs.svg_documents import document
from monitor_core.arrays import Floats
from monitor_core.drive import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.excitation.reference_experiment import FAULT_AT, SAMPLES, experiments
from monitor_core.modeling import INTERVAL_S, reference_model
from monitor_core.modeling.standard_drives import MONITORED
from monitor_core.monitoring import AxisBatch, Trace, standard_deviation
from monitor_core.settings import Settings
from service.reports.plot_style import BAND, DOTTED, DOWN, ESTIMATE, LIMIT, NOMINAL, QUIET, as_svg, figure
from service.reports.replay_course import SIGMAS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEED = 57
"""Of the records that are drawn: delays and largest g are near the medians of many.  fm is found late, as in every
second record; in the others not within the five seconds."""
FACTOR = 1.2
"""The start of Figure 5, the faults of both."""
_SEEDS_OF_P0 = range(1000, 1050)
_P0_SAMPLES = 4000
_EVERY = 8
"""Samples between two points of a drawn line."""
_LOOKS = (ESTIMATE, DOWN, DOTTED)


class Reference(NamedTuple):
    """The records and what the recursion made of them, one column of each trace for each parameter."""

    model: AxisModel
    settings: Settings
    homecoming: Trace
    """Theta starts 20 % above the true values; every column is the same record but for its noise"""
    faults: Trace
    """Column j: parameter j changes by 20 % after 5 s; g runs on"""


def reference() -> Reference:
    """Run the experiments."""
    model = reference_model()
    settings = _settings(model)
    W = len(MONITORED)
    faulty = [experiments([SEED], {name: FACTOR}) for name in MONITORED]
    t_us = np.repeat(faulty[0].t_us[:, np.newaxis], W, axis=1)
    u, y = (np.concatenate([getattr(record, field) for record in faulty], axis=1) for field in ("u", "y"))
    _, faults = AxisBatch([model] * W, [settings] * W).run_traced(t_us, u, y)
    healthy = experiments([SEED])
    batch = AxisBatch([model], [settings])
    batch.state.theta[:] *= FACTOR
    _, homecoming = batch.run_traced(t_us[:, :1], healthy.u, healthy.y)
    return Reference(model, settings, homecoming, faults)


def _settings(model: AxisModel) -> Settings:
    """The paper's; P(0) from records of its own, and the predictor settles before theta moves, as in the daemon."""
    settings = Settings.paper(INTERVAL_S, run_on=True)
    settling = 5 * slowest_time_constant(model, settings.gain(len(model.drive.states)), INTERVAL_S)
    settings = replace(settings, settle_s=settling)
    t_us, u, y = experiments(_SEEDS_OF_P0, samples=_P0_SAMPLES)
    batch = AxisBatch([model] * len(_SEEDS_OF_P0), [settings] * len(_SEEDS_OF_P0))
    batch.run(np.repeat(t_us[:, np.newaxis], len(_SEEDS_OF_P0), axis=1), u, y)
    return replace(settings, P0=tuple(float(v) for v in batch.state.P_nom.mean(axis=1)))


def figure_5(found: Reference) -> str:
    """Estimates that come home from 20 % above the true values, and that follow a change of 20 %; SVG."""
    with figure(6.6) as drawn:
        panels = drawn.subplots(len(MONITORED), 2, sharex=True, sharey="row", squeeze=False)
        for i, (home, follows) in enumerate(panels):
            _draw_estimate(home, found, found.homecoming, i, 0)
            _draw_estimate(follows, found, found.faults, i, i)
            t = _times()
            home.plot(t, np.ones_like(t), **NOMINAL, label="true value")
            follows.plot(t, np.where(t < FAULT_AT * INTERVAL_S, 1.0, FACTOR), **NOMINAL)
            home.set_ylabel(f"{MONITORED[i]} / nominal")
        panels[0, 0].set_title("Started 20 % above the true value")
        panels[0, 1].set_title("The true value rises by 20 % after 5 s")
        panels[0, 0].legend(loc="upper right", fontsize=9)
        for axes in panels[-1]:
            axes.set(xlabel="time [s]", xlim=(0, SAMPLES * INTERVAL_S))
        return _as_document(drawn, "Estimates of kT, 1/Ja and fm on the reference experiment", "figure5")


def _draw_estimate(axes: Axes, found: Reference, trace: Trace, i: int, column: int) -> None:
    at = slice(None, None, _EVERY)
    theta0 = found.model.theta0[i]
    P = trace.P[at, i, column]
    sd = np.array([standard_deviation(found.settings, float(P_ii)) for P_ii in P]) / theta0
    theta = trace.theta[at, i, column] / theta0
    band = f"± {SIGMAS:g} standard deviations"
    axes.fill_between(_times(), theta - SIGMAS * sd, theta + SIGMAS * sd, color=BAND, alpha=0.45, lw=0, label=band)
    axes.plot(_times(), theta, **ESTIMATE, label="estimate")


def figure_6(found: Reference) -> str:
    """g of the three parameters and h, for a fault in each of them; SVG."""
    with figure(3.6) as drawn:
        panels = drawn.subplots(1, len(MONITORED), sharex=True)
        for j, axes in enumerate(panels):
            for i, name in enumerate(MONITORED):
                g = found.faults.g[::_EVERY, 0, i, j] / found.model.scale[i]
                axes.plot(_times(), g, **_LOOKS[i], label=f"g of {name}")
            h = found.settings.alpha2
            axes.axhline(h, **LIMIT, label="h")
            axes.axvline(FAULT_AT * INTERVAL_S, color=QUIET, lw=1, ls=(0, (1, 2)), label="change")
            top = float(found.faults.g[:, 0, j, j].max()) / found.model.scale[j]
            axes.set(title=f"{MONITORED[j]} +20 %", xlabel="time [s]", xlim=(0, SAMPLES * INTERVAL_S))
            axes.set_ylim(0, 1.15 * max(top, h))
        panels[0].set_ylabel("g / nominal value")
        panels[0].legend(loc="upper left", fontsize=9)
        return _as_document(drawn, "g of kT, 1/Ja and fm on the reference experiment, with h", "figure6")


def _as_document(drawn: Figure, label: str, name: str) -> str:
    """The picture as a file of its own, with its colours, light or dark as the reader's system is."""
    room = 0.12  # inches around the panels: the page leaves them none
    drawn.set_layout_engine("constrained", w_pad=room, h_pad=room)
    return document(as_svg(drawn, label, name))


def _times() -> Floats:
    return np.arange(0, SAMPLES, _EVERY, dtype=float) * INTERVAL_S


def numbers(found: Reference) -> Mapping[str, Any]:
    """What is to be seen in the pictures, as numbers: a test compares them with those of the program."""
    theta0, scale = found.model.theta0, found.model.scale
    home = found.homecoming.theta[399::400, :, 0] / theta0
    changed = np.einsum("kii->ki", found.faults.theta[999::200]) / theta0
    return {
        "seed": SEED,
        "P0": [_rounded(v) for v in np.sqrt(found.settings.P0) / scale],
        "figure_5": {
            "started_above": {name: _list(home[:, i]) for i, name in enumerate(MONITORED)},
            "changed": {name: _list(changed[:, i]) for i, name in enumerate(MONITORED)},
        },
        "figure_6": {name: _of_fault(found, j) for j, name in enumerate(MONITORED)},
    }


def _of_fault(found: Reference, j: int) -> Mapping[str, Any]:
    g = found.faults.g[..., j] / found.model.scale
    above = np.flatnonzero(g[:, 0, j] > found.settings.alpha2)
    return {
        "largest_g_up": _list(g[:, 0].max(axis=0)),
        "largest_g_down": _list(g[:, 1].max(axis=0)),
        "alarm_after_s": round((above[0] + 1 - FAULT_AT) * INTERVAL_S, 3) if above.size else None,
    }


def _list(values: Floats) -> list[float]:
    return [_rounded(v) for v in values]


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
