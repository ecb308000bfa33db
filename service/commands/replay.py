"""``axiswatch replay``: the daemon's own pipeline over records, as fast as it goes."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import MISTAKE, explained
from service.commands.progress import progress_bar
from service.commands.replay_report import Report, as_json, doubts, stamp_remarks, tables
from service.config import Config

Records = Annotated[
    list[Path],
    typer.Argument(metavar="RECORD", help="Tables (.csv .parquet .mat) or CAN logs (.log .asc .blf .trc)."),
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write everything here; - is standard output."),
]


def replay(config: ConfigPath, records: Records, json: Json = None) -> None:
    """Run records through the same decoding, estimation and detection as the daemon, and list the alarms.

    Several records are one after the other in the life of the robot; the estimates of one are the start of
    the next.
    """
    read = configuration(config)
    with explained():
        report = _replay(read, records)
    if json == Path("-"):
        print(as_json(report), end="")
        return
    console = Console()
    for table in tables(report):
        console.print(table)
    for words in (*doubts(report), *stamp_remarks(report)):
        console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)
    if json is not None:
        try:
            json.write_text(as_json(report), encoding="utf-8")
        except OSError as error:
            typer.echo(f"axiswatch: cannot write {json}: {error.strerror}", err=True)
            raise typer.Exit(MISTAKE) from None


def _replay(config: Config, paths: list[Path]) -> Report:
    from service.ingest.records import read_record
    from service.monitoring.banks import Monitors

    monitors = Monitors(config.axes)
    report = Report(config, monitors)
    # All are opened before the first is run: a missing one is found at once.
    for record in [read_record(path, config) for path in paths]:
        with progress_bar(record.path.name) as progress:
            for step in record.steps():
                report.add(monitors.run(step.samples))
                progress(step.done)
        report.add_dropped(record)
    return report
