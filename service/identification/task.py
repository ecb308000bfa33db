"""What is to be identified: an axis, its drive, the values to start from, the records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from monitor_core.drive.structure import Drive
from monitor_core.identification.problem import Disturbance, Predictor, Problem
from monitor_core.identification.record_checks import Finding, Known, known_of, suspicions
from monitor_core.modeling.statespace import StateSpace
from service.config import Config, NamedAxis, predictor_of
from service.config import Predictor as Configured
from service.config.drive_sources import model_of_axis
from service.identification.errors import IdentificationError
from service.identification.initial_values import Nominal, Start, nominal_of, start_of
from service.identification.intervals import intervals
from service.identification.parameter_selection import Choice, choose
from service.identification.scheduling import Asked, Follows, asked, followed, with_varying
from service.ingest.identification_records import Loaded, load

_SLOW = 0.1
"""Where the level of the slow disturbance starts, as part of the torque's standard deviation."""


@dataclass(frozen=True)
class Wishes:
    """What the user says beside the axis.

    Args:
        free: names of parameters; empty: all that can be told.
        fix: names of those that stay.
        predictor: None: that of the configuration.
        delay: find the skew between torque and motion, too.
        disturbance_s: time constant of a slow torque disturbance; None: there is none.
        hold_noise: K follows from the noises of the configuration, which are not estimated.
        robust: outliers count less.
        start: where the fit starts: at the configured values; also where a search around them in the frequency
            response ends; or at what the records alone tell, without looking at the values.  None: "search" if there
            are values, else "records".
        varying: parameters that follow signals, "fm: temperature"; see ``service.identification.scheduling``.
        masses: compare rows of up to so many masses; None: do not.
    """

    free: tuple[str, ...] = ()
    fix: tuple[str, ...] = ()
    predictor: Predictor | None = None
    delay: bool = False
    disturbance_s: float | None = None
    hold_noise: bool = False
    robust: bool = False
    start: Start | None = None
    varying: tuple[str, ...] = ()
    masses: int | None = None


@dataclass(frozen=True)
class Task:
    """Everything that a fit needs, checked.

    ``unknown``: parameters whose nominal values in the problem stand for nothing, since there are none.  ``follows``:
    parameters that follow signals.
    """

    axis: NamedAxis
    space: StateSpace
    choice: Choice
    problem: Problem
    estimation: tuple[Loaded, ...]
    validation: tuple[Loaded, ...]
    warnings: tuple[str, ...]
    start: Start
    unknown: tuple[str, ...] = ()
    follows: tuple[Follows, ...] = ()
    masses: int | None = None

    @property
    def drive(self) -> Drive:
        """As it is drawn."""
        return self.problem.drive


def task_of(
    config: Config, axis: NamedAxis, records: Sequence[str], validation: Sequence[str], wishes: Wishes
) -> Task:
    """The task, all records read and looked at.

    Args:
        config: says where the axis is in the records.
        axis: of that configuration.
        records: files, each with a range or without, see ``service.ingest.identification_records``.
        validation: the same, for records that are only predicted.
        wishes: what the user wants.

    Raises:
        IdentificationError: a name that is not there, parameters that cannot be told, a record that is refused.
        ModelError: the axis has no drive.
        RecordError, DbcError, IngestError: a record cannot be read.
    """
    space, drive, *_ = model_of_axis(axis.config)
    nominal = nominal_of(axis, drive)
    varying = asked(wishes.varying, axis.config)
    choice = choose(space, drive, nominal.values, wishes.free, wishes.fix)
    choice = with_varying(choice, varying, wishes.free)
    start = start_of(nominal, choice, wishes.start)
    used, quarantined = ([load(text, config, axis.id) for text in texts] for texts in (records, validation))
    read = [one.record for one in (*used, *quarantined)]
    odd = tuple(intervals(read, axis.config.sample_interval_s))
    warnings = _looked_at([*used, *quarantined], _known(axis, drive, nominal, len(choice.free))) + odd
    follows, used, quarantined = followed(varying, used, quarantined)
    problem = _problem(axis, drive, nominal.values, choice, used, wishes, varying)
    if problem.predictor == "output-error" and drive.output == "angle":
        warnings += ("With the angle, output error diverges: these values are not for the daemon.",)
    return Task(
        axis,
        space,
        choice,
        problem,
        tuple(used),
        tuple(quarantined),
        warnings,
        start,
        nominal.unknown,
        follows,
        wishes.masses,
    )


def _known(axis: NamedAxis, drive: Drive, nominal: Nominal, parameters: int) -> Known:
    """What the records can be compared with."""
    speed_scale = predictor_of(axis.config).friction_speed_scale
    if nominal.unknown:
        return Known(parameters, speed_scale=speed_scale)
    return known_of(drive, nominal.values, parameters, speed_scale)


def _problem(
    axis: NamedAxis,
    drive: Drive,
    nominal: Mapping[str, float],
    choice: Choice,
    used: Sequence[Loaded],
    wishes: Wishes,
    varying: Asked,
) -> Problem:
    predictor = predictor_of(axis.config)
    configured: Predictor = "output-error" if predictor.kind == "output-error" else "innovations"
    kind = wishes.predictor or configured
    noise = _noise(kind, predictor, used, wishes)
    try:
        return Problem(
            drive, nominal, choice.free, kind,
            speed_scale=predictor.friction_speed_scale, delay_s=predictor.torque_delay_s, free_delay=wishes.delay,
            disturbance=noise, loss="huber" if wishes.robust else "squares", varying=varying,
        )  # fmt: skip
    except ValueError as error:
        raise IdentificationError(str(error)) from None


def _noise(
    kind: Predictor, configured: Configured, used: Sequence[Loaded], wishes: Wishes
) -> Disturbance | None:
    """What K follows from; None: white noise of unknown level.

    Raises:
        IdentificationError: output error, which has no K; no noises to hold.
    """
    if kind == "output-error" and (wishes.disturbance_s is not None or wishes.hold_noise):
        raise IdentificationError(
            "output error has no gain, so no noise: leave out --disturbance and --hold-noise"
        )
    given = Disturbance()
    if wishes.disturbance_s is not None:
        torque = max(float(one.record.u.std()) for one in used)
        given = Disturbance(slow=_SLOW * torque, time_constant_s=wishes.disturbance_s)
    if not wishes.hold_noise:
        return given if wishes.disturbance_s is not None else None
    if configured.torque_noise is None or configured.output_noise is None:
        raise IdentificationError("the configuration has no torque_noise and output_noise that could be held")
    return replace(given, torque=configured.torque_noise, output=configured.output_noise, free=("slow",))


def _looked_at(loaded: Sequence[Loaded], known: Known) -> tuple[str, ...]:
    """What is suspicious about the records.

    Raises:
        IdentificationError: one of them is refused.
    """
    found = [(one.record.name, finding) for one in loaded for finding in suspicions(one.record, known)]
    refused = [_said(name, finding) for name, finding in found if finding.severity == "refuse"]
    if refused:
        raise IdentificationError("refused: " + "\n".join(refused))
    return tuple(_said(name, finding) for name, finding in found)


def _said(name: str, finding: Finding) -> str:
    return f"{name}: {finding.sentence}."
