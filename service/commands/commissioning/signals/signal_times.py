"""Corrections of the times of an axis's samples: their unit, their interval, and whether they are those of receipt."""

import math
from collections.abc import Iterator

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record
from monitor_core.wording import sentence
from service.can.messages import find_counter
from service.commands.commissioning.signals.checked_axis import Checked
from service.commands.identification_task import SAME_INTERVAL, TIME_UNITS
from service.config.commissioned import Correction
from service.ingest.bus_samples import Ingest
from service.ingest.loaded_records import RecordOrigin
from service.ingest.records import LogRecord

_MIN_BUNCHED_SHARE = 0.05
"""Frames are bunched if more than this share comes shortly after another one."""
_BUNCH_PARTS = 5
"""Number of parts of a record with bunches; in each part some frames are hardly late."""
_MIN_FRAMES = 100
"""Least number of frames from which their interval is determined"""
_TIME_TOLERANCE = 0.5
"""Tolerance of the distance of two samples in intervals; outside it they do not belong to consecutive cycles."""
_MAX_ROUGHNESS_RATIO = 0.5
"""Equally spaced times are used if they reduce the third derivative of the motion to at most this share."""
_PAUSE_S = 0.5
"""After a longer gap a counter may have wrapped, or the controller was off"""
_MAX_INTERVAL_RATIO = 2.5
"""Factor by which the interval may differ from the configured one if the times are in another unit."""


def unit_of_time(checked: Checked) -> Iterator[Correction]:
    """Times of a table in another unit than seconds."""
    if checked.axis.config.time.column is None:
        return
    ratio = _interval_s(checked)[0] / checked.axis.config.sample_interval_s
    for factor, unit in TIME_UNITS.items():
        if 1 / _MAX_INTERVAL_RATIO < ratio / factor < _MAX_INTERVAL_RATIO:
            yield Correction(("time", "factor"), 1 / factor, f"the times look like {unit}")


def interval(checked: Checked) -> Iterator[Correction]:
    """A sample interval that is not the configured one."""
    configured_s, (measured_s, off) = checked.axis.config.sample_interval_s, _interval_s(checked)
    if not math.isclose(measured_s, configured_s, rel_tol=SAME_INTERVAL + off):
        words = "the samples of the records are {found} s apart, not {configured} s"
        reason = sentence("samples apart", words, found=f"{measured_s:.6g}", configured=f"{configured_s:g}")
        yield Correction(("sample_interval_s",), float(f"{measured_s:.5g}"), reason)


def _interval_s(checked: Checked) -> tuple[float, float]:
    """The median of the records, and its relative uncertainty.

    Times from a counter always have the configured interval; only the receive times show the true one.
    """
    counted = checked.axis.config.time.counter_signal is not None
    intervals = []
    for record, source in zip(checked.records, checked.sources, strict=True):
        if not checked.in_tables and (counted or _crowded(source) > _MIN_BUNCHED_SHARE):
            intervals.append(_interval_received(*_receipts(checked, source)))
        else:
            intervals.append((record.mean_interval_s, 0.0))
    known = [found for found in intervals if math.isfinite(found[1])] or intervals
    return sorted(known)[len(known) // 2]


def _receipts(checked: Checked, source: RecordOrigin) -> tuple[Floats, Floats]:
    """Times at which torque or counter were received [s], even if they became no sample, and their cycles (N,)."""
    config, bus, signals = checked.config, checked.axis.config.bus, {checked.axis.id: ()}
    assert bus is not None  # else there is no log of it
    time = checked.axis.config.time
    log, ingest = LogRecord(source.path, config, signals), Ingest(config, bus, signals)
    wanted = "torque" if time.counter_signal is None else "counter"
    frames = (of_bus[bus] for of_bus, _ in log.frames() if bus in of_bus)
    found = [v for block in frames for v in ingest.feed_values(block) if v.quantity == wanted]
    t = np.concatenate([v.t_us for v in found]).astype(np.float64) * 1e-6 - (source.begins_s or 0.0)
    cycle = np.arange(len(t), dtype=np.float64)
    if time.counter_message is not None and time.counter_signal is not None:
        _, counter = find_counter(ingest.decoder.known, time.counter_message, time.counter_signal)
        steps = np.diff(np.concatenate([v.physical for v in found])) % 2.0**counter.length
        cycle[1:] = np.cumsum(steps)
    inside = (t >= 0) & (t <= source.end_s - source.start_s)
    return t[inside], cycle[inside]


def _interval_received(t: Floats, cycle: Floats) -> tuple[float, float]:
    """The interval of cycles (N,) received at the times t (N,), and its relative uncertainty.

    Each frame has an unknown delay, but in each part of the record some have hardly any.  The interval is the slope of
    the line through the earliest ones near both ends; the earliest ones of all parts show the deviation from a line.
    """
    pauses = np.flatnonzero(np.diff(t) > _PAUSE_S) + 1
    t, cycle = max(zip(np.split(t, pauses), np.split(cycle, pauses), strict=True), key=lambda part: len(part[0]))
    if len(t) < _MIN_FRAMES or cycle[-1] == cycle[0]:
        return 0.0, math.inf
    late = t - t[0] - (cycle - cycle[0]) * (t[-1] - t[0]) / (cycle[-1] - cycle[0])
    parts = np.array_split(np.arange(len(t)), _BUNCH_PARTS)
    first, last = (part[late[part].argmin()] for part in (parts[0], parts[-1]))
    interval_s = float((t[last] - t[first]) / (cycle[last] - cycle[first]))
    earliest = [(t - cycle * interval_s)[part].min() for part in parts]
    return interval_s, float(np.ptp(earliest) / (t[last] - t[first]))


def _crowded(source: RecordOrigin) -> float:
    """Share of frames that came within half an interval after another one; of torque and motion each."""
    return source.dropped.get("repeated", 0) / 2 / source.samples


def clock(checked: Checked) -> Iterator[Correction]:
    """Times of receipt that are not those of the samples: in bunches, as of some adapters, or the motion shows it."""
    time = checked.axis.config.time
    if checked.in_tables or time.counter_signal is not None or time.clock != "receipt":
        return
    if max(map(_crowded, checked.sources)) > _MIN_BUNCHED_SHARE:
        reason = sentence(
            "bunches",
            "frames are received in bunches, so the times of receipt are not those of the samples: the clock of the"
            " controller is fitted to them",
        )
    elif all(_rougher(record, checked.axis.config.sample_interval_s) for record in checked.records):
        reason = sentence(
            "scatter",
            "the motion is smoother with even times than with those of receipt, which scatter: the clock of the"
            " controller is fitted to them",
        )
    else:
        return
    yield Correction(("time", "clock"), "cyclic", reason)


def _rougher(record: Record, interval_s: float) -> bool:
    """Whether a motion, where no sample is lost, has a far larger third derivative by its times than by even ones."""
    t, y = record.t[record.measured] / interval_s, record.y[record.measured]
    steps = np.diff(t)
    near = np.abs(steps - 1) < _TIME_TOLERANCE
    usable = near[:-2] & near[1:-1] & near[2:]
    moves = np.abs(y[3:] - y[:-3])
    usable &= moves > np.median(moves)
    if np.count_nonzero(usable) < _MIN_FRAMES:
        return False
    by_time = y
    for order in (1, 2, 3):
        by_time = order * np.diff(by_time) / (t[order:] - t[:-order])
    even = np.median(np.abs(np.diff(y, 3)[usable]))
    return bool(even < _MAX_ROUGHNESS_RATIO * np.median(np.abs(by_time[usable])))
