"""All that an identification found: what every report is made of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.drive.structure import DELAY, split_name
from monitor_core.identification.estimate import Estimate
from monitor_core.identification.starting import Growth
from service.identification.bode import Bode
from service.identification.masses import masses_of
from service.identification.scheduling import Follows
from service.identification.task import Task
from service.identification.traces import Trace

_SURE = 3.0
"""Standard deviations."""
_MOST_NAMED = 3
_STARTED = "Started from "
_SKEWED = (
    "the torque acts {:.3g} ms late, but the daemon can follow delays of 0 to one interval only: shift the torque"
    " against the motion where they are recorded"
)


class Row(NamedTuple):
    """One parameter: estimate and deviation, and the value before; a held one has no deviation."""

    name: str
    unit: str
    meaning: str
    value: float
    sd: float | None
    before: float | None
    held: str = ""

    @property
    def relative_sd(self) -> float | None:
        """Of the value; None where that is zero."""
        return None if self.sd is None or self.value == 0 else self.sd / abs(self.value)

    @property
    def about_zero(self) -> bool:
        """It cannot be told from zero."""
        return self.sd is not None and abs(self.value) < _SURE * self.sd

    @property
    def change(self) -> float | None:
        """Of the value before."""
        return None if not self.before else self.value / self.before - 1


class Slope(NamedTuple):
    """How a parameter follows a signal: its value at the reference, the slope and its standard deviation."""

    follows: Follows
    value: float
    slope: float
    sd: float

    def at(self, signal: float) -> float:
        """The parameter where the signal has that value."""
        return self.value + self.slope * (signal - self.follows.reference)

    @property
    def told(self) -> bool:
        """The slope can be told from none."""
        return abs(self.slope) > _SURE * self.sd


@dataclass(frozen=True, eq=False)
class Provenance:
    """Where it comes from: ``date`` in ISO 8601, ``drawing`` the file of the drive with its sha256, if it has one."""

    version: str
    date: str
    command: str
    drawing: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False)
class Found:
    """``estimation`` and ``validation`` are the traces of the records of the task, ``bode`` the pictures' responses.

    ``colour``: how many times larger the variance of recursive estimates is than if the prediction errors were white.
    ``growth``: how many masses the records ask for, if that was wished.
    """

    task: Task
    estimate: Estimate
    estimation: tuple[Trace, ...]
    validation: tuple[Trace, ...]
    bode: Bode
    colour: float
    provenance: Provenance
    growth: Growth | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """All doubts, in sentences: of the records, then of the fit."""
        of_fit = (word for word in self.estimate.words if word != self.origin)
        return (*self.task.warnings, *self._other_masses(), *of_fit)

    def _other_masses(self) -> Iterator[str]:
        """What is to be said where the drive has not as many masses as the records ask for."""
        growth, has = self.growth, masses_of(self.estimate.problem)
        if growth is None or has is None or growth.recommended == has:
            return
        asked = growth.recommended
        if asked > has or len(growth.models) > asked:  # else more were not tried
            yield (
                f"The records ask for {_counted(asked)} in a row, and the drive {self.task.drive.name} has {has}:"
                " identify a drive that has as many, of the library or drawn."
            )

    @property
    def origin(self) -> str:
        """Where the fit started, which is no doubt; empty: at the configured values."""
        return next((word for word in self.estimate.words if word.startswith(_STARTED)), "")

    def rows(self) -> Iterator[Row]:
        """Of the free parameters in their order, then of what is held; slopes have rows of their own."""
        e, start = self.estimate, self.task.problem
        values = dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))
        slopes = {one.slope for one in self.task.follows}
        for name, (value, sd) in values.items():
            if name in slopes:
                continue
            if name == DELAY:
                yield Row(name, "s", "delay of the torque", value, sd, start.delay_s)
            else:
                p = e.drive.parameter(name)
                before = None if split_name(name)[0] in self.task.unknown else _value(start.nominal, name)
                yield Row(name, p.unit, p.meaning, value, sd, before)
        for name, reason in self.task.choice.held.items():
            p = e.drive.parameter(name)
            yield Row(name, p.unit, p.meaning, e.values[name], None, start.nominal[name], reason)

    def slopes(self) -> Iterator[Slope]:
        """Of the parameters that follow signals."""
        e = self.estimate
        found = dict(zip(e.names, zip(e.theta.tolist(), e.sd.tolist(), strict=True), strict=True))
        for one in self.task.follows:
            yield Slope(one, found[one.parameter][0], *found[one.slope])

    def trustworthy(self) -> str:
        """Why no nominal values should be made of it; empty if they may."""
        lost = [
            n
            for n, sd in zip(self.estimate.names, self.estimate.sd.tolist(), strict=True)
            if not np.isfinite(sd)
        ]
        if not self.estimate.converged:
            return f"the fit has not converged after {self.estimate.iterations} evaluations{self._next()}"
        if lost:
            return f"{', '.join(lost)} cannot be told from these records: hold one of them with --fix"
        return "" if 0 <= self.delay_s <= self.estimate.interval_s else _SKEWED.format(1e3 * self.delay_s)

    def _next(self) -> str:
        """What to do about a search that does not end."""
        moving = self.estimate.moving[:_MOST_NAMED]
        if not moving:
            return ": give a longer record with more motion"
        return (
            f", and {', '.join(moving)} would still move: hold them with --fix at values that another record tells, as"
            " one with more excitation, or see with --masses auto how many masses these records ask for"
        )

    @property
    def delay_s(self) -> float:
        """Delay of the torque; one that cannot be told from zero or from a whole interval is that."""
        e = self.estimate
        if DELAY not in e.names:
            return e.delay_s
        sd = float(e.sd[e.names.index(DELAY)])
        nearest = min(max(e.delay_s, 0.0), e.interval_s)
        return nearest if abs(nearest - e.delay_s) < _SURE * sd else e.delay_s


def _counted(masses: int) -> str:
    return "one mass" if masses == 1 else f"{masses} masses"


def _value(values: Mapping[str, float], name: str) -> float | None:
    base, inverse = split_name(name)
    if base not in values:
        return None
    return 1 / values[base] if inverse else values[base]
