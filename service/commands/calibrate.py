"""``axiswatch calibrate``: thresholds from healthy records and a false-alarm budget, and the detected changes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from monitor_core.wording import seconds_in
from service.commands.exit_codes import explained
from service.commands.options import (
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
from service.commands.output_files import ResultFiles
from service.commands.progress import steps_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor_core.calibration import CalibrationOptions, CalibrationProgress
    from monitor_core.detection import DetectorName
    from service.config import Config, NamedAxis
    from service.reports.calibration_report import Calibration
    from service.reports.formats import Provenance

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
    files = ResultFiles.chosen(output, report, json)
    files.check(force, "thresholds")
    budget_s, tried = seconds_of(budget), _sizes(sizes)  # before anything is read
    read = starting_as(configuration(config, without_bus=True, thresholds=False), thermal)
    chosen = axis_named(read.axes, axis)
    with explained():
        from service.ingest.record_ranges import in_order_of_time

        records = in_order_of_time(records, read)
        if thermal is None:
            read, chosen = as_identified(read, chosen, records)
        from monitor_core.calibration import CalibrationOptions
        from service.reports.calibration_files import as_html, as_json, as_toml
        from service.reports.calibration_report import print_text
        from service.reports.formats import Provenance

        options = CalibrationOptions(budget_s, within, tried, onsets)
        with steps_bar(chosen.id) as progress:
            found = calibrate_axis(read, chosen, records, options, Provenance.now(), progress)
    files.write(as_toml(found), as_html(found), partial(as_json, found), partial(print_text, found))


def as_identified(config: Config, axis: NamedAxis, records: Sequence[str]) -> tuple[Config, NamedAxis]:
    """The configuration and the axis; with a cold start if its identification assumed one for the same records."""
    from service.ingest.loaded_records import begins_cold

    if not begins_cold(axis, records):
        return config, axis
    config = starting_as(config, "cold")
    return config, axis_named(config.axes, axis.id)


def calibrate_axis(
    config: Config,
    axis: NamedAxis,
    texts: Sequence[str],
    options: CalibrationOptions,
    provenance: Provenance,
    progress: CalibrationProgress = lambda _step, _done, _total: None,
) -> Calibration:
    """Read the records of a configured axis as the daemon would, and calibrate it on two cores.

    Raises:
        CalibrationError: these records yield no thresholds.
        AxisError: the axis cannot be monitored as configured.
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    from monitor_core.calibration import calibrate as find_thresholds
    from monitor_core.drive import friction_of
    from monitor_core.monitoring import pose_maps, ranges
    from service.commands.progress import Background
    from service.config import conditions_of
    from service.config.axis_detectors import alarm_source_of
    from service.config.axis_settings import axis_settings, monitored_model
    from service.ingest.loaded_records import load_samples
    from service.ingest.record_ranges import wanted
    from service.ingest.recorded_units import units_as_recorded
    from service.reports.calibration_report import Calibration, new_poses, one_sided, warnings

    model = monitored_model(axis)
    settings = axis_settings(axis, model)
    records, sources = load_samples(texts, config, axis, model, lambda part: progress("reading", part, 1.0))
    result = find_thresholds(model, settings, records, options, progress, Background)
    alarms: DetectorName = "cusum" if result.bank is None else alarm_source_of(axis.config, True)
    conditions = conditions_of(axis)
    friction = {name for names in friction_of(model.drive) for name in names}
    followed = {signal for s in conditions.schedules if s.name in friction for signal in s.term.signals}
    found = ranges(model.drive.output, settings, conditions.columns, records)
    poses = tuple(pose_maps(conditions.pose_angles, conditions.columns, records))
    units = units_as_recorded(config, axis, wanted(texts[0]).path)
    cautions = (*warnings(result), *one_sided(records, found, followed), *new_poses(poses), *units)
    return Calibration(axis, result, sources, cautions, provenance, alarms, tuple(found), poses)


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
