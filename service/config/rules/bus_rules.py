"""Cross-checks of names, buses and messages: references exist, nothing is used twice."""

from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import NamedTuple

from monitor_core.wording import did_you_mean, listed
from service.can.bus import blf_channels, interface_names
from service.can.canopen_drives import node_name, read_drive
from service.can.message_files import read_messages
from service.can.messages import DescriptionError, find_counter, find_signal
from service.config.bus_messages import bits_of, is_addressed, messages_of
from service.config.problems import CheckFinding
from service.config.schema import (
    FLOAT_BITS,
    LAST_STANDARD_ID,
    MAX_BYTES,
    AxisConfig,
    BitsConfig,
    BusConfig,
    Config,
    FurtherSignalConfig,
    MessageConfig,
    RobotConfig,
    SignalConfig,
)
from service.config.schema.base_table import TomlTable
from service.config.toml_lines import Keys

QUANTITIES = ("torque", "angle", "speed")
_NO_BUS = "there is no [[bus]] in this file: add it, or remove this where only tables are to be identified"


def names(config: Config) -> Iterator[CheckFinding]:
    """No two buses, robots, or axes of a robot have the same name."""
    yield from same_names("bus", config.bus)
    yield from same_names("robot", config.robot)
    for i, robot in enumerate(config.robot):
        yield from (finding.inside(("robot", i)) for finding in same_names("axis", robot.axis))


def same_names(
    key: str,
    tables: Sequence[BusConfig | MessageConfig | BitsConfig | RobotConfig | AxisConfig | FurtherSignalConfig],
) -> Iterator[CheckFinding]:
    """No two tables of an array have the same name."""
    first: dict[str, int] = {}
    for i, table in enumerate(tables):
        if first.setdefault(table.name, i) != i:
            yield CheckFinding((key, i, "name"), "must differ from the name of", (key, first[table.name]))


def channels(config: Config) -> Iterator[CheckFinding]:
    """No two buses have the same channel, as frames would count twice; options may distinguish channels."""
    first: dict[tuple[str, str, str], int] = {}
    for i, bus in enumerate(config.bus):
        options = "" if bus.interface == "socketcan" else repr(sorted(bus.options.items()))
        taken = first.setdefault((bus.interface, bus.channel, options), i)
        if taken != i:
            yield CheckFinding(("bus", i, "channel"), "is already used by", ("bus", taken, "channel"))


def recording_channels(config: Config) -> Iterator[CheckFinding]:
    """Recordings in a format with numbers instead of names can distinguish the buses."""
    if config.service.recording_format == "blf" and config.bus and blf_channels(config.bus) is None:
        found = listed([bus.channel for bus in config.bus])
        message = (
            "these files name each bus by the number at the end of its channel, and the channels are"
            f' {found}: use "log"'
        )
        yield CheckFinding(("service", "recording_format"), message)


def bus_references(config: Config) -> Iterator[CheckFinding]:
    """Every axis names a bus of the file, if the file has any."""
    known = [bus.name for bus in config.bus]
    for path, axis in _axes(config):
        if axis.bus and axis.bus not in known:
            hint = did_you_mean(axis.bus, known) if known else _NO_BUS
            yield CheckFinding((*path, "bus"), f"no such bus: {hint}")
        elif known and not axis.bus:
            yield CheckFinding((*path, "bus"), _missing(AxisConfig, "bus"))


def descriptions(config: Config) -> Iterator[CheckFinding]:
    """The messages of each bus are described, and the files of CANopen drives can be read."""
    drives = [(path, axis.bus, axis.canopen) for path, axis in _axes(config) if axis.canopen is not None]
    for i, bus in enumerate(config.bus):
        if bus.messages is None and not bus.message and bus.name not in [name for _, name, _ in drives]:
            message = f"{_missing(BusConfig, 'messages')}; or give [[bus.message]], or canopen of its axes"
            yield CheckFinding(("bus", i, "messages"), message)
    for path, _, drive in drives:
        try:
            read_drive(drive.eds, drive.node_id)
        except DescriptionError as error:
            yield CheckFinding((*path, "canopen", "eds"), str(error))


def sources(config: Config) -> Iterator[CheckFinding]:
    """Torque and motion are in a message of the bus, or, if there is no bus, in a column."""
    for path, axis in _axes(config):
        for quantity in QUANTITIES:
            source = getattr(axis, quantity)
            if source is None:
                continue
            where, given = (*path, quantity), [key for key in ("message", "signal") if getattr(source, key)]
            if config.bus:
                yield from (
                    CheckFinding((*where, key), _missing(SignalConfig, key))
                    for key in ("message", "signal")
                    if key not in given
                )
            elif given:  # message, signal and a missing column have one cause
                yield CheckFinding((*where, given[0]), f"is on a bus, but {_NO_BUS}")
            elif source.column is None:
                message = f"{_missing(SignalConfig, 'column')}: without a [[bus]] it is read from there"
                yield CheckFinding((*where, "column"), message)


def _missing(table: type[TomlTable], key: str) -> str:
    """The message for a missing key."""
    return f"missing ({table.meaning(key)})"


def _axes(config: Config) -> Iterator[tuple[Keys, AxisConfig]]:
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis):
            yield ("robot", i, "axis", k), axis


def usable_bus(bus: BusConfig) -> Iterator[CheckFinding]:
    """Python-can has the interface, options do not repeat keys of the bus, and the messages can be read."""
    if bus.interface not in interface_names():
        hint = did_you_mean(bus.interface, interface_names())
        yield CheckFinding(("interface",), f"python-can has no such interface: {hint}")
    for key in ("interface", "channel"):
        if key in bus.options:
            yield CheckFinding(("options", key), f"belongs in [[bus]] itself: {key} = ...")
    yield from _table_of_ids(bus)
    try:
        if bus.messages is not None:
            read_messages(bus.messages)
    except DescriptionError as error:
        yield CheckFinding(("messages",), str(error))


def _table_of_ids(bus: BusConfig) -> Iterator[CheckFinding]:
    """The messages that the configuration describes are possible."""
    yield from same_names("message", bus.message)
    for i, message in enumerate(bus.message):
        path: Keys = ("message", i)
        yield from (finding.inside(path) for finding in _identifier(message))
        yield from (finding.inside(path) for finding in same_names("signal", message.signal))
        for k, signal in enumerate(message.signal):
            yield from (finding.inside((*path, "signal", k)) for finding in _bits(signal))


def _identifier(message: MessageConfig) -> Iterator[CheckFinding]:
    """A message has either an identifier or a J1939 parameter group."""
    if (message.id is None) == (message.pgn is None):
        words = "missing" if message.id is None else "give it or pgn, not both"
        yield CheckFinding(("id",), f"{words} ({MessageConfig.meaning('id')})")
    if message.id is not None and message.id > LAST_STANDARD_ID and not message.is_extended:
        yield CheckFinding(("id",), "has more than 11 bits: extended = true, or leave extended out")
    if message.pgn is None and message.source_address is not None:
        yield CheckFinding(("source_address",), "belongs to pgn: an id has it in its lowest byte")
    if message.pgn is not None and not message.is_extended:
        yield CheckFinding(("extended",), "J1939 has identifiers of 29 bits: remove this")
    if message.pgn is not None and is_addressed(message.pgn) and message.pgn & 0xFF:
        yield CheckFinding(("pgn",), f"its lowest byte is the destination, and counts as 0: {message.pgn & ~0xFF:#x}")


def _bits(signal: BitsConfig) -> Iterator[CheckFinding]:
    if signal.kind == "float" and signal.length not in FLOAT_BITS:
        yield CheckFinding(("length",), f"a float has {listed([str(n) for n in FLOAT_BITS], 'or')} bits")
    if bits_of(signal).bytes_needed > MAX_BYTES:
        yield CheckFinding(("length",), f"the signal ends after {MAX_BYTES} bytes, but no frame is that long")


# --- The signals that axes use ----------------------------------------------------------------------------------------


class _Use(NamedTuple):
    """A signal that an axis uses, and the table that names it."""

    axis: AxisConfig
    table: Keys
    message: str
    signal: str
    counter: bool = False

    @property
    def drive_path(self) -> Keys | None:
        """The key that names the CANopen drive, if the signal follows from that; otherwise None."""
        drive = self.axis.canopen
        follows = drive is not None and self.message == node_name(drive.node_id)
        return (*self.table[:4], "canopen", "eds") if follows and self.table[4] in QUANTITIES else None

    @property
    def message_path(self) -> Keys:
        return self.drive_path or (*self.table, "counter_message" if self.counter else "message")

    @property
    def signal_path(self) -> Keys:
        return self.drive_path or (*self.table, "counter_signal" if self.counter else "signal")


def _values(config: Config) -> Iterator[_Use]:
    for path, axis in _axes(config):
        for quantity in QUANTITIES:
            s = getattr(axis, quantity)
            if s is not None and s.message and s.signal:
                yield _Use(axis, (*path, quantity), s.message, s.signal)


def _counters(config: Config) -> Iterator[_Use]:
    """The sample counters of all axes; axes may share a counter."""
    for path, axis in _axes(config):
        message, signal = axis.time.counter_message, axis.time.counter_signal
        if message is not None and signal is not None:
            yield _Use(axis, (*path, "time"), message, signal, counter=True)


def _further(config: Config) -> Iterator[_Use]:
    """The auxiliary signals of all axes; axes may share a signal."""
    for path, axis in _axes(config):
        for n, s in enumerate(axis.signal):
            if s.message is not None and s.signal is not None:
                yield _Use(axis, (*path, "signal", n), s.message, s.signal)


def message_names(config: Config) -> Iterator[CheckFinding]:
    """Each message and signal exists on the bus of the axis."""
    known_on = cache(partial(messages_of, config))
    for use in (*_values(config), *_counters(config), *_further(config)):
        try:
            known = known_on(use.axis.bus)
        except DescriptionError:  # reported with the bus
            continue
        try:
            (find_counter if use.counter else find_signal)(known, use.message, use.signal)
        except DescriptionError as error:
            yield CheckFinding(use.signal_path if error.signal else use.message_path, str(error))


def one_axis_for_each_signal(config: Config) -> Iterator[CheckFinding]:
    """No signal is the torque or motion of two axes, or both torque and motion of one."""
    first: dict[tuple[str, str, str], Keys] = {}
    for use in _values(config):
        taken = first.setdefault((use.axis.bus, use.message, use.signal), use.signal_path)
        if taken != use.signal_path:
            yield CheckFinding(use.signal_path, f"{use.message}.{use.signal} is already used by", taken)


def counters_beside_values(config: Config) -> Iterator[CheckFinding]:
    """A sample counter is in the message of the torque or of the motion."""
    wrong = {finding.path for finding in message_names(config)}
    by_axis: dict[int, list[_Use]] = {}
    for use in _values(config):
        by_axis.setdefault(id(use.axis), []).append(use)
    for counter in _counters(config):
        values = by_axis.get(id(counter.axis), [])
        if len(values) < 2 or wrong & {use.message_path for use in (*values, counter)}:
            continue
        messages = dict.fromkeys(value.message for value in values)
        if counter.message not in messages:
            either = " or ".join(f'"{message}"' for message in messages)
            yield CheckFinding(counter.message_path, f"the counter must come with the torque or the motion: {either}")


CONFIG_RULES = (
    names,
    channels,
    recording_channels,
    bus_references,
    descriptions,
    sources,
    message_names,
    one_axis_for_each_signal,
    counters_beside_values,
)
BUS_RULES = (usable_bus,)
