"""Status of an axis: plain values with their units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import DetectorName
from monitor_core.kernel.supervision import LOST, TAKES_PART
from monitor_core.monitoring.not_tested import MIN_TESTED_MEMORIES, NotTested, Remedy
from monitor_core.wording import sentence


class Status(StrEnum):
    """State of the estimate of a parameter."""

    WAITING = "waiting"  # no sample yet
    SETTLING = "settling"  # the predictor has just (re)started
    SEEDING = "seeding"  # P(0) is being found
    TRACKING = "tracking"
    WEAK = "weakly observed"  # tracking, with less information than at commissioning
    UNSEEN = "not observed"  # the last samples have almost no information on it
    INVALID = "invalid"  # the model is wrong: an estimate at a bound, or errors far larger than before
    ALARM = "alarm"  # an alarm episode is open


class Observation(StrEnum):
    """How much the last samples say of a parameter, compared with commissioning."""

    OBSERVED = "observed"
    WEAK = "weakly observed"
    UNSEEN = "not observed"  # the estimate is the last observed one; its CUSUM waits


@dataclass(frozen=True, slots=True)
class ParameterStatus:
    """One monitored parameter, in its own unit."""

    name: str
    unit: str
    meaning: str
    nominal: float
    """theta_0, which may follow measured conditions"""
    estimate: float
    """NaN where it is invalid"""
    standard_deviation: float
    """sqrt(lambda_0 P_ii / (1 + lambda))"""
    p_diagonal: float
    """P_ii of eq. 13"""
    g_up: float
    """CUSUM for an increase; in the parameter's unit times samples"""
    g_down: float
    h: float
    """Threshold of both"""
    nu: float
    """Deviation per sample that is tolerated"""
    status: Status
    observation: Observation
    not_tested: NotTested | None = None
    """Why no change of it would be found now; None: it is tested"""
    tested_s: float = 0.0
    """Time for which it has been tested since the start of the monitor [s]"""

    @property
    def tested(self) -> bool:
        """Whether a change of it would be found now."""
        return self.not_tested is None


@dataclass(frozen=True, slots=True)
class DetectorStatus:
    """Evidence of one detector now."""

    name: DetectorName
    alarms: bool
    """Whether the alarms of the axis come from it; otherwise it runs in shadow mode"""
    leading: str
    """The parameter, or other cause, that is nearest its threshold; empty: none yet"""
    evidence: float
    """g / h of that cause"""


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """One axis at the time of its last sample (microseconds since 1970, None before the first)."""

    time_us: int | None
    parameters: tuple[ParameterStatus, ...]
    innovation_variance: float
    """Running estimate of lambda_0, in the output's unit squared"""
    confounded: tuple[str, ...]
    """What cannot be distinguished now, in words; empty where all is observed"""
    counters: Mapping[str, int]
    """What became of the samples; see monitor_core.kernel.state.COUNTERS"""
    detectors: tuple[DetectorStatus, ...] = ()
    remedy: Remedy | None = None
    """What would help while P(0) is not found; None: it is"""
    memory_s: float = 0.0
    """Memory of the estimates [s]"""
    covariance: tuple[tuple[float, ...], ...] = ()
    """Covariance lambda_0 P / (1 + lambda) of the estimates, in order and units of the parameters; empty: unknown"""
    judged_in_s: float | None = None
    """Where the heat is not known: time until it is, if friction does not show it sooner [s]; None: it is, or cannot be
    said yet"""

    def untested(self) -> dict[NotTested, tuple[str, ...]]:
        """Parameters that are not tested now, by reason."""
        return _by_reason((p.name, p.not_tested) for p in self.parameters)

    def untested_so_far(self) -> dict[NotTested, tuple[str, ...]]:
        """Parameters whose tests ran for too short a time, since the start, to find and name a change; by reason."""
        least_s = MIN_TESTED_MEMORIES * self.memory_s
        missing = (p for p in self.parameters if p.tested_s < least_s or p.not_tested is NotTested.UNCERTAIN)
        return _by_reason((p.name, self._main_reason(p)) for p in missing)

    def _main_reason(self, p: ParameterStatus) -> NotTested:
        """Why a parameter was not tested: at present, if that lasts; else what most samples were lost by."""
        if p.not_tested in _LASTING:
            return p.not_tested
        lost_by = {
            NotTested.SEEDING: ("seeding",),
            NotTested.CONDITIONS: ("gated",),
            NotTested.NOT_OBSERVED: ("starved", "used"),
            NotTested.SETTLING: ("settling", "started", "gap"),
        }
        return max(lost_by, key=lambda reason: sum(self.counters.get(name, 0) for name in lost_by[reason]))

    @property
    def samples(self) -> int:
        """Samples received; the other counters say what became of them."""
        return sum(v for k, v in self.counters.items() if k != "projected")


_LASTING = (
    *(NotTested.NO_SAMPLE, NotTested.UNIDENTIFIABLE, NotTested.UNCERTAIN, NotTested.BLOCKED),
    *(NotTested.NO_THRESHOLD, NotTested.WARM_UP),
)
"""Reasons that do not change from sample to sample."""


def _by_reason(found: Iterable[tuple[str, NotTested | None]]) -> dict[NotTested, tuple[str, ...]]:
    names = dict[NotTested, tuple[str, ...]]()
    for name, reason in found:
        if reason is not None:
            names[reason] = (*names.get(reason, ()), name)
    return names


# --- Which combinations of parameters the last samples say nothing of, in words ---------------------------------------


def confounded(P: Floats, P_nom: Floats, scale: Floats, names: Sequence[str]) -> tuple[str, ...]:
    """Parameters that are not observed now, or only in combination.

    From P (p, p) of the recursion, the commissioned P_ii (p,), sizes (p,) and names (p,) of the parameters.
    """
    size = np.sqrt(P_nom)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    moves = abs(vectors[:, values > LOST] * (size / scale)[:, np.newaxis]).T
    return tuple(_words([names[i] for i in np.flatnonzero(v > TAKES_PART * v.max()).tolist()]) for v in moves)


def unidentifiable_words(pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Why nothing is tested, where the nominal values do not allow it, and what would help."""
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
