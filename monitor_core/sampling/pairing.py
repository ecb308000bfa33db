"""Pairs torque and motion values of one axis into samples.  Values that fit into no sample are dropped and counted."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.kernel.compile import outlined

DROP_REASONS = (*("not_finite", "absurd", "repeated", "out_of_order", "untimed", "unpaired", "late", "missing"),)
"""Reasons why values did not become a sample.  ``Pairing.counts`` counts values, and for "missing" whole samples.

not_finite: NaN or infinite.  absurd: beyond physical limits.  repeated: the same quantity again within half
an interval.  out_of_order: not after the last sample.  untimed: the sample counter, or the fitted clock, contradicts
the time of receipt.  unpaired: the partner was never received.  late: received after its partner had been discarded, or
paired with another value.  missing: samples that were never received, from the interval between two samples.
"""

NOT_FINITE, ABSURD, REPEATED, OUT_OF_ORDER, _, UNPAIRED, LATE, MISSING = range(len(DROP_REASONS))
FITS = -1
TORQUE, MOTION = 0, 1
NO_TIME = np.iinfo(np.int64).min
"""Stands for an absent time"""
_REMEMBERED = 8
"""Number of the last discarded values whose times are kept, to recognize late partners"""

PAIRING = np.dtype(
    [
        ("interval_us", "f8"),
        ("tolerance_us", "f8"),
        ("gap_us", "f8"),
        ("patience_us", "f8"),
        ("newest_us", "i8"),  # of all values received
        ("floor_us", "i8"),  # later of the two values of the last sample, as received
        ("last_us", "i8"),  # time of the last sample
        ("clock_set_back", "i8"),
        ("dropped", "i8", (len(DROP_REASONS),)),
        # Of torque and motion:
        ("limit", "f8", (2,)),
        ("waiting", "i8", (2,)),  # number of values without a partner
        ("paired_us", "i8", (2,)),
        ("given_up", "i8", (2,)),  # number of values whose partners did not come
        ("given_up_us", "i8", (2, _REMEMBERED)),
    ]
)
WAITING = np.dtype([("t_us", "i8"), ("value", "f8"), ("sample_us", "i8")])
"""A value, its time of receipt, by which it is paired, and its time by the sample counter, or NO_TIME."""
SAMPLE = np.dtype([("t_us", "i8"), ("torque", "f8"), ("motion", "f8"), ("place", "i8"), ("received_us", "i8")])
"""A sample, and the place in its block and the time of receipt of the frame that completed it."""


class Pairing(NamedTuple):
    """Pairs the values of one axis into samples with strictly increasing times.

    A torque and a motion value belong together if they were received within the tolerance.  No sample mixes two cycles,
    as long as all values of a cycle are received within the tolerance, and this is below half an interval.  Every value
    is either part of one sample or counted once.
    """

    state: NDArray[np.void]
    """(1,)"""
    waiting: NDArray[np.void]
    """(2, W) values of torque and of motion without a partner, in the order of receipt"""

    @property
    def counts(self) -> dict[str, int]:
        """Number of dropped values by reason, and of missing samples."""
        return dict(zip(DROP_REASONS, self.state["dropped"][0].tolist(), strict=True))

    @property
    def set_back(self) -> int:
        """How often the clock of this machine was set back."""
        return int(self.state["clock_set_back"][0])


def new_pairing(
    interval_s: float, tolerance_s: float, max_gap_s: float, patience: float, limits: tuple[float, float]
) -> Pairing:
    """The pairing of an axis.

    Args:
        interval_s: sample interval [s].
        tolerance_s: pairing tolerance [s], below half an interval.
        max_gap_s: a step back in time by more than this means that the clock was set back [s].
        patience: number of intervals that a value waits for its partner.
        limits: largest possible magnitudes of torque and motion.
    """
    state = np.zeros(1, PAIRING)
    state["interval_us"], state["tolerance_us"] = interval_s * 1e6, tolerance_s * 1e6
    state["gap_us"], state["patience_us"] = max_gap_s * 1e6, patience * (interval_s * 1e6)
    state["newest_us"] = state["floor_us"] = state["last_us"] = NO_TIME
    state["limit"], state["paired_us"] = limits, NO_TIME
    # Waiting values are at least half an interval apart; none is older than the longest gap plus the patience.
    most = 8 + 2 * math.ceil(2 * (max_gap_s / interval_s + patience))
    return Pairing(state, np.zeros((2, most), WAITING))


@outlined
def add_value(p: Any, waiting: Any, kind: int, t_us: int, value: float, sample_us: int, sample: Any) -> bool:
    """Take a value; returns whether it completes a sample, which is then written to ``sample``.

    Args:
        p: state of the pairing.
        waiting: its waiting values.
        kind: TORQUE or MOTION.
        t_us: time of receipt [us].
        value: torque [N m], or angle [rad] or speed [rad/s].
        sample_us: time of the sample [us] by the sample counter, or NO_TIME.
        sample: record for the result.
    """
    reason = _check_value(p, kind, value)
    if reason != FITS:
        p.dropped[reason] += 1
        return False
    _note_time(p, waiting, t_us)
    reason = _check_time(p, waiting, kind, t_us)
    if reason != FITS:
        p.dropped[reason] += 1
        return False
    other = 1 - kind
    partner = _nearest(p, waiting, other, t_us)
    if partner < 0:
        _wait(p, waiting, kind, t_us, value, sample_us)
        _give_up(p, waiting, t_us - p.patience_us)
        return False
    earlier = waiting[other, partner]
    earlier_us, earlier_value, earlier_sample_us = earlier.t_us, earlier.value, earlier.sample_us
    _remove(p, waiting, other, partner)
    p.paired_us[kind], p.paired_us[other] = t_us, earlier_us
    if kind == TORQUE:
        return _pair(p, waiting, t_us, value, sample_us, earlier_us, earlier_value, earlier_sample_us, sample)
    return _pair(p, waiting, earlier_us, earlier_value, earlier_sample_us, t_us, value, sample_us, sample)


@outlined
def add_pair(p: Any, waiting: Any, t_us: int, torque: float, motion: float, sample_us: int, sample: Any) -> bool:
    """Take both values of one frame, which belong together; arguments and result as of ``add_value``."""
    reason = _check_value(p, TORQUE, torque)
    if reason == FITS:
        reason = _check_value(p, MOTION, motion)
    if reason != FITS:
        p.dropped[reason] += 2
        return False
    _note_time(p, waiting, t_us)
    # With a sample counter, repeated frames have already been dropped, and frames of a burst may be close together.
    if sample_us == NO_TIME and p.floor_us != NO_TIME:
        if abs(t_us - p.floor_us) < p.interval_us / 2:
            p.dropped[REPEATED] += 2
            return False
        if t_us < p.floor_us:
            p.dropped[OUT_OF_ORDER] += 2
            return False
    return _pair(p, waiting, t_us, torque, sample_us, t_us, motion, sample_us, sample)


@outlined
def flush_pairing(p: Any, waiting: Any) -> None:
    """Discard all values that wait for a partner, as no more values will come; they count as unpaired."""
    _give_up(p, waiting, math.inf)


@outlined
def _check_value(p: Any, kind: int, value: float) -> int:
    """Reason why a value is impossible for any axis, or FITS."""
    if not math.isfinite(value):
        return NOT_FINITE
    return ABSURD if abs(value) > p.limit[kind] else FITS


@outlined
def _note_time(p: Any, waiting: Any, t_us: int) -> None:
    """Keep the newest time; restart after a large step back, which means that the clock was set back."""
    if p.newest_us != NO_TIME and t_us < p.newest_us - p.gap_us:
        p.clock_set_back += 1
        flush_pairing(p, waiting)
        for kind in range(2):
            p.given_up[kind] = 0
            p.paired_us[kind] = NO_TIME
        p.newest_us = p.floor_us = p.last_us = NO_TIME
    p.newest_us = max(p.newest_us, t_us)


@outlined
def _check_time(p: Any, waiting: Any, kind: int, t_us: int) -> int:
    """Reason why a value with this time fits into no sample, whether or not its partner is there; or FITS."""
    if _was_near(p, kind, t_us, p.interval_us / 2):
        return REPEATED
    for k in range(p.waiting[kind]):
        if abs(waiting[kind, k].t_us - t_us) < p.interval_us / 2:
            return REPEATED
    if _was_near(p, 1 - kind, t_us, p.tolerance_us):
        return LATE
    return OUT_OF_ORDER if p.floor_us != NO_TIME and t_us <= p.floor_us else FITS


@outlined
def _was_near(p: Any, kind: int, t_us: int, distance_us: float) -> Any:
    """Whether a paired or discarded value of this kind has a time within this distance of ``t_us``."""
    near = p.paired_us[kind] != NO_TIME and abs(p.paired_us[kind] - t_us) < distance_us
    for k in range(min(p.given_up[kind], _REMEMBERED)):
        near = near or abs(p.given_up_us[kind, k] - t_us) < distance_us
    return near


@outlined
def _nearest(p: Any, waiting: Any, kind: int, t_us: int) -> int:
    """Index of the waiting value nearest to this time, within the tolerance; -1: there is none."""
    best, least = -1, np.int64(0)
    for k in range(p.waiting[kind]):
        distance = abs(waiting[kind, k].t_us - t_us)
        if best < 0 or distance < least:
            best, least = k, distance
    return best if best >= 0 and least <= p.tolerance_us else -1


@outlined
def _wait(p: Any, waiting: Any, kind: int, t_us: int, value: float, sample_us: int) -> None:
    if p.waiting[kind] == waiting.shape[1]:  # should not happen; if it does, the dropped value is counted
        _remove(p, waiting, kind, 0)
        p.dropped[UNPAIRED] += 1
    place = waiting[kind, p.waiting[kind]]
    place.t_us, place.value, place.sample_us = t_us, value, sample_us
    p.waiting[kind] += 1


@outlined
def _remove(p: Any, waiting: Any, kind: int, at: int) -> None:
    for k in range(at + 1, p.waiting[kind]):
        waiting[kind, k - 1] = waiting[kind, k]
    p.waiting[kind] -= 1


@outlined
def _give_up(p: Any, waiting: Any, before_us: float) -> None:
    """Discard waiting values that are older than ``before_us``."""
    for kind in range(2):
        kept = 0
        for k in range(p.waiting[kind]):
            t_us = waiting[kind, k].t_us
            if t_us < before_us:
                p.given_up_us[kind, p.given_up[kind] % _REMEMBERED] = t_us
                p.given_up[kind] += 1
                p.dropped[UNPAIRED] += 1
            else:
                waiting[kind, kept] = waiting[kind, k]
                kept += 1
        p.waiting[kind] = kept


@outlined
def _pair(
    p: Any,
    waiting: Any,
    torque_us: int,
    torque: float,
    torque_sample_us: int,
    motion_us: int,
    motion: float,
    motion_sample_us: int,
    sample: Any,
) -> bool:
    p.floor_us = max(torque_us, motion_us)
    _give_up(p, waiting, float(p.floor_us))
    time_us = motion_sample_us
    if time_us == NO_TIME:
        time_us = motion_us if torque_sample_us == NO_TIME else torque_sample_us
    if not _follows(p, time_us):
        p.dropped[OUT_OF_ORDER] += 2
        return False
    p.last_us = time_us
    sample.t_us, sample.torque, sample.motion = time_us, torque, motion
    return True


@outlined
def _follows(p: Any, time_us: int) -> Any:
    """Whether a sample with this time comes after the last one; counts the missing samples in between."""
    if p.last_us == NO_TIME:
        return True
    if time_us < p.last_us - p.gap_us:  # the sample counter was re-anchored
        p.clock_set_back += 1
        return True
    missing = np.int64(np.rint((time_us - p.last_us) / p.interval_us)) - 1
    if missing > 0:
        p.dropped[MISSING] += missing
    return time_us > p.last_us
