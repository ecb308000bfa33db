"""Finds the torque and motion signals of each axis on a bus by units and names, before any value is received.

A unit shows what a signal is; a name is less reliable.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Literal, NamedTuple

from service.can.messages import Message, Signal
from service.config.unit_names import MeasuredQuantity, current_in, unit_in
from service.ingest.roles.roles_by_values import LIKELY, SURE
from service.ingest.roles_by_name import (
    MEASURED,
    NO_MOTION,
    NOT_MEASURED,
    axis_name,
    distance_from_gear,
    is_gripper,
    is_load,
    is_temperature,
    own_word,
    owners,
    role_of,
    words_in,
)

Confidence = Literal["sure", "likely", "guess"]
_COUNTS = {"counter", "cnt", "seq", "sequence", "alive", "rolling"}
_TURNS = (360.0, 2 * math.pi, 1.0)
_NEARLY = 1e-3
_SLOW_MS = 5000
"""Values that come more seldom would count as too old between two of them."""
_MOST_STATE_BITS = 2
"""Longest signal that is a state, of a gripper say; a longer one is its force or position."""


class SignalRole(NamedTuple):
    """A signal of a bus or a column of a table, with the quantity that it is taken for."""

    message: str
    """Name of the message; empty for a column"""
    signal: str
    """Name of the signal, or of the column"""
    quantity: MeasuredQuantity
    unit: str
    factor: float | None
    """Factor to SI units; None: the unit does not tell"""
    current: bool
    """Whether it is a current, which the torque constant converts to a torque"""
    confidence: Confidence
    wrap_period: float | None
    turned: bool = False
    """Whether the values show that it has the wrong sign"""

    @property
    def name(self) -> str:
        """Name of the signal, with that of its message."""
        return f"{self.message}.{self.signal}" if self.message else self.signal


class AxisRoles(NamedTuple):
    """The signals of an axis."""

    name: str
    torque: SignalRole
    motion: SignalRole
    counter: tuple[str, str] | None = None
    """Message and signal of a sample counter beside the torque"""
    interval_s: float | None = None
    """Interval of the samples: cycle of the message with the torque, or as measured; None: not known"""
    measured: bool = False
    """Whether the interval is measured"""
    bunched: bool = False
    """Whether its frames are received in bunches"""
    apart: bool = False
    """Whether torque and motion come at different rates or times"""
    explained: float | None = None
    """Share of the torque that a rigid mass with this motion explains; None: no values were compared"""
    rivals: tuple[str, ...] = ()
    """Other columns that may equally be the torque or the motion, with their quantity"""
    fastest: float | None = None
    """Speed that the axis hardly ever exceeds, in the unit of the motion (per second for an angle); None: not known"""
    better: tuple[str, float] | None = None
    """The motion of another axis that explains far more of the torque, and the share; None: there is none"""
    exchanged: float | None = None
    """Share of the torque that a rigid mass explains if torque and motion change places; None: they need not"""

    @property
    def by_place(self) -> bool:
        """Whether the columns have no names, and values that do not show either that they belong together."""
        return self.torque.confidence == "guess" and self.explained is not None and self.explained < LIKELY

    @property
    def confidence(self) -> str:
        """How sure the roles are: by the values, if they were compared; otherwise as sure as the less sure signal."""
        if self.rivals:
            return f"likely; or {', '.join(self.rivals)}"
        if self.explained is not None:
            if self.explained >= LIKELY:
                return "sure" if self.explained >= SURE else "likely"
            return "by place in the table only" if self.by_place else "by name only"
        grades: tuple[Confidence, ...] = ("guess", "likely", "sure")
        return min((self.torque.confidence, self.motion.confidence), key=grades.index)


def axes_in(messages: Sequence[Message]) -> list[AxisRoles]:
    """The axes in these messages, in the order of their numbers, then those without a number."""
    found = ((m, s, role_in(m, s)) for m in messages for s in m.signals)
    roles = [role for _, _, role in found if role is not None]
    owners, by_axis = owners_of(roles), dict[str, list[SignalRole]]()
    for role in roles:
        by_axis.setdefault(owners[role.message, role.signal], []).append(role)
    by_name = {m.name: m for m in messages}
    # Sorted, as the pages of a multiplexed message come in any order.
    numbers = sorted(by_axis, key=lambda n: (not n.isdigit(), int(n) if n.isdigit() else 0))
    return [axis for n in numbers if (axis := _axis(n, by_axis[n], by_name)) is not None]


class FurtherSignal(NamedTuple):
    """A signal beside torque and motion: what a robot carries, or a temperature."""

    message: str
    signal: str
    cyclic: bool
    """Whether its message has a short cycle time; otherwise it is sent seldom, or only when something changes"""

    @property
    def name(self) -> str:
        """Name of the signal, with that of its message."""
        return f"{self.message}.{self.signal}"


class FurtherSignals(NamedTuple):
    """The signals beside torque and motion that an axis may depend on."""

    loads: Sequence[FurtherSignal] = ()
    """Those that may tell what the robot carries"""
    temperatures: Mapping[str, FurtherSignal] = MappingProxyType({})
    """By the name of the axis"""


def further_in(messages: Sequence[Message], axes: Sequence[AxisRoles]) -> FurtherSignals:
    """Loads by their names and units, states of grippers by their names and lengths, and the temperatures of axes."""
    found = [
        (FurtherSignal(m.name, s.name, 0 < (m.cycle_time or 0) <= _SLOW_MS), s)
        for m in messages
        for s in m.signals
        if not counts(s)
    ]
    loads = [
        further
        for further, s in found
        if is_load(s.name, s.unit or "") or (is_gripper(s.name) and s.length <= _MOST_STATE_BITS)
    ]
    warm = [
        (axis_name(number_in(further.message, further.signal)), further)
        for further, s in found
        if is_temperature(s.name, s.unit or "") and s.length > _MOST_STATE_BITS
    ]
    of_axes = {a.name: [signal for name, signal in warm if len(axes) == 1 or name == a.name] for a in axes}
    nearest = {
        axis: min(several, key=lambda signal: distance_from_gear(signal.name))
        for axis, several in of_axes.items()
        if several
    }
    return FurtherSignals(loads, nearest)


def owners_of(roles: Iterable[SignalRole]) -> dict[tuple[str, str], str]:
    """The axis of each signal, from its name and that of its message: its number, otherwise its word; empty: none."""
    by_key = {(role.message, role.signal): role for role in roles}
    return owners(
        {key: number_in(*key) for key in by_key},
        {(message, signal): own_word(signal) or own_word(message) for message, signal in by_key},
        {key: role.quantity for key, role in by_key.items()},
    )


def may_be_measured(message: Message, signal: Signal) -> bool:
    """Whether a signal may be a measured torque or motion: it is no counter, state, limit or command."""
    words = {*words_in(signal.name), *words_in(_known(message.name))}
    return not (
        counts(signal)
        or words & NOT_MEASURED
        or {*words_in(signal.name)} & NO_MOTION
        or "wanted" in (role_of(signal.name), role_of(message.name))
        or signal.choices
    )


def role_in(message: Message, signal: Signal) -> SignalRole | None:
    """The role of a signal by its unit and its name; None: it is no measurement of an axis."""
    if not may_be_measured(message, signal):
        return None
    text, named = signal.unit or "", role_of(signal.name) or role_of(message.name)
    reading = _by_unit(text) if text else _by_name(named)
    if reading is None:
        return None
    agrees = named == reading.quantity or (reading.current and named == "current")
    if not agrees and (reading.current or reading.linear):
        return None  # the current of something else; the linear motion of a tool, or a distance
    confidence: Confidence = "guess" if not agrees else "sure" if reading.known else "likely"
    return SignalRole(
        message.name, signal.name, reading.quantity, text, reading.factor, reading.current, confidence,
        _wrap(signal) if reading.quantity == "angle" else None,
    )  # fmt: skip


_QUANTITIES: tuple[MeasuredQuantity, ...] = ("torque", "speed", "angle")


class _Reading(NamedTuple):
    """What the unit of a signal shows, or its name if it has no unit."""

    quantity: MeasuredQuantity
    known: bool
    """Whether this is certain"""
    factor: float | None = None
    """Factor to SI units; None: not known"""
    current: bool = False
    linear: bool = False
    """Whether it is in a unit of length"""


def _by_unit(text: str) -> _Reading | None:
    if (amperes := current_in(text)) is not None:
        return _Reading("torque", True, amperes, current=True)
    units = ((quantity, unit_in(text, quantity)) for quantity in _QUANTITIES)
    return next((_Reading(q, True, unit.factor, linear=unit.linear) for q, unit in units if unit is not None), None)


def _by_name(named: str) -> _Reading | None:
    if named == "current":
        return _Reading("torque", True, current=True)
    return next((_Reading(quantity, False) for quantity in _QUANTITIES if quantity == named), None)


def _wrap(signal: Signal) -> float | None:
    """Wrap period of an angle whose range is one turn, in its own unit; None: the range is not one turn."""
    if signal.is_float:
        return None
    extent = 2.0**signal.length * abs(float(signal.scale))
    stated = float(signal.maximum or 0) - float(signal.minimum or 0)
    turns = (t for t in _TURNS for range_ in (extent, stated) if abs(range_ / t - 1) < _NEARLY)
    return next(turns, None)


def _known(message: str) -> str:
    """The name of a message; empty if it is only an identifier, given to an unknown message."""
    return "" if re.fullmatch(r"x[\da-f]+", message) else message


def number_in(message: str, signal: str) -> str:
    """The axis number in the names; empty: none.  The number of a PDO is not used, as every drive has the same PDOs."""
    for name in (re.sub(r"pdo_?\d+", "", text, flags=re.IGNORECASE) for text in (signal, _known(message))):
        found = re.findall(r"(?:axis|joint|motor|drive|achse|node|[aj])_?(\d+)", name, re.IGNORECASE)
        found = found or re.findall(r"\d+", name)
        if found:
            return str(found[0])
    return ""


def _axis(number: str, roles: Sequence[SignalRole], messages: dict[str, Message]) -> AxisRoles | None:
    torque = _best([role for role in roles if role.quantity == "torque"])
    motion = _best([r for r in roles if r.quantity == "angle"]) or _best([r for r in roles if r.quantity == "speed"])
    if torque is None or motion is None:
        return None
    message = messages[torque.message]
    counters = [s.name for s in message.signals if counts(s)]
    cycle = message.cycle_time
    return AxisRoles(
        axis_name(number),
        torque,
        motion,
        (message.name, counters[0]) if counters else None,
        cycle / 1000 if cycle else None,
    )


def counts(signal: Signal) -> bool:
    """Whether a signal is a sample counter, by its name."""
    return bool({*words_in(signal.name)} & _COUNTS) and not signal.is_float and signal.scale == 1


def _best(roles: Sequence[SignalRole]) -> SignalRole | None:
    """The surest role; then torque before current, then one that is called measured; the first of equals."""
    grades = {"guess": 0, "likely": 1, "sure": 2}

    def grade(role: SignalRole) -> tuple[int, int, bool]:
        return grades[role.confidence], -role.current, bool({*words_in(role.signal)} & MEASURED)

    return max(roles, key=grade, default=None)


def summary(axes: Sequence[AxisRoles]) -> Iterator[str]:
    """The found axes in words, a line for each."""
    for axis in axes:
        torque, motion = (
            role.name if role.unit in role.name else f"{role.name} [{role.unit}]" for role in (axis.torque, axis.motion)
        )
        words = f"{axis.name}: torque {torque}, {axis.motion.quantity} {motion}: {axis.confidence}"
        if axis.explained is not None:
            words += f" (as one mass, the motion explains {100 * axis.explained:.0f} % of the torque)"
        elif axis.measured:
            words += " by its name; it did not move"
        if axis.exchanged is not None:
            words += f"; {100 * axis.exchanged:.0f} % if they change places: are the two columns exchanged?"
        elif axis.better is not None:
            words += f"; {axis.better[0]} explains {100 * axis.better[1]:.0f} % of it: are two columns exchanged?"
        if axis.apart:
            words += "; torque and motion come at different rates or times, but a sample needs both: "
            words += "send them at one rate" if axis.torque.message else "export them with a common interval"
        yield words
