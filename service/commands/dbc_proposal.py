"""The configuration that ``axiswatch init`` proposes for the bus of a DBC, with what is to be checked in it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from service.config.schema import BusConfig
from service.ingest.dbc_roles import DbcAxis, SignalRole

_INTERVAL_S = 0.005
_BUS = "can0"


def lines(
    axes: Sequence[DbcAxis], dbc: Path, output: Path, model: str, bus: BusConfig | None = None
) -> Iterator[str]:
    """Of the file ``output``.

    Args:
        axes: in their order.
        dbc: of their bus.
        output: the file.
        model: the line of each axis that names its drive.
        bus: that was listened to; None: none was.
    """
    name = _BUS if bus is None else bus.name
    yield f"# Proposed by `axiswatch init` from {dbc.name}."
    yield "# Check signals, units and signs: torque in N m, motion in rad or rad/s, both of the motor."
    yield "# factor converts the unit of the DBC, -1 turns the sign; of the angle of an arm it is the gear ratio."
    yield "[[bus]]"
    yield f"name = {_quoted(name)}"
    if bus is None:
        yield f'channel = "{_BUS}"  # of the interface; the name in a log'
    else:
        yield f"interface = {_quoted(bus.interface)}"
        yield f"channel = {_quoted(bus.channel)}"
        if bus.options:
            yield f"options = {{ {', '.join(f'{key} = {json.dumps(v)}' for key, v in bus.options.items())} }}"
    yield f"dbc = {_quoted(os.path.relpath(dbc.resolve(), output.resolve().parent))}"
    yield ""
    yield "[[robot]]"
    yield 'name = "robot1"'
    for axis in axes:
        yield from _axis_lines(axis, name)
        yield model


def _axis_lines(axis: DbcAxis, bus: str) -> Iterator[str]:
    yield ""
    yield "[[robot.axis]]"
    yield f"name = {_quoted(axis.name)}"
    yield f"bus = {_quoted(bus)}"
    if axis.interval_s is None:
        yield f"sample_interval_s = {_INTERVAL_S:g}  # not in the DBC: correct it; `commission` measures it"
    else:
        origin = "as measured" if axis.measured else "cycle time of the message"
        yield f"sample_interval_s = {axis.interval_s:g}  # {origin}"
    yield f"torque = {_source(axis.torque)}"
    yield f"{axis.motion.quantity} = {_source(axis.motion)}"
    if axis.bunched and axis.counter is None:
        yield 'time = { clock = "cyclic" }  # frames are received in bunches: the clock of the controller is fitted'
    if axis.counter is not None:
        message, signal = axis.counter
        # The times of a counter are whole intervals: nothing would show that the interval is wrong.
        remark, off = "a sample counter, by its name", ""
        if axis.interval_s is None:
            remark, off = f"{remark}: use it once sample_interval_s is right", "#"
        yield (
            f"{off}time = {{ counter_message = {_quoted(message)}, counter_signal = {_quoted(signal)} }}  # {remark}"
        )


def _source(role: SignalRole) -> str:
    keys = [f"message = {_quoted(role.message)}", f"signal = {_quoted(role.signal)}"]
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
        return "a current; factor is the torque constant [N m/A]"
    if not role.unit:
        return f"by its name; the DBC has no unit, so {'N m' if role.quantity == 'torque' else 'radians'} are assumed"
    if role.factor is None:
        what = (
            "rated torque / 1000 or / 100 [N m]"
            if role.quantity == "torque"
            else "2 pi / counts of a turn [rad]"
        )
        return f"in {role.unit}; factor is {what}"
    return f"in {role.unit}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
