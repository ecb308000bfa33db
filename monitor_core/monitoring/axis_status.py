"""Status of an axis: plain values with their units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import DetectorName
from monitor_core.kernel.supervision import LOST, TAKES_PART
from monitor_core.monitoring.not_tested import MIN_TESTED_MEMORIES, NotTested, SeedingRemedy
from monitor_core.wording import sentence


class Status(StrEnum):
    """State of the estimate of a parameter."""

    WAITING = "waiting"  # no sample yet
    SETTLING = "settling"  # the predictor has just (re)started
    SEEDING = "seeding"  # P(0) is being found
    TRACKING = "tracking"
    WEAK = "weakly observed"  # tracking, with less information than at commissioning
    UNSEEN = "not observed"  # the last samples have almost no information on the parameter
    INVALID = "invalid"  # the model is wrong: an estimate at a bound, or far larger errors than expected
    ALARM = "alarm"  # an alarm is open
    SILENT = "silent"  # the samples have stopped; the estimate is the last one


class Observation(StrEnum):
    """Information of the last samples on a parameter, compared with commissioning."""

    OBSERVED = "observed"
    WEAK = "weakly observed"
    UNSEEN = "not observed"  # the estimate is the last observed one; its CUSUM waits


@dataclass(frozen=True, slots=True)
class ParameterStatus:
    """One monitored parameter; values in its ``unit``.

    Attributes:
        name: "fm", "1/Ja".
        unit: SI, in text: "N m s/rad".
        meaning: in words.
        nominal: theta_0, which may depend on measured conditions.
        estimate: theta; NaN if it is invalid.
        standard_deviation: sqrt(lambda_0 P_ii / (1 + lambda)).
        p_diagonal: P_ii of eq. 13.
        g_up: CUSUM for an increase, in the unit times samples.
        g_down: CUSUM for a decrease.
        h: threshold of g_up and g_down.
        nu: deviation that each sample tolerates.
        status: state of the estimate.
        observation: whether the motion shows the parameter.
        not_tested: reason why a change of the parameter would not be detected now; None: the parameter is tested.
        tested_s: time for which the parameter has been tested [s]; a restored state counts on.
    """

    name: str
    unit: str
    meaning: str
    nominal: float
    estimate: float
    standard_deviation: float
    p_diagonal: float
    g_up: float
    g_down: float
    h: float
    nu: float
    status: Status
    observation: Observation
    not_tested: NotTested | None = None
    tested_s: float = 0.0

    @property
    def tested(self) -> bool:
        """Whether a change of the parameter would be detected now."""
        return self.not_tested is None


@dataclass(frozen=True, slots=True)
class DetectorStatus:
    """Present evidence of one detector."""

    name: DetectorName
    alarms: bool
    """Whether this detector raises the alarms of the axis; otherwise it runs in shadow mode"""
    leading: str
    """The parameter, or other cause, that is nearest its threshold; empty: none yet"""
    evidence: float
    """g / h of that cause"""


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """Status of one axis at its last sample (``time_us``: microseconds since 1970, None before the first sample)."""

    time_us: int | None
    parameters: tuple[ParameterStatus, ...]
    innovation_variance: float
    """Running estimate of lambda_0, in the output's unit squared"""
    confounded: tuple[str, ...]
    """Sentences on parameters that are not observed or not distinguished now; empty if all are observed"""
    counters: Mapping[str, int]
    """Counts of used and rejected samples; see monitor_core.kernel.state.COUNTERS"""
    detectors: tuple[DetectorStatus, ...] = ()
    remedy: SeedingRemedy | None = None
    """What to do so that P(0) is found; None: it has been found"""
    memory_s: float = 0.0
    """Memory of the estimates [s]"""
    covariance: tuple[tuple[float, ...], ...] = ()
    """Covariance lambda_0 P / (1 + lambda) of the estimates, in order and units of the parameters; empty: unknown"""
    judged_in_s: float | None = None
    """Time [s] until the unknown heat is known, if friction does not show it sooner; None: the heat is known, or the
    time cannot be told yet"""
    waits: bool = False
    """Whether the tests begin after that time and not sooner"""
    unjudged_s: float = 0.0
    """Time [s] of the samples since the start that have updated theta, but were not tested, as the heat was unknown"""

    def untested(self) -> dict[NotTested, tuple[str, ...]]:
        """Parameters that are not tested now, by reason."""
        return _by_reason((p.name, p.not_tested) for p in self.parameters)

    def untested_so_far(self) -> dict[NotTested, tuple[str, ...]]:
        """Parameters whose tests have run for too short a time since the start to find and name a change, by reason."""
        least_s = MIN_TESTED_MEMORIES * self.memory_s
        missing = (p for p in self.parameters if p.tested_s < least_s or p.not_tested is NotTested.UNCERTAIN)
        return _by_reason((p.name, self._main_reason(p)) for p in missing)

    def _main_reason(self, p: ParameterStatus) -> NotTested:
        """Main reason why a parameter was not tested: its present one if that lasts, else the one of most samples.

        With a heat that was known sooner it might have been tested long enough, however many samples a gate left out.
        """
        if p.not_tested in _LASTING:
            return p.not_tested
        if self.unjudged_s > 0 and p.tested_s + self.unjudged_s >= MIN_TESTED_MEMORIES * self.memory_s:
            return NotTested.WARM_UP
        lost_by = {
            NotTested.SEEDING: ("seeding",),
            NotTested.CONDITIONS: ("gated",),
            NotTested.NOT_OBSERVED: ("starved", "used"),
            NotTested.SETTLING: ("settling", "started", "gap"),
        }
        return max(lost_by, key=lambda reason: sum(self.counters.get(name, 0) for name in lost_by[reason]))

    @property
    def samples(self) -> int:
        """Number of samples received: each is in one counter (``projected`` counts some of them again)."""
        return sum(v for k, v in self.counters.items() if k != "projected")


_LASTING = (
    *(NotTested.NO_SAMPLE, NotTested.UNIDENTIFIABLE, NotTested.UNCERTAIN, NotTested.BLOCKED),
    *(NotTested.NO_THRESHOLD, NotTested.WARM_UP),
)
"""Reasons that do not change from sample to sample."""


def _by_reason(reasons: Iterable[tuple[str, NotTested | None]]) -> dict[NotTested, tuple[str, ...]]:
    names = dict[NotTested, tuple[str, ...]]()
    for name, reason in reasons:
        if reason is not None:
            names[reason] = (*names.get(reason, ()), name)
    return names


# --- Sentences on combinations of parameters that the last samples do not determine -----------------------------------


def confounded(P: Floats, P_nom: Floats, scale: Floats, names: Sequence[str]) -> tuple[str, ...]:
    """Sentences on parameters that are not observed now, or only in combination.

    Args:
        P: matrix of the recursion (p, p).
        P_nom: P_ii at commissioning (p,).
        scale: sizes of the parameters (p,).
        names: names of the parameters (p,).
    """
    size = np.sqrt(P_nom)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    moves = abs(vectors[:, values > LOST] * (size / scale)[:, np.newaxis]).T
    return tuple(_words([names[i] for i in np.flatnonzero(v > TAKES_PART * v.max()).tolist()]) for v in moves)


def unidentifiable_words(pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Sentences on pairs of nominal values that are not distinguished, so that nothing is tested, and on what helps."""
    return tuple(
        sentence(
            "unidentifiable",
            "{first} and {second} cannot be distinguished by the record of their nominal values: nothing is tested."
            " Identify the axis with a record of several speeds and accelerations, or with `axiswatch identify --fix"
            " {second}`, which holds it at its value in the configuration",
            first=first,
            second=second,
        )
        for first, second in pairs
    )


def _words(names: Sequence[str]) -> str:
    if len(names) == 1:
        return sentence("not observed", "{name} is not observed", name=names[0])
    first, last = ", ".join(names[:-1]), names[-1]
    return sentence("alike", "{first} and {last} cannot be distinguished", first=first, last=last)
