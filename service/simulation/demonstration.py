"""The axes of the demo with another drive: torque, noises and monitored parameters follow from it."""

import math
from collections.abc import Sequence

import numpy as np

from monitor_core.drive import AxisModel
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
from service.simulation.axis import lines_of_motion
from service.simulation.planned_motion import motion_of
from service.simulation.watching import frictions, watchable

OUTPUT_NOISE = 1e-4  # rad, as in the demo with its own drive
TORQUE_NOISE = 0.04  # of the torque, as there
_USUAL_TORQUE = 1.2  # N m rms: that is what the signals of the demo's DBC are made for


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
