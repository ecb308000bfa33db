"""Faults of the configured signals of an axis that records show, and the changes that correct them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, check_record, rigid_fit, samples_late, speed_scales, wrap_of
from monitor_core.wording import sentence
from service.can.messages import find_counter
from service.commands.commissioning.checked_axis import Checked, moves
from service.commands.commissioning.signal_faults import faults, unchecked, unknown_units
from service.commands.commissioning.signal_units import by_inertia, by_name, by_ratio, by_speed, by_weight
from service.commands.identification_task import SAME_INTERVAL, TIME_UNITS
from service.commands.output_files import replace_text
from service.config import Config, NamedAxis, load
from service.config.commissioned import Correction, corrected
from service.ingest.axis_records import wanted
from service.ingest.bus_samples import Ingest
from service.ingest.loaded_records import Loaded, RecordOrigin
from service.ingest.loaded_records import load as load_record
from service.ingest.records import LogRecord, is_table

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
_MIN_EXCHANGE_GAIN = 0.3
"""Share of the variance of the torque that two axes must explain better with exchanged torques."""
_MAX_SAMPLES = 50_000
"""Number of samples that are compared."""
_AS_LONG = 0.95
"""Share of the longest record of an axis: on a bus some axes lose a few samples."""
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


def review(text: str, axis_id: str, records: Sequence[str], folder: Path) -> Review:
    """Check the signals of an axis in files, each with or without a range.

    ``text``: a configuration that is valid in ``folder``.

    Raises:
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    found: list[Correction] = []
    while True:
        checked, used = _checked(*configured(corrected(text, axis_id, found), axis_id, folder), records)
        new, wrong = _first(checked, used)
        if new is None or len(found) == _MAX_ROUNDS or (new.key, new.value) in [(c.key, c.value) for c in found]:
            doubts = () if wrong else tuple(unknown_units(checked))
            standing = tuple(text for text in records if text not in used)
            return Review(tuple(found), wrong, doubts, unchecked(checked), standing)
        found.append(new)


def first_review(config: Config, axis: NamedAxis, record: str) -> Review:
    """First faults that a record shows: nothing is corrected yet, so that one mistake may hide another.

    Raises:
        RecordError, DescriptionError, IngestError: the record cannot be read.
    """
    checked, used = _checked(config, axis, [record])
    new, wrong = _first(checked, used)
    doubts = () if new or wrong else tuple(unknown_units(checked))
    return Review((new,) if new else (), wrong, doubts, unchecked(checked))


def _first(checked: Checked, used: tuple[str, ...]) -> tuple[Correction | None, tuple[str, ...]]:
    """The first correction, or the faults that no correction repairs."""
    new = next(_corrections(_FIRST_CHECKS, checked), None)
    if new is not None:
        return new, ()
    wrong = tuple(faults(checked, used))
    return (None if wrong else next(_corrections(_SIGNAL_CHECKS, checked), None)), wrong


def exchanged(text: str, records: Mapping[str, Sequence[str]], folder: Path) -> dict[str, tuple[Correction, ...]]:
    """Axes of a robot with the torque of another one, by name; each with the right signal.

    ``records``: of each axis; the first ones are compared.  Axes without records are skipped.
    """
    config, _ = configured(text, None, folder)
    found: dict[str, tuple[Correction, ...]] = {}
    for robot in config.robot:
        axes = [axis for axis in config.axes if axis.robot == robot.name and records.get(axis.id)]
        if axes:
            first = [records[axis.id][0] for axis in axes]
            shared = max(first, key=first.count)
            beside = [axis for axis, record in zip(axes, first, strict=True) if record == shared]
            found |= _exchanged_in(config, beside, shared)
    return found


def _exchanged_in(config: Config, axes: Sequence[NamedAxis], record: str) -> dict[str, tuple[Correction, ...]]:
    """Exchanged torques of one robot in one record."""
    from scipy.optimize import linear_sum_assignment

    loaded = {axis.id: _loaded(config, axis, [record])[0] for axis in axes}
    longest = max(len(item.record) for item in loaded.values())
    # Other axes have another interval, or their samples are from another time.
    axes = [axis for axis in axes if len(loaded[axis.id].record) >= _AS_LONG * longest]
    part = slice(min(longest, _MAX_SAMPLES))
    moved = [item._replace(record=item.record.select(part)) for item in (loaded[axis.id] for axis in axes)]
    explained = np.array(
        [[_explained(motion.record, _torque_at(motion, torque)) for torque in moved] for motion in moved]
    )
    # The right torque explains the motion best. Small differences are no reason for a proposal.
    _, best = linear_sum_assignment(-explained - _MIN_EXCHANGE_GAIN * np.eye(len(axes)))
    now = explained.diagonal()
    changed = [k for k, other in enumerate(best.tolist()) if other != k]
    if not changed or min(explained[k, best[k]] - now[k] for k in changed) < _MIN_EXCHANGE_GAIN:
        return {}
    return {axes[k].id: tuple(_torque_of(axes[k], axes[best[k]])) for k in changed}


def _torque_at(motion: Loaded, torque: Loaded) -> Floats:
    """The torque of an axis at the nearest samples of another one, by the clock of the file."""
    earlier_s = (motion.source.begins_s or 0.0) - (torque.source.begins_s or 0.0)
    t, at = torque.record.t, motion.record.t + earlier_s
    return torque.record.u[np.searchsorted((t[1:] + t[:-1]) / 2, at)]


def _explained(motion: Record, torque: Floats) -> float:
    """Share of the torque that is explained if it drives a mass with this motion."""
    if np.ptp(torque) == 0 or np.ptp(motion.y[motion.measured]) == 0:
        return 0.0
    record = replace(motion, u=torque)
    fit = rigid_fit(record, speed_scales([record])[1])
    return 0.0 if fit is None else max(0.0, fit.explained)  # of either sign, which is looked at afterwards


def _torque_of(axis: NamedAxis, partner: NamedAxis) -> Iterator[Correction]:
    reason = f"the motion of this axis follows the torque of {partner.config.name}"
    mine, other = axis.config.torque, partner.config.torque
    for key in ("column", "message", "signal"):
        value = getattr(other, key)
        if value and value != getattr(mine, key):
            yield Correction(("torque", key), value, reason)


def configured(text: str, axis_id: str | None, folder: Path) -> tuple[Config, NamedAxis]:
    """A configuration from this text, valid in a folder, and the named one of its axes, or the first."""
    path = folder / f".{axis_id or 'robot'}.toml"
    replace_text(path, text)
    try:
        config = load(path)
    finally:
        path.unlink()
    return config, next(axis for axis in config.axes if axis_id in (None, axis.id))


def _loaded(config: Config, axis: NamedAxis, records: Sequence[str]) -> list[Loaded]:
    return [load_record(record, config, axis.id) for record in records]


def _checked(config: Config, axis: NamedAxis, records: Sequence[str]) -> tuple[Checked, tuple[str, ...]]:
    """An axis with the records in which it moves, if there are any, and the names of these records."""
    loaded = dict(zip(records, _loaded(config, axis, records), strict=True))
    moving = {text: item for text, item in loaded.items() if moves(item.record.y, item.record.quantity)} or loaded
    return Checked(config, axis, list(moving.values()), is_table(wanted(records[0]).path)), tuple(moving)


# --- The checks, in the order in which their corrections are to be made -----------------------------------------------


def _unit_of_time(checked: Checked) -> Iterator[Correction]:
    if checked.axis.config.time.column is None:
        return
    ratio = _interval_s(checked)[0] / checked.axis.config.sample_interval_s
    for factor, unit in TIME_UNITS.items():
        if 1 / _MAX_INTERVAL_RATIO < ratio / factor < _MAX_INTERVAL_RATIO:
            yield Correction(("time", "factor"), 1 / factor, f"the times look like {unit}")


def _interval(checked: Checked) -> Iterator[Correction]:
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


def _clock(checked: Checked) -> Iterator[Correction]:
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


def _sign(checked: Checked) -> Iterator[Correction]:
    for finding in (f for record in checked.records for f in check_record(record)):
        if finding.kind == "wrong-sign":
            words = "{finding} (or turn that of the motion)"
            reason = sentence("wrong sign", words, finding=finding.sentence)
            yield Correction(("torque", "factor"), -checked.axis.config.torque.factor, reason)


def _wrap(checked: Checked) -> Iterator[Correction]:
    """An angle that starts again after each turn, or after each overflow of a counter."""
    angle = checked.axis.config.angle
    if angle is None or checked.output != "angle":
        return
    if angle.wrap_period is None:
        record = checked.records[0]
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


def _late(checked: Checked) -> Iterator[Correction]:
    """A torque that comes later than the motion that it has caused."""
    if found := samples_late(checked.records):
        config = checked.axis.config
        reason = sentence(
            "late torque",
            "the torque comes {seconds} s later than the motion that it has caused, as a filtered current does",
            seconds=f"{found * config.sample_interval_s:.3g}",
        )
        yield Correction(("torque", "late_samples"), config.torque.late_samples + found, reason)


def _corrections(checks: Sequence[_Check], checked: Checked) -> Iterator[Correction]:
    return (correction for check in checks for correction in check(checked))


_Check = Callable[[Checked], Iterator[Correction]]
_FIRST_CHECKS: tuple[_Check, ...] = (_unit_of_time, _interval, _clock, _wrap)
"""Checked before faults: an angle that jumps back looks like one that is stuck in between."""
_SIGNAL_CHECKS: tuple[_Check, ...] = (by_name, _sign, _late, by_ratio, by_weight, by_inertia, by_speed)
