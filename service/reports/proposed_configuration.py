"""The configuration that ``axiswatch init`` proposes for a table or a bus, with comments on what to check."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from monitor_core.drive import TEMPERATURE
from monitor_core.wording import listed
from service.config.schema import BusConfig
from service.config.schema.canopen_axis import CURRENT, VELOCITY
from service.config.unit_names import UNITS, unit_in
from service.ingest.roles.column_roles import TableRoles
from service.ingest.roles.drive_objects import DriveObjects
from service.ingest.roles.signal_roles import AxisRoles, FurtherSignal, FurtherSignals, SignalRole
from service.ingest.roles.unknown_messages import UnknownMessage
from service.reports.formats import toml_value

_MODEL = 'model = { drive = "one-mass", monitor = ["kT", "fc", "fm"], nominal = { kT = 1 } }'
"""Model of every proposed axis: the motion in production seldom determines springs."""
_INTERVAL_S = 0.005
_BUS = "can0"
_RATED_CURRENT = ("rated_current_A", "0x6075 (mA)", "0x6078")
_RATED_TORQUE = ("rated_torque_Nm", "0x6076 (mN m)", "0x6077")
"""Key, and the objects that hold the rated value and the measured one, of drives that send currents, and torques"""


def table_lines(found: TableRoles, record: str) -> Iterator[str]:
    """The configuration file for a table."""
    yield f"# Proposed by `axiswatch init` from {record}."
    yield "# Check units and signs: torque in N m, motion in rad or rad/s, both of the motor."
    yield "# factor converts: 0.0174533 from degrees, -1 turns the sign."
    unit = "" if found.unit_s == 1 else f", factor = {found.unit_s:g}"
    time = [] if found.time is None else [f"time = {{ column = {toml_value(found.time)}{unit} }}"]
    switches = {_signal_name(column): f"column = {toml_value(column)}" for column in found.switches}
    axes = dict[str, list[str]]()
    for axis in found.axes:
        load = found.loads.get(axis.name, found.loads.get(""))
        measured = {} if load is None else {"payload": f"column = {toml_value(load)}"}
        warm = [f"column = {toml_value(found.temperatures[axis.name])}"] if axis.name in found.temperatures else []
        axes[axis.name] = [*_axis_lines(axis, time), *_signal_lines({**measured, **switches}, warm)]
    yield from _robot_lines(axes)


_CARRIES = "may tell what the robot carries: `commission` lets the torque follow it, or leaves out what presses"
_WARM = "`commission` lets friction follow it, if the records show that it does"


def _signal_lines(loads: Mapping[str, str], temperature: Sequence[str] = ()) -> Iterator[str]:
    """The key for further signals: those that may tell what the robot carries, by their names, and the temperature.

    ``loads``, ``temperature``: where they are; of temperatures there is one or none.
    """
    signals = [(f"{{ name = {toml_value(TEMPERATURE)}, {source} }}", _WARM) for source in temperature]
    signals += [(f"{{ name = {toml_value(name)}, {source} }}", _CARRIES) for name, source in loads.items()]
    if len(signals) == 1:
        text, why = signals[0]
        yield f"signal = [{text}]  # {why}"
    elif signals and not temperature:
        yield "\n".join([f"signal = [  # each {_CARRIES}", *(f"  {text}," for text, _ in signals), "]"])
    elif signals:
        yield "\n".join(["signal = [", *(f"  {text},  # {why}" for text, why in signals), "]"])


_ANY_WAIT_S = 3600
"""Longest wait between two values of a signal that is not sent regularly"""
_NONE = FurtherSignals()


def _bus_source(signal: FurtherSignal) -> str:
    source = f"message = {toml_value(signal.message)}, signal = {toml_value(signal.signal)}"
    return source if signal.cyclic else f"{source}, max_age_s = {_ANY_WAIT_S}"


def _signal_name(column: str) -> str:
    """The name of a column in the letters that the name of a signal may have."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", column).strip("-")
    return name if any(c.isalpha() for c in name) else f"signal{name}"


def bus_lines(
    axes: Sequence[AxisRoles],
    messages: Path,
    output: Path,
    bus: BusConfig | None = None,
    channel: str = _BUS,
    further: FurtherSignals = _NONE,
) -> Iterator[str]:
    """The file ``output`` for the axes of a bus that ``messages`` describes.

    ``bus``: the bus that was listened to; None: ``channel`` is its name in a log.  ``further``: signals
    beside torque and motion.
    """
    yield f"# Proposed by `axiswatch init` from {messages.name}."
    yield "# Check signals, units and signs: torque in N m, motion in rad or rad/s, both of the motor."
    yield "# factor converts the unit on the bus, -1 turns the sign; of the angle of an arm it is the gear ratio."
    yield from _bus_lines(bus, channel)
    yield f"messages = {toml_value(os.path.relpath(messages.resolve(), output.resolve().parent))}"
    yield ""
    signals = [load.signal for load in further.loads]
    names = (load.signal if signals.count(load.signal) == 1 else load.name for load in further.loads)
    carried = {_signal_name(name): _bus_source(load) for name, load in zip(names, further.loads, strict=True)}
    warm = {name: [_bus_source(signal)] for name, signal in further.temperatures.items()}
    yield from _robot_lines(
        {
            axis.name: [*_axis_lines(axis, _time_lines(axis)), *_signal_lines(carried, warm.get(axis.name, []))]
            for axis in axes
        }
    )


def drive_lines(drives: Mapping[int, DriveObjects], eds: Path, output: Path, bus: BusConfig | None) -> Iterator[str]:
    """The file ``output`` for CANopen drives with these node ids, which share an EDS; ``bus``: the bus, if known."""
    yield f"# Proposed by `axiswatch init` from {eds.name}."
    yield "# Fill in what the data sheets say: remove # and put your values; `axiswatch check` names what is missing."
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
    """The [[bus]] table without the description of its messages; None: only its name in a log is known."""
    yield "[[bus]]"
    if bus is None:
        channel = f"can{channel}" if channel.isdigit() else channel  # as logs with channel numbers are read
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
    axes: Sequence[AxisRoles], messages: Sequence[UnknownMessage], name: str, bus: BusConfig | None
) -> Iterator[str]:
    """The file for the axes of an undescribed bus, with the fields of the messages that carry their signals.

    ``name``: name of the bus in a log; ``bus``: the bus that was listened to.
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
    yield from _robot_lines({axis.name: [*_axis_lines(axis, _time_lines(axis))] for axis in axes})


def _robot_lines(axes: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """A robot with axes, given as lines; keys that all axes share are written once."""
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


# --- An axis ----------------------------------------------------------------------------------------------------------


def _axis_lines(axis: AxisRoles, time: Iterable[str]) -> Iterator[str]:
    """The keys of an axis; ``time``: keys of its sample times."""
    if axis.interval_s is None:
        yield f"sample_interval_s = {_INTERVAL_S:g}  # not known: correct it; `commission` measures it where it can"
    else:
        origin = "as measured" if axis.measured else "cycle time of the message"
        yield f"sample_interval_s = {axis.interval_s:.4g}  # {origin}"
    yield from time
    yield _MODEL
    yield f"torque = {_source(axis, axis.torque)}"
    fastest = _fastest(axis)
    side = "" if fastest is None else _side(fastest)
    yield f"{axis.motion.quantity} = {_source(axis, axis.motion)}{side}"


_ARM, _MOTOR = 20.0, 100.0
"""Speeds [rad/s]: arms are slower than the first one and most motors faster; no arm comes near the second one."""


_RATIO = "; if it turns an arm, add r to nominal, the angle of the arm over that of the motor"


def _fastest(axis: AxisRoles) -> float | None:
    """Largest speed [rad/s] of an axis, as its signal has it; None: not known."""
    factor = axis.motion.factor
    return None if factor is None or axis.fastest is None else factor * axis.fastest


def gears_wanted(axes: Sequence[AxisRoles]) -> Iterator[str]:
    """A request for the gear ratios of a robot whose angles are those of its motors.

    Of one that is slow for a motor the others tell what it is: a controller sends all angles alike.
    """
    speeds = {axis.name: _fastest(axis) or 0.0 for axis in axes}
    motors = [name for name, speed in speeds.items() if speed > _ARM]
    if len(axes) > 1 and any(speed > _MOTOR for speed in speeds.values()):
        yield (
            f"{listed(motors)}: likely the angles of motors. If they turn the arms of a robot, add r, the angle of the"
            " arm over that of the motor (0.01 for a gear of 100:1), to nominal of each axis: the torque can then"
            " follow the pose, and smaller changes are found"
        )


def degrees_asked(axes: Sequence[AxisRoles]) -> Iterator[str]:
    """A question about angles without a unit that are faster than those of arms in rad: they may be in degrees."""
    unknown = [axis for axis in axes if axis.motion.quantity == "angle" and not axis.motion.unit]
    fast = [axis for axis in unknown if (axis.fastest or 0.0) > _ARM]
    if len(axes) > 1 and fast:
        yield (
            f"angles without a unit ({listed([axis.name for axis in unknown])}) are taken as rad; if they are in"
            " degrees, add factor = 0.0174533 to each: otherwise the torque cannot follow the pose"
        )


def _side(fastest: float) -> str:
    """Side of the gear on which this largest speed [rad/s] occurs; empty: it can be either side."""
    if fastest > _MOTOR:
        return f"; likely of the motor, as it reaches {fastest:.3g} rad/s{_RATIO}"
    arm = f"; likely of the arm, as it reaches {fastest:.3g} rad/s only"
    words = f"{arm}: for that of the motor multiply factor by the gear ratio, and add r, its inverse, to nominal"
    return words if 0 < fastest < _ARM else ""


def _time_lines(axis: AxisRoles) -> Iterator[str]:
    """The source of the times on a bus."""
    if axis.counter is not None:
        message, signal = axis.counter
        # The times of a counter are whole intervals, so that nothing would show a wrong interval.
        remark, off = "a sample counter, by its name", ""
        if axis.interval_s is None:
            remark, off = f"{remark}: use it once sample_interval_s is right", "#"
        beside = "" if message == axis.motion.message else f"counter_message = {toml_value(message)}, "
        yield f"{off}time = {{ {beside}counter_signal = {toml_value(signal)} }}  # {remark}"
    elif axis.bunched:
        yield 'time = { clock = "cyclic" }  # frames are received in bunches: the clock of the controller is fitted'


def _source(axis: AxisRoles, role: SignalRole) -> str:
    keys = [f"column = {toml_value(role.signal)}"]
    if role.message:
        keys = [f"message = {toml_value(role.message)}", f"signal = {toml_value(role.signal)}"]
    factor = (1.0 if role.factor is None else role.factor) * (-1.0 if role.turned else 1.0)
    if factor != 1:
        keys.append(f"factor = {factor:.10g}")
    if role.wrap_period is not None:
        keys.append(f"wrap_period = {role.wrap_period:.10g}")
    confidence = role.confidence if axis.explained is None else axis.confidence
    turned = "; the sign is turned, since the motion goes against it" if role.turned else ""
    return f"{{ {', '.join(keys)} }}  # {confidence}: {_unit_words(role, axis.by_place)}{turned}"


def _unit_words(role: SignalRole, by_place: bool) -> str:
    if role.current:
        return "a current: add kT_Nm_per_A, the torque constant"
    unit = unit_in(role.unit, role.quantity) or (None if role.message else unit_in(role.signal, role.quantity))
    if unit is None and role.factor is not None:
        return "by its values, which start again after a turn"
    if unit is None and role.confidence == "guess":
        return f"{'' if by_place else 'by its values; '}factor makes it {UNITS[role.quantity]}"
    if unit is None:
        return f"by its name; it has no unit, so {UNITS[role.quantity]} is assumed"
    if unit.factor is not None:
        return f"in {unit.words}"
    return f"in {unit.words}; factor is {unit.missing}"
