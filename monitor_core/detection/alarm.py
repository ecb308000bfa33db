"""Alarm episodes: what a monitor reports of its axis, and what an alarm is made of.

An axis alarms in two stages.  At the first crossing something has *changed*; what, is named only when the evidence is
in, three memory lengths later: of large changes the first to cross is often not the one that changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from monitor_core.detection.onset import Past
from monitor_core.trend.entries import Reading

Direction = Literal["up", "down"]
DIRECTIONS: tuple[Direction, Direction] = ("up", "down")

Stage = Literal["changed", "named"]
"""changed: something has; named: the evidence for what it is, is in."""

Kind = Literal["", "step", "drift", "forecast"]
"""How it changed: at once, or little by little; empty: it cannot be told.  forecast: no change, but a slow drift that
is about to reach a limit."""

Doubt = Literal["", "several", "model", "sign", "still"]
"""several: no single parameter explains it; model: the model no longer holds, so a sensor is more likely than any
parameter; sign: as if torque or motion had changed its sign, or were stuck; still: no motion follows the torque."""

NO_PARAMETER: tuple[Doubt, ...] = ("model", "sign", "still")
"""With these a sensor, or a wire, is more likely than any parameter."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """g of a parameter crossed h.  Times in microseconds since 1970."""

    parameter: str
    direction: Direction
    time_us: int
    onset_us: int
    size: float
    size_sd: float


@dataclass(frozen=True, slots=True)
class Recovered:
    """The deviation of a parameter has been below nu for three memory lengths."""

    parameter: str
    time_us: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that was known of the deviations at one time."""

    time_us: int
    parameters: tuple[str, ...]
    deviation: tuple[float, ...]
    """theta - theta_0 now: what sizes are measured by"""
    covariance: tuple[tuple[float, ...], ...]
    since: tuple[float, ...]
    """The deviations that explain the samples of the last three memory lengths, all counting alike: what causes are
    told apart by.  The estimates forget, and may know little just now."""
    since_covariance: tuple[tuple[float, ...], ...]
    tolerance: float
    """Standard deviations by which a healthy estimate may be off"""
    excess: float
    """Running innovation variance over lambda_0"""
    held: tuple[int, ...]
    """-1, 1: the lower, the upper bound holds the estimate; 0: none does"""
    past: Past | None = field(default=None, compare=False)
    """How the deviations went until then; None: it is not known, and nothing is named."""


Event = Crossing | Recovered | Evidence | Reading


class Cause(NamedTuple):
    """What may have changed; ``alike`` names causes that make the same data: it is this one or one of those."""

    parameter: str
    probability: float
    alike: tuple[str, ...] = ()

    @classmethod
    def read(cls, entry: Sequence[Any]) -> "Cause":
        """From what became of it as JSON."""
        parameter, probability, *alike = entry
        return cls(parameter, probability, tuple(alike[0]) if alike else ())


class Reach(NamedTuple):
    """When what the user gave a limit reaches it; see monitor_core.trend.forecast."""

    name: str
    unit: str
    limit: float
    above: bool
    """It must stay below"""
    state: str
    low_us: int
    high_us: int | None


class Name(NamedTuple):
    """What an alarm was called, until a time."""

    until_us: int
    stage: Stage
    parameter: str
    direction: Direction


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm.  ``parameter`` is the best present name, ``size`` its theta - theta0 with its standard deviation.

    ``raised_us`` and ``first`` never change: with them an episode is known again.
    """

    parameter: str
    direction: Direction
    onset_us: int
    raised_us: int
    updated_us: int
    ended_us: int | None
    size: float
    size_sd: float
    crossings: int
    stage: Stage = "changed"
    causes: tuple[Cause, ...] = ()
    """The likeliest first; those below a hundredth are left out"""
    doubt: Doubt = ""
    onset_low_us: int | None = None
    """The onset lies between these with a probability of 90 %; None: earlier than can be told, or not known yet"""
    onset_high_us: int | None = None
    kind: Kind = ""
    past: tuple[Name, ...] = ()
    """What it was called before"""
    reaches: tuple[Reach, ...] = ()
    """Of a forecast: the limit"""

    @property
    def first(self) -> tuple[str, Direction]:
        """Parameter and direction of the first crossing."""
        return (
            (self.past[0].parameter, self.past[0].direction)
            if self.past
            else (self.parameter, self.direction)
        )
