"""Signals of an axis that no correction can mend: stuck ones, and those whose values are held for several samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from monitor_core.identification import UNITS, Record, Span, held_for, stuck_spans
from monitor_core.samples import PHYSICAL_LIMITS
from service.commands.checked_axis import SIGNALS, Checked, Signal
from service.ingest.identification_records import Source

_LITTLE = 0.01
"""Of a record: so much of it may be stuck; identification leaves that to its warnings."""
_NAMED = 3
"""Spans of one signal."""


def faults(checked: Checked, texts: tuple[str, ...]) -> Iterator[str]:
    """What is wrong with the signals, and what to do, in sentences without their full stop.

    ``texts``: the records as the user gave them.
    """
    for record, source, text in zip(checked.records, checked.sources, texts, strict=True):
        yield from _beyond(checked, source, text)
        yield from _stuck(checked, record, text)
        yield from _held(checked, record, text)


def _beyond(checked: Checked, source: Source, text: str) -> Iterator[str]:
    """Values that no motor reaches, in another unit."""
    lost = source.dropped.get("absurd", 0)
    if lost > _LITTLE * (source.samples + lost):
        quantity = checked.output
        yield (
            f"{lost} values of {text} are beyond {PHYSICAL_LIMITS['torque']:g} N m or"
            f" {PHYSICAL_LIMITS[quantity]:g} {UNITS[quantity]}, which no motor reaches: set torque.factor and"
            f" {quantity}.factor, for counts 2 pi / counts of a turn of the motor (data sheet of the encoder)"
        )


def _stuck(checked: Checked, record: Record, text: str) -> Iterator[str]:
    for signal in SIGNALS:
        name = f"{_place(checked, signal)} (the {_quantity(checked, signal)})"
        if _constant(record, signal):
            value = (record.u if signal == "torque" else record.y[record.measured])[0]
            yield (
                f"{name} is {value:.6g} throughout {text}: the axis did not move, or the signal is stuck; record the"
                " moving axis, and check that this is its signal"
            )
            continue
        spans = stuck_spans(record, signal)
        if sum(s.end_s - s.start_s for s in spans) > _LITTLE * record.duration_s:
            yield (
                f"{name} is stuck, while the axis moves, {_words(spans)} of {text}: a stuck sensor or a lost"
                f" connection; record again, or use what is sound of it, {_sound(spans, record, text)}"
            )


def _held(checked: Checked, record: Record, text: str) -> Iterator[str]:
    """Of the motion; a torque that is held has really acted so."""
    count = held_for(record.y[record.measured])
    if count > 1:
        other = held_for(record.u) == count
        signals = "torque and motion come" if other else "the motion comes"
        interval = f"{count * record.interval_s:.5g}"
        if checked.in_tables:
            rows, way = "rows", f"keep every {_nth(count)} row, and set sample_interval_s = {interval}"
        else:
            rows = "frames"
            way = f"let the controller send each value once, every {interval} s, and set sample_interval_s to that"
        yield (
            f"{_place(checked, 'motion')} (the {_quantity(checked, 'motion')}) changes only in every"
            f" {_nth(count)} sample of {text}: {signals} {count} times as slowly as the {rows}; {way}"
        )


def _constant(record: Record, signal: Signal) -> bool:
    values = record.u if signal == "torque" else record.y[record.measured]
    return bool(values.size and np.ptp(values) == 0)


def _place(checked: Checked, signal: Signal) -> str:
    config = checked.axis.config
    source = config.torque if signal == "torque" else config.motion
    return f"column {source.column}" if checked.in_tables else f"signal {source.signal} of {source.message}"


def _quantity(checked: Checked, signal: Signal) -> str:
    return "torque" if signal == "torque" else checked.output


def _words(spans: list[Span]) -> str:
    named = [f"from {s.start_s:.2f} to {s.end_s:.2f} s" for s in spans[:_NAMED]]
    more = len(spans) - _NAMED
    return ", ".join(named) + (f" and {more} times more" if more > 0 else "")


def _sound(spans: list[Span], record: Record, text: str) -> str:
    """The longest stretch without any, as a range of the file."""
    edges = [0.0, *(edge for span in spans for edge in span), record.duration_s]
    start, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda pair: pair[1] - pair[0])
    return f"{text.rpartition('@')[0] or text}@{start:.2f}:{end:.2f}"


def _nth(count: int) -> str:
    return {2: "second", 3: "third"}.get(count, f"{count}th")
