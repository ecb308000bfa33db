"""Corrections of the times of an axis's samples: their unit, their interval, and whether they are those of receipt."""

import math
from collections.abc import Iterator

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import is_smoother_evenly, received_interval
from monitor_core.wording import sentence
from service.can.messages import find_counter
from service.commands.commissioning.axis.identification_records import SAME_INTERVAL, TIME_UNITS
from service.commands.commissioning.signals.recorded_axis import RecordedAxis
from service.config.written.corrections import Correction
from service.ingest.records.loaded_records import RecordOrigin
from service.ingest.records.record_files import LogRecord
from service.ingest.samples.bus_samples import Ingest

_MIN_BUNCHED_SHARE = 0.05
"""Frames are bunched if more than this share comes shortly after another one."""
_MAX_INTERVAL_RATIO = 2.5
"""Factor by which the interval may differ from the configured one if the times are in another unit."""


def unit_of_time(recorded: RecordedAxis) -> Iterator[Correction]:
    """Times of a table in another unit than seconds."""
    if recorded.axis.config.time.column is None:
        return
    ratio = _interval_s(recorded)[0] / recorded.axis.config.sample_interval_s
    for factor, unit in TIME_UNITS.items():
        if 1 / _MAX_INTERVAL_RATIO < ratio / factor < _MAX_INTERVAL_RATIO:
            yield Correction(("time", "factor"), 1 / factor, f"the times look like {unit}")


def interval(recorded: RecordedAxis) -> Iterator[Correction]:
    """A sample interval that is not the configured one."""
    configured_s, (measured_s, off) = recorded.axis.config.sample_interval_s, _interval_s(recorded)
    if not math.isclose(measured_s, configured_s, rel_tol=SAME_INTERVAL + off):
        words = "the samples of the records are {found} s apart, not {configured} s"
        reason = sentence("samples apart", words, found=f"{measured_s:.6g}", configured=f"{configured_s:g}")
        yield Correction(("sample_interval_s",), float(f"{measured_s:.5g}"), reason)


def _interval_s(recorded: RecordedAxis) -> tuple[float, float]:
    """The median of the records, and its relative uncertainty.

    Times from a counter always have the configured interval; only the receive times show the true one.
    """
    counted = recorded.axis.config.time.counter_signal is not None
    intervals = []
    for record, source in zip(recorded.records, recorded.sources, strict=True):
        if not recorded.in_tables and (counted or _crowded(source) > _MIN_BUNCHED_SHARE):
            intervals.append(received_interval(*_receipts(recorded, source)))
        else:
            intervals.append((record.mean_interval_s, 0.0))
    known = [found for found in intervals if math.isfinite(found[1])] or intervals
    return sorted(known)[len(known) // 2]


def _receipts(recorded: RecordedAxis, source: RecordOrigin) -> tuple[Floats, Floats]:
    """Times at which torque or counter were received [s], even if they became no sample, and their cycles (N,)."""
    config, bus, signals = recorded.config, recorded.axis.config.bus, {recorded.axis.id: ()}
    assert bus is not None  # else there is no log of it
    time = recorded.axis.config.time
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


def _crowded(source: RecordOrigin) -> float:
    """Share of frames that came within half an interval after another one; of torque and motion each."""
    return source.dropped.get("repeated", 0) / 2 / source.samples


def clock(recorded: RecordedAxis) -> Iterator[Correction]:
    """Times of receipt that are not those of the samples: in bunches, as of some adapters, or the motion shows it."""
    time = recorded.axis.config.time
    if recorded.in_tables or time.counter_signal is not None or time.clock != "receipt":
        return
    if max(map(_crowded, recorded.sources)) > _MIN_BUNCHED_SHARE:
        reason = sentence(
            "bunches",
            "frames are received in bunches, so the times of receipt are not those of the samples: the clock of the"
            " controller is fitted to them",
        )
    elif all(is_smoother_evenly(record, recorded.axis.config.sample_interval_s) for record in recorded.records):
        reason = sentence(
            "scatter",
            "the motion is smoother with even times than with those of receipt, which scatter: the clock of the"
            " controller is fitted to them",
        )
    else:
        return
    yield Correction(("time", "clock"), "cyclic", reason)
