"""Status of an axis: plain values with their units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import DetectorName
from monitor_core.kernel.supervision import LOST, TAKES_PART


class Status(StrEnum):
    """State of the estimate of a parameter."""

    WAITING = "waiting"  # no sample yet
    SETTLING = "settling"  # the predictor has just (re)started
    SEEDING = "seeding"  # P(0) is being found
    TRACKING = "tracking"
    WEAK = "weakly observed"  # tracking, with less information than at commissioning
    UNSEEN = "not observed"  # the last samples have almost no information on it
    INVALID = (
        "invalid"  # the model is wrong: the estimate is at a bound, or errors are far larger than before
    )
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

    @property
    def samples(self) -> int:
        """Samples received; the other counters say what became of them."""
        return sum(v for k, v in self.counters.items() if k != "projected")


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
    """Why nothing is tested, where the nominal values do not allow it."""
    return tuple(
        f"{first} and {second} cannot be distinguished by the record of their nominal values: nothing is tested"
        for first, second in pairs
    )


def _words(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{names[0]} is not observed"
    return f"{', '.join(names[:-1])} and {names[-1]} cannot be distinguished"
