"""Changes of the arm of ``arm_cell``, what is right to raise for each, and how often that was raised."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.calibration import CalibrationError
from tests.service.arm_cell import ArmAlarm
from tests.service.by_commands import CommandRefusedError


class Case(NamedTuple):
    """A change, and the alarms that it should raise: axis, parameter, direction."""

    changes: Mapping[str, float]
    right: frozenset[tuple[str, str, str]]


PAYLOADS = {
    f"payload {sign}30 %": Case(
        {"payload": factor}, frozenset((axis, "load", direction) for axis in ("shoulder", "elbow"))
    )
    for sign, factor, direction in (("+", 1.3, "up"), ("-", 0.7, "down"))
}
FAULTS = {
    "shoulder kT +20 %": Case({"shoulder kT": 1.2}, frozenset({("shoulder", "kT", "up")})),
    "shoulder kT -20 %": Case({"shoulder kT": 0.8}, frozenset({("shoulder", "kT", "down")})),
    "elbow kT +20 %": Case({"elbow kT": 1.2}, frozenset({("elbow", "kT", "up")})),
    "elbow kT -20 %": Case({"elbow kT": 0.8}, frozenset({("elbow", "kT", "down")})),
    "shoulder fc +30 %": Case({"shoulder fc": 1.3}, frozenset({("shoulder", "fc", "up")})),
    "elbow fm +50 %": Case({"elbow fm": 1.5}, frozenset({("elbow", "fm", "up")})),
}
CASES = PAYLOADS | FAULTS


class Tried(NamedTuple):
    """A change of an arm, and all alarms that it raised."""

    arm: int
    case: str
    alarms: list[ArmAlarm]

    @property
    def right(self) -> bool:
        """Whether each axis that shows it names it, by one alarm, and no other axis has any."""
        return self._names_once and set(self._names) == CASES[self.case].right

    @property
    def called_right(self) -> bool:
        """Whether all that is named is right, if not by every axis."""
        return self._names_once and set(self._names) <= CASES[self.case].right

    @property
    def _names(self) -> list[tuple[str, str, str]]:
        return [(a.axis, a.parameter, a.direction) for a in self.alarms]

    @property
    def _names_once(self) -> bool:
        """Whether there are alarms, all of them with a name, and none twice."""
        named = all(np.isfinite(a.named_s) for a in self.alarms)
        return bool(self.alarms) and named and len(self._names) == len(set(self._names))


def try_arms(
    arms: int, folder: Path, try_arm: Callable[[int, Path], tuple[list[str], list[Tried]]]
) -> tuple[list[Tried], list[str], list[int]]:
    """What became of arms, printed: trials, false alarms, and the numbers of those that were refused.

    ``try_arm``: false alarms and trials of the arm of a number, which may write into a folder of its own.
    """
    trials, false, refused = list[Tried](), list[str](), list[int]()
    for number in range(arms):
        own = folder / str(number)
        own.mkdir()
        try:
            quiet, found = try_arm(number, own)
        except (CommandRefusedError, CalibrationError) as error:
            refused.append(number)
            print(f"arm {number}: {error}", flush=True)
            continue
        false += quiet
        trials += found
        print(f"arm {number}: false alarms {quiet}")
        for trial in found:
            print(f"   {'' if trial.right else 'WRONG '}{trial.case}: {trial.alarms}", flush=True)
    return trials, false, refused


def table(trials: Sequence[Tried]) -> str:
    """Delays, sizes and counts of each change, a line for each axis that shows it."""
    return "\n".join(_lines(trials))


def _lines(trials: Sequence[Tried]) -> Iterator[str]:
    for name, case in CASES.items():
        own = [trial for trial in trials if trial.case == name]
        for axis in sorted({axis for axis, *_ in case.right}, reverse=True):
            alarms = [a for trial in own for a in trial.alarms if a.axis == axis]
            good = [a for a in alarms if (a.axis, a.parameter, a.direction) in case.right]
            sizes = [100 * a.size for a in good if np.isfinite(a.size)]
            if good:
                yield (
                    f"{name}, {axis}: raised after {np.median([a.raised_s for a in good]):.0f} s (at most"
                    f" {max(a.raised_s for a in good):.0f}), named after {np.median([a.named_s for a in good]):.0f} s,"
                    f" size {np.median(sizes):+.0f} % ({min(sizes):+.0f} to {max(sizes):+.0f}); medians"
                )
        yield (
            f"{name}: {sum(t.right for t in own)} of {len(own)} named right by one alarm of each axis,"
            f" {sum(t.called_right for t in own)} by one of at least one"
        )
