"""What the web knows of the configuration: what is in force, where its file is, and how the signals of an axis are."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from service.config import Config
from service.web.models import SENTENCES, Body, Number, Sentence


class SignalRange(Body):
    """The values of a signal in the time that was looked at."""

    signal: str = Field(description="message and signal on the bus")
    unit: str
    low: Number = Field(description="smallest value, in unit")
    high: Number = Field(description="largest value, in unit")


class SignalCheck(Body):
    """What the last frames of an axis show of its signals, by the checks of commissioning."""

    axis: str
    seconds: Number = Field(description="length of what was looked at [s]")
    samples: int
    rate_hz: Number = Field(description="samples a second; null: there are none")
    scatter_s: Number = Field(description="scatter of the time stamps [s]; null: not known")
    missing: Number = Field(description="share of the samples that never came; null: there are none")
    moves: bool | None = Field(description="whether the axis moves; null: not known")
    signals: list[SignalRange] = Field(description="torque, then angle or speed; empty without samples")
    problems: list[str] = Field(
        description="what keeps the axis from being identified or monitored, and what to do"
    )
    proposals: list[str] = Field(description="changes of the configuration that these values suggest")
    doubts: list[str] = Field(description="what these values leave open, and what would settle it")
    sentences: list[Sentence] = Field(description=SENTENCES)


class NoLookError(Exception):
    """The signals cannot be looked at now; the text says why."""


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """The configuration.

    ``config`` is in force, ``file`` is where it was read.  ``look`` checks the signals of an axis, from any thread; it
    takes some tenths of a second, and raises NoLookError where it cannot.  ``problems`` has what keeps files of the
    state directory from being written, by their names.
    """

    config: Callable[[], Config]
    file: Path
    look: Callable[[str], SignalCheck]
    problems: Callable[[], Mapping[str, str | None]] = dict
