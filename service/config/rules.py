"""Rules beyond single values: names that must differ or exist, values that must fit together.

Each rule takes a table of a lenient reading and yields findings with paths relative to that table.  Where a
rule asks for a value that is itself wrong, ``Absent`` ends it: that value has been reported.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

from monitor_core.suggestions import did_you_mean
from service.can.bus import interface_names
from service.config.base_table import Absent, Table, present
from service.config.condition_rules import CONDITION_RULES, places_of_signals, signals_of_axes
from service.config.crosschecks import DBC_RULES
from service.config.detector_rules import DETECTOR_RULES
from service.config.encoder_rules import ENCODER_RULES
from service.config.estimator_rules import ESTIMATOR_RULES
from service.config.limit_rules import LIMIT_RULES
from service.config.model_rules import MODEL_RULES
from service.config.nominal_rules import NOMINAL_RULES
from service.config.positions import Keys
from service.config.schema import AxisConfig, BusConfig, Config, RobotConfig
from service.config.schema_signals import FurtherConfig, SignalConfig
from service.config.skew_rules import SKEW_RULES
from service.config.thresholds_rules import THRESHOLDS_RULES
from service.config.validation_messages import Finding

T = TypeVar("T")
Rule = Callable[[T], Iterator[Finding]]


def broken(config: Config) -> Iterator[Finding]:
    """All findings of all rules in a lenient reading of the file."""
    yield from _run(FILE_RULES, config, ())
    for i, bus in enumerate(config.bus if present(config, "bus") else ()):
        yield from _run(BUS_RULES, bus, ("bus", i))
    for i, robot in enumerate(config.robot if present(config, "robot") else ()):
        yield from _run(ROBOT_RULES, robot, ("robot", i))
        for k, axis in enumerate(robot.axis if present(robot, "axis") else ()):
            yield from _run(AXIS_RULES, axis, ("robot", i, "axis", k))


def _run(rules: Iterable[Rule[T]], table: T, path: Keys) -> Iterator[Finding]:
    for rule in rules:
        try:
            for finding in rule(table):
                yield finding.inside(path)
        except Absent:
            continue


def bus_names(config: Config) -> Iterator[Finding]:
    """No two buses have one name."""
    return _same_names("bus", config.bus)


def robot_names(config: Config) -> Iterator[Finding]:
    """No two robots have one name."""
    return _same_names("robot", config.robot)


def axis_names(robot: RobotConfig) -> Iterator[Finding]:
    """No two axes of a robot have one name."""
    return _same_names("axis", robot.axis)


def bus_references(config: Config) -> Iterator[Finding]:
    """Every axis names a bus of the file, if it has any."""
    known = [bus.name for bus in config.bus if present(bus, "name")]
    for path, axis in _axes(config):
        if not present(axis, "bus") or axis.bus in known:
            continue
        if config.bus:
            message = (
                f"no such bus: {did_you_mean(axis.bus, known)}" if axis.bus else _missing(AxisConfig, "bus")
            )
            yield Finding((*path, "bus"), message)
        elif axis.bus:
            yield Finding((*path, "bus"), f"no such bus: {_NO_BUS}")


def sources(config: Config) -> Iterator[Finding]:
    """Torque and motion are in a message of the bus; in a file without any bus, in a column."""
    for path, axis in _axes(config):
        for quantity in ("torque", "angle", "speed"):
            source = getattr(axis, quantity) if present(axis, quantity) else None
            if source is not None:
                find = _on_bus if not present(config, "bus") or config.bus else _in_tables
                yield from (finding.inside((*path, quantity)) for finding in find(source))


def _on_bus(source: SignalConfig) -> Iterator[Finding]:
    for key in ("message", "signal"):
        if present(source, key) and not getattr(source, key):
            yield Finding((key,), _missing(SignalConfig, key))


def _in_tables(source: SignalConfig) -> Iterator[Finding]:
    for key in ("message", "signal"):
        if present(source, key) and getattr(source, key):
            yield Finding((key,), f"is on a bus, but {_NO_BUS}")
    if present(source, "column") and source.column is None:
        yield Finding(
            ("column",), f"{_missing(SignalConfig, 'column')}: without a [[bus]] it is read from there"
        )


_NO_BUS = "there is no [[bus]] in this file: add it, or remove this where only tables are to be identified"


def _missing(table: type[Table], key: str) -> str:
    """As for a key that is always needed."""
    return f"missing ({table.model_fields[key].description})"


def _axes(config: Config) -> Iterator[tuple[Keys, AxisConfig]]:
    """All axes with their paths."""
    for i, robot in enumerate(config.robot):
        for k, axis in enumerate(robot.axis if present(robot, "axis") else ()):
            yield ("robot", i, "axis", k), axis


def interface(bus: BusConfig) -> Iterator[Finding]:
    """The interface is one that python-can has."""
    if bus.interface not in interface_names():
        hint = did_you_mean(bus.interface, interface_names())
        yield Finding(("interface",), f"python-can has no such interface: {hint}")


def bus_options(bus: BusConfig) -> Iterator[Finding]:
    """Options do not repeat what has its own key."""
    for key in ("interface", "channel"):
        if key in bus.options:
            yield Finding(("options", key), f"belongs into [[bus]] itself: {key} = ...")


def motion(axis: AxisConfig) -> Iterator[Finding]:
    """An axis has an angle or a speed."""
    if axis.angle is not None and axis.speed is not None:
        message = (
            "give angle or speed, not both: the angle gives better estimates, unless its resolution is coarse"
        )
        yield Finding(("speed",), message)
    if axis.angle is None and axis.speed is None:
        yield Finding(("angle",), "missing: an axis needs a table angle (motor angle) or speed (motor speed)")


def torque_delay(axis: AxisConfig) -> Iterator[Finding]:
    """The torque is at most one interval late."""
    if axis.torque_delay_s > axis.sample_interval_s:
        yield Finding(("torque_delay_s",), f"must be at most sample_interval_s = {axis.sample_interval_s}")


def pairing_tolerance(axis: AxisConfig) -> Iterator[Finding]:
    """A wider tolerance would pair values of different samples."""
    interval_s = axis.sample_interval_s
    if axis.pairing_tolerance_s >= interval_s / 2:
        limit = (
            f"must be below half of sample_interval_s = {interval_s}: values of different samples would pair"
        )
        yield Finding(("pairing_tolerance_s",), limit)


def maximum_gap(axis: AxisConfig) -> Iterator[Finding]:
    """The normal interval is no gap."""
    if axis.max_gap_s < axis.sample_interval_s:
        limit = (
            f"must be at least sample_interval_s = {axis.sample_interval_s}: every interval would be a gap"
        )
        yield Finding(("max_gap_s",), limit)


def counter(axis: AxisConfig) -> Iterator[Finding]:
    """Message and signal of the counter come together."""
    pair = {"counter_message": axis.time.counter_message, "counter_signal": axis.time.counter_signal}
    if len([value for value in pair.values() if value is None]) == 1:
        missing = next(key for key, value in pair.items() if value is None)
        yield Finding(("time", missing), "missing: counter_message and counter_signal go together")


def clock(axis: AxisConfig) -> Iterator[Finding]:
    """A clock is fitted only where no counter tells the time."""
    if axis.time.clock == "cyclic" and axis.time.counter_signal is not None:
        yield Finding(
            ("time", "clock"), "the counter gives the times: remove this, or", ("time", "counter_signal")
        )


def further_signals(axis: AxisConfig) -> Iterator[Finding]:
    """Further signals have names of their own, and each says where it is."""
    yield from _same_names("signal", axis.signal)
    yield from places_of_signals(axis)


def _same_names(
    key: str, tables: Sequence[BusConfig | RobotConfig | AxisConfig | FurtherConfig]
) -> Iterator[Finding]:
    first: dict[str, int] = {}
    for i, table in enumerate(tables):
        if present(table, "name") and first.setdefault(table.name, i) != i:
            yield Finding((key, i, "name"), "must differ from the name of", (key, first[table.name]))


FILE_RULES: tuple[Rule[Config], ...] = (bus_names, robot_names, bus_references, sources, *DBC_RULES)
BUS_RULES: tuple[Rule[BusConfig], ...] = (interface, bus_options)
ROBOT_RULES: tuple[Rule[RobotConfig], ...] = (axis_names, signals_of_axes)
AXIS_RULES: tuple[Rule[AxisConfig], ...] = (
    motion,
    torque_delay,
    pairing_tolerance,
    maximum_gap,
    counter,
    clock,
    further_signals,
    *NOMINAL_RULES,
    *MODEL_RULES,
    *LIMIT_RULES,
    *SKEW_RULES,
    *ENCODER_RULES,
    *ESTIMATOR_RULES,
    *CONDITION_RULES,
    *THRESHOLDS_RULES,
    *DETECTOR_RULES,
)
