"""``axiswatch calibrate``: thresholds from healthy records and a false-alarm budget, and the detected changes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from monitor_core.wording import seconds_in
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.freed_memory import return_freed_memory
from service.commands.command_line.options import (
    AxisName,
    ConfigPath,
    Force,
    JsonFile,
    RecordRanges,
    ReportFile,
    ThermalStartOption,
    axis_named,
    configuration,
    starting_as,
)
from service.commands.command_line.output_files import ResultFiles
from service.commands.command_line.progress import steps_bar

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
        help="Find changes within this time, as small ones as possible. Default: ten memory lengths.",
    ),
]
Sizes = Annotated[str, typer.Option("--sizes", metavar="PERCENT,..", help="Changes to try, upwards and downwards.")]
Onsets = Annotated[
    int,
    typer.Option("--onsets", min=1, max=1000, help="Number of places of the record at which each change begins."),
]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File for the thresholds.")]


def calibrate(
    config: ConfigPath,
    records: RecordRanges,
    axis: AxisName = None,
    budget: Budget = "1y",
    within: Within = None,
    sizes: Sizes = "5,10,20,30,50",
    onsets: Onsets = 100,
    thermal: ThermalStartOption = None,
    output: Output = Path("thresholds.toml"),
    report: ReportFile = None,
    json: JsonFile = None,
    force: Force = False,
) -> None:
    """Find thresholds that keep a false-alarm budget, from records of the healthy axis, and what they will detect.

    Writes thresholds.toml, which the configuration names as thresholds_file, and report.html: which changes of each
    parameter are found how soon, and under which name. Records that are too short for the budget, in which the axis
    does not move, or in which something changes, are refused with the place.
    """
    return_freed_memory()
    files = ResultFiles.chosen(output, report, json)
    files.check(force, "thresholds")
    budget_s, tried = seconds_of(budget), _sizes(sizes)  # before anything is read
    read = starting_as(configuration(config, without_bus=True, thresholds=False), thermal)
    chosen = axis_named(read.axes, axis)
    with explained():
        from monitor_core.calibration import CalibrationOptions
        from service.commands.commissioning.axis.calibration_task import as_identified, calibrate_axis
        from service.ingest.records.record_ranges import in_order_of_time
        from service.reports.calibration_files import as_html, as_json, as_toml
        from service.reports.calibration_report import print_text
        from service.reports.formats import Provenance

        records = in_order_of_time(records, read)
        if thermal is None:
            read, chosen = as_identified(read, chosen, records)
        options = CalibrationOptions(budget_s, within, tried, onsets)
        with steps_bar(chosen.id) as progress:
            found = calibrate_axis(read, chosen, records, options, Provenance.now(), progress)
    files.write(as_toml(found), as_html(found), partial(as_json, found), partial(print_text, found))


def seconds_of(text: str) -> float:
    """A time such as 10min, 1h, 30d, 1y, "2 hours", or seconds."""
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
