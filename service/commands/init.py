"""``axiswatch init``: writes a first configuration for the columns of a table or the signals of a bus."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from monitor_core.arrays import Floats
from monitor_core.wording import first_of
from service.can.canopen_drives import SUFFIXES, commissioned_node
from service.can.frames import FrameBlock
from service.can.log_files import log_suffix
from service.can.message_files import KINDS, read_messages
from service.can.messages import DescriptionError, MessageSet
from service.can.user_errors import RecordError, undescribed_words
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import LOG_KINDS, BusOption, Force, bus_named
from service.commands.command_line.output_files import check_new, write_all
from service.config.schema import BusConfig

if TYPE_CHECKING:
    from service.ingest.roles.column_roles import TableRoles
    from service.ingest.roles.live_roles import BusRoles
    from service.ingest.roles.signal_roles import FurtherSignals
    from service.ingest.tables.table_files import TableFile
from service.commands.command_line.received_frames import heard_on, logged

RecordFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="A table (.csv .parquet .mat) of the healthy, moving robot, or the description of its"
        " bus (.dbc .kcd .sym .arxml), or of its CANopen drives (.eds .dcf).",
    ),
]
CanRecord = Annotated[
    Path | None,
    typer.Argument(
        metavar="LOG",
        help=f"With a description of the bus or its drives: a CAN log ({LOG_KINDS}) of the healthy, moving robot, so"
        " that values are evaluated, too.",
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File for the configuration.")]


ListenFor = Annotated[
    float, typer.Option("--seconds", min=1.0, max=600.0, metavar="N", help="With --bus: how long to listen.")
]
Nodes = Annotated[
    list[int] | None,
    typer.Option(
        "--node",
        min=1,
        max=127,
        metavar="N",
        help="With the EDS of CANopen drives: node id of a drive, once for each. Default: those on the bus or in the"
        " log, or the one in the DCF.",
    ),
]


def init(
    record: RecordFile,
    log: CanRecord = None,
    output: Output = Path("axis.toml"),
    force: Force = False,
    bus: BusOption = None,
    seconds: ListenFor = 10.0,
    node: Nodes = None,
) -> None:
    """Write a first configuration: which columns of a table, or signals of a bus, are torque and motion of which axis.

    The names and values of the columns are evaluated; each proposal says how sure it is. Check it, then run
    `axiswatch commission` with it. A table without names is understood by its values alone. For the
    description of a bus, --bus looks at the values on the bus, too, while the robot moves. The EDS of CANopen drives
    tells what they send; what that is in SI units is in their data sheets.
    """
    described = record.suffix.lower() in (*KINDS, *SUFFIXES)
    if log is not None and bus is None and not described and not log_suffix(log):
        raise typer.BadParameter(
            f"one table is looked at, that in which the axes move most: axiswatch init {record}; `axiswatch commission`"
            " takes all of them",
            param_hint="LOG",
        )
    if log is not None and (bus is not None or not described or not log_suffix(log)):
        raise typer.BadParameter(
            "a log is looked at with the description of its bus, without --bus: axiswatch init robot.dbc robot.log",
            param_hint="LOG",
        )
    check_new(output, force)
    with explained():
        if record.suffix.lower() in KINDS:
            if log is not None:
                _from_log(record, log, output)
            elif bus is None:
                _from_description(record, output)
            else:
                _from_bus(record, bus_named(bus, record), seconds, output)
        elif record.suffix.lower() in SUFFIXES:
            _from_drives(record, node, log, None if bus is None else bus_named(bus), seconds, output)
        elif bus is not None:
            raise typer.BadParameter(
                f"{record} describes no bus: give its .dbc, .kcd, .sym or .arxml file, or the .eds of its drives",
                param_hint="--bus",
            )
        else:
            _from_table(record, output)


def propose(output: Path, found: Iterable[str], lines: Iterable[str], next_step: str) -> None:
    """Print the findings, write the lines of the configuration, and print the next step."""
    print(*found, sep="\n")
    write_all([(output, "\n".join(lines) + "\n")])
    print(next_step)


def _from_table(record: Path, output: Path) -> None:
    """Write a configuration for a table."""
    from service.ingest.records.record_files import is_table
    from service.ingest.roles.column_roles import roles
    from service.ingest.roles.column_values import changes
    from service.ingest.roles.signal_roles import summary
    from service.ingest.tables.table_files import open_table
    from service.reports.proposed_configuration import degrees_asked, gears_wanted, table_lines

    if not is_table(record):
        raise typer.BadParameter(
            f"{record} is a CAN log by its name; let a table end with .csv. For a log give the description of its bus"
            f" (.dbc .kcd .sym .arxml) before it, such as axiswatch init robot.dbc {record}; without one"
            f" `axiswatch discover {record}` looks at the frames",
            param_hint="FILE",
        )
    table = open_table(record)
    columns, interval_s, faults = _read(table)
    fault = "".join(f"; {why}" for why in [*faults.values()][:1])
    if not any(map(len, columns.values())):
        raise RecordError(f"{record} holds no rows of numbers; its columns are {', '.join(table.names)}{fault}")
    found = roles(columns, table.units, interval_s)
    apart = f"at other times than the others: {', '.join(found.apart)}; export all at one rate" if found.apart else ""
    if not found.axes:
        constant = ", ".join(name for name, column in columns.items() if not changes(column))
        still = f", and these do not change: {constant}" if constant else ""
        raise RecordError(
            f"no torque and motion of an axis in {record}; its columns are {', '.join(columns)}{still}"
            f"{apart and '; '}{apart}{fault}"
        )
    if all(axis.apart for axis in found.axes):
        torque, motion = found.axes[0].torque.name, found.axes[0].motion.name
        raise RecordError(
            f"{record}: {torque} and {motion} are hardly ever in the same row, but a sample needs both; export all"
            " columns with a common interval"
        )
    unused = [f"not used: {', '.join(filter(None, found.unused))}"] if any(found.unused) else []
    alone = (f"{name} is a torque without its motion: add its axis to {output}" for name in found.alone)
    not_read = (f"not used: {why}" for why in filter(None, [apart, *faults.values()]))
    loads = (f"{name or 'all axes'}: load {column}" for name, column in found.loads.items())
    further = [*loads, *_load_words(found.switches), *_temperature_words(found.temperatures)]
    asked = [*degrees_asked(found.axes), *gears_wanted(found.axes)]
    words = [*table.taken, _time_words(found), *summary(found.axes), *further, *unused, *alone, *not_read, *asked]
    lines = table_lines(found, record.name)
    propose(output, words, lines, f"Next: axiswatch commission {record} --config {output}")


def _from_description(description: Path, output: Path) -> None:
    """Write a configuration for the bus that a file describes."""
    from service.ingest.roles.signal_roles import axes_in, further_in, summary
    from service.reports.proposed_configuration import bus_lines

    known = read_messages(description).messages
    axes = axes_in(known)
    if not axes:
        raise DescriptionError(
            f"no torque and motion of an axis in {description}, by the names and units of its signals"
        )
    further = further_in(known, axes)
    lines = bus_lines(axes, description, output, further=further)
    words = [*summary(axes), *_further_words(further)]
    propose(output, words, lines, f"Next: axiswatch commission RECORD.log --config {output}")


def _from_bus(description: Path, bus: BusConfig, seconds: float, output: Path) -> None:
    """Write a configuration for a bus from the frames that it sends."""
    from service.reports.proposed_configuration import bus_lines

    where = f"{bus.interface} {bus.channel}"
    known = read_messages(description)  # a mistake in it is reported before anything is waited for
    found = _roles(known, heard_on(bus, seconds), description, where)
    further = _further_in(found, known)
    lines = bus_lines(found.axes, description, output, bus, further=further)
    next_step = f"Next: axiswatch commission --config {output} --minutes 10"
    propose(output, [*_bus_words(found, description), *_further_words(further)], lines, next_step)


def _from_log(description: Path, log: Path, output: Path) -> None:
    """Write a configuration for the bus in a log that carries most of the described messages."""
    from service.ingest.roles.live_roles import roles_on_bus
    from service.reports.proposed_configuration import bus_lines

    known, buses = read_messages(description), logged(log)
    received = {name: roles_on_bus(known, frames).received for name, frames in buses.items()}
    name = max(buses, key=lambda bus: len(received[bus]))
    found = _roles(known, buses[name], description, f"{log}, {name}")
    others = [f"{other} carries {_few(names)}" for other, names in received.items() if names and other != name]
    more = [f"looked at: {name}; {'; '.join(others)}: each channel needs a [[bus]]"] if others else []
    further = _further_in(found, known)
    lines = bus_lines(found.axes, description, output, channel=name, further=further)
    next_step = f"Next: axiswatch commission {log} --config {output}"
    propose(output, [*_bus_words(found, description), *more, *_further_words(further)], lines, next_step)


def _further_in(found: BusRoles, known: MessageSet) -> FurtherSignals:
    """Signals of the received messages beside torque and motion."""
    from service.ingest.roles.signal_roles import further_in

    return further_in([message for message in known.messages if message.name in found.received], found.axes)


def _further_words(further: FurtherSignals) -> Iterator[str]:
    yield from _load_words([load.name for load in further.loads])
    yield from _temperature_words({axis: signal.name for axis, signal in further.temperatures.items()})


def _load_words(names: Sequence[str]) -> Iterator[str]:
    if names:
        yield f"all axes: {_few(names)} may tell what the robot carries"


def _temperature_words(names: Mapping[str, str]) -> Iterator[str]:
    if names:
        yield f"temperatures, which friction may follow: {_few([f'{axis}: {name}' for axis, name in names.items()])}"


def _roles(known: MessageSet, frames: FrameBlock, description: Path, where: str) -> BusRoles:
    """What these frames show of the axes that the file describes."""
    from service.ingest.roles.live_roles import roles_on_bus

    found = roles_on_bus(known, frames)
    if not found.received:
        received = f"{frames.size} frames on {where}"
        raise RecordError(undescribed_words(received, description, _few(found.undescribed)))
    if not found.axes:
        raise RecordError(
            f"no torque and motion of an axis on {where}: messages of {description} received: {_few(found.received)};"
            " do the axes move?"
        )
    return found


def _bus_words(found: BusRoles, description: Path) -> Iterator[str]:
    from service.ingest.roles.signal_roles import summary

    yield from summary(found.axes)
    for what, names in (("not received", found.missing), (f"not in {description.name}", found.undescribed)):
        if names:
            yield f"{what}: {_few(names)}"


def _from_drives(
    eds: Path, nodes: list[int] | None, log: Path | None, bus: BusConfig | None, seconds: float, output: Path
) -> None:
    """Write a configuration for CANopen drives: the given ones, or those in a log, or heard on the bus."""
    from service.ingest.roles.drive_objects import nodes_in, objects_of
    from service.reports.proposed_configuration import drive_lines

    if nodes is None and bus is None and log is None:
        own = commissioned_node(eds)
        if own is None:
            raise typer.BadParameter("say which drives: --node 3 --node 4, --bus, or a log", param_hint="--node")
        nodes = [own]
    if nodes is None:
        heard = [heard_on(bus, seconds)] if bus is not None else [*logged(log).values()] if log is not None else []
        nodes = max((nodes_in(eds, frames) for frames in heard), key=len)
        if not nodes:
            where = log if bus is None else f"{bus.interface} {bus.channel}"
            raise RecordError(
                f"no drive of {eds} on {where}: {sum(frames.size for frames in heard)} frames; is the master on, which"
                " starts the drives and sends the SYNC?"
            )
    drives = {node: objects_of(eds, node) for node in nodes}
    words = [f"node {node}: {found}" for node, found in drives.items()]
    lines = drive_lines(drives, eds, output, bus)
    propose(output, words, lines, f"Next: fill in {output}, then axiswatch listen --config {output}")


_NAMED = 12


def _few(names: Sequence[str]) -> str:
    return first_of(names, _NAMED)


def _together(table: TableFile, names: Sequence[str]) -> Mapping[str, Floats]:
    """The columns at the rows in which each of them has a number."""
    parts = [rows.columns for rows in table.rows(names)]
    return {name: np.concatenate([np.zeros(0), *(part[name] for part in parts)]) for name in names}


_NEARLY = 0.5
"""A column with a number in fewer rows is left out, so that it costs no rows of the others."""


def _read(table: TableFile) -> tuple[Mapping[str, Floats], float | None, Mapping[str, str]]:
    """The long numeric columns; the sample interval, if a variable states it; faults of the other columns."""
    from service.ingest.tables.table_files import MatTable

    found, faults = dict[str, Floats](), dict[str, str]()
    for name in table.names:
        try:
            found |= _together(table, [name])
        except RecordError as error:
            faults[name] = str(error)
    longest = max(map(len, found.values()), default=0)
    nearly = [name for name, values in found.items() if len(values) > _NEARLY * longest]
    if len({len(found[name]) for name in nearly}) > 1 and not isinstance(table, MatTable):
        found |= _together(table, nearly)  # some rows have no number in some column
        longest = len(found[nearly[0]])
    intervals = (float(v[0]) for n, v in found.items() if len(v) == 1 and n.lower() in ("sample_time", "dt", "ts"))
    return {n: v for n, v in found.items() if len(v) == longest}, next(intervals, None), faults


def _time_words(found: TableRoles) -> str:
    interval_s = found.axes[0].interval_s
    unknown = "put their interval into sample_interval_s, which nothing shows"
    apart = f"{interval_s:.4g} s apart" if interval_s else unknown
    where = "no column; rows are taken as evenly spaced" if found.time is None else found.time
    return f"time: {where}, {apart}{found.asked}"
