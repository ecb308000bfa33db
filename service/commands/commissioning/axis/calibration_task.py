"""Calibrates a configured axis from its record files with ``monitor_core.calibrate``."""

from collections.abc import Sequence

from monitor_core.calibration import CalibrationOptions, CalibrationProgress
from monitor_core.calibration import calibrate as find_thresholds
from monitor_core.detection import DetectorName
from monitor_core.drive import friction_of
from monitor_core.monitoring import pose_maps, ranges
from service.commands.command_line.options import axis_named, starting_as
from service.commands.command_line.progress import Background
from service.config import Config, NamedAxis, conditions_of
from service.config.axis_detectors import alarm_source_of
from service.config.axis_settings import axis_settings, monitored_model
from service.ingest.records.loaded_records import begins_cold, load_samples
from service.ingest.records.record_ranges import wanted
from service.ingest.records.recorded_units import units_as_recorded
from service.reports.calibration_report import Calibration, new_poses, one_sided, warnings
from service.reports.formats import Provenance


def as_identified(config: Config, axis: NamedAxis, records: Sequence[str]) -> tuple[Config, NamedAxis]:
    """The configuration and the axis; with a cold start if its identification assumed one for the same records."""
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
