"""What the CUSUM tests of an axis report: crossings of h, recoveries, and the evidence to name a cause."""

from dataclasses import dataclass, field

from monitor_core.detection.alarm import Direction
from monitor_core.detection.onset import Past
from monitor_core.trend.entries import Reading


@dataclass(frozen=True, slots=True)
class Crossing:
    """g of a parameter has crossed h.  Times in microseconds since 1970."""

    parameter: str
    direction: Direction
    time_us: int
    onset_us: int
    size: float
    size_sd: float


@dataclass(frozen=True, slots=True)
class Recovered:
    """The deviation of a parameter has stayed below nu for three memory lengths."""

    parameter: str
    time_us: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """Deviations of all parameters at one time, with their covariance."""

    time_us: int
    parameters: tuple[str, ...]
    deviation: tuple[float, ...]
    """theta - theta_0 now: for the sizes"""
    covariance: tuple[tuple[float, ...], ...]
    since: tuple[float, ...]
    """The deviations that explain the samples of the last three memory lengths, all with equal weight: for the
    isolation of causes.  The estimates forget, and may hold little information at this moment."""
    since_covariance: tuple[tuple[float, ...], ...]
    tolerance: float
    """Standard deviations by which the estimate of a healthy axis may be off"""
    excess: float
    """Running innovation variance over lambda_0"""
    held: tuple[int, ...]
    """-1, 1: the estimate is at its lower, upper bound; 0: at neither"""
    past: Past | None = field(default=None, compare=False)
    """Earlier deviations; None: not known, and no cause is named"""


CusumEvent = Crossing | Recovered | Evidence
BatchEvent = CusumEvent | Reading
"""Of an axis batch: readings for the long-term trend come with them."""
