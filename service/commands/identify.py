"""``axiswatch identify``: nominal values of an axis from records of it, with a report."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from service.commands.command_line.exit_codes import MISTAKE, explained
from service.commands.command_line.freed_memory import return_freed_memory
from service.commands.command_line.options import (
    AxisName,
    ConfigPath,
    Force,
    JsonFile,
    RecordRanges,
    ReportFile,
    axis_named,
    configuration,
    names_in,
)
from service.commands.command_line.output_files import ResultFiles
from service.commands.command_line.progress import steps_bar

Free = Annotated[
    list[str] | None,
    typer.Option(
        "--free",
        metavar="NAMES",
        help='Estimate only these parameters, "Jm,fm,1/Ja". Default: all that can be identified with kT and r held.',
    ),
]
Fix = Annotated[
    list[str] | None,
    typer.Option("--fix", metavar="NAMES", help="Hold these at their nominal values, in addition to kT and r."),
]
PredictorOption = Annotated[
    Literal["innovations", "output-error"] | None,
    typer.Option("--predictor", help="How the motion is predicted. Default: as configured."),
]
Varying = Annotated[
    list[str] | None,
    typer.Option(
        "--schedule",
        metavar="NAME:SIGNALS",
        help='This parameter follows signals of [[robot.axis.signal]]: "fm: temperature"; "tau0: cos(angle2),'
        ' cos(angle2 + angle3)". Of a signal or a sum there are cos, sin and square; * multiplies. Default: as'
        " configured, and as in the nominal file that the configuration names.",
    ),
]
Validate = Annotated[
    list[str] | None,
    typer.Option("--validate", metavar="RECORD", help="Also predict this record, which is not fitted."),
]
Delay = Annotated[bool, typer.Option("--delay", help="Also estimate the delay of the torque.")]
Slow = Annotated[
    float | None,
    typer.Option(
        "--disturbance",
        metavar="SECONDS",
        min=1e-3,
        help="Model a slow disturbance of the torque with this time constant, as one more state.",
    ),
]
Robust = Annotated[bool, typer.Option("--robust", help="Give outliers less weight (Huber's loss).")]
StartOption = Annotated[
    Literal["search", "values", "records"] | None,
    typer.Option(
        "--start",
        help="Where the fit starts. search: at the configured values, and where a search around them ends; values: at"
        " the configured values only (fast); records: at values found from the records alone. Default: search; records"
        " where the configuration has no values.",
    ),
]
MassesOption = Annotated[
    str | None,
    typer.Option(
        "--masses",
        metavar="auto|N",
        help="Also report how many masses the records need: chains of up to five (auto) or N masses are compared.",
    ),
]
Thermal = Annotated[
    Literal["cold", "unknown", "off"] | None,
    typer.Option(
        "--thermal",
        help="How warm the axis is at the beginning of the first record. Records of more than three minutes of motion"
        " are searched for friction that falls as the axis warms up; off: they are not. Default: cold; off where"
        " friction follows a signal by --schedule.",
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File for the nominal values.")]


def identify(
    config: ConfigPath,
    records: RecordRanges,
    axis: AxisName = None,
    free: Free = None,
    fix: Fix = None,
    predictor: PredictorOption = None,
    varying: Varying = None,
    validate: Validate = None,
    delay: Delay = False,
    disturbance: Slow = None,
    robust: Robust = False,
    start: StartOption = None,
    masses: MassesOption = None,
    thermal: Thermal = None,
    output: Output = Path("nominal.toml"),
    report: ReportFile = None,
    json: JsonFile = None,
    force: Force = False,
) -> None:
    """Identify the nominal values of an axis from records of its healthy state.

    Writes nominal.toml, which the configuration of the daemon refers to, and report.html. The first line of the report
    says what can be watched with these values, the second one how good the fit is. With a poor fit, or one that does
    not converge, no nominal values are written, and the exit code is 2; --force writes those of a poor fit.
    """
    return_freed_memory()
    files = ResultFiles.chosen(output, report, json)
    files.check(force, "nominal values")
    read = configuration(config, without_bus=True)
    chosen = axis_named(read.axes, axis)
    with explained():
        from service.commands.commissioning.axis.identification_task import (
            Request,
            configured_schedule,
            drawing_of,
            prepare,
        )
        from service.ingest.records.record_ranges import in_order_of_time
        from service.reports.formats import Provenance
        from service.reports.identification_files import as_json, as_toml
        from service.reports.identification_html import as_html
        from service.reports.identification_tables import print_text

        request = Request(
            free=names_in(",".join(free or ())),
            fix=names_in(",".join(fix or ())),
            predictor=predictor,
            delay=delay,
            disturbance_s=disturbance,
            robust=robust,
            start=start,
            schedule=tuple(varying or ()) or configured_schedule(chosen.config),
            masses=_masses(masses),
            thermal=thermal,
        )
        task = prepare(read, chosen, in_order_of_time(records, read), validate or [], request)
        with steps_bar(chosen.id) as progress:
            result = task.run(Provenance.now(drawing_of(chosen.config)), progress)
    refused = bool(result.rejection) and not (force and result.is_poor)
    values = None if refused else as_toml(result)
    files.write(values, as_html(result), partial(as_json, result), partial(print_text, result))
    if refused:
        way = "; --force writes them anyway" if result.is_poor else ""
        print(f"axiswatch: no nominal values: {result.rejection}{way}", file=sys.stderr)
        raise typer.Exit(MISTAKE)


def _masses(text: str | None) -> int | None:
    """Largest number of masses."""
    from monitor_core.identification import MOST_MASSES, USUAL_MASSES

    if text is None:
        return None
    if text == "auto":
        return USUAL_MASSES
    if not (text.isdecimal() and 1 <= int(text) <= MOST_MASSES):
        raise typer.BadParameter(f"{text}: write auto, or 1 to {MOST_MASSES}", param_hint="--masses")
    return int(text)
