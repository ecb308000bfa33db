"""Fit of one-step predictions and simulations of records: NRMSE, 100 (1 - |y - yhat| / |y - mean y|).

Any drive predicts an angle one step ahead, as the angle hardly moves within an interval.  And in a simulation two
integrators let the smallest constant error of the torque grow without limit.  So a simulated angle is
compared by its speed, y being the differences over 20 ms, and gravity acts at the measured angle:
an arm that stands upright would fall in a simulation of its own.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DELAY, LOAD, Output
from monitor_core.identification.greybox.criterion import fit_starts
from monitor_core.identification.greybox.estimate import Estimate
from monitor_core.identification.greybox.residuals import Information, information
from monitor_core.identification.predictor.prediction_errors import Errors, RecordPredictor
from monitor_core.identification.problem import MotionSource, Problem
from monitor_core.identification.records.measured_record import Record

_SPEED_S = 0.02
"""Time over which an angle is differenced; over a shorter time its resolution would dominate."""
_CLOSE = 0.5
"""Samples that are closer than this share of that time give no speed."""
_THIRD = np.array([1.0, -3.0, 3.0, -1.0])


@dataclass(frozen=True, eq=False)
class ComparedRecord:
    """Times (N,) [s] of one record; its output (N,) as measured (NaN: missing), predicted one step ahead, simulated."""

    name: str
    t: Floats
    y: Floats
    predicted: Floats
    simulated: Floats
    quantity: Output

    @property
    def fit(self) -> float:
        """NRMSE one step ahead, per cent."""
        return _nrmse(self.y, self.y - self.predicted)

    @property
    def fit_simulation(self) -> float:
        """NRMSE of the simulation, per cent; an angle is compared by its speed."""
        speed, errors = self.motion
        return _nrmse(speed, errors)

    @property
    def motion(self) -> tuple[Floats, Floats]:
        """Measured speed and errors of the simulated one (M,) [rad/s]."""
        return _speeds(self.t, self.y, self.y - self.simulated, self.quantity)


def traces_of(problem: Problem, records: Sequence[Record]) -> tuple[ComparedRecord, ...]:
    """Traces with the values of a problem, such as ``Estimate.problem``; only the initial states are fitted."""
    held = _with_values_held(problem)
    ahead = RecordPredictor(held, records, held.disturbance if held.K is None else None)
    outputs = [
        [series.record.y - e.eps for series, e in zip(p.series, p.errors(fit_starts(p)), strict=True)]
        for p in (ahead, RecordPredictor(_free_run(held), records, None))
    ]
    return tuple(
        ComparedRecord(r.name, r.t, r.y, predicted, simulated, r.quantity)
        for r, predicted, simulated in zip(records, *outputs, strict=True)
    )


def simulated_fits(problem: Problem, records: Sequence[Record]) -> tuple[float, ...]:
    """NRMSE of the simulation of each record, per cent, an angle by its speed; only initial states are fitted."""
    predictor = RecordPredictor(_free_run(_with_values_held(problem)), records, None)
    errors = predictor.errors(fit_starts(predictor))
    return tuple(_nrmse(*_speeds(r.t, r.y, e.eps, r.quantity)) for r, e in zip(records, errors, strict=True))


def fits(predictor: RecordPredictor, errors: Sequence[Errors]) -> tuple[float, ...]:
    """NRMSE of each record, per cent, where a predictor leaves these errors."""
    return tuple(
        _nrmse(np.where(s.counts, s.record.y, np.nan), e.eps) for s, e in zip(predictor.series, errors, strict=True)
    )


def _with_values_held(problem: Problem) -> Problem:
    """The problem with all parameters held and all samples counted, as only initial states are fitted."""
    return replace(problem, free=tuple(problem.varying), free_delay=False, min_speed=0.0)


def _free_run(problem: Problem) -> Problem:
    # With the angle, friction is at the simulated speed in both, and gravity at the measured angle.
    motion: MotionSource = "measured" if problem.drive.output == "angle" else "simulated"
    return replace(problem, predictor="output-error", disturbance=None, K=None, motion=motion, initial="free")


def _speeds(t: Floats, y: Floats, eps: Floats, quantity: Output) -> tuple[Floats, Floats]:
    """Measured speed and its errors (M,): an angle and its errors (N,) differenced; NaN is left out."""
    measured = np.isfinite(y)
    t, y, eps = t[measured], y[measured], eps[measured]
    if quantity != "angle" or t.size < 2:
        return y, eps
    apart = min(max(1, round(_SPEED_S / float(np.median(np.diff(t))))), t.size - 1)
    steps, turned, missed = (values[apart:] - values[:-apart] for values in (t, y, eps))
    far = steps > _CLOSE * float(np.median(steps))
    with np.errstate(over="ignore", invalid="ignore"):
        return turned[far] / steps[far], missed[far] / steps[far]


def explained(traces: Sequence[ComparedRecord]) -> float:
    """Per cent of the motion that a simulation explains, 100 (1 - |errors| / |speed - mean|), of all records together.

    The noise of the measurement is taken out of both.

    White noise is what third differences of the errors show: what a drive lacks is slower than the samples.
    """
    spread = left = noise = 0.0
    for trace in traces:
        speed, errors = trace.motion
        with np.errstate(over="ignore", invalid="ignore"):
            power = float(errors @ errors)
            white = min(_white(trace) * speed.size, power)
        spread += speed.size * float(speed.var())
        left, noise = left + power - white, noise + white
    if not (np.isfinite(left) and spread > noise):
        return -np.inf
    return 100 * (1 - float(np.sqrt(left / (spread - noise))))


def _white(trace: ComparedRecord) -> float:
    """Variance of the white noise on the measured speed; of an angle, its noise turned into that of the speed."""
    errors = (trace.y - trace.simulated)[np.isfinite(trace.y)]
    if errors.size < _THIRD.size:
        return 0.0
    variance = float(np.mean(np.convolve(errors, _THIRD, "valid") ** 2) / np.sum(_THIRD**2))
    if trace.quantity != "angle":
        return variance
    apart = max(1, round(_SPEED_S / float(np.median(np.diff(trace.t)))))
    return 2 * variance / (apart * float(np.median(np.diff(trace.t)))) ** 2


def _nrmse(y: Floats, eps: Floats) -> float:
    measured = np.isfinite(y)
    y, eps = y[measured], eps[measured]
    with np.errstate(over="ignore", invalid="ignore"):  # of a simulation that runs away
        around, left = float(np.linalg.norm(y - y.mean())), float(np.linalg.norm(eps))
    return 100 * (1 - left / around) if around > 0 and np.isfinite(left) else -np.inf


# --- Increase of the scatter of recursive estimates by correlated prediction errors -----------------------------------


# If the noise model is not right, neighbouring errors are correlated, and the sum of N errors is larger than sqrt(N)
# times one error.  The standard deviations of the monitor come from lambda_0 P, so lambda_0 must be increased by this
# factor.


def colour_of(
    estimate: Estimate,
    monitored: Sequence[str],
    records: Sequence[Record],
    weight: Mapping[str, float] = MappingProxyType({}),
) -> float:
    """Largest ratio of the variance of a monitored parameter to its variance with white errors; at least 1.

    ``weight``: as in ``monitored_information``.
    """
    _, result = monitored_information(estimate, monitored, records, weight)
    white, coloured = np.diag(result.white), np.diag(result.covariance)
    known = np.isfinite(white)
    return float(np.max(coloured[known] / white[known], initial=1.0))


def monitored_information(
    estimate: Estimate,
    monitored: Sequence[str],
    records: Sequence[Record],
    weight: Mapping[str, float],
) -> tuple[list[str], Information]:
    """Names of the monitored parameters, and how well the records determine them if everything else is held.

    As in the daemon: values, K and delay are the estimates, and schedules are followed.  ``weight``: the reference of
    what the constant torque follows as a weight, by the name of the slope; if there is any, LOAD comes last, which
    scales the torque of the weight.
    """
    found = estimate.problem
    K = tuple(estimate.K.tolist()) if found.predictor == "innovations" else None
    watched = _free(found.varying, monitored)
    # What follows signals still does.
    free = (*watched, *(name for name in found.varying if name not in watched))
    problem = replace(
        found, drive=estimate.drive, nominal=estimate.values, free=free,
        K=K, disturbance=None, delay_s=estimate.delay_s, free_delay=DELAY in monitored,
        bounds={},
    )  # fmt: skip
    predictor = RecordPredictor(problem, records, None)
    errors = predictor.errors(fit_starts(predictor))
    end = len(free) + sum(map(len, problem.varying.values()))  # parameters and slopes, before the delay
    own, start = [*range(len(watched)), *[end] * problem.free_delay], end + problem.free_delay
    every, columns = predictor.layout.names, np.eye(start)[:, own]
    if weight:
        theta, load = dict(zip(estimate.names, estimate.theta.tolist(), strict=True)), np.zeros(start)
        for slope, reference in weight.items():
            load[every.index(slope)] = theta[slope]
            load[every.index(slope.partition(" per ")[0])] += theta[slope] * reference
        columns = np.column_stack([columns, load])
    gradients, starts = [e.psi[:, :start] @ columns for e in errors], [e.psi[:, start:] for e in errors]
    names = [*(every[k] for k in own), *([LOAD] if weight else [])]
    sizes, eps = np.ones(len(names)), [e.eps for e in errors]
    return names, information(names, sizes, gradients, starts, eps, estimate.lam0)


def _free(varying: Iterable[str], monitored: Sequence[str]) -> tuple[str, ...]:
    """The monitored parameters; a scheduled one by the name (Ja or 1/Ja) that has the slopes."""
    called = {split_name(name)[0]: name for name in varying}
    return tuple(called.get(split_name(name)[0], name) for name in monitored if name != DELAY)
