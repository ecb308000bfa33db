"""Cross-checks of names, buses, DBC files and the web: references exist, nothing is used twice, pairs are complete."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from monitor_core.wording import did_you_mean
from service.can.bus import interface_names
from service.can.dbc import DbcError, find_counter, find_message, find_signal, read_dbc
from service.config.base_table import Table
from service.config.problems import Finding, Keys
from service.config.schema import (
    AxisConfig,
    BusConfig,
    Config,
    FurtherConfig,
    RobotConfig,
    SignalConfig,
    WebConfig,
)

QUANTITIES = ("torque", "angle", "speed")
_NO_BUS = "there is no [[bus]] in this file: add it, or remove this where only tables are to be identified"


def names(config: Config) -> Iterator[Finding]:
    """No two buses, no two robots and no two axes of a robot have one name."""
    yield from same_names("bus", config.bus)
    yield from same_names("robot", config.robot)
    for i, robot in enumerate(config.robot):
        yield from (finding.inside(("robot", i)) for finding in same_names("axis", robot.axis))


def same_names(
    key: str, tables: Sequence[BusConfig | RobotConfig | AxisConfig | FurtherConfig]
) -> Iterator[Finding]:
    """No two tables of an array have one name."""
    first: dict[str, int] = {}
    for i, table in enumerate(tables):
        if first.setdefault(table.name, i) != i:
            yield Finding((key, i, "name"), "must differ from the name of", (key, first[table.name]))


def bus_references(config: Config) -> Iterator[Finding]:
    """Every axis names a bus of the file, if there is any."""
    known = [bus.name for bus in config.bus]
    for path, axis in _axes(config):
        if axis.bus and axis.bus not in known:
            hint = did_you_mean(axis.bus, known) if known else _NO_BUS
            yield Finding((*path, "bus"), f"no such bus: {hint}")
        elif known and not axis.bus:
            yield Finding((*path, "bus"), _missing(AxisConfig, "bus"))


def sources(config: Config) -> Iterator[Finding]:
    """Torque and motion are in a message of the bus; without any bus, in a column."""
    for path, axis in _axes(config):
        for quantity in QUANTITIES:
            source = getattr(axis, quantity)
            if source is None:
                continue
            where = (*path, quantity)
            for key in ("message", "signal"):
                if config.bus and not getattr(source, key):
                    yield Finding((*where, key), _missing(SignalConfig, key))
                elif not config.bus and getattr(source, key):
                    yield Finding((*where, key), f"is on a bus, but {_NO_BUS}")
            if not config.bus and source.column is None:
                message = f"{_missing(SignalConfig, 'column')}: without a [[bus]] it is read from there"
                yield Finding((*where, "column"), message)


def _missing(table: type[Table], key: str) -> str:
    """The finding of a key that is required here."""
    return f"missing ({table.meaning(key)})"


def _axes(config: Config) -> Iterator[tuple[Keys, AxisConfig]]:
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis):
            yield ("robot", i, "axis", k), axis


def usable_bus(bus: BusConfig) -> Iterator[Finding]:
    """Python-can has the interface, options do not repeat keys of the bus, and the DBC can be read."""
    if bus.interface not in interface_names():
        hint = did_you_mean(bus.interface, interface_names())
        yield Finding(("interface",), f"python-can has no such interface: {hint}")
    for key in ("interface", "channel"):
        if key in bus.options:
            yield Finding(("options", key), f"belongs into [[bus]] itself: {key} = ...")
    try:
        read_dbc(bus.dbc)
    except DbcError as error:
        yield Finding(("dbc",), str(error))


# --- The signals that axes use ----------------------------------------------------------------------------------------


class _Use(NamedTuple):
    """A signal that an axis uses, and the table where it is named."""

    axis: AxisConfig
    table: Keys
    message: str
    signal: str
    counter: bool = False

    @property
    def message_path(self) -> Keys:
        return (*self.table, "counter_message" if self.counter else "message")

    @property
    def signal_path(self) -> Keys:
        return (*self.table, "counter_signal" if self.counter else "signal")


def _values(config: Config) -> Iterator[_Use]:
    for path, axis in _axes(config):
        for quantity in QUANTITIES:
            s = getattr(axis, quantity)
            if s is not None and s.message and s.signal:
                yield _Use(axis, (*path, quantity), s.message, s.signal)


def _counters(config: Config) -> Iterator[_Use]:
    """The sample counters of all axes; axes may share them."""
    for path, axis in _axes(config):
        message, signal = axis.time.counter_message, axis.time.counter_signal
        if message is not None and signal is not None:
            yield _Use(axis, (*path, "time"), message, signal, counter=True)


def _further(config: Config) -> Iterator[_Use]:
    """The auxiliary signals of all axes; axes may share them."""
    for path, axis in _axes(config):
        for n, s in enumerate(axis.signal):
            if s.message is not None and s.signal is not None:
                yield _Use(axis, (*path, "signal", n), s.message, s.signal)


def dbc_names(config: Config) -> Iterator[Finding]:
    """Each message and each signal is in the DBC of the axis's bus."""
    files = {bus.name: bus.dbc for bus in config.bus}
    for use in (*_values(config), *_counters(config), *_further(config)):
        try:
            database = read_dbc(files[use.axis.bus])
        except (KeyError, DbcError):  # reported with the bus
            continue
        path = use.message_path
        try:
            message = find_message(database, use.message)
            path = use.signal_path
            (find_counter if use.counter else find_signal)(message, use.signal)
        except DbcError as error:
            yield Finding(path, str(error))


def one_axis_for_each_signal(config: Config) -> Iterator[Finding]:
    """No signal is the torque or the motion of two axes, or both of one."""
    first: dict[tuple[str, str, str], Keys] = {}
    for use in _values(config):
        taken = first.setdefault((use.axis.bus, use.message, use.signal), use.signal_path)
        if taken != use.signal_path:
            yield Finding(use.signal_path, f"{use.message}.{use.signal} is already used by", taken)


def counters_beside_values(config: Config) -> Iterator[Finding]:
    """A sample counter is in the message of the torque or of the motion."""
    wrong = {finding.path for finding in dbc_names(config)}
    for counter in _counters(config):
        values = [use for use in _values(config) if use.axis is counter.axis]
        if len(values) < 2 or wrong & {use.message_path for use in (*values, counter)}:
            continue
        messages = dict.fromkeys(value.message for value in values)
        if counter.message not in messages:
            either = " or ".join(f'"{message}"' for message in messages)
            yield Finding(
                counter.message_path, f"the counter must come with the torque or the motion: {either}"
            )


def certificate_and_key(config: Config) -> Iterator[Finding]:
    """Neither comes alone.  Whether they fit is seen at the start: not everyone who reads this may read the key."""
    for given, lacking in (("certificate", "key"), ("key", "certificate")):
        if getattr(config.web, given) is not None and getattr(config.web, lacking) is None:
            yield Finding(("web", lacking), f"{_missing(WebConfig, lacking)}: {given} is given")


CONFIG_RULES = (
    certificate_and_key,
    names,
    bus_references,
    sources,
    dbc_names,
    one_axis_for_each_signal,
    counters_beside_values,
)
BUS_RULES = (usable_bus,)
