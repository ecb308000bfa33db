"""Prepares the arguments of ``monitor_core.identify`` from a configured axis and its record files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

from monitor_core.drive import (
    COULOMB,
    HEAT,
    LOAD,
    AxisModel,
    Drive,
    ThermalStart,
    friction_of,
    split_name,
)
from monitor_core.identification import (
    Disturbance,
    IdentificationError,
    IdentificationOptions,
    IdentificationProgress,
    ParameterSelection,
    PredictorKind,
    Problem,
    Record,
    ScheduledTerms,
    Start,
    identify,
    known_axis,
    scheduled_terms,
    select_parameters,
    speed_scales,
    torque_time,
    with_schedule,
)
from service.commands.commissioning.axis.identification_records import IdentificationRecords, load_records
from service.commands.commissioning.signals.torque_times import torque_time_doubts
from service.config import AxisConfig, Config, NamedAxis, given_values, predictor_of, scales_of
from service.config.conditions import schedules_of, term_of
from service.config.drive_sources import model_of_axis
from service.config.drives import lacking_for, watches_load
from service.config.schema.base_table import SUFFIX
from service.ingest.records.recorded_units import units_as_recorded
from service.reports.formats import Provenance
from service.reports.identification_report import IdentificationReport
from service.reports.temperature_words import temperature_remarks

_SLOW = 0.1
"""Initial level of the slow disturbance, as a share of the torque's standard deviation."""


@dataclass(frozen=True)
class Request:
    """What the user requests in addition to the configuration of the axis."""

    free: tuple[str, ...] = ()
    """Names of the parameters to estimate; empty: all that are identifiable"""
    fix: tuple[str, ...] = ()
    """Names of the parameters that keep their values"""
    predictor: PredictorKind | None = None
    """None: as configured"""
    delay: bool = False
    """Estimate the skew between torque and motion, too"""
    disturbance_s: float | None = None
    """Time constant of a slow torque disturbance [s]; None: no disturbance"""
    robust: bool = False
    """Give outliers less weight"""
    start: Start | None = None
    """Where the fit starts; None: "search" if nominal values are known, else "records"."""
    schedule: tuple[str, ...] = ()
    """Parameters that follow signals: "fm: temperature"."""
    masses: int | None = None
    """Compare chains of up to this number of masses; None: do not"""
    thermal: Literal["cold", "unknown", "off"] | None = None
    """State at the start of the first record, if friction may follow an unmeasured temperature; "off": it does not;
    None: cold, or off if friction follows a signal"""
    memories_s: tuple[float, ...] = ()
    """Memories of the monitor [s] to choose from, in ascending order; empty: that of the configuration"""


@dataclass(frozen=True)
class IdentificationTask:
    """A checked problem with its records."""

    axis: NamedAxis
    problem: Problem
    records: IdentificationRecords
    warnings: tuple[str, ...]
    options: IdentificationOptions

    def with_most_moving_parts(self) -> IdentificationTask:
        """The same problem with only that part of long records that shows whether a drive model fits at all."""
        return replace(self, records=self.records.with_most_moving_parts(), options=replace(self.options, thermal=None))

    def run(self, provenance: Provenance, progress: IdentificationProgress | None = None) -> IdentificationReport:
        """Identify the axis.

        Raises:
            IdentificationError: as ``identify``.
        """
        fitted, reserved = self.records
        validation = [item.record for item in reserved]
        result = identify(self.problem, self.records.fitted, validation, self.options, progress)
        return IdentificationReport(
            self.axis.id,
            result,
            tuple(item.source for item in fitted),
            tuple(item.source for item in reserved),
            (*self.warnings, *temperature_remarks(self.axis.config, result)),
            provenance,
            tuple(sorted(self.axis.config.coupling.values())),
        )


def prepare(
    config: Config, axis: NamedAxis, records: Sequence[str], validation: Sequence[str], request: Request
) -> IdentificationTask:
    """Read and check the records of an axis, and state the problem.

    ``records``: files to fit the drive to, each with or without a range; those of ``validation`` are only predicted.

    Raises:
        IdentificationError: an unknown name, parameters that cannot be distinguished, a record that is refused.
        ModelError: the axis has no drive.
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    parameters = _parameters(axis, request)
    drive, nominal, unknown, schedule, selection = parameters
    start = _start(unknown, selection, request.start)
    loaded = load_records(config, axis.id, records, validation)
    speed_scale, *more_scales = _speed_scales(axis.config, drive, nominal, loaded.fitted)
    known = known_axis(drive, nominal, len(selection.free), speed_scale, unknown)
    warnings = [*loaded.warnings(known, axis.config.sample_interval_s)]
    warnings += units_as_recorded(config, axis, loaded.estimation[0].source.path)
    warnings += torque_time_doubts(axis.config, torque_time(loaded.fitted))
    used, cut_words = loaded.without_gaps(known)
    warnings += cut_words
    scheduled = scheduled_terms(schedule, used.fitted)
    used = used.with_terms(scheduled)
    problem = _problem(axis, parameters, used, request, speed_scale)
    if problem.predictor == "output-error" and drive.output == "angle":
        warnings.append("With the angle, output error diverges: these values are not for the daemon.")
    load_too = watches_load(axis.config)
    options = IdentificationOptions(
        start=start,
        monitored=tuple(name for name in axis.config.model.monitor if name != LOAD or not load_too),
        load=load_too,
        interval_mean=axis.config.interval_mean,
        max_masses=request.masses,
        held=selection.held,
        unknown=unknown,
        scheduled=scheduled,
        memory_s=axis.config.memory_s,
        memories_s=request.memories_s,
        sizes=scales_of(axis.config),
        speed_scales=tuple(more_scales),
        thermal=_thermal_start(request, axis.config, drive, schedule),
        begins_s=tuple(item.source.begins_s for item in used.estimation),
        cut_at_gaps=False,  # done above
    )
    return IdentificationTask(axis, problem, used, tuple(warnings), options)


def drawing_of(axis: AxisConfig) -> tuple[str, str] | None:
    """Name and sha256 of the Modelica file of an axis; None: its drive comes from the library."""
    if not axis.model.drive.endswith(SUFFIX):
        return None
    path = Path(axis.model.drive)
    return path.name, hashlib.sha256(path.read_bytes()).hexdigest()


# --- the parameters, and values to start from ------------------------------------------------------------


class _Parameters(NamedTuple):
    """A drive before its identification, and what is to be found of it."""

    drive: Drive
    nominal: Mapping[str, float]
    """Values of all parameters; those without one have placeholders"""
    unknown: tuple[str, ...]
    """Parameters without a value"""
    schedule: ScheduledTerms
    selection: ParameterSelection


def _parameters(axis: NamedAxis, request: Request) -> _Parameters:
    space, drive, *_ = model_of_axis(axis.config)
    nominal, unknown = known_values(axis, drive)
    schedule = read_schedule(request.schedule, axis.config)
    selection = select_parameters(space, drive, nominal, request.free, request.fix)
    return _Parameters(drive, nominal, unknown, schedule, with_schedule(selection, schedule, request.free))


def known_values(axis: NamedAxis, drive: Drive) -> tuple[Mapping[str, float], tuple[str, ...]]:
    """Values of all parameters from the configuration or the file that it names, and the parameters without a value.

    Those without a value get placeholders.
    """
    names = {p.name for p in (*drive.parameters, *drive.drawn)}
    values = {name: value for name, value in given_values(axis.config).items() if name in names}
    unknown = tuple(p.name for p in drive.parameters if any(lacking_for(drive, p.name, values)))
    placeholders = {name: 1.0 if drive.parameter(name).positive else 0.0 for name in unknown}
    return AxisModel(drive, {**values, **placeholders}, ()).nominal, unknown


def _start(unknown: Sequence[str], selection: ParameterSelection, requested: Start | None) -> Start:
    free = {split_name(name)[0] for name in selection.free}
    if held := [name for name in unknown if name not in free]:
        raise IdentificationError(
            f"no value of {', '.join(held)}, to be held: give it in [robot.axis.model.nominal], or free it with --free"
        )
    if unknown and requested in ("values", "search"):
        raise IdentificationError(
            f"--start {requested} needs a value of {', '.join(unknown)}: give it in [robot.axis.model.nominal],"
            " or let --start records find it"
        )
    return requested or ("records" if unknown else "search")


# --- parameters that follow signals -----------------------------------------------------------------------


def configured_schedule(axis: AxisConfig) -> tuple[str, ...]:
    """The schedules of the configuration and of its nominal file, as a user writes them; not those of the heat."""
    return tuple(f"{v.parameter}: {v.signal}" for _, v in schedules_of(axis) if v.signal != HEAT)


def read_schedule(texts: Sequence[str], axis: AxisConfig) -> ScheduledTerms:
    """Parse a schedule as the user writes it: "fm: temperature", "Ja: payload, cos(angle2)".

    Raises:
        IdentificationError: the text has another form, or there is no such signal or function.
    """
    schedule = dict[str, tuple[str, ...]]()
    for text in texts:
        parameter, colon, terms = (part.strip() for part in text.partition(":"))
        if not (parameter and colon and terms):
            raise IdentificationError(
                f'--schedule "{text}": write PARAMETER: SIGNAL, as "fm: temperature" or'
                ' "tau0: cos(angle2), cos(angle2 + angle3)"'
            )
        for term in terms.split(","):
            try:
                name = str(term_of(term.strip(), [signal.name for signal in axis.signal]))
            except ValueError as error:
                raise IdentificationError(str(error)) from None
            if name in schedule.get(parameter, ()):
                raise IdentificationError(f"{parameter} follows {name} twice")
            schedule[parameter] = (*schedule.get(parameter, ()), name)
    return schedule


def _thermal_start(request: Request, axis: AxisConfig, drive: Drive, schedule: ScheduledTerms) -> ThermalStart | None:
    """Thermal state at the start of the first record; None: no parameter depends on heat."""
    named = any(signal.name == HEAT for signal in axis.signal)
    if request.thermal is None:
        measured = any(name in schedule for names in friction_of(drive) for name in names)
        return None if measured or named else "cold"
    if request.thermal == "off":
        return None
    if named:
        raise IdentificationError(
            f"--thermal {request.thermal}: a signal of the configuration is called {HEAT}, the name of the heat that"
            " friction follows: give the signal another name"
        )
    return request.thermal


# --- the problem ------------------------------------------------------------------------------------------


def _problem(
    axis: NamedAxis, parameters: _Parameters, used: IdentificationRecords, request: Request, speed_scale: float
) -> Problem:
    predictor = predictor_of(axis.config)
    kind = request.predictor or predictor.kind
    try:
        return Problem(
            parameters.drive, parameters.nominal, parameters.selection.free, kind,
            speed_scale=speed_scale, delay_s=predictor.torque_delay_s, free_delay=request.delay,
            disturbance=_disturbance(kind, used.fitted, request.disturbance_s),
            loss="huber" if request.robust else "squares", varying=parameters.schedule,
            interval_s=used.interval_s(axis.config.sample_interval_s),
            min_speed=axis.config.min_speed or 0.0,
        )  # fmt: skip
    except ValueError as error:
        raise IdentificationError(str(error)) from None


def _speed_scales(
    axis: AxisConfig, drive: Drive, nominal: Mapping[str, float], records: Sequence[Record]
) -> tuple[float, ...]:
    """Speed scales of Coulomb friction: the configured one, or those to try."""
    given = axis.model.nominal_file is not None or "friction_speed_scale" in axis.model.model_fields_set
    if given or COULOMB not in drive.inputs:
        return (predictor_of(axis).friction_speed_scale,)
    ratio = abs(float(drive.matrix("ratio", nominal)[drive.inputs.index(COULOMB), 0]))
    return tuple(ratio * scale for scale in speed_scales(records))


def _disturbance(kind: PredictorKind, fitted: Sequence[Record], time_constant_s: float | None) -> Disturbance | None:
    """The slow disturbance of the torque; None: only white noise of unknown level."""
    if time_constant_s is None:
        return None
    if kind == "output-error":
        raise IdentificationError("output error has no gain, so no disturbance: leave out --disturbance")
    torque = max(float(record.u.std()) for record in fitted)
    return Disturbance(slow=_SLOW * torque, time_constant_s=time_constant_s)
