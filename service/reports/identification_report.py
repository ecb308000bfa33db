"""The result of an identification with its origin, and what is stated of it: warnings, verdict, next step."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from monitor_core.drive import TEMPERATURE
from monitor_core.identification import (
    ComparedRecord,
    FoundWarmUp,
    IdentificationResult,
    Rejection,
)
from monitor_core.settings import MODEL_ERRORS
from monitor_core.wording import duration, listed, percent
from service.ingest.records.loaded_records import RecordOrigin
from service.reports.formats import Provenance, number
from service.reports.outlook_words import missing_words, obstacle_words, outlook_words, verdict_words

_MOST_NAMED = 3
_HALL_SDS = 2.0
"""A hall that differs by more than so many standard deviations is unlikely."""
_WARM = 3.0
"""Number of time constants after which an axis counts as warm: 5 % of the warm-up remain."""


@dataclass(frozen=True, eq=False)
class IdentificationReport:
    """The contents of every report of an identification, with the sources of the fitted and the reserved records."""

    axis_id: str
    result: IdentificationResult
    estimation: tuple[RecordOrigin, ...]
    validation: tuple[RecordOrigin, ...]
    record_warnings: tuple[str, ...]
    """Warnings about the records, in sentences"""
    provenance: Provenance
    coupling: tuple[float, ...] = ()
    """Factors of the motions of other axes in that of the motor, in ascending order"""

    @property
    def warnings(self) -> tuple[str, ...]:
        """All warnings, in sentences: about the fit, the records, the number of masses, and fixed parameters."""
        missing = missing_words(self.result.verdict)
        return (
            *([missing] if missing else []),
            *self.record_warnings,
            *self._other_masses(),
            *self.result.estimate.words,
            *self._held(),
            *self._friction(),
            *self._standstill(),
            *self._short_of_warm(),
            *self._beside_the_heat(),
            *self._not_following(),
        )

    @property
    def rejection(self) -> str:
        """Why there are no nominal values, in a sentence without its full stop; empty: there are some."""
        result = self.result
        if result.rejection is Rejection.NOT_CONVERGED:
            return f"the fit has not converged after {result.estimate.iterations} evaluations{self._next_step()}"
        if result.rejection is Rejection.NOT_IDENTIFIABLE:
            names = ", ".join(result.not_identifiable)
            return f"{names} cannot be determined from these records: hold one of them with --fix"
        if result.rejection is Rejection.DELAY_OUT_OF_RANGE:
            return (
                f"the torque acts {1e3 * result.delay_s:.3g} ms late, but the daemon can follow delays of 0 to one"
                " interval only: shift the torque against the motion where they are recorded"
            )
        if result.rejection is Rejection.POOR:
            return f"the drive does not explain the motion: {verdict_words(result.verdict)}"
        return ""

    @property
    def outlook(self) -> str:
        """The first line of every report: what can be monitored with this result, and what cannot and why."""
        return outlook_words(self.result, self.rejection)

    @property
    def obstacles(self) -> str:
        """What of it cannot be monitored, why, and what would help; empty: nothing."""
        return obstacle_words(self.result)

    @property
    def is_poor(self) -> bool:
        """Whether a poor fit is the only objection to the values."""
        return self.result.rejection is Rejection.POOR

    def traces(self) -> Iterator[tuple[str, RecordOrigin, ComparedRecord]]:
        """Purpose, source and origin of each record."""
        for purpose, sources, traces in (
            ("estimation", self.estimation, self.result.estimation),
            ("validation", self.validation, self.result.validation),
        ):
            for source, trace in zip(sources, traces, strict=True):
                yield purpose, source, trace

    def _next_step(self) -> str:
        """Advice if the search has not converged."""
        moving = self.result.estimate.moving[:_MOST_NAMED]
        return (
            f", and {', '.join(moving)} would still move: hold them with --fix at values from another record, such as"
            " one with more excitation, or see with --masses auto how many masses these records ask for"
        )

    def _friction(self) -> Iterator[str]:
        if self.result.options.speed_scales:
            scale = self.result.estimate.problem.speed_scale
            yield f"friction_speed_scale is not given: {scale:.3g} rad/s explains the records best."

    def _standstill(self) -> Iterator[str]:
        """Remark that the torque of an axis at rest, held by its brake, or all of its slow motion, is left out."""
        found, slow = self.result.standstill, self.result.slow_left_out
        if slow:
            yield (
                f"What is slower than {slow:.2g} rad/s is left out of the fit: its friction sticks and slips, or"
                " falls with the speed, other than fm and fc describe. The monitor leaves it out, too."
            )
        elif found is not None and not found.speed:
            yield (
                f"A brake holds the axis {percent(found.share)} of the time, while its motor is off: the fit leaves"
                " that out. So does the monitor."
            )
        elif found is not None:
            yield (
                f"The axis stands {percent(found.share)} of the time, and friction holds any torque then: the fit"
                f" leaves that torque out. So does the monitor, below {found.speed:.2g} rad/s."
            )

    def _short_of_warm(self) -> Iterator[str]:
        """Remark that the records end before the axis is warm."""
        found = self.result.warm_up
        if found is None:
            return
        ends_s = dict[Path, tuple[float, float]]()
        for source in self.estimation:  # of a record with gaps, the parts
            start_s, _ = ends_s.get(source.path, (source.start_s, source.end_s))
            ends_s[source.path] = start_s, source.end_s
        longest_s = max(end_s - start_s for start_s, end_s in ends_s.values())
        slow_s, slow_share = found.model.parts[0]
        needed_s = slow_s * (_WARM + math.log(slow_share))
        if longest_s < needed_s:
            yield (
                f"The axis warms up with a time constant of {duration(slow_s)}, and the longest record lasts"
                f" {duration(longest_s)}: in operation it becomes warmer than in any record. More than a tenth beyond"
                ' that only larger changes are found; with outside_calibration = "wait" in [robot.axis.detector] none.'
                f" Record at least {duration(needed_s)} of operation without a pause, from cold on."
            )

    def _beside_the_heat(self) -> Iterator[str]:
        """What the identified warm-up lacks."""
        found = self.result.warm_up
        if found is None:
            if off := self._off_by(self.result.temperature_errors):
                yield (
                    f"Beside the temperature {off} (standard deviation, in the worst part of the records; a thermometer"
                    f" lags): the tests allow for {MODEL_ERRORS:g} times that."
                )
            return
        off = self._off_by(found.errors)
        if not off:
            return
        how = "the larger, the less there is to judge it by" if found.judged else "half of what the heat changes"
        yield (f"Beside the heat {off} (standard deviation; {how}): the tests allow for {MODEL_ERRORS:g} times that.")
        if not found.judged:
            yield "These records are too short to judge that better: give two records from cold on."
        yield from self._ambient(found)

    def _ambient(self, found: FoundWarmUp) -> Iterator[str]:
        """What is done about a hall that is colder or warmer than in the records, and its price."""
        sd, values = found.model.ambient, {row.name: row.value for row in self.result.rows()}
        moved = [
            f"{name} by up to {percent(_HALL_SDS * sd * abs(slope / values[name]))}"
            for name, (slope, _) in found.slopes.items()
            if values.get(name)
        ]
        if sd > 0 and moved:
            yield (
                f"A hall that is colder or warmer than in the records changes {' and '.join(moved)}. The daemon"
                " observes that in the first minutes of motion, and follows it. So a change of friction by as much that"
                " came while the axis stood is taken for the hall. A measured temperature of the axis (signal"
                f" {TEMPERATURE}) tells them apart."
            )
        others = [w for w in found.ambients if w]
        if others:
            shown = listed([f"{w:+.2g}" for w in found.ambients[1:]])
            yield (
                f"The halls of the records differ from that of the first, by {shown} W of heat, beside up to"
                f" {found.model.largest:.2g} W by friction."
            )

    def _off_by(self, errors: Mapping[str, float]) -> str:
        """What parameters are off by, relative to their values; empty: nothing is known of that."""
        values = {row.name: row.value for row in self.result.rows()}
        off = (
            f"{name} is off by {percent(error / abs(values[name]))}"
            for name, error in errors.items()
            if values.get(name)
        )
        return " and ".join(off)

    def _not_following(self) -> Iterator[str]:
        """Remark on friction that is taken as constant, although a warm-up of it was searched for."""
        names, found = self.result.not_following, self.result.warm_up
        if names and found is not None:
            yield (
                f"The records show that {listed(list(found.slopes))} changes as the axis warms up, but not that"
                f" {listed(names)} would, too: taken as constant."
            )
        elif names:
            yield (
                f"The records do not show that friction falls as the axis warms up: {listed(names)} taken as constant."
                " If the axis was warm when they began, expect 20 to 80 % more friction in the morning, and an alarm"
                " of it. To test it then, too, record it from cold on."
            )

    def _held(self) -> Iterator[str]:
        held = self.result.held
        for row in self.result.rows():
            if row.name in held:
                yield f"{row.name} is held at {number(row.value)} {row.unit}: {held[row.name]}."

    def _other_masses(self) -> Iterator[str]:
        recommended, result = self.result.recommended_masses, self.result
        if recommended is not None:
            masses = "one mass" if recommended == 1 else f"{recommended} masses"
            yield (
                f"The records ask for {masses} in a row, and the drive {result.start.drive.name} has {result.masses}:"
                " identify a drive that has as many, from the library or your own."
            )
