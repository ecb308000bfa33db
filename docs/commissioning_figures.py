"""The pictures of docs/commissioning.md: a replay of the demo's six axes, and the planned motion of the first."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from docs.svg_documents import document
from service.commands.commissioning.axis.planned_motion import MotionRequest, planned
from service.config import load
from service.config.drive_sources import shipped
from service.config.unit_names import UNITS
from service.ingest.records.record_files import read_record
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.reports.plot_style import LIMIT, TEXT, ZONE, as_svg, figure
from service.reports.replay_html import overview_picture
from service.reports.replay_result import Replay, Replayed
from service.simulation.robot import SimulatedFault, table_lines

SECONDS, BROKEN_S, GROWN = 60.0, 30.0, 1.3
_SEED = 7
_REQUEST = MotionRequest(seconds=3.0, torque=2.0, speed=15.0, find=("1/Ja", "fm"))


def replayed() -> Replayed:
    """The commissioned demo over a minute in which the friction of the second axis grows."""
    robot, config = load(shipped("demo.toml"), {}), load(shipped("demo/axiswatch.toml"), {})
    fault = SimulatedFault("demo.axis2", {"fm": GROWN}, BROKEN_S)
    run = Replay(AxisMonitors(config.axes), config, True)
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "cell.csv"
        table.write_text("".join(table_lines(robot, SECONDS, _SEED, faults=[fault])), encoding="utf-8")
        run.add(read_record(table, config), lambda _: None)
    return run.result([table.name], "axiswatch.toml")


def replay_figure(found: Replayed) -> str:
    """What was tested when, and the alarm."""
    return document(overview_picture(found.axes))


def motion_figure() -> str:
    """The planned motion of an axis, within its limits; the periods that count are shaded."""
    axis = load(shipped("demo.toml"), {}).axes[0]
    experiment = planned(axis, _REQUEST, np.random.default_rng(_SEED))
    task, motion = experiment.task, experiment.motion
    t = np.arange(len(motion.torque)) * task.plant.interval_s
    counted, limits = t[task.schedule.evaluated][[0, -1]], task.limits.by_name()
    with figure(4.2) as drawn:
        panels = drawn.subplots(2, 1, sharex=True)
        for panel, name in zip(panels, ("torque", "speed"), strict=True):
            panel.axvspan(*counted, color=ZONE, alpha=0.6, lw=0)
            panel.plot(t, getattr(motion, name), color=TEXT, lw=0.7)
            for limit in (-limits[name], limits[name]):
                panel.axhline(limit, **LIMIT)
            panel.set(ylabel=f"{name} [{UNITS[name]}]", xlim=t[[0, -1]])
        panels[-1].set_xlabel("time [s]")
        label = f"the planned motion of {axis.id}: torque and speed, with their limits"
        return document(as_svg(drawn, label, "motion"))
