"""Nominal values of the real axis, fitted by hand: ``python -m tests.real.fit_irb RECORD.mat``.

All ten parameters are fitted to the whole record as the one-step predictor that the monitor runs: its very
kernel, with theta frozen, gives the prediction errors eps and their derivatives psi.  The gain K follows the
parameters, so fit and gain take turns until nothing moves.  Prints what config/irb.toml calls fitted.
"""

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import as_columns
from tests.core.figures import steady_p_of
from tests.real.irb import model_and_settings, noises, read

FITTED = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0")
SETTLED = 1e-5
"""The fit has settled when no parameter moves by more than this part of itself."""
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


def fit(model: AxisModel, settings: Settings, noise: tuple[float, float], record: SampleBlock) -> AxisModel:
    """The model that predicts the record best with the gain K that belongs to it."""
    while True:
        before, model = model, fit_with_gain(model, replace(settings, K=gain(model, settings, noise)), record)
        if (abs(model.theta0 - before.theta0) < SETTLED * before.scale).all():
            return model


def fit_with_gain(model: AxisModel, settings: Settings, record: SampleBlock) -> AxisModel:
    """The model that predicts the record best with the gain K of the settings."""
    sizes = model.scale

    def errors(p: Floats) -> Floats:
        return prediction_errors(_with(model, p * sizes), settings, record).eps

    def derivatives(p: Floats) -> Floats:
        return -prediction_errors(_with(model, p * sizes), settings, record).psi * sizes

    bounds = (_lowest(model), np.inf)
    found = least_squares(errors, model.theta0 / sizes, derivatives, bounds=bounds)
    return _with(model, found.x * sizes)


def gain(model: AxisModel, settings: Settings, noise: tuple[float, float]) -> tuple[float, ...]:
    """K of the Kalman filter for these noises of torque and output."""
    return tuple(float(k) for k in filter_gain(model, settings.interval_s, *noise)[0])


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


def goodness(model: AxisModel, settings: Settings, record: SampleBlock) -> float:
    """1 - |y - yhat| / |y - mean y|: 1 is perfect, 0 as good as the mean."""
    eps = prediction_errors(model, settings, record).eps
    y = record.y[-len(eps) :]
    return float(1 - np.linalg.norm(eps) / np.linalg.norm(y - y.mean()))


def all_fitted(model: AxisModel) -> AxisModel:
    """The same axis, with every parameter that is fitted as one that is monitored."""
    return replace(model, monitored=FITTED, scales={}, bounds={})


def _with(model: AxisModel, theta: Floats) -> AxisModel:
    return replace(model, nominal=model.values(theta), scales=dict(zip(FITTED, model.scale, strict=True)))


def _lowest(model: AxisModel) -> Floats:
    return np.array([1e-3 if parameter.positive else -np.inf for parameter in model.parameters])


def autocorrelation(eps: Floats, lag: int) -> float:
    """Of the prediction errors."""
    return float(eps[lag:] @ eps[:-lag] / (eps @ eps))


def report(fitted: AxisModel, settings: Settings, record: SampleBlock) -> Mapping[str, object]:
    """What goes into the configuration, and how good it is."""
    watched = replace(fitted, monitored=("kT", "1/Ja", "fm"), scales={})
    errors, ten = prediction_errors(watched, settings, record), prediction_errors(fitted, settings, record)
    factor = correlation_factor(errors, settings.interval_s)
    covariance = errors.eps.var() * np.linalg.inv(ten.psi.T @ ten.psi) * factor.max()
    sd = np.sqrt(np.diag(covariance))
    fm, fc = FITTED.index("fm"), FITTED.index("fc")
    columns = as_columns(Experiment(*record[:3]))
    names = dict(zip(watched.monitored, steady_p_of(watched, settings, columns), strict=True))
    return {
        **{n: f"{v:.6g}   # +- {d:.2g}" for n, v, d in zip(FITTED, fitted.theta0, sd, strict=True)},
        "correlation of fm and fc": f"{covariance[fm, fc] / sd[fm] / sd[fc]:.3f}",
        "K": settings.K,
        "variance of eps": f"{errors.eps.var():.4g}",
        "autocorrelation of eps": {
            lag: f"{autocorrelation(errors.eps, lag):.2f}" for lag in (1, 5, 20, 50, 100)
        },
        "factor of the autocorrelation": dict(zip(watched.monitored, factor.round(1).tolist(), strict=True)),
        "innovation_variance": f"{errors.eps.var() * factor.max():.4g}",
        "initial_p": {name: f"{value:.4g}" for name, value in names.items()},
        "fit, one sample ahead": f"{goodness(watched, settings, record):.4f}",
        "fit, simulation": f"{goodness(watched, replace(settings, K=()), record):.4f}",
    }


def main(path: Path) -> None:
    """Fit, starting from the configuration, and print."""
    record = read(path)
    model, settings = model_and_settings()
    fitted = fit(all_fitted(model), settings, noises(), record)
    settings = replace(settings, K=gain(fitted, settings, noises()))
    for name, value in report(fitted, settings, record).items():
        print(f"{name} = {value}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
