"""The record of a real robot axis, its configuration, and faults put into it exactly.

A torque constant changed by a factor, or a changed friction of the motor, would have needed another torque
for the same motion, whatever the rest of the dynamics is.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisMonitor
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


# --- The monitor's own predictor over the record ------------------------------------------------------------


FITTED = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0")
"""What the configuration says is fitted to the record."""
CORRELATION_S = 0.1
"""Autocorrelation of the prediction errors counts up to here."""


class Errors(NamedTuple):
    """Prediction errors (N,) and their negative derivatives (N, p), after the predictor has settled."""

    eps: Floats
    psi: Floats


def prediction_errors(model: AxisModel, settings: Settings, record: SampleBlock) -> Errors:
    """The errors of the monitor's predictor with theta at nominal: the run that looks for P(0) never ends."""
    frozen = replace(settings, lam=1 - 1e-6, P0=())
    _, trace = AxisMonitor(model, frozen).update_traced(record)
    learned = np.isfinite(trace.eps)
    return Errors(trace.eps[learned], trace.psi[learned])


def goodness(model: AxisModel, settings: Settings, record: SampleBlock) -> float:
    """1 - |y - yhat| / |y - mean y|: 1 is perfect, 0 as good as the mean."""
    eps = prediction_errors(model, settings, record).eps
    y = record.y[-len(eps) :]
    return float(1 - np.linalg.norm(eps) / np.linalg.norm(y - y.mean()))


def correlation_factor(errors: Errors, interval_s: float) -> Floats:
    """By what the autocorrelation of the errors enlarges the variance of each estimate (p,); Newey and West:

    R^-1 S R^-1  over  lam0 R^-1,      S = sum_l w_l E s(t) s(t-l)',  s = psi eps
    """
    count, most = len(errors.eps), round(CORRELATION_S / interval_s)
    s = errors.psi * errors.eps[:, np.newaxis]
    S = s.T @ s / count
    for lag in range(1, most + 1):
        G = s[lag:].T @ s[:-lag] / count
        S += (1 - lag / (most + 1)) * (G + G.T)
    inverse = np.linalg.inv(errors.psi.T @ errors.psi / count)
    factor: Floats = np.diag(inverse @ S @ inverse) / (errors.eps.var() * np.diag(inverse))
    return factor


def all_fitted(model: AxisModel) -> AxisModel:
    """The same axis, with every parameter that is fitted as one that is monitored."""
    return replace(model, monitored=FITTED, scales={}, bounds={})
