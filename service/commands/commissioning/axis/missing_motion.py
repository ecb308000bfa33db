"""A planned motion that would show what the records of an axis do not."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import OF_ANGLE
from monitor_core.identification import Obstacle, Record, top_speed
from service.commands.command_line.output_files import replace_text
from service.commands.commissioning.axis.axis_job import REFUSALS, AxisJob
from service.commands.commissioning.axis.planned_motion import MotionRequest, angle_columns, planned, torque_columns
from service.config.written.commissioned import Found
from service.config.written.commissioning_files import motion_file
from service.ingest.records.loaded_records import load
from service.reports.commissioning_report import Outcome, own_config
from service.reports.excitation_report import as_csv
from service.reports.identification_report import IdentificationReport
from service.reports.outlook_words import shaped_for

_OF_NYQUIST = 0.8
"""Upper end of the band if the samples are too slow for the usual one."""
_PHASES = 1
"""Seed for the phases of a planned motion, so that the same records give the same file."""


class SuggestedMotion(NamedTuple):
    """Settings for a planned motion that would show more of an axis."""

    lost: tuple[str, ...]
    """Parameters that the records do not determine"""
    request: MotionRequest
    """Parameters to determine, and the limits, taken from the records"""


def motion_for(report: IdentificationReport, records: Sequence[Record]) -> SuggestedMotion | None:
    """Plan that would show the missing parameters; None: nothing is missing, or nothing was identified."""
    result = report.result
    lost = tuple(w.name for w in result.watched if w.obstacle in (Obstacle.NOT_SHOWN, Obstacle.TOGETHER))
    if report.rejection or not lost:
        return None
    request = MotionRequest(
        torque=_three_digits(max(float(abs(record.u).max()) for record in records)),
        speed=_speed(records),
        angle=_angle_limit(records),
        find=tuple(name for name in lost if shaped_for(name, result)),
    )
    if not set(OF_ANGLE).isdisjoint(result.estimate.drive.inputs):
        request = request._replace(command="angle")  # a torque alone does not keep a weight in its place
    most_hz = _OF_NYQUIST * 0.5 / result.estimate.interval_s
    if most_hz < request.band_hz[1]:
        request = request._replace(band_hz=(0.0, _three_digits(most_hz)))
    return SuggestedMotion(lost, request)


def within_arm(motion: SuggestedMotion, job: AxisJob) -> SuggestedMotion:
    """The motion with the limits of the arm in the records, for an axis whose motor also moves with other axes.

    While the axis is moved alone, the motor moves as the arm does.

    Raises:
        RecordError: a record cannot be read.
    """
    config, axis = job.uncoupled().configured()
    records = [load(name, config, axis.id).record for name in job.records]
    return motion._replace(request=motion.request._replace(speed=_speed(records), angle=_angle_limit(records)))


def _speed(records: Sequence[Record]) -> float:
    return _three_digits(top_speed(records))


def _angle_limit(records: Sequence[Record]) -> float:
    return _three_digits(max(float(np.ptp(_angle(record))) / 2 for record in records))


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _angle(record: Record) -> Floats:
    """Angle of a record; for a speed, its integral."""
    t, y = record.t[record.measured], record.y[record.measured]
    if record.quantity == "angle":
        return y
    return np.asarray(np.concatenate([[0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2)]))


def with_motion(job: AxisJob, outcome: Outcome, motion: SuggestedMotion) -> Outcome:
    """Add a file with a motion of the axis that shows what its records do not.

    ``job``: with the configuration with which its nominal values were identified.
    """
    name, file = job.axis_id, motion_file(job.axis_id)
    assert outcome.nominal_file is not None
    found = outcome.found or Found(outcome.nominal_file, None, motion.lost)
    own = job.corrected(outcome.corrections).alone(found)
    if outcome.found is None:  # no part of what is commissioned, but a motion is planned with its values
        replace_text(job.folder / own_config(name), own.text)
    outcome = replace(outcome, lost=motion.lost, excite=motion.request.options)
    path = job.folder / file
    path.parent.mkdir(exist_ok=True)
    try:
        _, axis = own.configured()
        experiment = planned(axis, motion.request, np.random.default_rng(_PHASES))
    except REFUSALS as error:
        return replace(outcome, notes=(*outcome.notes, f"No motion could be planned for it: {error}."))
    replace_text(path, as_csv(experiment, torque_columns(axis), angle_columns(axis)))
    seconds = experiment.task.schedule.samples * experiment.task.plant.interval_s
    return replace(outcome, motion=file, motion_s=seconds)
