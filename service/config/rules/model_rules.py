"""Cross-checks of the model of an axis: drive, nominal values, monitored parameters, bounds, limits, skew."""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress

from monitor_core.drive import DELAY, LOAD, AxisModel, Drive, NominalValueError, Output, split_name
from monitor_core.modeling import ModelError
from monitor_core.wording import closest, did_you_mean
from service.config.drive_sources import has_no_gear
from service.config.drives import (
    axis_model,
    drive_of,
    has_own_delay,
    lacking,
    monitored_as,
    nominal_skew,
    scales_of,
    watched_drive,
    watched_values,
    watches_skew,
)
from service.config.problems import CheckFinding
from service.config.schema import AxisConfig
from service.config.schema.base_table import GEAR_RATIO, Undecidable
from service.config.toml_lines import Keys

_SAME = 1e-6
DRIVE: Keys = ("model", "drive")


# --- The drive --------------------------------------------------------------------------------------------------------


def possible_drive(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The drive can be modelled, and its inputs can be computed from the measured quantities."""
    try:
        if wrong := _model_error(watched_drive(axis, _measured(axis)), {}):
            yield CheckFinding(DRIVE, str(wrong))
    except ModelError as error:
        yield CheckFinding(DRIVE, str(error))


def usable_drive(axis: AxisConfig) -> Drive:
    """The drive as it is monitored; raises Undecidable if there is none, which another check reports."""
    if any(possible_drive(axis)):
        raise Undecidable("drive")
    return watched_drive(axis, _measured(axis))


def _measured(axis: AxisConfig) -> Output | None:
    """The output to model; "angle" if the configuration states none, so that other checks still have a drive."""
    return None if axis.angle or axis.speed else "angle"


def _model_error(
    drive: Drive, values: Mapping[str, float], monitor: str = "", scales: Mapping[str, float] = {}
) -> ValueError | None:
    """The error of a model with these values, and 1 for all others; None: the model is valid."""
    nominal = {p.name: 1.0 for p in drive.parameters} | dict(values)
    try:
        AxisModel(drive, nominal, (monitor,) if monitor else (), scales)
    except ValueError as error:
        return error
    except ZeroDivisionError:
        return ValueError(f"{monitor} does not exist: its nominal value is 0")
    return None


# --- Nominal values ---------------------------------------------------------------------------------------------------


def nominal_values(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Nominal values are possible and belong to parameters of the drive; a monitored drive needs all of them."""
    drive, path = usable_drive(axis), ("model", "nominal")
    known = {p.name: p for p in (*drive.drawn, *drive.parameters)}
    for name, value in axis.model.nominal.items():
        if name not in known and name == GEAR_RATIO and has_no_gear(axis):
            # One mass has no gear; the angle of its motor still tells the pose of the arm.
            if not 0 < abs(value) <= 1:
                yield CheckFinding((*path, name), _NO_RATIO)
        elif name not in known:
            yield CheckFinding((*path, name), _no_parameter(name, known))
        elif error := _model_error(drive, {name: value}):
            # The finding already names key and value.
            reason = error.reason if isinstance(error, NominalValueError) else str(error)
            yield CheckFinding((*path, name), reason)
    if axis.to_be_identified:  # identification will find the missing values
        return
    given = watched_values(axis).keys()
    misspelled = {closest(name, known) for name in axis.model.nominal if name not in known}
    for name in lacking(drive, given):
        if name not in misspelled:
            yield CheckFinding((*path, name), f"missing ({known[name].meaning} [{known[name].unit}])")


_NO_RATIO = "the angle of the arm over that of the motor, such as 0.02 for a gear of 50:1: above 0, and at most 1"


def merged_values(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The given value of a merged parameter agrees with the values of its parts."""
    given = axis.model.nominal
    for merged in usable_drive(axis).definitions:
        if merged.name in given and merged.names <= given.keys():
            with suppress(ValueError):
                value = merged.value(given)
                if not math.isclose(value, given[merged.name], rel_tol=_SAME):
                    message = f"is given twice: {', '.join(sorted(merged.names))} make {value:.6g}"
                    yield CheckFinding(("model", "nominal", merged.name), message)


def _nominal(axis: AxisConfig, drive: Drive) -> dict[str, float]:
    """The known nominal values of the parameters of the drive, including merged ones."""
    values = with_merged(watched_values(axis), drive)
    return {p.name: values[p.name] for p in drive.parameters if p.name in values}


def with_merged(given: Mapping[str, float], drive: Drive) -> dict[str, float]:
    """The values, and the values of parameters merged from them."""
    values = dict(given)
    for d in drive.definitions:
        if d.name not in values and d.names <= values.keys():
            with suppress(ValueError):
                values[d.name] = d.value(values)
    return values


def _no_parameter(name: str, known: Iterable[str]) -> str:
    return f"the drive has no such parameter: {did_you_mean(name, known)}"


# --- Monitored parameters ---------------------------------------------------------------------------------------------


def monitored(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Monitored parameters exist, are listed once, and have a size: a nominal value or a scale."""
    drive, seen, scales = usable_drive(axis), set[str](), scales_of(axis)
    nominal = _nominal(axis, drive)
    names = [p.name for p in drive.parameters]
    for i, name in enumerate(axis.model.monitor):
        path = ("model", "monitor", i)
        base, inverse = split_name(name)
        if base not in names and name == LOAD:
            yield CheckFinding(path, "acts as a constant torque does, and the drive has none: add a torque offset")
        elif base not in names:
            known = [f"1/{n}" for n in names] if inverse else [*names, DELAY]
            drawn = any(p.name == base for p in drive.drawn)
            yield CheckFinding(path, _why_not(drive, base) if drawn else _no_parameter(name, known))
        elif base in seen:
            yield CheckFinding(path, f"{base} is monitored twice")
        elif base in nominal:
            value = {base: nominal[base]}
            # Report why it has no size; another check reports an impossible value.
            error = None if _model_error(drive, value) else _model_error(drive, value, name, scales)
            if error is not None:
                yield CheckFinding(path, str(error))
        seen.add(base)


def _why_not(drive: Drive, name: str) -> str:
    """Why a drawn parameter is not a parameter of the drive."""
    try:
        drive.parameter(name)
    except KeyError as error:
        return str(error.args[0])
    raise AssertionError(name)


def scales_and_bounds(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Scales, bounds and P(0) are given for monitored parameters only."""
    model = axis.model
    tables: tuple[tuple[Keys, Iterable[str]], ...] = (
        (("model", "scales"), model.scales),
        (("model", "bounds"), model.bounds),
        (("estimator", "initial_p"), axis.estimator.initial_p),
    )
    for path, names in tables:
        for name in names:
            if name not in model.monitor:
                yield CheckFinding((*path, name), f"not monitored: {did_you_mean(name, model.monitor)}")


def bounds(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The nominal value lies between the bounds, and a positive parameter stays positive."""
    drive = usable_drive(axis)
    nominal = _nominal(axis, drive)
    for name, (lower, upper) in axis.model.bounds.items():
        base, inverse = split_name(name)
        if base not in nominal or (inverse and nominal[base] == 0):
            continue
        value = 1 / nominal[base] if inverse else nominal[base]
        least = 0.0 if drive.parameter(name).positive else -math.inf
        if not least <= lower < value < upper or lower == least:
            need = "0 < lower < nominal < upper" if least == 0 else "lower < nominal < upper"
            yield CheckFinding(("model", "bounds", name), f"must be [lower, upper] with {need} = {value}")


def complete_model(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The model can be made.  This finds faults in drawn or merged values that no other rule checks."""
    try:
        axis_model(axis)
    except KeyError:  # a wrong value, which counts as missing here
        return
    except ValueError as error:
        yield CheckFinding(DRIVE, str(error))


# --- Limits of the long-term trend ------------------------------------------------------------------------------------


def limited(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A limit belongs to a monitored parameter or its reciprocal, not to both."""
    monitor, seen = axis.model.monitor, dict[str, str]()
    for name in axis.model.limits:
        own = monitored_as(name, monitor)
        if own is None:
            yield CheckFinding(("model", "limits", name), f"not monitored: {did_you_mean(name, monitor)}")
        elif own in seen:
            yield CheckFinding(("model", "limits", name), "has one already, by", ("model", "limits", seen[own]))
        else:
            seen[own] = name


def sides(axis: AxisConfig) -> Iterator[CheckFinding]:
    """Limits lie on the right side of the nominal value, and within the bounds of the estimate."""
    model = decided_model(axis)
    for name, values in axis.model.limits.items():
        own = monitored_as(name, axis.model.monitor)
        if own is None:
            continue
        i = axis.model.monitor.index(own)
        nominal, low, high = float(model.theta0[i]), *(float(b) for b in model.limits[:, i])
        if own == name:
            message = _wrong_side(values, nominal, low, high)
        elif nominal == 0 or min(abs(low), abs(high)) == 0 or low * high < 0:
            message = f"{own} is monitored and may be zero: give its limit"
        else:
            message = _wrong_side(values, 1 / nominal, 1 / high, 1 / low)
        if message:
            yield CheckFinding(("model", "limits", name), message)


def _wrong_side(values: tuple[float, ...], nominal: float, low: float, high: float) -> str:
    """The fault of a limit or a pair of limits; empty: none."""
    if len(values) == 2 and not values[0] < nominal < values[1]:
        return f"must be [lower, upper] with lower < nominal < upper, nominal = {nominal:g}"
    if len(values) == 1 and values[0] == nominal:
        return "must be above or below the nominal value, which it is"
    beyond = [f"{value:g}" for value in values if not low < value < high]
    if beyond:
        verb = "is" if len(beyond) == 1 else "are"
        return f"{' and '.join(beyond)} {verb} never reached: the estimate stays between {low:g} and {high:g}"
    return ""


def decided_model(axis: AxisConfig) -> AxisModel:
    """The model of an axis; raises Undecidable if there is none, which another check reports."""
    usable_drive(axis)
    try:
        return axis_model(axis)
    except (KeyError, ValueError):
        raise Undecidable("model") from None


# --- Skew between torque and motion -----------------------------------------------------------------------------------


def torque_skew(axis: AxisConfig) -> Iterator[CheckFinding]:
    """A monitored delay is that of the torque; its nominal value is given once and is below one interval.

    A torque with a larger delay would belong to another sample.
    """
    if not watches_skew(axis):
        return
    h, bounds = axis.sample_interval_s, axis.model.bounds.get(DELAY)
    place: Keys = ("model", "monitor", axis.model.monitor.index(DELAY))
    if bounds is not None and max(map(abs, bounds)) > h:
        yield CheckFinding(("model", "bounds", DELAY), f"must be within sample_interval_s, [{-h}, {h}]")
    if nominal_skew(axis) >= h:
        message = (
            f"a delay is monitored up to sample_interval_s = {h}, which is its nominal value here: no increase of it"
            " could be seen"
        )
        yield CheckFinding(place, message)
    usable_drive(axis)
    if has_own_delay(drive_of(axis)):
        message = "is how late the torque acts, but the drive has a parameter of that name: rename that one"
        yield CheckFinding(place, message)
    elif DELAY in axis.model.nominal:
        message = "its nominal value is torque_delay_s of the axis: remove this"
        yield CheckFinding(("model", "nominal", DELAY), message)


MODEL_RULES = (
    possible_drive,
    nominal_values,
    merged_values,
    monitored,
    scales_and_bounds,
    bounds,
    limited,
    sides,
    torque_skew,
)
