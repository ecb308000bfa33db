"""``axiswatch calibrate``: thresholds from healthy records and a budget of false alarms, and what they will find."""

from __future__ import annotations

import shlex
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import explained
from service.commands.identify_arguments import Axis, Force, JsonFile, Records, Report
from service.commands.identify_files import Files
from service.commands.optional_value import OptionalValueCommand
from service.commands.progress import steps_bar
from service.commands.which_drive import axis_named
from service.commands.writing import STDOUT, write
from service.config.durations import seconds_in

if TYPE_CHECKING:
    from service.calibration.found import Calibration, Provenance


Budget = Annotated[
    str,
    typer.Option(
        "--budget",
        metavar="TIME",
        help="No more than one false alarm of the axis in this time: 10min, 1h, 30d, 1y.",
    ),
]
Within = Annotated[
    float | None,
    typer.Option(
        "--within",
        metavar="SECONDS",
        min=1e-3,
        help="Faults are to be found in this time, as small ones as possible. Default: ten memories.",
    ),
]
Sizes = Annotated[
    str, typer.Option("--sizes", metavar="PERCENT,..", help="Changes to try, upwards and downwards.")
]
Onsets = Annotated[
    int, typer.Option("--onsets", min=1, max=1000, help="At so many places of the record each begins.")
]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="Where the thresholds are written to.")
]


class Command(OptionalValueCommand):
    """--json alone writes to standard output."""

    options = ("--json",)

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after the option is a file to write to, and not a record."""
        return word == "-" or word.endswith(".json") or word.startswith("/dev/")


def calibrate(
    config: ConfigPath,
    records: Records,
    axis: Axis = None,
    budget: Budget = "1y",
    within: Within = None,
    sizes: Sizes = "5,10,20,30,50",
    onsets: Onsets = 100,
    output: Output = Path("thresholds.toml"),
    report: Report = None,
    json: JsonFile = None,
    force: Force = False,
) -> None:
    """Find thresholds that keep a budget of false alarms, from records of the healthy axis, and what they will find.

    Writes thresholds.toml, which the configuration points at with thresholds_file, and report.html: which changes of
    each parameter are found how soon, and under which name. Records that are too short for the budget, do not move the
    axis, or in which something changes are refused, with the place.
    """
    files = Files.of(None, output, report, json)
    files.check(force, "thresholds")
    wanted = seconds_of(budget), within, _sizes(sizes), onsets
    read = configuration(config, without_bus=True, thresholds=False)
    chosen = axis_named(read.axes, axis)
    with explained():
        from service.calibration.running import Wishes
        from service.calibration.running import calibrate as run

        with steps_bar(chosen.id) as progress:
            found = run(read, chosen, records, Wishes(*wanted), _provenance(), progress)
    _write(found, files)


def seconds_of(text: str) -> float:
    """A time such as 10min, 1h, 30d, 1y, "2 hours", or seconds.

    Raises:
        typer.BadParameter: it is none.
    """
    try:
        return seconds_in(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--budget") from None


def _sizes(text: str) -> tuple[float, ...]:
    try:
        sizes = sorted({float(part) / 100 for part in text.split(",")})
    except ValueError:
        sizes = []
    if not sizes or not all(0 < size <= 10 for size in sizes):
        raise typer.BadParameter(f"{text}: write percents, such as 5,10,20", param_hint="--sizes")
    return tuple(sizes)


def _provenance() -> Provenance:
    from service.calibration.found import Provenance

    command = shlex.join(["axiswatch", *sys.argv[1:]])
    return Provenance(version("axiswatch"), datetime.now(UTC).isoformat(timespec="seconds"), command)


def _write(found: Calibration, files: Files) -> None:
    """All files, and the tables to the terminal.

    Raises:
        typer.Exit: a file cannot be written.
    """
    from service.reports.calibration_html import as_html
    from service.reports.calibration_toml import as_toml

    texts = [(files.nominal, as_toml(found)), (files.report, as_html(found))]
    if files.json is not None:
        from service.reports.calibration_json import as_json

        texts.append((files.json, as_json(found)))
    for path, text in texts:
        write(path, text)
    if files.json != STDOUT:
        from rich.console import Console

        from service.reports.calibration_text import print_text

        print_text(found, Console(highlight=False))
    written = ", ".join(str(path) for path, _ in texts if path != STDOUT)
    print(f"written: {written}", file=sys.stderr)
