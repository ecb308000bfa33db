"""The summary of a commissioned robot: for each axis what is found how fast, what is not found, and the next step."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from monitor_core.wording import duration, listed, percent
from service.config.written.commissioned import Found
from service.config.written.commissioning_files import motion_file
from service.config.written.corrections import Correction, changes_in
from service.reports.formats import Provenance, TextTable, render

READY = "ready"


@dataclass(frozen=True)
class Outcome:
    """The result of commissioning an axis, in values and words."""

    axis_id: str
    verdict: str = ""
    outlook: str = ""
    """What can be monitored, and what is needed for the rest"""
    obstacles: str = ""
    """The second part of it: what cannot, and what is needed"""
    watched: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    corrections: tuple[Correction, ...] = ()
    nominal_file: str | None = None
    thresholds_file: str | None = None
    budget_s: float | None = None
    """Operating time between false alarms by the thresholds; None: there are no thresholds"""
    promise: str = ""
    within_s: float = 0.0
    smallest: tuple[tuple[str, float | None, float | None], ...] = ()
    """The smallest changes up and down that are found within that time, by parameter"""
    untested: tuple[str, ...] = ()
    """Parameters that `replay` would not test in these same records"""
    refusal: str = ""
    """Why the axis has no nominal values or no thresholds; empty: it has both"""
    pages: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    """Parameters that the records do not determine"""
    excite: tuple[str, ...] = ()
    """Options of `excite` for a motion that would determine them"""
    motion: str = ""
    """File with that motion, beside the report; empty: there is none"""
    motion_s: float = 0.0
    """Duration of that motion"""
    no_warm_up: bool = False
    """Whether friction is taken as constant, because the records do not show that it falls as the axis warms up"""
    misfit: bool = False
    """The nominal values do not fit the records from which they were found, so the drive lacks something"""
    changes: bool = False
    """The refusal is that a parameter changes within a record"""
    fault: bool = False
    """The refusal is an internal error, not a fault of the records"""

    @property
    def finds(self) -> dict[str, float]:
        """The smallest change of each tested parameter that is found in time in either direction."""
        sizes = {name: (up, down) for name, up, down in self.smallest if name not in self.untested}
        return {
            name: max(abs(up), abs(down)) for name, (up, down) in sizes.items() if up is not None and down is not None
        }

    @property
    def finding(self) -> str:
        """What the thresholds find in time, as a sentence; empty: there are none."""
        if not self.smallest:
            return ""
        finds = self.finds
        sizes = ", ".join(f"{name} from {percent(size)}" for name, size in finds.items()) or "nothing"
        rest = [name for name, *_ in self.smallest if name not in finds]
        words = f"Found within {self.within_s:.3g} s, either way: {sizes}"
        return f"{words}; as far as was tried, not {', '.join(rest)}." if rest else f"{words}."

    @property
    def answer(self) -> str:
        """The first sentences: what is found in time (without thresholds: what the records show), and what cannot be.

        Not both: the records show smaller changes, but later, and two sizes of a parameter beside each other confuse.
        """
        return f"{self.finding} {self.obstacles}".strip() if self.finding else self.outlook

    @property
    def is_blind(self) -> bool:
        """Whether no parameter would be tested in its own records."""
        return bool(self.untested) and set(self.watched) <= set(self.untested)

    @property
    def state(self) -> str:
        """Whether the axis is ready, or else why not."""
        if self.refusal:
            return self.refusal
        if self.is_blind:
            return "nothing is tested in its own records"
        none = self.smallest and all(up is None and down is None for _, up, down in self.smallest)
        return f"no change that was tried is found within {self.within_s:.3g} s" if none else READY

    @property
    def found(self) -> Found | None:
        """The results for the configuration; None: the axis cannot be monitored."""
        if self.nominal_file is None or not self.watched:
            return None
        return Found(self.nominal_file, self.thresholds_file, self.watched)


def own_config(axis_id: str) -> str:
    """Name of the configuration of an axis that cannot be monitored yet; a motion is planned from it."""
    return f"{axis_id}.toml"


def motion_step(outcome: Outcome, config: Path) -> str:
    """The motion that would show what the records of an axis lack; empty: none would show more.

    ``config``: of the commissioned robot.
    """
    if not outcome.excite:
        return ""
    file = config if outcome.found is not None else config.parent / own_config(outcome.axis_id)
    plan = config.parent / motion_file(outcome.axis_id)
    words = ["--config", str(file), "--axis", outcome.axis_id, *outcome.excite, "-o", str(plan)]
    command = f"`{shlex.join(['axiswatch', 'excite', *words])}`"
    lost = f"{outcome.axis_id}: to show {listed(outcome.lost)}, too, let the controller run the motion"
    if not outcome.motion:
        return f"{lost} that {command} plans (its limits are those of the records), and record it."
    given = (
        "angle_reference_rad is the angle to follow, angle_reference_as_recorded in the unit of the records"
        if "--as" in outcome.excite
        else "torque_Nm is the torque to give, or current_A its current, torque_as_recorded in the unit of the records;"
        " a controller that takes no torque follows angle_rad, or angle_as_recorded, from where the axis stands"
    )
    return (
        f"{lost} in {plan} ({outcome.motion_s:.0f} s, within the torque, speed and angle of the records; its column"
        f" {given}, at the motor), and record it. {command} plans another one, with other limits."
    )


def next_step(outcomes: Sequence[Outcome], config: Path, on_a_bus: bool, again: str) -> str:
    """The next step, in a sentence or two.

    ``config``: of the commissioned robot; ``again``: the command that records, or takes, planned motions.
    """
    lost = [outcome.axis_id for outcome in outcomes if outcome.refusal]
    planned = [outcome for outcome in outcomes if outcome.motion]
    moved = ""
    if planned:
        which = "the planned motion" + ("s, one after the other" if len(planned) > 1 else "")
        still = set(lost) - {outcome.axis_id for outcome in planned}
        names = ", ".join(outcome.axis_id for outcome in planned)
        what = f"What the records do not show of {names}" if still else "What is missing"
        moved = f" {what} takes a record of {which}: `{again}`."
    if not any(outcome.found for outcome in outcomes):
        return f"No axis could be commissioned: the report says why, and which record would help.{moved}"
    run = f"Next: `axiswatch replay RECORD --config {config}` with another record"
    run += f", or `axiswatch run --config {config}`." if on_a_bus else "; to run, add the bus to that file."
    run += _not_calibrated([outcome.axis_id for outcome in outcomes if outcome.found and not outcome.thresholds_file])
    run += _cold_morning([outcome.axis_id for outcome in outcomes if outcome.found and outcome.no_warm_up])
    if not lost:
        return run + moved
    return f"Not complete: {', '.join(lost)}; the report says why, and which record would help. {run}{moved}"


def _not_calibrated(names: Sequence[str]) -> str:
    if not names:
        return ""
    return (
        f" That file tests {listed(names)} with thresholds that are not from the records, so expect false alarms"
        " there, more often than the budget."
    )


def _cold_morning(names: Sequence[str]) -> str:
    if not names:
        return ""
    return (
        f" The records of {listed(names)} show no warm-up: if the robot was warm, expect alarms of friction on a cold"
        " morning, or record it from cold on, too."
    )


def recording_s(outcomes: Sequence[Outcome]) -> float:
    """Duration of a record of all planned motions one after the other, with time to start each."""
    return sum(outcome.motion_s + _TO_START_S for outcome in outcomes if outcome.motion)


_TO_START_S = 15.0


def smallest(outcome: Outcome) -> TextTable:
    """A row for each parameter: the smallest changes that are found in time."""
    rows = [(name, *(_size(size) for size in sizes)) for name, *sizes in outcome.smallest]
    return TextTable(("parameter", "up", "down"), rows)


def _size(size: float | None) -> str:
    return "none of those tried" if size is None else percent(size, signed=True)


def overview(outcomes: Sequence[Outcome]) -> TextTable:
    """A row for each axis."""
    rows = [
        (
            outcome.axis_id,
            ", ".join(outcome.watched) or "nothing",
            ", ".join(f"{name} {percent(size)}" for name, size in outcome.finds.items()),
            "" if outcome.budget_s is None else duration(outcome.budget_s),
            outcome.state,
        )
        for outcome in outcomes
    ]
    return TextTable(("axis", "watched", "changes found in time, either way", "one false alarm in", "state"), rows)


def as_html(outcomes: Sequence[Outcome], next_step: str, config: Path, provenance: Provenance) -> str:
    """The page, which lies beside the pages of each axis; ``config``: configuration of the commissioned robot."""
    known = [outcome.notes for outcome in outcomes if outcome.notes]
    common = [note for note in known[0] if all(note in notes for notes in known)] if len(known) > 1 else []
    ready = sum(outcome.state == READY for outcome in outcomes)
    return render(
        "commissioning.html",
        title="Commissioned robot",
        outcomes=outcomes,
        ready=ready,
        next_step=next_step,
        common=common,
        motions=[motion_step(outcome, config) for outcome in outcomes],
        overview=overview(outcomes),
        tables=[smallest(outcome) for outcome in outcomes],
        changes=[[f"{c.written}: {c.reason}" for c in changes_in(outcome.corrections)] for outcome in outcomes],
        provenance=provenance,
    )
