"""The record of a real robot axis, its configuration, and faults put into it exactly.

A torque constant changed by a factor, or a changed friction of the motor, would have needed another torque
for the same motion, whatever the rest of the dynamics is.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings
from service.config import Config, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.records import read_record

CONFIG = Path(__file__).resolve().parents[2] / "config" / "irb.toml"
AXIS = "irb.axis1"


class Record(NamedTuple):
    """Fields (N,): time [us], torque [N m], speed [rad/s]."""

    t_us: NDArray[np.int64]
    u: Floats
    y: Floats


def configuration() -> Config:
    """The configuration as shipped."""
    return load(CONFIG, {})


def read(path: Path) -> Record:
    """A record, through the program's own reader."""
    blocks = [
        step.samples[AXIS] for step in read_record(path, configuration()).steps() if AXIS in step.samples
    ]
    return Record(*(np.concatenate([block[i] for block in blocks]) for i in range(3)))


def model_and_settings() -> tuple[AxisModel, Settings]:
    """What the daemon makes of the configuration."""
    axis = configuration().axes[0]
    model = axis_model(axis.config)
    return model, axis_settings(axis, model)


def noises() -> tuple[float, float]:
    """Standard deviations of torque and output from which the configuration computes the gain."""
    estimator = configuration().axes[0].config.estimator
    assert estimator.torque_noise is not None
    assert estimator.output_noise is not None
    return estimator.torque_noise, estimator.output_noise


def with_torque_constant(record: Record, factor: float, start: int) -> Record:
    """From sample ``start`` on the torque constant is that of before times ``factor``."""
    u = record.u.copy()
    u[start:] /= factor
    return record._replace(u=u)


def with_viscous_friction(record: Record, change: float, start: int) -> Record:
    """From sample ``start`` on the viscous friction [N m s/rad] is higher by ``change``."""
    return _with_load(record, change * record.y, start)


def with_coulomb_friction(record: Record, change: float, start: int) -> Record:
    """From sample ``start`` on the Coulomb friction [N m] is higher by ``change``."""
    speed_scale = model_and_settings()[1].speed_scale
    return _with_load(record, change * np.tanh(record.y / speed_scale), start)


def _with_load(record: Record, load: Floats, start: int) -> Record:
    """The torque held over an interval has to overcome the mean of the load (N,) over that interval."""
    mean = np.append((load[:-1] + load[1:]) / 2, load[-1])
    u = record.u.copy()
    u[start:] += mean[start:]
    return record._replace(u=u)


class Fault(NamedTuple):
    """Of the torque constant, a factor, and of the viscous friction, a change; and what is to be said of it."""

    torque_constant: float
    viscous: float
    alarm: tuple[str, str]

    def put_into(self, record: Record, start: int) -> Record:
        return with_viscous_friction(
            with_torque_constant(record, self.torque_constant, start), self.viscous, start
        )

    def __str__(self) -> str:
        return " ".join(self.alarm)


VISCOUS = 0.0074
"""N m s/rad: about a quarter of the healthy friction."""
FAULTS = (
    Fault(1.2, 0.0, ("kT", "up")),
    Fault(0.8, 0.0, ("kT", "down")),  # needs 31 N m; what the drive can give is not known
    Fault(1.0, VISCOUS, ("fm", "up")),
    Fault(1.0, -VISCOUS, ("fm", "down")),
)
