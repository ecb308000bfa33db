"""The record of a real robot axis, its configuration, and faults put into it exactly.

A torque constant changed by a factor, or a changed friction of the motor, would have needed another torque
for the same motion, whatever the rest of the dynamics is.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings
from service.config import Config, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.records import read_record

CONFIG = Path(__file__).resolve().parents[2] / "config" / "irb.toml"
AXIS = "irb.axis1"


def configuration() -> Config:
    """The configuration as shipped."""
    return load(CONFIG, {})


def read(path: Path) -> SampleBlock:
    """A record, through the program's own reader."""
    steps = read_record(path, configuration()).steps()
    return concatenate([step.samples[AXIS] for step in steps if AXIS in step.samples])


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


def with_torque_constant(record: SampleBlock, factor: float, start: int) -> SampleBlock:
    """From sample ``start`` on the torque constant is that of before times ``factor``."""
    u = record.u.copy()
    u[start:] /= factor
    return record._replace(u=u)


def with_viscous_friction(record: SampleBlock, change: float, start: int) -> SampleBlock:
    """From sample ``start`` on the viscous friction [N m s/rad] is higher by ``change``."""
    return _with_load(record, change * record.y, start)


def with_coulomb_friction(record: SampleBlock, change: float, start: int) -> SampleBlock:
    """From sample ``start`` on the Coulomb friction [N m] is higher by ``change``."""
    speed_scale = model_and_settings()[1].speed_scale
    return _with_load(record, change * np.tanh(record.y / speed_scale), start)


def _with_load(record: SampleBlock, load: Floats, start: int) -> SampleBlock:
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

    def put_into(self, record: SampleBlock, start: int) -> SampleBlock:
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
