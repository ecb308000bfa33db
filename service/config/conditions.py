"""Operating conditions of an axis, from its configuration and its nominal file."""

import math
from collections.abc import Iterable, Iterator

from monitor_core.drive import (
    FUNCTIONS,
    HEAT,
    LOAD,
    Conditions,
    Fast,
    Gate,
    NominalSchedule,
    Term,
    ThermalModel,
    split_name,
)
from monitor_core.wording import did_you_mean
from service.config.drive_sources import model_of_axis
from service.config.schema import AxisConfig, FurtherSignalConfig, GateConfig, NamedAxis, ScheduleConfig
from service.config.schema.nominal_file import ScheduleTable
from service.config.toml_lines import Keys

Schedule = ScheduleTable | ScheduleConfig
"""A nominal value that follows a signal, from the nominal file or from the configuration"""


def schedules_of(axis: AxisConfig) -> tuple[tuple[Keys, Schedule], ...]:
    """All schedules of an axis with the keys where they are written, relative to the axis."""
    found = axis.model.nominal_file
    return (
        *((("model", "nominal_file"), v) for v in (found.schedule if found else ())),
        *((("model", "schedule", k), v) for k, v in enumerate(axis.model.schedule)),
    )


def nominal_schedule(schedule: Schedule) -> NominalSchedule:
    """The schedule as the core uses it.

    Raises:
        ValueError: the signal is no valid term.
    """
    v = schedule
    low, high = v.range or (-math.inf, math.inf)
    return NominalSchedule(v.parameter, Term.read(v.signal), v.slope, v.reference, low, high)


def weight_of(axis: AxisConfig) -> tuple[Schedule, ...]:
    """The schedules that describe the weight of arm and payload; all are of the same constant torque.

    The weight is an input of the drive, and a load in ``monitor`` multiplies it.  Empty: the weight is not known; or
    the torque is itself monitored, and follows its signals like any other parameter.
    """
    followed = _followed_torques(axis)
    monitored = {split_name(name)[0] for name in axis.model.monitor}
    if all(v.parameter not in monitored for v in followed):
        return followed
    return load_torques(axis) if LOAD in axis.model.monitor else ()


def load_torques(axis: AxisConfig) -> tuple[Schedule, ...]:
    """The schedules of one constant torque that are those of what the axis carries, as they depend on the pose."""
    return tuple(v for v in _followed_torques(axis) if _is_load(v))


def _followed_torques(axis: AxisConfig) -> tuple[Schedule, ...]:
    """The schedules of the first constant torque that has any."""
    offsets = model_of_axis(axis).drive.constant_torques()
    followed = [v for _, v in schedules_of(axis) if v.parameter in offsets]
    return tuple(v for v in followed if v.parameter == followed[0].parameter)


def _is_load(schedule: Schedule) -> bool:
    try:
        return Term.read(schedule.signal).is_load
    except ValueError:  # a cross-check reports that
        return False


def term_of(text: str, known: Iterable[str]) -> Term:
    """Parse a term of signals as the user writes it: temperature, cos(angle2 + angle3).

    Raises:
        ValueError: a signal or function does not exist.
    """
    term, names = Term.read(text), list(known)
    for function in term.functions:
        if function not in FUNCTIONS:
            raise ValueError(f"no function {function} of signals: {did_you_mean(function, FUNCTIONS)}")
    for signal in term.signals:
        if not names:
            raise ValueError(
                f"no signal {signal}: the configuration names none; add [[robot.axis.signal]] with"
                f' name = "{signal}" and its column'
            )
        if signal not in names:
            raise ValueError(
                f"no signal {signal}: {did_you_mean(signal, names)}; signals are [[robot.axis.signal]] of the"
                " configuration"
            )
    return term


def conditions_of(axis: NamedAxis) -> Conditions:
    """The operating conditions of an axis; the configuration must be valid."""
    weight = weight_of(axis.config)
    return Conditions(
        tuple(source.name for source in needed(axis)),
        tuple(_within(nominal_schedule(v), axis.config) for _, v in schedules_of(axis.config) if v not in weight),
        gates_of(axis.config),
        min_speed_of(axis.config),
        thermal_of(axis.config),
        tuple(map(nominal_schedule, weight)),
        _arm_angles(axis),
    )


def gates_of(axis: AxisConfig) -> tuple[Gate, ...]:
    """The gates of an axis as configured."""
    return tuple(_gate(gate) for gate in axis.gate)


def min_speed_of(axis: AxisConfig) -> float:
    """Speed below which estimates are not updated [rad/s at the sensor]: as configured, or from the nominal file."""
    found = axis.model.nominal_file
    identified = 0.0 if found is None else found.predictor.min_speed
    return identified if axis.min_speed is None else axis.min_speed


def _within(follow: NominalSchedule, axis: AxisConfig) -> NominalSchedule:
    """Let a parameter follow the heat also beyond the range of the records, if so configured.

    The heat of a colder or warmer hall is there all day.  So it is followed unless the axis is to wait, or the
    multi-model detector raises its alarms, whose allowance is fixed.
    """
    outside = axis.detector.outside_calibration
    follows_hall = has_ambient_heat(axis) and outside == "report" and axis.detector.alarm_source != "multimodel"
    if follow.term.signals == (HEAT,) and (outside == "widen" or follows_hall):
        return follow._replace(margin=math.inf)
    return follow


def thermal_of(axis: AxisConfig) -> ThermalModel | None:
    """The thermal model of an axis; None: no parameter follows its heat."""
    found = axis.model.nominal_file
    table = None if found is None else found.thermal
    if table is None or all(HEAT not in Term.read(v.signal).signals for _, v in schedules_of(axis)):
        return None
    friction, slopes = (table.viscous_friction, table.coulomb_friction), dict[str, float]()
    for _, v in schedules_of(axis):
        if v.signal == HEAT:
            slopes[v.parameter] = v.slope
    # Error of the friction, expressed as an error of the heat.
    errors = [table.model_error.get(name, 0.0) / abs(s) for name, s in slopes.items() if s]
    return ThermalModel(
        table.time_constant_s,
        *friction,
        table.largest_w,
        axis.thermal.start,
        axis.thermal.unwatched,
        max(errors, default=0.0),
        None if table.fast_time_constant_s is None else Fast(table.fast_time_constant_s, table.fast_share),
        table.ambient_w,
    )


def has_ambient_heat(axis: AxisConfig) -> bool:
    """Whether friction follows a heat that the hall is a part of, which is observed."""
    thermal = thermal_of(axis)
    return thermal is not None and thermal.ambient > 0


def signal_names(axis: AxisConfig) -> list[str]:
    """Names of the signals that parameters of an axis may follow."""
    found = axis.model.nominal_file
    derived = [HEAT] if found is not None and found.thermal is not None else []
    return [*(s.name for s in axis.signal), *derived]


def needed(axis: NamedAxis) -> tuple[FurtherSignalConfig, ...]:
    """The auxiliary signals that the monitoring of an axis needs, in the order of the configuration."""
    names = _used(axis.config) | {*_arm_angles(axis)}
    return tuple(source for source in axis.sources if source.name in names)


def _used(axis: AxisConfig) -> set[str]:
    """Names of the signals that parameters and gates of an axis use."""
    followed = {name for _, v in schedules_of(axis) for name in nominal_schedule(v).term.signals}
    return followed | {g.signal for g in axis.gate}


def _arm_angles(axis: NamedAxis) -> tuple[str, ...]:
    """The signals that are angles of axes, as part of the pose: all of them, if the load follows the pose.

    Otherwise those that nothing uses: they are there for the pose alone.  In any case those of which the thresholds
    have poses; their axes may be left out of the configuration.
    """
    follows = any(nominal_schedule(v).term.turns for v in load_torques(axis.config))
    used = set[str]() if follows else _used(axis.config)
    thresholds = axis.config.model.thresholds_file
    mapped = [] if thresholds is None else [name for poses in thresholds.poses for name in poses.angles]
    there = {signal.name for signal in axis.config.signal}
    angles = [name for name in axis.angles if name not in used]
    return tuple(dict.fromkeys([*angles, *(name for name in mapped if name in there)]))


def _gate(gate: GateConfig) -> Gate:
    above = -math.inf if gate.above is None else gate.above
    below = math.inf if gate.below is None else gate.below
    return Gate(gate.signal, gate.equals or (), above, below, gate.settle_s)


def in_words(axis: AxisConfig) -> Iterator[str]:
    """The operating conditions of an axis in words."""
    for _, v in schedules_of(axis):
        yield f"{v.parameter} follows {v.signal}"
    for g in axis.gate:
        yield f"only while {g.signal} is {_value(g)}"
    if least := min_speed_of(axis):
        yield f"only from {least:.3g} rad/s on"


def _value(gate: GateConfig) -> str:
    if gate.equals is not None:
        return " or ".join(f"{value:g}" for value in gate.equals)
    return f"above {gate.above:g}" if gate.above is not None else f"below {gate.below:g}"
