"""Faults of the configured signals of an axis that records show, and the changes that correct them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from monitor_core.identification import TorqueTime, check_record, moves, samples_late, torque_time, wrap_of
from monitor_core.wording import sentence
from service.commands.commissioning.signals.recorded_axis import RecordedAxis
from service.commands.commissioning.signals.signal_faults import faults, unchecked, unknown_units
from service.commands.commissioning.signals.signal_times import clock, interval, unit_of_time
from service.commands.commissioning.signals.signal_units import by_inertia, by_name, by_ratio, by_speed, by_weight
from service.config import Config, NamedAxis
from service.config.written.commissioned import configured, corrected
from service.config.written.corrections import Correction
from service.ingest.records.loaded_records import RecordOrigin
from service.ingest.records.loaded_records import load as load_record
from service.ingest.records.record_files import is_table
from service.ingest.records.record_ranges import wanted

_MAX_ROUNDS = 8
"""Most corrections in a row: one mistake may hide another, so the signals are checked again after each."""


class Review(NamedTuple):
    """Findings about the signals of an axis."""

    corrections: tuple[Correction, ...]
    """Corrections, in the order in which they are to be made"""
    faults: tuple[str, ...]
    """Faults that no correction repairs: the axis cannot be identified with these records"""
    doubts: tuple[str, ...]
    """Suspicions that the records cannot confirm, and how to settle them"""
    unchecked: str
    """Values that were taken as configured"""
    standing: tuple[str, ...] = ()
    """Records in which the axis does not move although it does in others; they are left out"""
    torque_time: TorqueTime | None = None
    """Time of the torque as received; None: the records do not show it"""
    samples: int = 0
    """Number of samples of the axis that its identification has in memory at once"""


def review(text: str, axis_id: str, records: Sequence[str], folder: Path) -> Review:
    """Check the signals of an axis in files, each with or without a range.

    ``text``: a configuration that is valid in ``folder``.

    Raises:
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    found: list[Correction] = []
    while True:
        recorded, used = _checked(*configured(corrected(text, axis_id, found), axis_id, folder), records)
        new, wrong = _first(recorded, used)
        if new is None or len(found) == _MAX_ROUNDS or (new.key, new.value) in [(c.key, c.value) for c in found]:
            doubts = () if wrong else tuple(unknown_units(recorded))
            standing = tuple(text for text in records if text not in used)
            at_once = _at_once(recorded.sources)
            return Review(tuple(found), wrong, doubts, unchecked(recorded), standing, _torque_time(recorded), at_once)
        found.append(new)


def _at_once(sources: Sequence[RecordOrigin]) -> int:
    """Number of samples that are in memory at once: those that are used, and one file of which they are a part."""
    return sum(source.used for source in sources) + max(source.samples - source.used for source in sources)


def first_review(config: Config, axis: NamedAxis, record: str) -> Review:
    """First faults that a record shows: nothing is corrected yet, so that one mistake may hide another.

    Raises:
        RecordError, DescriptionError, IngestError: the record cannot be read.
    """
    recorded, used = _checked(config, axis, [record])
    new, wrong = _first(recorded, used)
    doubts = () if new or wrong else tuple(unknown_units(recorded))
    return Review((new,) if new else (), wrong, doubts, unchecked(recorded))


def _first(recorded: RecordedAxis, used: tuple[str, ...]) -> tuple[Correction | None, tuple[str, ...]]:
    """The first correction, or the faults that no correction repairs."""
    new = next(_corrections(_FIRST_CHECKS, recorded), None)
    if new is not None:
        return new, ()
    wrong = tuple(faults(recorded, used))
    return (None if wrong else next(_corrections(_SIGNAL_CHECKS, recorded), None)), wrong


def _torque_time(recorded: RecordedAxis) -> TorqueTime | None:
    found = torque_time(recorded.records)
    return found and found._replace(late=found.late + recorded.axis.config.torque.late_samples)


def _checked(config: Config, axis: NamedAxis, records: Sequence[str]) -> tuple[RecordedAxis, tuple[str, ...]]:
    """An axis with the records in which it moves, if there are any, and the names of these records."""
    loaded = {record: load_record(record, config, axis.id) for record in records}
    moving = {text: item for text, item in loaded.items() if moves(item.record.y, item.record.quantity)} or loaded
    return RecordedAxis(config, axis, list(moving.values()), is_table(wanted(records[0]).path)), tuple(moving)


# --- The checks, in the order in which their corrections are to be made -----------------------------------------------


def _sign(recorded: RecordedAxis) -> Iterator[Correction]:
    for finding in (f for record in recorded.records for f in check_record(record)):
        if finding.kind == "wrong-sign":
            words = "{finding} (or turn that of the motion)"
            reason = sentence("wrong sign", words, finding=finding.sentence)
            yield Correction(("torque", "factor"), -recorded.axis.config.torque.factor, reason)


def _wrap(recorded: RecordedAxis) -> Iterator[Correction]:
    """An angle that starts again after each turn, or after each overflow of a counter."""
    angle = recorded.axis.config.angle
    if angle is None or recorded.output != "angle":
        return
    if angle.wrap_period is None:
        record = recorded.records[0]
        period = wrap_of((record.y[record.measured] - angle.offset) / angle.factor)
        if period is not None:
            reason = sentence("wraps", "the angle starts again after {period}", period=f"{period:.6g}")
            yield Correction(("angle", "wrap_period"), period, reason)
        return
    for period, unit in _TURNS.items():
        if math.isclose(angle.wrap_period, period) and abs(angle.factor) == 1:
            words = "an angle that starts again after {period} is {unit}"
            reason = sentence("unit of turn", words, period=f"{period:g}", unit=f"in {unit}")
            yield Correction(("angle", "factor"), angle.factor * 2 * math.pi / period, reason)


_TURNS = {360.0: "degrees", 1.0: "revolutions"}


def _late(recorded: RecordedAxis) -> Iterator[Correction]:
    """A torque that comes later than the motion that it has caused."""
    if found := samples_late(recorded.records):
        config = recorded.axis.config
        reason = sentence(
            "late torque",
            "the torque comes {seconds} s later than the motion that it has caused, as a filtered current does",
            seconds=f"{found * config.sample_interval_s:.3g}",
        )
        yield Correction(("torque", "late_samples"), config.torque.late_samples + found, reason)


def _corrections(checks: Sequence[_Check], recorded: RecordedAxis) -> Iterator[Correction]:
    return (correction for check in checks for correction in check(recorded))


_Check = Callable[[RecordedAxis], Iterator[Correction]]
_FIRST_CHECKS: tuple[_Check, ...] = (unit_of_time, interval, clock, _wrap)
"""Checked before faults: an angle that jumps back looks like one that is stuck in between."""
_SIGNAL_CHECKS: tuple[_Check, ...] = (by_name, _sign, _late, by_ratio, by_weight, by_inertia, by_speed)
