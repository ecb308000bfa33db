"""Cross-checks of names, buses and DBC files: references exist, and no signal is used twice."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from monitor_core.wording import did_you_mean
from service.can.bus import interface_names
from service.can.dbc import DbcError, find_counter, find_message, find_signal, read_dbc
from service.config.base_table import Table
from service.config.positions import Keys
from service.config.schema import AxisConfig, BusConfig, Config, RobotConfig
from service.config.schema_signals import FurtherConfig, SignalConfig
from service.config.validation_messages import Finding

_NO_BUS = "there is no [[bus]] in this file: add it, or remove this where only tables are to be identified"


def bus_names(config: Config) -> Iterator[Finding]:
    """No two buses have one name."""
    return same_names("bus", config.bus)


def robot_names(config: Config) -> Iterator[Finding]:
    """No two robots have one name."""
    return same_names("robot", config.robot)


def axis_names(robot: RobotConfig) -> Iterator[Finding]:
    """No two axes of a robot have one name."""
    return same_names("axis", robot.axis)


def bus_references(config: Config) -> Iterator[Finding]:
    """Every axis names a bus of the file, if there is any."""
    known = [bus.name for bus in config.bus]
    for path, axis in _axes(config):
        if axis.bus in known:
            continue
        if config.bus:
            message = (
                f"no such bus: {did_you_mean(axis.bus, known)}" if axis.bus else _missing(AxisConfig, "bus")
            )
            yield Finding((*path, "bus"), message)
        elif axis.bus:
            yield Finding((*path, "bus"), f"no such bus: {_NO_BUS}")


def sources(config: Config) -> Iterator[Finding]:
    """Torque and motion are in a message of the bus; without any bus, in a column."""
    for path, axis in _axes(config):
        for quantity in ("torque", "angle", "speed"):
            source = getattr(axis, quantity)
            if source is not None:
                find = _on_bus if config.bus else _in_tables
                yield from (finding.inside((*path, quantity)) for finding in find(source))


def _on_bus(source: SignalConfig) -> Iterator[Finding]:
    for key in ("message", "signal"):
        if not getattr(source, key):
            yield Finding((key,), _missing(SignalConfig, key))


def _in_tables(source: SignalConfig) -> Iterator[Finding]:
    for key in ("message", "signal"):
        if getattr(source, key):
            yield Finding((key,), f"is on a bus, but {_NO_BUS}")
    if source.column is None:
        yield Finding(
            ("column",), f"{_missing(SignalConfig, 'column')}: without a [[bus]] it is read from there"
        )


def _missing(table: type[Table], key: str) -> str:
    """The finding of a key that is required here."""
    return f"missing ({table.model_fields[key].description})"


def _axes(config: Config) -> Iterator[tuple[Keys, AxisConfig]]:
    """All axes with their paths."""
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis):
            yield ("robot", i, "axis", k), axis


def same_names(
    key: str, tables: Sequence[BusConfig | RobotConfig | AxisConfig | FurtherConfig]
) -> Iterator[Finding]:
    """No two tables of an array have one name."""
    first: dict[str, int] = {}
    for i, table in enumerate(tables):
        if first.setdefault(table.name, i) != i:
            yield Finding((key, i, "name"), "must differ from the name of", (key, first[table.name]))


def interface(bus: BusConfig) -> Iterator[Finding]:
    """The interface is one that python-can has."""
    if bus.interface not in interface_names():
        hint = did_you_mean(bus.interface, interface_names())
        yield Finding(("interface",), f"python-can has no such interface: {hint}")


def bus_options(bus: BusConfig) -> Iterator[Finding]:
    """Options do not repeat keys of the bus."""
    for key in ("interface", "channel"):
        if key in bus.options:
            yield Finding(("options", key), f"belongs into [[bus]] itself: {key} = ...")


# --- DBC files ----------------------------------------------------------------------------------------


class _Wanted(NamedTuple):
    """A signal that an axis uses: the paths and values of its two names."""

    bus: str
    message_path: Keys
    message: str
    signal_path: Keys
    signal: str


def dbc_files(config: Config) -> Iterator[Finding]:
    """The DBC of each bus can be read."""
    for i, bus in enumerate(config.bus):
        try:
            read_dbc(bus.dbc)
        except DbcError as error:
            yield Finding(("bus", i, "dbc"), str(error))


def dbc_names(config: Config) -> Iterator[Finding]:
    """Each message and each signal is in the DBC of the axis's bus."""
    files = {bus.name: bus.dbc for bus in config.bus}
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
    """No signal is the torque or the motion of two axes, or both of one."""
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
    """A sample counter is in the message of the torque or of the motion."""
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


def _wanted(config: Config) -> Iterator[_Wanted]:
    for wanted in _by_axis(config):
        yield from wanted


def _further(config: Config) -> Iterator[_Wanted]:
    """The auxiliary signals of all axes; axes may share them."""
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis):
            for n, s in enumerate(axis.signal):
                if s.message is not None and s.signal is not None:
                    where: Keys = ("robot", i, "axis", k, "signal", n)
                    yield _Wanted(axis.bus, (*where, "message"), s.message, (*where, "signal"), s.signal)


def _by_axis(config: Config) -> Iterator[list[_Wanted]]:
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis):
            yield list(_of_axis(axis, ("robot", i, "axis", k)))


def _of_axis(axis: AxisConfig, path: Keys) -> Iterator[_Wanted]:
    for quantity in ("torque", "angle", "speed"):
        signal = getattr(axis, quantity)
        if signal is not None and signal.message and signal.signal:
            where = (*path, quantity)
            yield _Wanted(axis.bus, (*where, "message"), signal.message, (*where, "signal"), signal.signal)
    message, signal = axis.time.counter_message, axis.time.counter_signal
    if message is not None and signal is not None:
        where = (*path, "time")
        yield _Wanted(axis.bus, (*where, "counter_message"), message, (*where, "counter_signal"), signal)


FILE_RULES = (
    bus_names,
    robot_names,
    bus_references,
    sources,
    dbc_files,
    dbc_names,
    one_axis_for_each_signal,
    counters_beside_values,
)
BUS_RULES = (interface, bus_options)
