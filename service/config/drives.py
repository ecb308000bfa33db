"""The drive of an axis with nominal values, scales, bounds and limits, from the configuration.

The skew between torque and motion (``monitor = [.., "delay"]``) is no parameter of the drawing: every drive can have
it, and its nominal value is ``torque_delay_s`` of the axis.  Functions raise ModelError if the drive cannot be made.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence

from monitor_core.drive import DELAY, LOAD, AxisModel, Drive, Output
from monitor_core.monitoring import ParameterLimit
from service.config.conditions import weight_of
from service.config.drive_sources import has_no_gear, model_of_axis
from service.config.schema import AxisConfig
from service.config.schema.base_table import GEAR_RATIO, SUFFIX

SCALE = 0.5
"""Scale of the delay in sample intervals.  With it, a delay of a tenth of an interval (which looks like 3 % of motor
inertia) counts like a change of 20 % of any other parameter.  With smaller scales, a change of the arm's inertia by 20
% is often taken for a skew."""


def drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis; ``output``: default is the measured output.

    It includes the state of a torque disturbance if the nominal values were found with one.
    """
    drive, found = plain_drive_of(axis, output), axis.model.nominal_file
    return drive.with_disturbance() if found is not None and found.drive.torque_disturbance else drive


def plain_drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive as drawn, with the mean speed as output if the sensor sends the interval mean."""
    drive = model_of_axis(axis, output).drive
    return drive.with_mean_speed() if output is None and axis.interval_mean else drive


def given_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values from the configuration, the nominal file and the drawing, by name.

    The nominal file takes precedence; a cross-check compares it with the configuration.  Example values of the library
    are those of one particular robot, so they are not used.
    """
    drawn = model_of_axis(axis).values if axis.model.drive.endswith(SUFFIX) else {}
    found = axis.model.nominal_file
    given = {**drawn, **axis.model.nominal, **(found.values if found else {})}
    return {name: value for name, value in given.items() if name != GEAR_RATIO or not has_no_gear(axis)}


def gear_ratio(axis: AxisConfig) -> float:
    """The given angle of the arm over that of the motor, also of a drive of one mass, which has no gear; 1: none."""
    return axis.model.nominal.get(GEAR_RATIO, given_values(axis).get(GEAR_RATIO, 1.0))


def lacking(drive: Drive, given: Collection[str]) -> list[str]:
    """Names of the parameters, drawn or merged, whose values are missing."""
    return list(dict.fromkeys(part for p in drive.parameters for part in lacking_for(drive, p.name, given)))


def not_identified(axis: AxisConfig) -> bool:
    """Whether values of the drive are missing that identification has to find."""
    return axis.to_be_identified and bool(lacking(watched_drive(axis), watched_values(axis)))


def lacking_for(drive: Drive, name: str, given: Collection[str]) -> Iterator[str]:
    """The missing parameters for the value of this one: itself, or those from which it is merged."""
    if name in given:
        return
    definition = next((d for d in drive.definitions if d.name == name), None)
    if definition is None:
        yield name
    else:
        for part in sorted(definition.names):
            yield from lacking_for(drive, part, given)


# --- The drive as it is monitored: with torque delay and load as parameters, if these are monitored -------------------


def watches_skew(axis: AxisConfig) -> bool:
    """Whether the delay of the torque is monitored."""
    return DELAY in axis.model.monitor


def has_own_delay(drive: Drive) -> bool:
    """Whether the drawing has a parameter named "delay", which then has another meaning."""
    return any(p.name == DELAY for p in (*drive.parameters, *drive.drawn))


def watched_drive(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis as it is monitored."""
    drive = drive_of(axis, output)
    if holds_weight(axis) and (offset := load_acts_as(axis, drive)):
        drive = drive.with_load(offset)
    return drive.with_delay() if watches_skew(axis) and not has_own_delay(drive) else drive


def watched_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values of the monitored drive; see ``given_values``."""
    own = {DELAY: nominal_skew(axis)} if watches_skew(axis) else {}
    given = given_values(axis)
    return given | own | (nominal_load(axis, given) if holds_weight(axis) else {})


def nominal_skew(axis: AxisConfig) -> float:
    """Delay of the torque of the healthy axis [s]."""
    found = axis.model.nominal_file
    return axis.torque_delay_s if found is None else found.predictor.torque_delay_s


def watches_load(axis: AxisConfig) -> bool:
    """Whether the load is monitored and is no parameter of the drawing."""
    return LOAD in axis.model.monitor and not _draws_load(axis)


def holds_weight(axis: AxisConfig) -> bool:
    """Whether the weight of the arm is an input of the monitored drive."""
    return not _draws_load(axis) and (LOAD in axis.model.monitor or bool(weight_of(axis)))


def _draws_load(axis: AxisConfig) -> bool:
    drive = model_of_axis(axis).drive
    return any(p.name == LOAD for p in (*drive.parameters, *drive.drawn))


def load_acts_as(axis: AxisConfig, drive: Drive) -> str:
    """The constant torque that represents the weight: the one that follows the pose; empty: the drive has none."""
    offsets = (*(v.parameter for v in weight_of(axis)), *drive.constant_torques())
    return next(iter(offsets), "")


def nominal_load(axis: AxisConfig, given: Mapping[str, float]) -> dict[str, float]:
    """The nominal load, and the part of the constant torque that remains when the weight is an input."""
    weight, values = weight_of(axis), {LOAD: 1.0}
    for name in {v.parameter for v in weight} & given.keys():
        values[name] = given[name] - sum(v.slope * v.reference for v in weight)
    return values


def scales_of(axis: AxisConfig) -> dict[str, float]:
    """Sizes of those monitored parameters, by name, whose size is not |nominal|."""
    own = {DELAY: SCALE * axis.sample_interval_s} if watches_skew(axis) else {}
    return own | axis.model.scales


def bounds_of(axis: AxisConfig) -> dict[str, tuple[float, float]]:
    """Bounds of monitored parameters, by name, that differ from the defaults.

    A skew is estimated up to one interval; a torque with a larger delay would belong to another sample.
    """
    h = axis.sample_interval_s
    own = {DELAY: (-h, h)} if watches_skew(axis) and nominal_skew(axis) < h else {}
    return own | axis.model.bounds


def axis_model(axis: AxisConfig) -> AxisModel:
    """The model of an axis; the configuration must be valid."""
    drive, values = watched_drive(axis), watched_values(axis)
    return AxisModel(drive, values, axis.model.monitor, scales_of(axis), bounds_of(axis))


# --- Limits of the long-term trend, of a monitored parameter or of its reciprocal -------------------------------------


def monitored_as(name: str, monitor: Sequence[str]) -> str | None:
    """The monitored parameter that a limit with this name belongs to; None: there is none."""
    reciprocal = name.removeprefix("1/") if name.startswith("1/") else f"1/{name}"
    return next((own for own in (name, reciprocal) if own in monitor), None)


def limits_of(axis: AxisConfig, model: AxisModel) -> Mapping[str, tuple[ParameterLimit, ...]]:
    """The limits of the monitored parameters that have limits."""
    found = {}
    for name, values in axis.model.limits.items():
        own = monitored_as(name, model.monitored)
        assert own is not None  # a cross-check ensures it
        nominal, inverse = float(model.theta0[model.monitored.index(own)]), own != name
        nominal, unit = 1 / nominal if inverse else nominal, model.drive.parameter(name).unit
        found[own] = tuple(
            ParameterLimit(1 / v if inverse else v, (v > nominal) != inverse, name, unit, v, v > nominal)
            for v in values
        )
    return found
