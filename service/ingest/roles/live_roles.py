"""Finds the torque and motion signals of each axis on a described bus, by names and by values.

Names and units are used as in ``signal_roles``; the values decide as for the columns of a table.
"""

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import wrap_of
from service.can.decoder import Decoder
from service.can.frames import FrameBlock, FrameKey
from service.can.inferred_layout import counts_frames
from service.can.messages import DescriptionError, Message, MessageSet, Signal
from service.config.unit_names import MeasuredQuantity
from service.ingest.roles.candidate_columns import Named
from service.ingest.roles.column_values import changes
from service.ingest.roles.roles_by_values import SignalPair, axes_by_values
from service.ingest.roles.signal_roles import (
    AxisRoles,
    SignalRole,
    axes_in,
    counts,
    may_be_measured,
    number_in,
    owners_of,
    role_in,
)
from service.ingest.roles_by_name import role_of
from service.ingest.samples.unwrap import continuous

_MIN_VALUES = 50
"""Fewest values of a signal that are compared."""
_SCATTER_S, _CATCH_UP_S = 0.1, 1.0
"""Largest jitter of the times of receipt [s], and the time within which late frames have caught up [s]"""
_MIN_BUNCHED_SHARE = 0.05
"""Frames are bunched if more than this share comes within half an interval after another frame"""
_ALIKE, _APART = 1.3, 5.0
"""Signals are compared if their intervals differ by less than the first factor; by the second if no axis is found"""
_MIN_BITS = 8  # a number of fewer bits is a state
_CYCLE_TOLERANCE = 0.02
"""A measured interval within this relative distance of the described cycle is taken as that cycle."""
_INTERVAL_ACCURACY = 0.003
"""Relative accuracy of an interval that is measured in some seconds."""
_TURN_FACTORS = {360.0: math.pi / 180, 1.0: 2 * math.pi}
"""SI factors of angles without a unit, by the period after which they wrap"""
_TURN_TOLERANCE = 1e-3


class SignalSeries(NamedTuple):
    """The values of a signal (N,), with their times (N,) [s]."""

    t: Floats
    values: Floats

    @property
    def interval_s(self) -> float:
        """Median of the mean intervals over a fifth of the series; late, lost or bunched frames affect it little."""
        span = max(1, self.t.size // 5)
        return float(np.median(self.t[span:] - self.t[:-span])) / span if self.t.size > 1 else 0.0

    @property
    def is_bunched(self) -> bool:
        """Whether many values come shortly after another one."""
        return int(np.count_nonzero(np.diff(self.t) < 0.5 * self.interval_s)) > _MIN_BUNCHED_SHARE * self.t.size

    @property
    def even_s(self) -> Floats:
        """Times (N,) without the jitter of receipt [s]: evenly spaced, unless values were lost."""
        even = np.asarray(self.t[0] + self.interval_s * np.arange(self.t.size), np.float64)
        # Late frames catch up soon; after a loss, all later frames lag behind the even times.
        starts = np.arange(0, self.t.size, max(1, round(_CATCH_UP_S / self.interval_s)))
        behind = np.minimum.reduceat(self.t - even, starts)
        return even if np.ptp(behind) < _SCATTER_S else self.t


class BusRoles(NamedTuple):
    """The axes and messages found on a bus."""

    axes: tuple[AxisRoles, ...]
    received: tuple[str, ...]
    """Names of described messages that were received"""
    missing: tuple[str, ...]
    """Described messages that were never received, with their identifiers"""
    undescribed: tuple[str, ...]
    """Identifiers of frames without a description"""


def roles_on_bus(known: MessageSet, frames: FrameBlock) -> BusRoles:
    """Find the axes on a bus with these messages, from all its frames in order of receipt."""
    frames = frames.in_order()
    decoder, messages = _decoder(known)
    keys = frames.counts()
    received = tuple(m.name for key, m in messages.items() if key in keys)
    missing = tuple(f"{m.name} (0x{key.can_id:x})" for key, m in messages.items() if key not in keys)
    undescribed = tuple(_undescribed(key, messages) for key in sorted(keys.keys() - messages.keys()))
    series = _series(decoder, frames)
    return BusRoles(tuple(_axes(known, messages.values(), series)), received, missing, undescribed)


def _undescribed(key: FrameKey, messages: Container[FrameKey]) -> str:
    bits = (29, 11) if key.extended else (11, 29)
    twin = FrameKey(key.can_id, not key.extended) in messages
    return f"0x{key.can_id:x}" + (f" (received with {bits[0]} bits, described with {bits[1]})" if twin else "")


def _decoder(known: MessageSet) -> tuple[Decoder, dict[FrameKey, Message]]:
    """A decoder of all messages that can be decoded, and these messages."""
    decoder, messages = Decoder(known), dict[FrameKey, Message]()
    for message in known.messages:
        try:
            for signal in message.signals:
                messages[decoder.want(message.name, signal.name)] = message
        except DescriptionError:
            continue  # the faulty message may not be needed; if it is, `check` reports the fault
    return decoder, messages


def _series(decoder: Decoder, frames: FrameBlock) -> dict[str, SignalSeries]:
    """The series of all received signals, by "Message.Signal"."""
    decoded = decoder.decode(frames)
    began_us = min((int(found.t_us[0]) for found in decoded.values()), default=0)
    series = dict[str, SignalSeries]()
    for key, found in decoded.items():
        t = np.asarray((found.t_us - began_us) * 1e-6, np.float64)
        for name, (values, there) in found.signals.items():
            if there.any():
                series[f"{decoder.messages[key].name}.{name}"] = SignalSeries(t[there], values[there])
    return series


# --- The axes: by values if they move, otherwise by names -------------------------------------------------------------


def _axes(known: MessageSet, messages: Iterable[Message], series: Mapping[str, SignalSeries]) -> Iterator[AxisRoles]:
    signals = {f"{m.name}.{s.name}": (m, s) for m in messages for s in m.signals}
    by_name = {name: role for name, (m, s) in signals.items() if (role := role_in(m, s)) is not None}
    owners = owners_of(by_name.values())
    candidates = {name: named for name, pair in signals.items() if (named := _named(*pair, by_name.get(name), owners))}
    taken, numbers = set[str](), set[str]()
    moving = {n: s for n, s in series.items() if n in candidates and changes(s.values)}
    pairs = [(group, pair) for group in _groups(moving, _ALIKE) for pair in _pairs(group, candidates, by_name)] or [
        (group, pair) for group in _groups(moving, _APART) for pair in _pairs(group, candidates, by_name)
    ]
    for group, pair in pairs:
        taken |= {pair.torque, pair.motion}
        numbers.add(pair.name)
        torque = by_name.get(pair.torque) or _guess(*signals[pair.torque], "torque")
        motion = by_name.get(pair.motion) or _guess(*signals[pair.motion], pair.output)
        motion = _with_wrap(motion, group[pair.motion])
        torque = torque._replace(turned=pair.turned)
        axis = AxisRoles(pair.name, torque, motion, explained=pair.explained, fastest=pair.fastest)
        yield _timed(axis, signals[pair.torque][0], series)
    for axis in axes_in(known.messages):
        own = {f"{role.message}.{role.signal}" for role in (axis.torque, axis.motion)}
        if own <= series.keys() and not own & taken and axis.name not in numbers:
            message = signals[f"{axis.torque.message}.{axis.torque.signal}"][0]
            yield _timed(axis._replace(measured=True), message, series)


def _named(
    message: Message, signal: Signal, role: SignalRole | None, owners: Mapping[tuple[str, str], str]
) -> Named | None:
    """What the name of a signal says; None: the signal is neither torque nor motion."""
    if role is not None:
        return Named("current" if role.current else role.quantity, owners[message.name, signal.name])
    number = number_in(message.name, signal.name)
    unnamed = may_be_measured(message, signal) and not (
        signal.unit or role_of(signal.name) or signal.length < _MIN_BITS
    )
    return Named("", number) if unnamed else None


def _groups(series: Mapping[str, SignalSeries], most: float) -> Iterator[dict[str, SignalSeries]]:
    """Groups of signals whose intervals differ by less than ``most``, resampled to the times of a slowest signal."""
    long = {name: s for name, s in series.items() if s.t.size >= _MIN_VALUES and s.interval_s > 0}
    while long:
        shortest_s = min(s.interval_s for s in long.values())
        group = {name: s for name, s in long.items() if s.interval_s < most * shortest_s}
        slow_s = max(s.interval_s for s in group.values()) / _ALIKE
        first = next(s for s in group.values() if s.interval_s > slow_s)
        yield {name: SignalSeries(first.even_s, _nearest(s, first.t)) for name, s in group.items()}
        long = {name: s for name, s in long.items() if name not in group}


def _nearest(series: SignalSeries, t: Floats) -> Floats:
    return series.values[np.searchsorted((series.t[1:] + series.t[:-1]) / 2, t)]


def _pairs(
    group: Mapping[str, SignalSeries], named: Mapping[str, Named], by_name: Mapping[str, SignalRole]
) -> list[SignalPair]:
    values, t = {}, next(iter(group.values())).t
    for name, series in group.items():
        role, period = by_name.get(name), None
        if role is None or role.quantity == "angle":
            period = (role and role.wrap_period) or wrap_of(series.values)
        values[name] = continuous(t, series.values, period)
    return axes_by_values(values, t, named)


def _with_wrap(role: SignalRole, series: SignalSeries) -> SignalRole:
    """The role of an angle with its wrap period as the values show it, and the unit that follows from the period."""
    if role.quantity != "angle" or role.wrap_period is not None:
        return role
    period = wrap_of(series.values)
    factor = role.factor
    if not role.unit and period is not None:
        near = (f for turn, f in _TURN_FACTORS.items() if math.isclose(period, turn, rel_tol=_TURN_TOLERANCE))
        factor = next(near, factor)
    return role._replace(wrap_period=period, factor=factor)


def _guess(message: Message, signal: Signal, quantity: MeasuredQuantity) -> SignalRole:
    """The role of a signal whose name says nothing."""
    return SignalRole(message.name, signal.name, quantity, signal.unit or "", None, False, "guess", None)


def _timed(axis: AxisRoles, message: Message, series: Mapping[str, SignalSeries]) -> AxisRoles:
    """The axis with its measured interval, and with the sample counter beside the torque, if that counts frames."""
    own = [series[f"{role.message}.{role.signal}"] for role in (axis.torque, axis.motion)]
    measured_s, counter = max(s.interval_s for s in own), None
    for signal in filter(counts, message.signals):
        counted_s = _counted_s(signal, series.get(f"{message.name}.{signal.name}"))
        if counted_s is not None:
            measured_s, counter = counted_s, (message.name, signal.name)
            break
    cycle_s = (message.cycle_time or 0) / 1000
    interval_s = cycle_s if abs(measured_s - cycle_s) < _CYCLE_TOLERANCE * cycle_s else _rounded(measured_s)
    bunched = any(s.is_bunched for s in own)
    apart = max(s.interval_s for s in own) > _ALIKE * min(s.interval_s for s in own)
    return axis._replace(interval_s=interval_s or None, measured=True, counter=counter, bunched=bunched, apart=apart)


def _rounded(interval_s: float) -> float:
    """A measured interval, rounded as far as its accuracy allows."""
    few = float(f"{interval_s:.2g}")
    return few if abs(few - interval_s) < _INTERVAL_ACCURACY * interval_s else float(f"{interval_s:.4g}")


def _counted_s(signal: Signal, series: SignalSeries | None) -> float | None:
    """Seconds per count of a sample counter; None: it does not count the frames, or was not received."""
    if series is None:
        return None
    if not counts_frames(series.values, 2.0**signal.length):
        return None
    steps = np.diff(series.values) % 2.0**signal.length
    return float((series.t[-1] - series.t[0]) / steps.sum())
