"""The configuration that ``axiswatch init`` proposes, with what is to be checked in it: of a table, or of a bus."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from service.config.canopen_axis import CURRENT, VELOCITY
from service.config.schema import BusConfig
from service.config.unit_names import UNITS, Quantity, current_in, unit_in, unit_of
from service.ingest.column_roles import TableRoles
from service.ingest.drive_objects import DriveObjects
from service.ingest.roles_by_values import AxisRoles
from service.ingest.signal_roles import BusAxis, SignalRole
from service.ingest.unknown_messages import UnknownMessage
from service.reports.formats import toml_value

_MODEL = 'model = { drive = "one-mass", monitor = ["kT", "fc", "fm"], nominal = { kT = 1 } }'
"""The model of every proposed axis: the motion of production seldom determines springs."""
_INTERVAL_S = 0.005
_BUS = "can0"
_RATED_CURRENT = ("rated_current_A", "0x6075 (mA)", "0x6078")
_RATED_TORQUE = ("rated_torque_Nm", "0x6076 (mN m)", "0x6077")
"""Key, and the objects that hold the rated value and the measured one, of drives that send currents, and torques"""


def table_lines(found: TableRoles, record: str, interval_s: float | None) -> Iterator[str]:
    """The file for a table; ``interval_s``: between its rows, where the record shows it."""
    yield f"# Proposed by `axiswatch init` from {record}."
    yield "# Check units and signs: torque in N m, motion in rad or rad/s, both of the motor."
    yield "# factor converts: 0.0174533 from degrees, -1 turns the sign."
    yield from _robot_lines({axis.name: [*_column_lines(found, axis, interval_s)] for axis in found.axes})


def bus_lines(
    axes: Sequence[BusAxis], messages: Path, output: Path, bus: BusConfig | None = None
) -> Iterator[str]:
    """The file ``output`` for the axes of a bus that ``messages`` describes; ``bus``: if one was listened to."""
    yield f"# Proposed by `axiswatch init` from {messages.name}."
    yield "# Check signals, units and signs: torque in N m, motion in rad or rad/s, both of the motor."
    yield "# factor converts the unit on the bus, -1 turns the sign; of the angle of an arm it is the gear ratio."
    yield from _bus_lines(bus)
    yield f"messages = {toml_value(os.path.relpath(messages.resolve(), output.resolve().parent))}"
    yield ""
    yield from _robot_lines({axis.name: [*_message_lines(axis)] for axis in axes})


def drive_lines(
    drives: Mapping[int, DriveObjects], eds: Path, output: Path, bus: BusConfig | None = None
) -> Iterator[str]:
    """The file ``output`` for CANopen drives, by their node ids, that share an EDS; ``bus``: where it is known."""
    yield f"# Proposed by `axiswatch init` from {eds.name}."
    yield "# Fill in what the data sheets say: remove # and put your values; `axiswatch check` names what lacks."
    yield from _bus_lines(bus)
    yield ""
    yield "[[robot]]"
    yield 'name = "robot1"'
    yield ""
    yield "[robot.defaults]  # of all axes of this robot; an axis may have its own"
    first = next(iter(drives.values()))
    if first.interval_s is None:
        yield f"sample_interval_s = {_INTERVAL_S:g}  # time between two SYNCs: correct it; `listen` measures it"
    else:
        yield f"sample_interval_s = {first.interval_s:g}  # time between two SYNCs"
    yield _MODEL
    current = first.torque == CURRENT
    if current:
        yield "#torque = { kT_Nm_per_A = 0.1 }  # torque constant of the motor"
    yield ""
    yield "[robot.defaults.canopen]"
    yield f"eds = {toml_value(os.path.relpath(eds.resolve(), output.resolve().parent))}"
    known = "in this file; compare "
    key, rated, measured = _RATED_CURRENT if current else _RATED_TORQUE
    where = f"object {rated}, {known if first.rated else ''}data sheet of the motor"
    yield f"#{key} = {first.rated or 1.0:.10g}  # {where}: {measured} is in thousandths of it"
    if first.motion == VELOCITY:
        yield 'motion = "speed"'
        yield '#speed_unit = "rpm"  # of object 0x606C, or "counts/s": manual of the drive'
    else:
        counts = first.counts_per_turn
        where = f"object 0x608F, {known if counts else ''}data sheet of the encoder"
        yield f"#counts_per_turn = {counts or 4096:.10g}  # of the position: {where}"
    yield '#side = "arm"  # where the position is measured behind the gear; then also:'
    yield "#motor_turns = 100  # of the motor for one turn of the arm: data sheet of the gear"
    if first.others:
        yield ""
        yield f"# Also sent, as signals for conditions: {', '.join(first.others)}."
        yield f'# Of an axis: signal = [{{ name = "NAME", signal = {toml_value(first.others[-1].split()[0])} }}]'
    for place, node_id in enumerate(drives, 1):
        yield ""
        yield "[[robot.axis]]"
        yield f'name = "axis{place}"'
        yield f"canopen = {{ node_id = {node_id} }}"


def _bus_lines(bus: BusConfig | None, channel: str = _BUS) -> Iterator[str]:
    """The bus, without what describes its messages; None: only its name in a log is known."""
    yield "[[bus]]"
    if bus is None:
        name = channel if re.fullmatch(r"[\w-]+", channel, re.ASCII) else _BUS
        yield f"name = {toml_value(name)}"
        yield f"channel = {toml_value(channel)}  # of the interface; the name in a log"
        return
    yield f"name = {toml_value(bus.name)}"
    yield f"interface = {toml_value(bus.interface)}"
    yield f"channel = {toml_value(bus.channel)}"
    if bus.options:
        yield f"options = {{ {', '.join(f'{key} = {toml_value(v)}' for key, v in bus.options.items())} }}"


def unknown_bus_lines(
    axes: Sequence[BusAxis], messages: Sequence[UnknownMessage], name: str, bus: BusConfig | None = None
) -> Iterator[str]:
    """The file for the axes of a bus that nothing describes, with the numbers in the messages that carry them.

    ``name``: of the bus in a log; ``bus``: if one was listened to.
    """
    yield "# Proposed by `axiswatch discover`: what the numbers mean is a guess by their values."
    yield "# Put in the units: the factor of a torque makes it N m, that of a motion rad or rad/s, both of the motor."
    yield from _bus_lines(bus, name)
    for message in messages:
        yield ""
        yield "[[bus.message]]"
        yield f"name = {toml_value(message.name)}"
        yield f"id = 0x{message.key.can_id:x}"
        if message.key.extended:
            yield "extended = true"
        yield "signal = ["
        for bits in message.bits:
            order = "" if bits.byte_order == "little" else ', byte_order = "big"'
            place = f"start_bit = {bits.start_bit}, length = {bits.length}"
            yield f'  {{ name = {toml_value(bits.name)}, {place}, kind = "{bits.kind}"{order} }},'
        yield "]"
    yield ""
    yield from _robot_lines({axis.name: [*_message_lines(axis)] for axis in axes})


def _robot_lines(axes: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """A robot of axes, whose lines are given by their names: what all have in common stands once."""
    yield "[[robot]]"
    yield 'name = "robot1"'
    first, *others = axes.values()
    common = [line for line in first if others and all(line in lines for lines in others)]
    if common:
        yield ""
        yield "[robot.defaults]  # of all axes of this robot; an axis may have its own"
        yield from common
    for name, lines in axes.items():
        yield ""
        yield "[[robot.axis]]"
        yield f"name = {toml_value(name)}"
        yield from (line for line in lines if line not in common)


# --- An axis in a table -----------------------------------------------------------------------------------------------


def _column_lines(found: TableRoles, axis: AxisRoles, interval_s: float | None) -> Iterator[str]:
    if interval_s is None:
        yield "sample_interval_s = 0.001  # not known: correct it"
    else:
        yield f"sample_interval_s = {interval_s:.4g}"
    if found.time is not None:
        unit = "" if found.unit_s == 1 else f", factor = {found.unit_s:g}"
        yield f"time = {{ column = {toml_value(found.time)}{unit} }}"
    yield _MODEL
    torque, motion = (unit_of(name, found.units.get(name, "")) for name in (axis.torque, axis.motion))
    sign = -1.0 if axis.turned else 1.0
    if axis.current:
        factor, remark = current_in(torque) or 1.0, "a current: add kT_Nm_per_A, the torque constant"
    else:
        factor, remark = _factor(axis.torque, torque, "torque")
    remark = f"{axis.sureness}; {remark}" if remark else axis.sureness
    yield f"torque = {_column(axis.torque, sign * factor)}  # {remark}"
    factor, remark = _factor(axis.motion, motion, axis.output)
    if not remark and axis.fastest is not None and (factor != 1 or motion):
        remark = _side(factor * axis.fastest)
    source = _column(axis.motion, factor, axis.wrap_period)
    yield f"{axis.output} = {source}" + (f"  # {remark}" if remark else "")


_ARM, _MOTOR = 20.0, 100.0
"""Speeds [rad/s]: no arm is faster than this, and hardly a motor slower; no arm is nearly as fast as that."""


def _side(fastest: float) -> str:
    """On which side of the gear something turns that hardly ever is faster [rad/s]; empty: that does not tell."""
    if fastest > _MOTOR:
        return f"likely of the motor, as it reaches {fastest:.3g} rad/s"
    words = f"likely of the arm, as it reaches {fastest:.3g} rad/s only: multiply factor by the gear ratio"
    return words if 0 < fastest < _ARM else ""


def _factor(column: str, unit: str, quantity: Quantity) -> tuple[float, str]:
    """Of the unit of a column, or of the one in its name, and what is to be put in its place by hand."""
    known = unit_in(unit, quantity) or unit_in(column, quantity)
    if known is None or known.factor is None:
        by_hand = _LINEAR if known is not None and known.linear else _BY_HAND[quantity]
        return 1.0, "" if known is None else f"in {known.words}: {by_hand}"
    return known.factor, ""


_LINEAR = "add factor, 2 pi / mm that a turn of the motor moves it"
_BY_HAND: Mapping[Quantity, str] = {
    "torque": "add factor, N m of one",
    "angle": "add factor, radians of the motor for one",
    "speed": "add factor, rad/s of the motor for one",
}


def _column(column: str, factor: float, wrap_period: float | None = None) -> str:
    words = "" if factor == 1 else f", factor = {factor:.10g}"
    wraps = "" if wrap_period is None else f", wrap_period = {wrap_period:.10g}"
    return f"{{ column = {toml_value(column)}{words}{wraps} }}"


# --- An axis on a bus -------------------------------------------------------------------------------------------------


def _message_lines(axis: BusAxis) -> Iterator[str]:
    if axis.interval_s is None:
        yield f"sample_interval_s = {_INTERVAL_S:g}  # not described: correct it; `commission` measures it"
    else:
        origin = "as measured" if axis.measured else "cycle time of the message"
        yield f"sample_interval_s = {axis.interval_s:g}  # {origin}"
    yield from _time_lines(axis)
    yield _MODEL
    yield f"torque = {_source(axis.torque)}"
    yield f"{axis.motion.quantity} = {_source(axis.motion)}"


def _time_lines(axis: BusAxis) -> Iterator[str]:
    if axis.counter is not None:
        message, signal = axis.counter
        # The times of a counter are whole intervals: nothing would show that the interval is wrong.
        remark, off = "a sample counter, by its name", ""
        if axis.interval_s is None:
            remark, off = f"{remark}: use it once sample_interval_s is right", "#"
        beside = "" if message == axis.motion.message else f"counter_message = {toml_value(message)}, "
        yield f"{off}time = {{ {beside}counter_signal = {toml_value(signal)} }}  # {remark}"
    elif axis.bunched:
        yield 'time = { clock = "cyclic" }  # frames are received in bunches: the clock of the controller is fitted'


def _source(role: SignalRole) -> str:
    keys = [f"message = {toml_value(role.message)}", f"signal = {toml_value(role.signal)}"]
    factor = (1.0 if role.factor is None else role.factor) * (-1.0 if role.turned else 1.0)
    if factor != 1:
        keys.append(f"factor = {factor:.10g}")
    if role.wrap_period is not None:
        keys.append(f"wrap_period = {role.wrap_period:.10g}")
    remark = f"{role.sureness}: {_unit_words(role)}"
    if role.turned:
        remark += "; the sign is turned, since the motion goes against it"
    return f"{{ {', '.join(keys)} }}  # {remark}"


def _unit_words(role: SignalRole) -> str:
    if role.current:
        return "a current: add kT_Nm_per_A, the torque constant"
    if not role.unit and role.sureness == "guess":
        return f"by its values; factor is {UNITS[role.quantity]} for each count"
    if not role.unit:
        assumed = "N m" if role.quantity == "torque" else "radians"
        return f"by its name; it has no unit, so {assumed} are assumed"
    if role.factor is not None:
        return f"in {role.unit}"
    known = unit_in(role.unit, role.quantity)
    if known is not None and known.linear:
        return f"in {known.words}; factor is 2 pi / mm that a turn of the motor moves it"
    of_rated = {"per mille of the rated torque": "/ 1000", "percent of the rated torque": "/ 100"}
    part = of_rated.get("" if known is None else known.words, "/ 1000 or / 100")
    rated, counts = f"rated torque {part} [N m]", "2 pi / counts of a turn [rad]"
    return f"in {role.unit}; factor is {rated if role.quantity == 'torque' else counts}"
