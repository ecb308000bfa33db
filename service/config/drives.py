"""The drive of an axis with its nominal values, scales, bounds and limits, as named or drawn in the configuration.

The skew between torque and motion, ``monitor = [.., "delay"]``, is no parameter of the drawing: every drive can have
it; its nominal value is ``torque_delay_s`` of the axis.  ModelError: the axis has no drive.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence

from monitor_core.drive import DELAY, LOAD, AxisModel, Drive, Output
from monitor_core.monitoring import Limit
from service.config.base_table import SUFFIX
from service.config.conditions import weight_of
from service.config.drive_sources import model_of_axis
from service.config.schema import AxisConfig

SCALE = 0.5
"""Of a sample interval.  A tenth of an interval late, which reads as 3 % of motor inertia, then counts as a fifth of
any other parameter does; with smaller scales a change of the arm's inertia by a fifth is often taken for a skew."""


def drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis, for the measured output, or for the ``output`` given.

    It includes the state of a torque disturbance if the nominal values were found with one.
    """
    drive, found = plain_drive_of(axis, output), axis.model.nominal_file
    return drive.with_disturbance() if found is not None and found.drive.torque_disturbance else drive


def plain_drive_of(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive as it is drawn, where its sensor averages with a mean speed as output."""
    drive = model_of_axis(axis, output).drive
    return drive.with_mean_speed() if output is None and axis.interval_mean else drive


def given_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values of the configuration and of the drawing, by the names they have there.

    Those of a file of nominal values take precedence over the drawing's; a cross-check compares them with the
    configuration. The values of the library are those of one robot, so they are not used.
    """
    drawn = model_of_axis(axis).values if axis.model.drive.endswith(SUFFIX) else {}
    found = axis.model.nominal_file
    return {**drawn, **axis.model.nominal, **(found.values if found else {})}


def lacking(drive: Drive, given: Collection[str]) -> list[str]:
    """The parameters of the drive, drawn or its own, whose values are missing."""
    return list(dict.fromkeys(part for p in drive.parameters for part in lacking_for(drive, p.name, given)))


def not_identified(axis: AxisConfig) -> bool:
    """Whether values of the drive are missing that an identification is to find."""
    return axis.to_be_identified and bool(lacking(watched_drive(axis), watched_values(axis)))


def lacking_for(drive: Drive, name: str, given: Collection[str]) -> Iterator[str]:
    """The parameters whose values are missing for this one: itself, or those it is merged from."""
    if name in given:
        return
    definition = next((d for d in drive.definitions if d.name == name), None)
    if definition is None:
        yield name
    else:
        for part in sorted(definition.names):
            yield from lacking_for(drive, part, given)


# --- As it is monitored: where that is wanted, with the delay of its torque and with the load as parameters -----------


def watches_skew(axis: AxisConfig) -> bool:
    """Whether the delay of the torque is monitored."""
    return DELAY in axis.model.monitor


def has_own_delay(drive: Drive) -> bool:
    """Whether the drawing has a parameter of that name, which is something else."""
    return any(p.name == DELAY for p in (*drive.parameters, *drive.drawn))


def watched_drive(axis: AxisConfig, output: Output | None = None) -> Drive:
    """The drive of an axis as it is monitored."""
    drive = drive_of(axis, output)
    if holds_weight(axis) and (offset := load_acts_as(axis, drive)):
        drive = drive.with_load(offset)
    return drive.with_delay() if watches_skew(axis) and not has_own_delay(drive) else drive


def watched_values(axis: AxisConfig) -> dict[str, float]:
    """The nominal values of the monitored drive, as ``given_values``."""
    own = {DELAY: nominal_skew(axis)} if watches_skew(axis) else {}
    given = given_values(axis)
    return given | own | (nominal_load(axis, given) if holds_weight(axis) else {})


def nominal_skew(axis: AxisConfig) -> float:
    """How late the torque of the healthy axis acts [s]."""
    found = axis.model.nominal_file
    return axis.torque_delay_s if found is None else found.predictor.torque_delay_s


def watches_load(axis: AxisConfig) -> bool:
    """Whether the load is monitored, and is no parameter of the drawing."""
    return LOAD in axis.model.monitor and not _draws_load(axis)


def holds_weight(axis: AxisConfig) -> bool:
    """Whether the weight of the arm is an input of the monitored drive, whatever it is compared with."""
    return not _draws_load(axis) and (LOAD in axis.model.monitor or bool(weight_of(axis)))


def _draws_load(axis: AxisConfig) -> bool:
    drive = model_of_axis(axis).drive
    return any(p.name == LOAD for p in (*drive.parameters, *drive.drawn))


def load_acts_as(axis: AxisConfig, drive: Drive) -> str:
    """The constant torque that the weight acts like: the one that follows the pose; empty: the drive has none."""
    offsets = (*(v.parameter for v in weight_of(axis)), *drive.constant_torques())
    return next(iter(offsets), "")


def nominal_load(axis: AxisConfig, given: Mapping[str, float]) -> dict[str, float]:
    """The load, and what remains of the constant torque when the weight in it is an input."""
    weight, values = weight_of(axis), {LOAD: 1.0}
    for name in {v.parameter for v in weight} & given.keys():
        values[name] = given[name] - sum(v.slope * v.reference for v in weight)
    return values


def scales_of(axis: AxisConfig) -> dict[str, float]:
    """Sizes of monitored parameters, by name, where |nominal| is not the size."""
    own = {DELAY: SCALE * axis.sample_interval_s} if watches_skew(axis) else {}
    return own | axis.model.scales


def bounds_of(axis: AxisConfig) -> dict[str, tuple[float, float]]:
    """Bounds of monitored parameters, by name, where they differ from the defaults.

    A skew is followed up to one interval: beyond that the torque would be that of another sample.
    """
    h = axis.sample_interval_s
    own = {DELAY: (-h, h)} if watches_skew(axis) and nominal_skew(axis) < h else {}
    return own | axis.model.bounds


def axis_model(axis: AxisConfig) -> AxisModel:
    """The model of an axis of a valid configuration."""
    drive, values = watched_drive(axis), watched_values(axis)
    return AxisModel(drive, values, axis.model.monitor, scales_of(axis), bounds_of(axis))


# --- Limits of the long-term trend, of a monitored parameter or of its reciprocal -------------------------------------


def monitored_as(name: str, monitor: Sequence[str]) -> str | None:
    """The monitored parameter that a limit of this name is about; None: there is none."""
    reciprocal = name.removeprefix("1/") if name.startswith("1/") else f"1/{name}"
    return next((own for own in (name, reciprocal) if own in monitor), None)


def limits_of(axis: AxisConfig, model: AxisModel) -> Mapping[str, tuple[Limit, ...]]:
    """The limits of each monitored parameter that has any."""
    found = {}
    for name, values in axis.model.limits.items():
        own = monitored_as(name, model.monitored)
        assert own is not None  # a cross-check ensures it
        nominal, inverse = float(model.theta0[model.monitored.index(own)]), own != name
        nominal, unit = 1 / nominal if inverse else nominal, model.drive.parameter(name).unit
        found[own] = tuple(
            Limit(1 / v if inverse else v, (v > nominal) != inverse, name, unit, v, v > nominal)
            for v in values
        )
    return found
