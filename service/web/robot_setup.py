"""The configuration for the web: the one in force, its file, and live checks of the signals."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from service.config import Config
from service.web.models import SENTENCES, Body, Number, Sentence


class SignalRange(Body):
    """The range of a signal in the checked time."""

    signal: str = Field(description="message and signal on the bus")
    unit: str
    low: Number = Field(description="smallest value, in unit")
    high: Number = Field(description="largest value, in unit")


class SignalCheck(Body):
    """Result of the commissioning checks on the last frames of an axis."""

    axis: str
    seconds: Number = Field(description="length of the checked time [s]")
    samples: int
    rate_hz: Number = Field(description="samples a second; null: there are none")
    scatter_s: Number = Field(description="scatter of the time stamps [s]; null: not known")
    missing: Number = Field(description="share of missing samples; null: there are none")
    moves: bool | None = Field(description="whether the axis moves; null: not known")
    signals: list[SignalRange] = Field(description="torque, then angle or speed; empty without samples")
    problems: list[str] = Field(description="what keeps the axis from being identified or monitored, and what to do")
    proposals: list[str] = Field(description="changes of the configuration that these values suggest")
    doubts: list[str] = Field(description="questions that these values do not answer, and how to answer them")
    sentences: list[Sentence] = Field(description=SENTENCES)


class NoLookError(Exception):
    """The signals cannot be checked now; the text says why."""


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """The configuration.

    ``config``: returns the configuration in force.  ``file``: its file.  ``look``: checks the signals of an axis, from
    any thread, within some 0.1 s; raises NoLookError.  ``problems``: returns the problems in writing files of the state
    directory, by file name.
    """

    config: Callable[[], Config]
    file: Path
    look: Callable[[str], SignalCheck]
    problems: Callable[[], Mapping[str, str | None]] = dict

    @property
    def folder(self) -> Path:
        """The folder of the configuration, from which relative paths start."""
        return self.file.absolute().parent
