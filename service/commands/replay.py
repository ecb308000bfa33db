"""``axiswatch replay``: runs the daemon's pipeline over records at full speed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.can.user_errors import left_out_words
from service.commands.command_line.exit_codes import MISTAKE, NOT_TESTED, explained
from service.commands.command_line.options import (
    LOG_KINDS,
    ConfigPath,
    JsonFile,
    ThermalStartOption,
    configuration,
    starting_as,
)
from service.commands.command_line.output_files import (
    STDOUT,
    check_writable,
    table_console,
    write,
    write_all,
)
from service.commands.command_line.progress import progress_bar
from service.config import Config
from service.ingest.records.record_ranges import RecordRange

if TYPE_CHECKING:
    from service.reports.replay_result import Replayed


Records = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORD",
        help=f"Tables (.csv .parquet .mat) or CAN logs ({LOG_KINDS}); FILE@10:60 are the seconds 10 to 60 of a file.",
    ),
]
Page = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FILE.html",
        help="Also draw it: estimates with their bands, g with h, alarms, unused samples.",
    ),
]


def replay(
    config: ConfigPath,
    records: Records,
    thermal: ThermalStartOption = None,
    json: JsonFile = None,
    report: Page = None,
) -> None:
    """Run records through the same decoding, estimation and detection as the daemon, and list the alarms.

    Several records are processed in the given order; each one starts with the estimates of the one
    before. The exit code is 5 where a monitored parameter was not tested: the absence of an alarm says nothing of it.
    """
    from service.reports.replay_report import as_json, print_text

    read = starting_as(configuration(config, without_bus=True), thermal)
    for file in (report, json):
        if file is not None and file != STDOUT:
            check_writable(file)
    with explained():
        found = _replay(read, config, records, report is not None)
    if report is not None:
        from service.reports.replay_html import as_html

        if not found.can_be_drawn:
            names = ", ".join(records)
            print(f"axiswatch: no sample of any axis in {names}: there is nothing to draw", file=sys.stderr)
            raise typer.Exit(MISTAKE)
        write_all([(report, as_html(found))])
    if json != STDOUT:
        print_text(found, table_console())
    if json is not None:
        write(json, as_json(found))
    if any(axis.untested for axis in found.axes):
        raise typer.Exit(NOT_TESTED)


def _replay(config: Config, path: Path, records: list[str], drawn: bool) -> Replayed:
    from service.pipeline.axes.axis_monitors import AxisMonitors
    from service.reports.replay_result import Replay

    run = Replay(AxisMonitors(config.axes), config, drawn)
    # All files are opened before the first one is processed, so that a missing file is reported at once.
    for record in [RecordRange(text, config) for text in records]:
        with progress_bar(record.name) as progress:
            run.add(record, progress)
        if record.left_out:
            print(f"axiswatch: {left_out_words(record.path, record.left_out)}", file=sys.stderr)
    return run.result([Path(text).name for text in records], str(path))
