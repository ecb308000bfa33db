"""Faults of the signals of an axis that no correction can repair, and questions that records leave open."""

from collections.abc import Iterator

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, Span, held_for, samples_late, stuck_spans, top_speed
from monitor_core.samples import PHYSICAL_LIMITS
from monitor_core.wording import Sentence, sentence
from service.can.user_errors import left_out_words
from service.commands.commissioning.signals.recorded_axis import FASTEST, SIGNALS, RecordedAxis, values_of
from service.config.schema import MOST_LATE
from service.config.unit_names import UNITS
from service.ingest.records.loaded_records import RecordOrigin
from service.ingest.records.recorded_units import Signal

_MAX_STUCK_SHARE = 0.01
"""Share of a record that may be stuck; smaller faults are left to the warnings of the identification."""
_FEWEST, _RARE = 100, 0.005
"""One of so many samples at either end may be an outlier, such as the first one."""
_MAX_NAMED_SPANS = 3
"""Most spans of one signal that are reported."""


# --- Stuck signals, and those whose values are held for several samples -----------------------------------------------


def faults(recorded: RecordedAxis, texts: tuple[str, ...]) -> Iterator[str]:
    """Faults of the signals and their remedies, in sentences without their full stop.

    ``texts``: the records as the user gave them.
    """
    for record, source, text in zip(recorded.records, recorded.sources, texts, strict=True):
        yield from _out_of_range(recorded, source, text)
        yield from _restarted(recorded, source, text)
        yield from _stuck(recorded, record, text)
        yield from _stuck_motion(recorded, record, text)
    yield from _too_late(recorded)


def _out_of_range(recorded: RecordedAxis, source: RecordOrigin, text: str) -> Iterator[str]:
    """Values that no motor reaches, so that the unit must be another one."""
    lost = source.dropped.get("absurd", 0)
    if lost > _MAX_STUCK_SHARE * (source.samples + lost):
        quantity = recorded.output
        yield sentence(
            "values beyond",
            "{lost} values of {record} are beyond {torque} N m or {motion}, which no motor reaches: set torque.factor"
            " and {key}.factor, for counts 2 pi / counts of a turn of the motor (data sheet of the encoder)",
            lost=lost,
            record=text,
            torque=f"{PHYSICAL_LIMITS['torque']:g}",
            motion=f"{PHYSICAL_LIMITS[quantity]:g} {UNITS[quantity]}",
            key=quantity,
        )


def _restarted(recorded: RecordedAxis, source: RecordOrigin, text: str) -> Iterator[str]:
    """Times of a table that start again, so that the rows with smaller ones are left out."""
    lost = source.dropped.get("out_of_order", 0)
    if recorded.in_tables and lost > _MAX_STUCK_SHARE * (source.samples + lost):
        yield sentence(
            "times restart",
            "the times of {record} start again, so that {lost} of {rows} rows are not after those above: cut the file"
            " there, or, if no row is missing, take time.column out of the configuration",
            record=text,
            lost=lost,
            rows=source.samples + lost,
        )


def _too_late(recorded: RecordedAxis) -> Iterator[str]:
    """A torque that comes later than a correction may be."""
    late = recorded.axis.config.torque.late_samples
    if late and late + (more := samples_late(recorded.records)) > MOST_LATE:
        yield sentence(
            "torque too late",
            "the torque comes {samples} samples or more later than the motion that it has caused, and at most {most}"
            " can be corrected: shift it where it is recorded, or record it without the filter",
            samples=f"{late + more:g}",
            most=MOST_LATE,
        )


def _stuck(recorded: RecordedAxis, record: Record, text: str) -> Iterator[str]:
    for signal in SIGNALS:
        name, values = _name(recorded, signal), values_of(record, signal)
        nearly = signal == "motion" and values.size > _FEWEST and _same(values)
        if values.size and (np.ptp(values) == 0 or nearly):
            yield sentence(
                "signal constant",
                "{name} is {value} {throughout} {record}: the axis did not move, or the signal is stuck; record the"
                " moving axis, and check that this is its signal",
                name=name,
                value=f"{np.median(values):.6g}",
                throughout="nearly throughout" if np.ptp(values) else "throughout",
                record=text,
            )
            continue
        spans = stuck_spans(record, signal)
        if sum(s.end_s - s.start_s for s in spans) > _MAX_STUCK_SHARE * record.duration_s:
            yield sentence(
                "signal stuck",
                "{name} is stuck, while the axis moves, {spans} of {record}: a stuck sensor or a lost connection;"
                " record again, or use only the sound part, {sound}",
                name=name,
                spans=_words(spans),
                seconds=f"{sum(s.end_s - s.start_s for s in spans):.2f}",
                record=text,
                sound=_sound(spans, record, text),
            )


def _same(values: Floats) -> bool:
    """Whether nearly all values (N,) are one number."""
    low, high = np.quantile(values, (_RARE, 1 - _RARE))
    return bool(low == high)


def _stuck_motion(recorded: RecordedAxis, record: Record, text: str) -> Iterator[str]:
    """Stuck values of the motion; a held torque has really acted so."""
    count = held_for(record.y[record.measured])
    if count > 1:
        other = held_for(record.u) == count
        signals = "torque and motion come" if other else "the motion comes"
        interval = f"{count * record.interval_s:.5g}"
        if recorded.in_tables:
            rows, way = "rows", f"keep every {_ordinal(count)} row, and set sample_interval_s = {interval}"
        else:
            rows = "frames"
            way = f"let the controller send each value once, every {interval} s, and set sample_interval_s to that"
        yield sentence(
            "signal held",
            "{name} changes only in every {nth} sample of {record}: {signals} {count} times as slowly as the {rows};"
            " {way}",
            name=_name(recorded, "motion"),
            nth=_ordinal(count),
            record=text,
            signals=signals,
            count=count,
            rows=rows,
            way=way,
            interval=interval,
        )


def _name(recorded: RecordedAxis, signal: Signal) -> Sentence:
    source = recorded.source(signal)
    place = f"column {source.column}" if recorded.in_tables else f"signal {source.signal} of {source.message}"
    column = source.column if recorded.in_tables else f"{source.message}.{source.signal}"
    words = "{place} (the {quantity})"
    return sentence("place", words, place=place, signal=column, quantity=recorded.quantity(signal))


def _words(spans: list[Span]) -> str:
    named = [f"from {s.start_s:.2f} to {s.end_s:.2f} s" for s in spans[:_MAX_NAMED_SPANS]]
    more = len(spans) - _MAX_NAMED_SPANS
    return ", ".join(named) + (f" and {more} times more" if more > 0 else "")


def _sound(spans: list[Span], record: Record, text: str) -> str:
    """The longest stretch without stuck values, as a range of the file."""
    edges = [0.0, *(edge for span in spans for edge in span), record.duration_s]
    start, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda pair: pair[1] - pair[0])
    return f"{text.rpartition('@')[0] or text}@{start:.2f}:{end:.2f}"


def _ordinal(count: int) -> str:
    return {2: "second", 3: "third"}.get(count, f"{count}th")


# --- What records leave open, with the key and the value that settle it -----------------------------------------------


def unknown_units(recorded: RecordedAxis) -> Iterator[str]:
    """Open questions about the units, with the key and the value that settle each."""
    for source in recorded.sources:
        if source.left_out:
            yield left_out_words(source.path, source.left_out)
    # If both are counts, the inertia may agree with the nominal one by chance.
    if not recorded.agrees or all(_counts(signal, recorded) for signal in SIGNALS):
        yield from _unknown_torque(recorded)
        yield from _unknown_motion(recorded)
    if (times := recorded.times_nominal) is not None and not recorded.agrees:
        yield sentence(
            "inertia off",
            "as one mass the drive shows {times} times the nominal inertia: check units, the gear ratio and"
            " [robot.axis.model.nominal]; if the {quantity} is that of the arm, {key}.factor is the gear ratio, motor"
            " over arm",
            times=f"{times:.3g}",
            quantity=recorded.output,
            key=recorded.output,
        )


def _unknown_torque(recorded: RecordedAxis) -> Iterator[Sentence]:
    if recorded.axis.config.torque.kT_Nm_per_A is None and _counts("torque", recorded):
        yield sentence(
            "torque counted",
            "the torque is in whole numbers, as in per mille of the rated torque (CiA 402, object 6077h): set"
            " torque.factor to the rated torque of the name plate / 1000 [N m]; until then all torques, inertias and"
            " frictions are in that unit, and alarms, in percent, are the same",
        )


def _unknown_motion(recorded: RecordedAxis) -> Iterator[Sentence]:
    if _counts("motion", recorded):
        weighed = any(p.name == "gc" for p in recorded.drive.drawn)
        until = (
            "the weight of the arm cannot be found"
            if weighed
            else "inertias and frictions are in it, and alarms, in percent, are the same"
        )
        yield sentence(
            "motion counted",
            "the {quantity} is in whole numbers, as counts are: set {key}.factor to 2 pi / counts of a turn of the"
            " motor (data sheet of the encoder) [rad]; until then {until}",
            quantity=recorded.output,
            key=recorded.output,
            until=until,
        )
    elif recorded.output == "speed" and (speed := top_speed(recorded.records)) > FASTEST:
        yield sentence(
            "speed beyond",
            "no motor turns at {speed} rad/s: set speed.factor to 0.10472 for revolutions per minute, 0.0174533 for"
            " degrees per second",
            speed=f"{speed:.3g}",
        )


def _counts(signal: Signal, recorded: RecordedAxis) -> bool:
    """Whether a signal consists of whole numbers of unknown unit."""
    counted = recorded.in_whole_numbers(signal) and abs(recorded.factor(signal)) == 1
    return counted and not recorded.is_as_recorded(signal)


def unchecked(recorded: RecordedAxis) -> str:
    """Units that nothing in the records could have checked; empty: everything configured has been compared."""
    if recorded.known.inertia is not None:
        return ""
    ratio = "" if recorded.ratio is None else f", and of the gear ratio r = {recorded.ratio:g}"
    return (
        f"Units of torque and {recorded.output} are taken as configured{ratio}: records show them beside the nominal"
        " inertias of [robot.axis.model.nominal], or where a weight acts."
    )
