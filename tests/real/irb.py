"""The record of a real robot axis, its configuration, and faults put into it exactly."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings
from service.config import Config, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.records.record_files import read_record
from tests.real.halves import with_fault

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


class Fault(NamedTuple):
    """A change of a value, and what is to be said of it."""

    parameter: str
    change: float

    @property
    def alarm(self) -> tuple[str, str]:
        return self.parameter, "up" if self.change > 0 else "down"

    def put_into(self, record: SampleBlock, start: int) -> SampleBlock:
        return with_fault(MonitoredAxis(*model_and_settings()), record, {self.parameter: self.change}, start)

    def __str__(self) -> str:
        return " ".join(self.alarm)


VISCOUS = 0.0074
"""N m s/rad: about a quarter of the healthy friction."""
# A torque constant of 0.8 needs 31 N m; what the drive can give is not known.
FAULTS = (Fault("kT", 0.2), Fault("kT", -0.2), Fault("fm", VISCOUS), Fault("fm", -VISCOUS))

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
