"""Many simulated records of the reference experiment, a fit to each, and what their spread ought to be.

Every fit starts away from the truth, so that one which does not move cannot look unbiased.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from monitor_core.arrays import Floats
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.excitation import multisine
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.prediction import Sensitivities
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS
from monitor_core.identification import Record
from monitor_core.identification.greybox import fit
from monitor_core.identification.problem import Disturbance, PredictorKind, Problem
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from tests.core.identification.problems import EIGHT, TRUE

SAMPLES = 4000
DRIVE = three_mass("speed")
TORQUE_AT = DRIVE.inputs.index(TORQUE)
START_SPREAD = 0.1
"""Standard deviation of the logarithms of the start values."""
STANDARD_ERRORS = 3.0
KP, KI = 0.3, 1.0
"""Of the speed controller, N m s/rad and N m/rad: noise of 1 rad/s is a torque of 0.3 N m through it."""
WANTED_RMS = 4.0
"""Of the excitation of the reference, rad/s."""
SLOW, SLOW_TIME_S = 0.4, 0.1
"""Torque disturbance d' = -d / T + w: a third of the torque's rms value, N m, and T."""
START_OF_NOISE = Disturbance(torque=0.0, slow=SLOW / 2, time_constant_s=SLOW_TIME_S / 2, free=("slow", "time_constant"))
"""What the fit starts from where there is a disturbance."""


class Spread(NamedTuple):
    """Of the estimates from W records: relative deviations from the truth (W, p), deviations said, bound (p,)."""

    deviations: Floats
    reported: Floats
    bound: Floats
    lam0: Floats
    converged: int

    @property
    def z(self) -> Floats:
        """Mean deviation (p,) in standard errors."""
        count = len(self.deviations)
        return np.asarray(self.deviations.mean(axis=0) / (self.empirical / np.sqrt(count)))

    @property
    def empirical(self) -> Floats:
        """Standard deviations (p,) of the estimates."""
        return np.asarray(self.deviations.std(axis=0, ddof=1))

    @classmethod
    def joined(cls, parts: Sequence[Spread]) -> Spread:
        """Of all records."""
        deviations, lam0 = (np.concatenate([getattr(p, n) for p in parts]) for n in ("deviations", "lam0"))
        reported, bound = (_rms(np.array([getattr(p, n) for p in parts])) for n in ("reported", "bound"))
        return cls(deviations, reported, bound, lam0, sum(p.converged for p in parts))

    def lines(self) -> str:
        """A table to print."""
        rows = zip(EIGHT, self.z, self.empirical, self.reported, self.bound, strict=True)
        body = [f"{n:4s} {z:+7.2f} {100 * e:9.3f} % {100 * s:9.3f} % {100 * b:9.3f} %" for n, z, e, s, b in rows]
        head = f"{len(self.deviations)} records, {self.converged} converged, lambda_0 {self.lam0.mean():.4f}"
        return "\n".join([head, "      mean/SE  empirical    reported       bound", *body])


def limit_of_means(experiments: int) -> float:
    """Three standard errors for all parameters of so many experiments together: by luck one run in 370 is beyond."""
    return float(norm.isf(norm.sf(STANDARD_ERRORS) / len(EIGHT) / experiments))


def open_loop(seeds: Sequence[int]) -> list[Record]:
    """The torque is the multisine."""
    return _records(seeds, kp=0.0, ki=0.0, slow=0.0)


def closed_loop(seeds: Sequence[int], slow: float = 0.0) -> list[Record]:
    """The multisine is the reference of a speed controller that feeds the noise back; ``slow`` disturbs the torque."""
    return _records(seeds, KP, KI, slow)


def spread(records: Sequence[Record], seed: int, disturbance: Disturbance | None = None) -> Spread:
    """Fit each record: output error, or, with a disturbance, the innovations form."""
    rng = np.random.default_rng(seed)
    predictor: PredictorKind = "innovations" if disturbance else "output-error"
    found = []
    for record in records:
        nominal = dict(REFERENCE_VALUES)
        for name in EIGHT:
            nominal[name] *= float(np.exp(START_SPREAD * rng.standard_normal()))
        problem = Problem(DRIVE, nominal, EIGHT, predictor=predictor, disturbance=disturbance)
        found.append(fit(problem, [record]))
    return Spread(
        np.array([e.theta[: len(EIGHT)] for e in found]) / TRUE - 1,
        _rms(np.array([e.sd[: len(EIGHT)] for e in found]) / TRUE),
        _rms(np.array([bound(record) for record in records[:20]])),
        np.array([e.lam0 for e in found]),
        sum(e.converged for e in found),
    )


def bound(record: Record) -> Floats:
    """Cramer and Rao's (p,), relative, for white noise on the output and the torque as recorded."""
    u = np.zeros((len(record), len(DRIVE.inputs)))
    u[:, TORQUE_AT] = record.u
    S = Sensitivities(DRIVE, REFERENCE_VALUES, EIGHT, INTERVAL_S).along(u)
    return Accuracy(EIGHT, S, NOISE["speed"]).standard_deviations


def _records(seeds: Sequence[int], kp: float, ki: float, slow: float) -> list[Record]:
    """All records side by side, from rest; one column for each seed."""
    rngs = [np.random.default_rng(seed) for seed in seeds]
    rms = WANTED_RMS if kp else TORQUE_RMS
    wanted = np.stack([multisine(rng, SAMPLES, INTERVAL_S, BAND_HZ, rms) for rng in rngs], axis=1)
    v, w = (np.stack([rng.standard_normal(SAMPLES) for rng in rngs], axis=1) for _ in range(2))
    values = DRIVE.complete(REFERENCE_VALUES)
    A, B, C = DRIVE.matrices(values)
    Ad, Bd = zero_order_hold(A, B[:, [TORQUE_AT]], INTERVAL_S)
    x, total = np.zeros((len(A), len(rngs))), np.zeros(len(rngs))
    # A disturbance held over each interval is that of the model to within T / h.
    d, decay = np.zeros(len(rngs)), np.exp(-INTERVAL_S / SLOW_TIME_S)
    u, y = np.empty(wanted.shape), np.empty(wanted.shape)
    for k in range(SAMPLES):
        y[k] = C[0] @ x + NOISE["speed"] * v[k]
        total += INTERVAL_S * (wanted[k] - y[k])
        u[k] = kp * (wanted[k] - y[k]) + ki * total if kp else wanted[k]
        x = Ad @ x + Bd * (u[k] + d)
        d = decay * d + slow * np.sqrt(1 - decay**2) * w[k]
    t = INTERVAL_S * np.arange(SAMPLES, dtype=np.float64)
    return [Record(t, u[:, i], y[:, i], "speed") for i in range(len(rngs))]


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
