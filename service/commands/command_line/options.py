"""Options, configuration and axis selection that several commands share."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.text import Text

from service.can.bus import BusSettings, reaches_hardware
from service.commands.command_line.exit_codes import MISTAKE
from service.config import Config, ConfigErrors, ConfigProblem, NamedAxis, load

if TYPE_CHECKING:
    from service.config.schema import BusConfig


LOG_KINDS = ".log .asc .blf .trc .mf4 .csv, also .gz"
"""Suffixes of CAN logs, for the help"""
ConfigPath = Annotated[
    Path, typer.Option("--config", "-c", help="Configuration file (TOML).", show_default=True, metavar="FILE")
]
AxisName = Annotated[
    str | None,
    typer.Option("--axis", metavar="NAME", help="Which axis, if there are several; its name, or robot.axis."),
]
RecordRanges = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORD...",
        help=f"Tables (.csv .parquet .mat) or CAN logs ({LOG_KINDS}) of the healthy axis; FILE@10:60 are its"
        " seconds 10 to 60.",
    ),
]
ReportFile = Annotated[
    Path | None,
    typer.Option("--report", metavar="FILE", help="The report. Default: report.html beside that file."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write everything here; - is standard output."),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite files that are there already.")]
Seconds = Annotated[
    float | None,
    typer.Option("--seconds", min=0.0, metavar="N", help="Stop after N seconds. [default: never]"),
]
Port = Annotated[
    int | None,
    typer.Option("--port", min=0, max=65535, help="Port of the page and the API, instead of the configured one."),
]
BusOption = Annotated[
    str | None,
    typer.Option(
        "--bus",
        metavar="INTERFACE:CHANNEL",
        help="With a description of the bus: listen to this bus, so that values are evaluated, too. Options of"
        " python-can follow after commas: pcan:PCAN_USBBUS1,bitrate=500000.",
    ),
]


ThermalStartOption = Annotated[
    Literal["cold", "unknown"] | None,
    typer.Option(
        "--thermal",
        help="How warm an axis is at the start of the first record, if its friction follows its heat without a"
        " thermometer. unknown: it is found from the motion. Default: as in the configuration, [robot.axis.thermal].",
    ),
]


def names_in(text: str) -> tuple[str, ...]:
    """Split names at commas; names of merged parameters contain blanks."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


# --- The configuration of a command line, the report of a wrong file, and the axis that is wanted ---------------------


_NO_BUS = (
    "no bus: this is for tables (`check`, `commission`, `identify`, `calibrate`, `replay`), `excite` and `model`;"
    " add [[bus]] with its messages and, to each axis, bus, and message and signal of torque and motion"
)


def configuration(path: Path, without_bus: bool = False, thresholds: bool = True) -> Config:
    """The configuration from a file and the environment; threshold files that it names may be skipped.

    Raises:
        typer.Exit: with status 2, after all problems have been written to the error stream.
    """
    try:
        found = load(path, thresholds=thresholds)
    except ConfigErrors as errors:
        console = Console(stderr=True, soft_wrap=True, highlight=False)
        for problem in errors.problems:
            console.print(_line(problem))
        count = len(errors.problems)
        console.print(f"{count} problem{'s' if count > 1 else ''} in the configuration", style="bold red")
        raise typer.Exit(MISTAKE) from None
    if not found.bus and not without_bus:
        typer.echo(f"axiswatch: {path}: {_NO_BUS}", err=True)
        raise typer.Exit(MISTAKE)
    return found


def starting_as(config: Config, start: Literal["cold", "unknown"] | None) -> Config:
    """The configuration with this thermal start for all axes without a thermometer; None: as configured.

    Raises:
        typer.BadParameter: no axis has a thermal model.
    """
    from service.config.conditions import thermal_of

    if start is None:
        return config
    if all(thermal_of(axis.config) is None for axis in config.axes):
        raise typer.BadParameter(
            "no axis follows its heat: no nominal_file has [thermal], as identify writes it where friction falls with"
            " the warm-up; leave this option out",
            param_hint="--thermal",
        )
    robots = (
        robot.model_copy(
            update={
                "axis": tuple(
                    axis.model_copy(update={"thermal": axis.thermal.model_copy(update={"start": start})})
                    for axis in robot.axis
                )
            }
        )
        for robot in config.robot
    )
    return config.model_copy(update={"robot": tuple(robots)})


def _line(problem: ConfigProblem) -> Text:
    """``file:line: key = value: message`` with place and key in colour."""
    text = Text(str(problem))
    text.stylize("cyan", 0, len(problem.place))
    if problem.key:
        start = len(problem.place) + 2
        text.stylize("bold", start, start + len(problem.key))
    return text


def axis_of(config: Path, wanted: str | None) -> NamedAxis:
    """The selected axis of a configuration file, which needs no bus."""
    return axis_named(configuration(config, without_bus=True).axes, wanted)


def axis_named(axes: Sequence[NamedAxis], wanted: str | None, option: str = "--axis") -> NamedAxis:
    """The selected one of these axes, by its name with or without its robot, or the only one.

    Raises:
        typer.BadParameter: no axis fits, or several do.
    """
    names = ", ".join(a.id for a in axes)
    if wanted is None and len(axes) > 1:
        raise typer.BadParameter(f"say which axis: there is {names}", param_hint=option)
    found = [a for a in axes if wanted in (None, a.id, a.id.split(".", 1)[1])]
    if len(found) != 1:
        what = "is in more than one robot" if found else "is not there"
        raise typer.BadParameter(f"{wanted} {what}; there is {names}", param_hint=option)
    return found[0]


def bus_named(text: str, messages: Path | None = None) -> BusConfig:
    """The bus of a text such as "socketcan:can0", with options after commas; ``messages``: file that describes the bus.

    Raises:
        typer.BadParameter: the text has another form, or the interface does not exist.
    """
    from service.config.rules.bus_rules import usable_bus
    from service.config.schema import BusConfig
    from service.config.schema.base_table import ReadingContext

    (where, *further), options = text.split(","), dict[str, object]()
    interface, _, channel = where.partition(":")
    pairs = [option.partition("=") for option in further]
    if not (interface and channel and all(key and value for key, _, value in pairs)):
        raise typer.BadParameter(
            f"{text}: must be INTERFACE:CHANNEL, such as socketcan:can0, with options as ,bitrate=500000",
            param_hint="--bus",
        )
    for key, _, value in pairs:
        options[key.strip()] = _value(value.strip())
    name = channel if re.fullmatch(r"[\w-]+", channel, re.ASCII) else "bus1"
    values: dict[str, object] = {"name": name, "interface": interface, "channel": channel, "options": options}
    if messages is not None:
        values["messages"] = str(messages.resolve())
    bus = BusConfig.model_validate(values, context=ReadingContext(Path.cwd()))
    for finding in usable_bus(bus):
        if finding.path != ("messages",):  # that is reported as a file
            raise typer.BadParameter(f"{text}: {finding.message}", param_hint="--bus")
    return bus


def _value(text: str) -> object:
    """A value as in TOML; everything else is text."""
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text


# --- Consent to send on a bus where a drive may listen: only simulate and play send at all ----------------------------


SendYes = Annotated[
    bool, typer.Option("--yes", help="Send on a real CAN interface without asking: a drive there may move.")
]


def confirm_sending(buses: Iterable[BusSettings], yes: bool) -> None:
    """Ask before frames are sent on buses that may have drives; without a terminal, ``yes`` is required.

    Raises:
        typer.Exit: with status 2, where there is no consent.
    """
    real = [f"{bus.interface} {bus.channel}" for bus in buses if reaches_hardware(bus)]
    if yes or not real:
        return
    danger = f"this sends frames on {', '.join(real)}: a drive or controller that listens there may act on them"
    if not sys.stdin.isatty():
        print(f"axiswatch: {danger}. Give --yes if none does, or use a virtual bus (vcan0).", file=sys.stderr)
        raise typer.Exit(MISTAKE)
    print(f"{danger[0].upper()}{danger[1:]}.")
    if not typer.confirm("Send?", default=False):
        raise typer.Exit(MISTAKE)
