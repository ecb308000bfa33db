"""Thresholds of the multi-model detector from healthy records and a false-alarm budget.

For an exact model g exceeds h at about the rate exp(-h).  For a real axis the rate is exp(-r h), with its own r for
each hypothesis (multimodel_tails.py).  The rate comes from the records themselves, as model errors depend on their
motion, and from enough copies of them to know the tail (multimodel_healthy.py).  Evidence for a hypothesis that lasts
throughout a part of a healthy record is subtracted from its log-likelihood ratios: the allowance.

The rate is uncertain because the record is finite: its length limits how well the power of the innovations is known
(spectra.py), and future motions and large innovations will differ (multimodel_tails.py).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import LOWER, UPPER, bisected, root
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.multimodel_healthy import (
    MultiModelStatistics,
    multimodel_statistics,
)
from monitor_core.calibration.multimodel_tails import LEAST_HEIGHT, TOP, ExcursionPeaks, bank_tails
from monitor_core.detection.multimodel.multimodel_detector import HypothesisThreshold
from monitor_core.samples import SampleBlock

_MIN_MARGIN = 1.1
"""A threshold is at least this multiple of the largest g in the healthy records."""
_DRAWS = 1000
_MAX_LOG = 4.0
"""Logarithm of the largest factor by which the shares of the budget are corrected."""
_LOG_TOLERANCE = 0.01
_HALVINGS = 14
"""Number of bisections for a threshold."""


@dataclass(frozen=True)
class BankThresholds:
    """Thresholds of all hypotheses; false alarms per sample of the detector: most likely value and 90 % interval."""

    own: tuple[HypothesisThreshold, ...]
    total: float
    lower: float
    upper: float


def bank_thresholds(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    samples: float,
    rng: np.random.Generator,
    copies: int,
    progress: Callable[[float], None] = lambda _: None,
) -> BankThresholds:
    """Thresholds from records, for at most one false alarm of the detector in ``samples`` with a certainty of 95 %.

    Raises:
        ValueError: the detector is not available for the axis; no record has tested samples.
    """
    return thresholds_for_budget(multimodel_statistics(axis, records, rng, copies, progress), samples, rng)


def thresholds_for_budget(statistics: MultiModelStatistics, samples: float, rng: np.random.Generator) -> BankThresholds:
    """Thresholds for at most one false alarm of the detector in ``samples`` with a certainty of 95 %.

    Every hypothesis gets the same share of the budget.
    """
    many, log_budget = len(statistics.hypotheses), -float(np.log(max(samples, 1.0)))
    weights = (_weights(statistics.places, rng), _weights(statistics.places, rng))
    farther = rng.standard_normal(1 + _DRAWS)
    farther[0] = 0.0
    tails = bank_tails(statistics.copied, many, weights, farther)
    seen = bank_tails(statistics.recorded, many, weights, farther)
    off = rng.multivariate_normal(np.zeros(many), statistics.covariance, 1 + _DRAWS, method="eigh")
    of_bank = log_share(statistics.copied, many, log_budget, rng.standard_normal(_DRAWS))
    least = np.maximum(_MIN_MARGIN * statistics.recorded.largest, LEAST_HEIGHT)

    def each(h: Floats) -> Floats:
        return tails.log_rates(h, np.exp(-off))[1:]

    def total(h: Floats) -> Floats:
        return np.asarray(np.logaddexp.reduce(each(h), axis=1) + of_bank)

    def h_for(less: float) -> Floats:
        share = log_budget - float(np.log(many)) - less
        of_copies = _height_for_rate(lambda h: np.quantile(each(h), UPPER, axis=0), share, least)
        return _height_for_rate(lambda h: seen.log_rates(h, np.ones((1, many)))[0], share, of_copies)

    def excess(less: float) -> float:
        return float(np.quantile(total(h_for(less)), UPPER)) - log_budget

    found = excess(-_MAX_LOG) > 0 > excess(_MAX_LOG)
    less = root(excess, -_MAX_LOG, _MAX_LOG, xtol=_LOG_TOLERANCE) if found else 0.0
    h = h_for(less)
    own = tuple(
        HypothesisThreshold(hypothesis.cause, hypothesis.size, height, allowance, hypothesis.alike, size_error)
        for hypothesis, height, allowance, size_error in zip(
            statistics.hypotheses,
            h.tolist(),
            statistics.allowance.tolist(),
            statistics.size_error.tolist(),
            strict=True,
        )
    )
    lower, most_likely, upper = (float(v) for v in np.exp(np.quantile(total(h), [LOWER, 0.5, UPPER])))
    return BankThresholds(own, most_likely, lower, upper)


def _weights(places: int, rng: np.random.Generator) -> Floats:
    """Random weights of mean 1 (1 + _DRAWS, places); the first row is 1."""
    drawn = rng.exponential(size=(1 + _DRAWS, places))
    drawn[0] = 1.0
    return np.asarray(drawn / drawn.mean(axis=1, keepdims=True))


def _height_for_rate(log_rate: Callable[[Floats], Floats], share: float, least: Floats) -> Floats:
    """Heights (H,), at least ``least``, at which the log of the rate, which falls with height, equals the share."""
    low, high = least, least
    while (above := log_rate(high) > share).any():
        high = np.where(above, 2 * high, high)
    return bisected(lambda h: log_rate(h) > share, low, high, _HALVINGS)


# --- Alarms of a bank are fewer than those of its hypotheses: an event that alarms several of them is one alarm -------


# After an alarm all hypotheses restart.  The higher the thresholds, the rarer are common alarms: -log of the share of
# the remaining alarms falls as a power of their rate, and two counts determine this power.

_MORE_EXCURSIONS, _FEWER_EXCURSIONS = TOP, TOP // 20
"""Numbers of excursions of each hypothesis for the two counts, which differ enough for two distinct shares"""
_MAX_POWER = 1.0
_LOG_SHARE_SD = 0.2
"""Relative standard deviation of the logarithm of the share."""


def log_share(found: ExcursionPeaks, hypotheses: int, log_rate: float, draws: Floats) -> Floats:
    """Logarithm (B,) of the ratio of the detector's alarms to those of its hypotheses, with total rate exp(log_rate).

    ``draws`` (B,): standard normal draws for its uncertainty.
    """
    often, seldom = (_merged_share(found, hypotheses, many) for many in (_MORE_EXCURSIONS, _FEWER_EXCURSIONS))
    if not seldom[0] < 0 or not often[0] < seldom[0]:
        return np.zeros_like(draws)
    power = math.log(often[0] / seldom[0]) / (often[1] - seldom[1])
    farther = min(log_rate - seldom[1], 0.0)
    return np.asarray(seldom[0] * math.exp(min(power, _MAX_POWER) * farther) * np.exp(_LOG_SHARE_SD * draws))


def _merged_share(found: ExcursionPeaks, hypotheses: int, many: int) -> tuple[float, float]:
    """Logs of the share, and of the rate of excursions, counted with ``many`` excursions of each hypothesis."""
    events = np.concatenate([found.events(i, many) for i in range(hypotheses)], axis=1)
    together, alarms, last = max(events.shape[1], 1), 0, -1.0
    for start, reached in events[:, np.argsort(events[1])].T.tolist():
        if start > last:
            alarms, last = alarms + 1, reached
    return math.log(max(alarms, 1) / together), math.log(together / max(found.samples, 1))
