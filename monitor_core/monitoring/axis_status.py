"""What a monitor knows about its axis now: plain values, units beside them."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from monitor_core.detection.detector import DetectorName


class Status(StrEnum):
    """State of the estimate of a parameter."""

    WAITING = "waiting"  # no sample yet
    SETTLING = "settling"  # the predictor has just (re)started
    SEEDING = "seeding"  # P(0) is being found
    TRACKING = "tracking"
    WEAK = "weakly observed"  # tracking, though the last samples say less than those at commissioning
    UNSEEN = "not observed"  # the last samples say next to nothing of it
    INVALID = "invalid"  # the model does not hold: the estimate is at a bound, or errors are far larger than they were
    ALARM = "alarm"  # an alarm episode is open


class Observation(StrEnum):
    """How much is known of a parameter now, beside what was known at commissioning."""

    OBSERVED = "observed"
    WEAK = "weakly observed"
    UNSEEN = "not observed"  # the estimate is the last that was observed; its CUSUM waits


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
    """What cannot be told apart now, in words; empty where all is observed"""
    counters: Mapping[str, int]
    """What became of the samples; see monitor_core.kernel.state.COUNTERS"""
    detectors: tuple[DetectorStatus, ...] = ()

    @property
    def samples(self) -> int:
        """Samples received, whatever became of them; the other counters say what."""
        return sum(v for k, v in self.counters.items() if k != "projected")
