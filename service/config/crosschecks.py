"""Rules between the configuration and the DBC files it names."""

from collections.abc import Iterator
from typing import NamedTuple

from service.can.dbc import DbcError, find_counter, find_message, find_signal, read_dbc
from service.config.base_table import present
from service.config.positions import Keys
from service.config.schema import AxisConfig, Config
from service.config.validation_messages import Finding


class _Wanted(NamedTuple):
    """A signal that an axis asks for: the paths and values of its two names."""

    bus: str
    message_path: Keys
    message: str
    signal_path: Keys
    signal: str


def dbc_files(config: Config) -> Iterator[Finding]:
    """The DBC of each bus can be read."""
    for i, bus in enumerate(config.bus):
        try:
            read_dbc(bus.dbc) if present(bus, "dbc") else None
        except DbcError as error:
            yield Finding(("bus", i, "dbc"), str(error))


def dbc_names(config: Config) -> Iterator[Finding]:
    """Each message and each signal is in the DBC of the axis's bus."""
    files = {bus.name: bus.dbc for bus in config.bus if present(bus, "name", "dbc")}
    for wanted in (*_wanted(config), *_further(config)):
        try:
            database = read_dbc(files[wanted.bus])
        except (KeyError, DbcError):  # reported with the bus
            continue
        try:
            message = find_message(database, wanted.message)
        except DbcError as error:
            yield Finding(wanted.message_path, str(error))
            continue
        try:
            find = find_counter if wanted.signal_path[-1] == "counter_signal" else find_signal
            find(message, wanted.signal)
        except DbcError as error:
            yield Finding(wanted.signal_path, str(error))


def one_axis_for_each_signal(config: Config) -> Iterator[Finding]:
    """No signal is the torque or the motion of two axes, nor both of one."""
    first: dict[tuple[str, str, str], Keys] = {}
    for wanted in _wanted(config):
        if wanted.signal_path[-1] == "signal":  # many axes may share a counter
            name = (wanted.bus, wanted.message, wanted.signal)
            taken = first.setdefault(name, wanted.signal_path)
            if taken != wanted.signal_path:
                yield Finding(
                    wanted.signal_path, f"{wanted.message}.{wanted.signal} is already used by", taken
                )


def counters_beside_values(config: Config) -> Iterator[Finding]:
    """A sample counter is in the message of the torque or of the motion, where these are right."""
    wrong = {finding.path for finding in dbc_names(config)}
    for wanted in _by_axis(config):
        values = [w for w in wanted if w.signal_path[-1] == "signal"]
        counter = next((w for w in wanted if w not in values), None)
        if counter is None or len(values) < 2 or wrong & {w.message_path for w in wanted}:
            continue
        messages = dict.fromkeys(value.message for value in values)
        if counter.message not in messages:
            names = " or ".join(f'"{message}"' for message in messages)
            yield Finding(
                counter.message_path, f"the counter must come with the torque or the motion: {names}"
            )


DBC_RULES = (dbc_files, dbc_names, one_axis_for_each_signal, counters_beside_values)


def _wanted(config: Config) -> Iterator[_Wanted]:
    for wanted in _by_axis(config):
        yield from wanted


def _further(config: Config) -> Iterator[_Wanted]:
    """The further signals of all axes; several axes may share one."""
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis if present(robot, "axis") else ()):
            for n, further in enumerate(axis.signal if present(axis, "bus", "signal") else ()):
                message = further.message if present(further, "message") else None
                signal = further.signal if present(further, "signal") else None
                if message is not None and signal is not None:
                    where: Keys = ("robot", i, "axis", k, "signal", n)
                    yield _Wanted(axis.bus, (*where, "message"), message, (*where, "signal"), signal)


def _by_axis(config: Config) -> Iterator[list[_Wanted]]:
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis if present(robot, "axis") else ()):
            if present(axis, "bus"):
                yield list(_of_axis(axis, ("robot", i, "axis", k)))


def _of_axis(axis: AxisConfig, path: Keys) -> Iterator[_Wanted]:
    for quantity in ("torque", "angle", "speed"):
        signal = getattr(axis, quantity) if present(axis, quantity) else None
        if signal is not None and present(signal, "message", "signal") and signal.message and signal.signal:
            where = (*path, quantity)
            yield _Wanted(axis.bus, (*where, "message"), signal.message, (*where, "signal"), signal.signal)
    if not present(axis, "time") or not present(axis.time, "counter_message", "counter_signal"):
        return
    message, signal = axis.time.counter_message, axis.time.counter_signal
    if message is not None and signal is not None:
        where = (*path, "time")
        yield _Wanted(axis.bus, (*where, "counter_message"), message, (*where, "counter_signal"), signal)
