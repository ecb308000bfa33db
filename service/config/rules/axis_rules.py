"""Cross-checks of an axis: measured quantities, times, predictor, estimator, names of alarms, CANopen drive."""

import math
from collections.abc import Iterator

from monitor_core.detection import INERTIA as PAYLOAD_INERTIA
from monitor_core.drive import DELAY, LOAD, OF_ANGLE
from monitor_core.monitoring import MIN_MEMORY_SAMPLES, reopen_s
from monitor_core.wording import did_you_mean
from service.config.axis_settings import step_noise
from service.config.drives import not_identified, watched_values
from service.config.problems import CheckFinding
from service.config.rules.model_rules import usable_drive
from service.config.schema import AxisConfig, RobotConfig
from service.config.toml_lines import Keys
from service.texts.alarm_words import SENSORS

_NEARLY = 1e-3
"""Tolerance of a whole number of turns: the accuracy with which a user may have written 2 pi."""


def motion(axis: AxisConfig) -> Iterator[CheckFinding]:
    """An axis has either an angle or a speed."""
    if axis.angle is not None and axis.speed is not None:
        message = "give angle or speed, not both: the angle gives better estimates, unless its resolution is coarse"
        yield CheckFinding(("speed",), message)
    if axis.angle is None and axis.speed is None:
        yield CheckFinding(("angle",), "missing: an axis needs a table angle (motor angle) or speed (motor speed)")


def defaults_without_name(robot: RobotConfig) -> Iterator[CheckFinding]:
    """The defaults of a robot must not contain a name."""
    if "name" in robot.defaults:
        yield CheckFinding(("defaults", "name"), "remove this: each axis has a name of its own")


def torque_constant(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The torque constant is not zero."""
    if axis.torque.kT_Nm_per_A == 0:
        yield CheckFinding(("torque", "kT_Nm_per_A"), "must not be 0: no current would make a torque")


def times(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Torque delay, pairing tolerance and longest gap fit the sample interval."""
    h = axis.sample_interval_s
    if axis.torque_delay_s > h:
        yield CheckFinding(("torque_delay_s",), f"must be at most sample_interval_s = {h}")
    if axis.pairing_tolerance_s >= h / 2:
        message = f"must be below half of sample_interval_s = {h}: values of different samples would pair"
        yield CheckFinding(("pairing_tolerance_s",), message)
    if axis.max_gap_s < h:
        message = f"must be at least sample_interval_s = {h}: every interval would be a gap"
        yield CheckFinding(("max_gap_s",), message)


def clock(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Message and signal of the counter are both given; a cyclic clock needs frames of a bus, and no counter."""
    if axis.time.counter_message is not None and axis.time.counter_signal is None:
        yield CheckFinding(("time", "counter_signal"), "missing: it is needed with counter_message")
    if axis.time.counter_signal is not None and axis.time.counter_message is None:
        yield CheckFinding(("time", "counter_signal"), "is on a bus, but angle or speed is not: give counter_message")
    if axis.time.clock == "cyclic" and axis.time.counter_signal is not None:
        message = "the counter gives the times: remove this, or"
        yield CheckFinding(("time", "clock"), message, ("time", "counter_signal"))
    elif axis.time.clock == "cyclic" and axis.records_only:
        message = (
            "is the clock of frames on a bus; the rows of a table have the times of time.column, or are"
            " sample_interval_s apart without it: remove this, and where the times scatter but the rows are regular,"
            " time.column, too"
        )
        yield CheckFinding(("time", "clock"), message)


def wrapping_under_gravity(axis: AxisConfig) -> Iterator[CheckFinding]:
    """If gravity acts, an angle that wraps must still determine the position of the arm."""
    if axis.angle is None or axis.angle.wrap_period is None:
        return
    drive = usable_drive(axis)
    try:
        ratio = drive.matrix("ratio", drive.complete(watched_values(axis)))[:, 0].tolist()
    except (KeyError, ValueError):  # a value is missing; another check reports that
        return
    period = abs(axis.angle.factor) * axis.angle.wrap_period
    for r, kind in zip(ratio, drive.inputs, strict=True):
        turns = period * abs(r) / (2 * math.pi)
        if kind in OF_ANGLE and (round(turns) == 0 or abs(turns - round(turns)) > _NEARLY):
            message = (
                f"gravity depends on the position of the arm, and the angle wraps after {turns:.3g} of its turns:"
                " send an angle that does not wrap"
            )
            yield CheckFinding(("angle", "wrap_period"), message)
            return


def predictor(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The predictor fits the measured quantity."""
    if (found := axis.model.nominal_file) is not None:
        if found.predictor.kind == "output-error" and axis.output == "angle":
            message = "found by output error, which diverges with the angle: identify it with innovations"
            yield CheckFinding(("model", "nominal_file"), message)
    elif axis.estimator.predictor == "output-error" and axis.output == "angle":
        message = 'needs speed; from the angle without a gain it diverges: use "innovations"'
        yield CheckFinding(("estimator", "predictor"), message)


def noises(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The noises are given from which the filter gain and lambda_0 are computed."""
    e = axis.estimator
    if axis.model.nominal_file is not None or axis.records_only:
        return
    if axis.to_be_identified and usable_drive(axis) and not_identified(axis):
        return
    output_noise = e.output_noise or step_noise(axis)
    if e.predictor == "output-error":
        if e.innovation_variance is None and output_noise is None:
            yield CheckFinding(("estimator", "output_noise"), "missing: give output_noise or innovation_variance")
        return
    for name, value in (("torque_noise", e.torque_noise), ("output_noise", output_noise)):
        if value is None:
            message = "missing: the filter gain needs torque_noise and output_noise"
            yield CheckFinding(("estimator", name), message)


def memory(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The memory has enough samples."""
    memory_s, least = axis.estimator.memory_s, MIN_MEMORY_SAMPLES * axis.sample_interval_s
    if memory_s is not None and memory_s < least:
        message = f"must be at least {MIN_MEMORY_SAMPLES} sample intervals, {least:g} s"
        yield CheckFinding(("estimator", "memory_s"), message)


def initial_p(axis: AxisConfig) -> Iterator[CheckFinding]:
    """P(0) is given for all monitored parameters or for none."""
    given = axis.estimator.initial_p
    for name in axis.model.monitor:
        if given and name not in given:
            yield CheckFinding(("estimator", "initial_p", name), "missing: give all monitored parameters, or none")


def alarm_names(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Alarm settings name monitored parameters, sensor faults, or the causes that indicate another payload."""
    known = [*dict.fromkeys([*axis.model.monitor, *SENSORS, DELAY, LOAD, PAYLOAD_INERTIA])]
    given: list[tuple[Keys, str]] = [(("priorities", name), name) for name in axis.alarms.priorities]
    for key in ("latched", "suppressed"):
        given += [((key, i), name) for i, name in enumerate(getattr(axis.alarms, key))]
    for place, name in given:
        if name not in known:
            yield CheckFinding(("alarms", *place), f"no alarm has this name: {did_you_mean(name, known)}")


def off_delay(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The off-delay is short enough that an alarm whose cause returns within it is reopened."""
    most_s = reopen_s(axis.memory_s)
    if (axis.alarms.off_delay_s or 0.0) > most_s:
        message = f"must be at most {most_s:g} s: what is back later is another alarm"
        yield CheckFinding(("alarms", "off_delay_s"), message)


def allowance_of_models(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The multi-model detector waits beyond the heat of the records, so the axis would not be tested there."""
    detector = axis.detector
    if detector.alarm_source == "multimodel" and detector.outside_calibration == "widen":
        message = 'is not for alarm_source = "multimodel", whose allowance is fixed: remove one of the two'
        yield CheckFinding(("detector", "outside_calibration"), message)


# --- A CANopen drive: the values that determine its units are given, not guessed --------------------------------------


def torque_of_drive(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Either the rated torque, or the rated current and the torque constant, are given."""
    drive, kT = axis.canopen, axis.torque.kT_Nm_per_A
    if drive is None:
        return
    if drive.rated_torque_Nm is None and drive.rated_current_A is None:
        yield CheckFinding(
            ("canopen", "rated_torque_Nm"),
            "missing: object 0x6077 is in thousandths of the rated torque of the motor, which is not guessed: read"
            " object 0x6076 (mN m) with the tool of the drive, and compare the data sheet of the motor; or use the"
            " current, object 0x6078: give rated_current_A (object 0x6075, mA) and torque.kT_Nm_per_A",
        )
    if drive.rated_torque_Nm is not None and drive.rated_current_A is not None:
        yield CheckFinding(("canopen", "rated_current_A"), "give the rated torque or the rated current, not both")
    elif drive.rated_current_A is not None and kT is None:
        yield CheckFinding(
            ("torque", "kT_Nm_per_A"),
            "missing: the current, object 0x6078, makes no torque without torque = { kT_Nm_per_A = ... }, the torque"
            " constant of the motor (data sheet) [N m/A]",
        )
    elif drive.rated_torque_Nm is not None and kT is not None:
        yield CheckFinding(("torque", "kT_Nm_per_A"), "object 0x6077 is a torque: remove this, or give rated_current_A")


def motion_of_drive(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The units of position and velocity are given."""
    drive = axis.canopen
    if drive is None:
        return
    if drive.motion == "speed" and drive.speed_unit is None:
        yield CheckFinding(
            ("canopen", "speed_unit"),
            'missing: object 0x606C is in a unit of the drive: "counts/s" or "rpm"; see the manual of the drive; of'
            " another unit give speed = { factor = ... }, too, which makes it rad/s of the motor",
        )
    counts = drive.motion == "angle" or drive.speed_unit == "counts/s"
    if counts and drive.counts_per_turn is None:
        yield CheckFinding(
            ("canopen", "counts_per_turn"),
            "missing: the position is in counts: see the data sheet of the encoder, or object 0x608F; 360000 if the"
            " drive converts to thousandths of a degree",
        )
    if drive.side == "arm" and drive.motor_turns is None:
        yield CheckFinding(
            ("canopen", "motor_turns"),
            'missing: with side = "arm" it tells how often the motor turns for one turn of the arm (data sheet of the'
            " gear)",
        )


AXIS_RULES = (
    motion,
    torque_constant,
    times,
    clock,
    wrapping_under_gravity,
    predictor,
    noises,
    memory,
    initial_p,
    alarm_names,
    off_delay,
    allowance_of_models,
    torque_of_drive,
    motion_of_drive,
)
