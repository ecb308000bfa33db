"""``axiswatch replay``: the daemon's own pipeline over records, as fast as it goes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.text import Text

from service.commands.configuration import ConfigPath, configuration
from service.commands.exit_codes import explained
from service.commands.output_files import STDOUT, write
from service.commands.progress import progress_bar
from service.commands.replay_report import Report, as_json, doubts, stamp_remarks, tables, trends
from service.config import Config

if TYPE_CHECKING:
    from service.commands.replay_drawing import Drawing
    from service.pipeline.axis_monitors import AxisMonitors

Records = Annotated[
    list[Path],
    typer.Argument(metavar="RECORD", help="Tables (.csv .parquet .mat) or CAN logs (.log .asc .blf .trc)."),
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write everything here; - is standard output."),
]


Page = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FOLDER|FILE.html",
        help="Also draw it: estimates with their bands, g with h, alarms, unused samples.",
    ),
]


def replay(config: ConfigPath, records: Records, json: Json = None, report: Page = None) -> None:
    """Run records through the same decoding, estimation and detection as the daemon, and list the alarms.

    Several records are one after the other in the life of the robot; the estimates of one are the start of
    the next.
    """
    read = configuration(config)
    with explained():
        found, drawing = _replay(read, records, report)
    if drawing is not None:
        drawing.write(found, config, records)
    if json == STDOUT:
        print(as_json(found), end="")
        return
    console = Console()
    for table in tables(found):
        console.print(table)
    for words in trends(found):
        console.print(Text.assemble(("Trend: ", "bold"), words), soft_wrap=True)
    for words in (*doubts(found), *stamp_remarks(found)):
        console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)
    if json is not None:
        write(json, as_json(found))


def _replay(config: Config, paths: list[Path], where: Path | None) -> tuple[Report, Drawing | None]:
    from service.ingest.records import read_record
    from service.pipeline.axis_monitors import AxisMonitors

    monitors = AxisMonitors(config.axes)
    report, drawing = Report(config, monitors), _drawing(where, monitors)
    observer = None if drawing is None else drawing.see
    # All are opened before the first is run: a missing one is found at once.
    for record in [read_record(path, config) for path in paths]:
        with progress_bar(record.path.name) as progress:
            for step in record.steps():
                report.add(monitors.update(step.samples, observer))
                report.add(monitors.trends.update())
                progress(step.done)
        report.add_dropped(record)
    return report, drawing


def _drawing(where: Path | None, monitors: AxisMonitors) -> Drawing | None:
    if where is None:
        return None
    from service.commands.replay_drawing import Drawing

    return Drawing(where, monitors.by_id)
