"""``axiswatch discover``: finds torque and motion on a bus without a description."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from service.can.frames import FrameBlock
from service.can.inferred_layout import Field
from service.can.log_files import LOG_SUFFIXES, log_suffix
from service.can.user_errors import RecordError
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import LOG_KINDS, BusOption, Force, bus_named
from service.commands.command_line.output_files import check_new
from service.commands.command_line.received_frames import heard_on, logged
from service.commands.init import ListenFor, Output, propose
from service.config.schema import BusConfig

if TYPE_CHECKING:
    from service.ingest.roles.unknown_messages import UnknownMessage

Log = Annotated[Path | None, typer.Argument(metavar="RECORD", help=f"A CAN log ({LOG_KINDS}) of the moving robot.")]
Channel = Annotated[
    str | None,
    typer.Option("--channel", metavar="NAME", help="The bus to look at, of a log of several. Default: the busiest."),
]  # fmt: skip


def discover(
    record: Log = None,
    output: Output = Path("axis.toml"),
    force: Force = False,
    bus: BusOption = None,
    seconds: ListenFor = 20.0,
    channel: Channel = None,
) -> None:
    """Look at a bus that no file describes: which bits are torque and motion of which axis, with the reasons.

    The robot must move, with changes of its speed, best as in production. The numbers in a message are found by how
    smoothly they change, torque and motion by how well the motion explains the torque. Units cannot be found: the
    proposed configuration says where to put them. If a DBC, an EDS or a table of the maker exists, use it with
    `axiswatch init` instead.
    """
    if (record is None) == (bus is None):
        raise typer.BadParameter("give either a CAN log or --bus INTERFACE:CHANNEL", param_hint="RECORD")
    check_new(output, force)
    with explained():
        from service.ingest.roles.signal_roles import summary
        from service.ingest.roles.unknown_messages import discover_axes, used_messages
        from service.reports.proposed_configuration import unknown_bus_lines

        source: BusConfig | None = None
        if record is not None:
            name, frames = _logged(record, channel)
        else:
            source = bus_named(bus or "", None)
            name, frames = source.name, heard_on(source, seconds)
        found = discover_axes(frames)
        Console(highlight=False, soft_wrap=True).print(_table(found.messages))
        if not found.axes:
            raise RecordError(
                "no torque and motion of an axis among these numbers; record while the robot moves, for some"
                " seconds at least, with changes of its speed; one axis after another is best"
            )
    propose(
        output,
        summary(found.axes),
        unknown_bus_lines(found.axes, used_messages(found), name, source),
        f"{output} is written; put the units into it: they cannot be seen on the bus.\n"
        f"Next: axiswatch commission {record or '--minutes 10'} --config {output}",
    )


def _logged(record: Path, channel: str | None) -> tuple[str, FrameBlock]:
    """The bus names in a log, with their frames."""
    if not log_suffix(record):
        raise RecordError(
            f"{record} is no CAN log ({' '.join(LOG_SUFFIXES)}); a table is for `axiswatch init {record}`, and of"
            " another log of python-can, such as .db, `can_logconvert` makes a .log"
        )
    buses = logged(record)
    if channel is not None and channel not in buses:
        raise RecordError(f"no channel {channel} in {record}; it has {', '.join(buses)}")
    chosen = max(buses, key=lambda name: buses[name].size) if channel is None else channel
    if len(buses) > 1:
        others = ", ".join(f"{name} ({of_bus.size} frames)" for name, of_bus in buses.items() if name != chosen)
        print(f"Looking at {chosen}; --channel chooses another one: {others}")
    return chosen, buses[chosen]


def _table(messages: tuple[UnknownMessage, ...]) -> Table:
    table = Table("identifier", "frames/s", "bytes", "numbers in it", box=None, pad_edge=False)
    for message in messages:
        frames_per_s = f"{message.rate:.1f}"
        table.add_row(f"0x{message.key.can_id:x}", frames_per_s, f"{message.length}", _contents(message))
    return table


def _contents(message: UnknownMessage) -> str:
    if message.multiplexer is not None:
        return (
            f"byte {message.multiplexer} chooses between {message.pages} meanings of the others:"
            " only a DBC can describe that"
        )
    if not message.fields:
        return "too few frames to look at" if message.length else "no data"
    return ", ".join(_words(field) for field in message.fields)


def _words(field: Field) -> str:
    last = field.first_byte + field.width - 1
    place = f"{field.first_byte}" if field.width == 1 else f"{field.first_byte}-{last}"
    if field.part is not None:
        first = field.part.low_bit
        place = f"{place} (bits {first}-{first + field.length - 1})"
    if field.kind in ("constant", "random", "state"):
        return f"{place} {field.kind}"
    kind = "float" if field.is_float else "signed" if field.is_signed else "unsigned"
    order = "" if field.width == 1 else f" {field.byte_order}-endian"
    return f"{place} {field.kind} ({kind}{order})"
