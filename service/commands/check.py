"""``axiswatch check``: checks a configuration and shows its content."""

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import ConfigPath, configuration
from service.config import Config, ModelConfig, NamedAxis, in_words
from service.config.axis_detectors import detectors_in_words
from service.config.axis_settings import awaits_identification
from service.config.bus_messages import messages_of
from service.config.certificates import expiries
from service.config.remarks import remarks
from service.config.schema import AxisConfig, SignalConfig
from service.config.schema.base_table import SUFFIX
from service.reports.formats import labelled
from service.texts.instants import now_us

LOCAL_HOST = "127.0.0.1"
"""Default host of [web]: no other machine reaches it, so that it needs neither tokens nor TLS"""


def check(config: ConfigPath) -> None:
    """Check a configuration with the messages of its buses; name every problem by file and line."""
    read = configuration(config, without_bus=True)
    with explained():  # an axis may be well written and have no predictor, or too short a memory for it
        expiring = (expiry.warning(now_us()) for expiry in expiries(read))
        notes = (*remarks(read), *filter(None, expiring))
        axes = _axes(read)
        hindered = tuple(_obstacles(read))
    console = Console()
    if read.bus:
        console.print(_buses(read))
    console.print(axes)
    would_not_start = (f"the daemon would not start on this machine: {obstacle}" for obstacle in hindered)
    for note in (*notes, *would_not_start):
        console.print(labelled("Note", note), soft_wrap=True)
    console.print(Text(f"{config}: no problems", style="green"), soft_wrap=True)


def _obstacles(config: Config) -> Iterator[str]:
    """Problems of this machine or user, such as missing files or rights; the configuration itself may be right."""
    if config.web.host == LOCAL_HOST and config.web.certificate is None and not config.links.any:
        return
    from service.commands.daemon.protection import obstacles

    yield from obstacles(config)


def _buses(config: Config) -> Table:
    from service.can.socket_receivers import reader_of

    table = Table("bus", "interface", "channel", "read by", "messages", title="Buses", title_justify="left")
    for bus in config.bus:
        described, reader = messages_of(config, bus.name).source, reader_of(bus.interface)
        table.add_row(*map(escape, (bus.name, bus.interface, bus.channel, reader, described)))
    return table


def _axes(config: Config) -> Table:
    columns = ("axis", "bus", "torque and motion", "interval", "drive and watched")
    table = Table(*columns, title="Axes", title_justify="left", show_lines=True)
    for axis in config.axes:
        table.add_row(*map(escape, _cells(axis)))
    return table


def _place(source: SignalConfig) -> str:
    return f"{source.message}.{source.signal}" if source.message else f"column {source.column}"


def _cells(axis: NamedAxis) -> tuple[str, ...]:
    config = axis.config
    found = [file for file in (config.model.nominal_file, config.model.thresholds_file) if file is not None]
    files = [line for file in found for line in (file.path.name, f"of {file.date[:10]}")]
    watched = ", ".join(config.model.monitor)
    detectors = "not identified yet" if awaits_identification(config) else detectors_in_words(axis)
    return (
        axis.id,
        config.bus or "tables",
        "\n".join((_place(config.torque), f"{_place(config.motion)} ({config.output})", *_added(config))),
        f"{1000 * config.sample_interval_s:g} ms",
        "\n".join((_drive(config.model), watched, *files, *in_words(config), detectors)),
    )


def _added(config: AxisConfig) -> Iterator[str]:
    """What coupling adds to the motion of the axis."""
    yield from (f"{factor:+g} {name}" for name, factor in config.coupling.items())


def _drive(model: ModelConfig) -> str:
    return Path(model.drive).name if model.drive.endswith(SUFFIX) else model.drive
