"""Drives that the first axis of a stage is monitored by, and traces of them."""

from dataclasses import replace
from typing import Any

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.modeling import DRAWINGS, reference_model
from monitor_core.monitoring import AxisTrace, Trace
from monitor_core.settings import Settings
from service.pipeline.axes.axis_pipeline import MonitoredDrive
from tests.service.web.conftest import PARAMETERS, Stage

MODEL = reference_model("angle")


def watch(stage: Stage, watched: MonitoredDrive, **estimates: float) -> None:
    """The first axis with this drive; its parameters have their nominal values, or these estimates."""
    axis = stage.snapshot.axes[0]
    parameters = [
        replace(p, name=name, nominal=theta0, estimate=estimates.get(name, theta0))
        for p, name, theta0 in zip(PARAMETERS, watched.model.monitored, watched.model.theta0, strict=False)
    ]
    status = replace(axis.status, parameters=tuple(parameters))
    stage.snapshot = replace(
        stage.snapshot,
        axes=(replace(axis, status=status, output=watched.model.drive.output, watched=watched),),
    )


def traced(eps: Floats, yhat: Floats) -> AxisTrace:
    """A trace of which only these are read."""
    unread = dict.fromkeys(Trace._fields, np.zeros(0))
    return AxisTrace(Trace(**{**unread, "eps": eps, "yhat": yhat}), (), None)


def reference(**settings: Any) -> MonitoredDrive:
    return MonitoredDrive(MODEL, Settings(0.005, **settings), DRAWINGS["three-mass"].flat().components)
