"""Cross-checks of the model of an axis: drive, nominal values, monitored parameters, bounds, limits, skew."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress

from monitor_core.drive import DELAY, AxisModel, Drive, NominalValueError, Output, Parameter, split_name
from monitor_core.modeling import ModelError
from monitor_core.wording import did_you_mean
from service.config.base_table import Undecidable
from service.config.drives import drive_of, place_of
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.skew import (
    bounds_of,
    has_own_delay,
    nominal_skew,
    scales_of,
    watched_drive,
    watched_values,
    watches_skew,
)
from service.config.trend_limits import monitored_as
from service.config.validation_messages import Finding

_SAME = 1e-6


def one_drive(axis: AxisConfig) -> Iterator[Finding]:
    """A drive is named or drawn, not both."""
    model = axis.model
    for key in ("drive", "drive_model"):
        if model.components and key in model.model_fields_set:
            message = "the drive is drawn already: remove this, or"
            yield Finding(("model", key), message, ("model", "components"))


def known_drive(axis: AxisConfig) -> Iterator[Finding]:
    """The drive exists and can be modelled."""
    try:
        watched_drive(axis, _measured(axis))
    except ModelError as error:
        yield Finding(place_of(error, axis.model), str(error))


def measurable(axis: AxisConfig) -> Iterator[Finding]:
    """The inputs of the drive can be computed from the measured quantities."""
    if error := _model_error(usable_drive(axis, inputs=False), {}):
        yield Finding(("model", "components" if axis.model.components else "drive"), str(error))


def nominal_names(axis: AxisConfig) -> Iterator[Finding]:
    """Nominal values belong to parameters of the drive; a monitored drive needs all of them."""
    drive = usable_drive(axis)
    known = _by_name(drive)
    for name in axis.model.nominal:
        if name not in known:
            yield Finding(("model", "nominal", name), _no_parameter(name, known))
    if axis.records_only:  # an identification finds what is missing
        return
    given = watched_values(axis).keys()
    for name in dict.fromkeys(part for p in drive.parameters for part in _lacking(drive, p.name, given)):
        p = known[name]
        yield Finding(("model", "nominal", name), f"missing ({p.meaning} [{p.unit}])")


def merged_values(axis: AxisConfig) -> Iterator[Finding]:
    """A merged parameter that is given agrees with the parameters that it is merged from."""
    given = axis.model.nominal
    for merged in usable_drive(axis).definitions:
        if merged.name in given and merged.names <= given.keys():
            with suppress(ValueError):
                value = merged.value(given)
                if not math.isclose(value, given[merged.name], rel_tol=_SAME):
                    message = f"is given twice: {', '.join(sorted(merged.names))} make {value:.6g}"
                    yield Finding(("model", "nominal", merged.name), message)


def nominal_values(axis: AxisConfig) -> Iterator[Finding]:
    """Each nominal value is possible for the drive."""
    drive = usable_drive(axis)
    for name, value in _known(axis.model.nominal, drive).items():
        if error := _model_error(drive, {name: value}):
            # A finding names key and value itself.
            message = error.reason if isinstance(error, NominalValueError) else str(error)
            yield Finding(("model", "nominal", name), message)


def monitored(axis: AxisConfig) -> Iterator[Finding]:
    """Monitored parameters exist, are listed once, and have a size for a threshold."""
    drive, seen = usable_drive(axis), set[str]()
    names = [p.name for p in drive.parameters]
    drawn = {p.name for p in drive.drawn}
    for i, name in enumerate(axis.model.monitor):
        base, inverse = split_name(name)
        if base not in names:
            known = [f"1/{n}" for n in names] if inverse else [*names, DELAY]
            problem = _why_not(drive, base) if base in drawn else _no_parameter(name, known)
            yield Finding(("model", "monitor", i), problem)
        elif base in seen:
            yield Finding(("model", "monitor", i), f"{base} is monitored twice")
        seen.add(base)


def monitored_sizes(axis: AxisConfig) -> Iterator[Finding]:
    """Each monitored parameter has a size: its nominal value or a scale."""
    drive, model, scales = usable_drive(axis), axis.model, scales_of(axis)
    nominal = _nominal(axis, drive)
    for i, name in enumerate(model.monitor):
        base = split_name(name)[0]
        if base not in nominal or _model_error(drive, {base: nominal[base]}):
            continue
        if error := _model_error(drive, {base: nominal[base]}, name, scales):
            yield Finding(("model", "monitor", i), str(error))


def scales_and_bounds(axis: AxisConfig) -> Iterator[Finding]:
    """Scales, bounds and P(0) belong to monitored parameters."""
    model = axis.model
    for path, names in (
        (("model", "scales"), list(model.scales)),
        (("model", "bounds"), list(model.bounds)),
        (("estimator", "initial_p"), list(axis.estimator.initial_p)),
    ):
        for name in names:
            if name not in model.monitor:
                yield Finding((*path, name), f"not monitored: {did_you_mean(name, model.monitor)}")


def bounds(axis: AxisConfig) -> Iterator[Finding]:
    """The nominal value lies between the bounds, and a positive parameter stays positive."""
    drive, model = usable_drive(axis), axis.model
    nominal = _nominal(axis, drive)
    for name, (lower, upper) in model.bounds.items():
        base, inverse = split_name(name)
        if base not in nominal or (inverse and nominal[base] == 0):
            continue
        value = 1 / nominal[base] if inverse else nominal[base]
        least = 0.0 if drive.parameter(name).positive else -math.inf
        if not least <= lower < value < upper or lower == least:
            need = "0 < lower < nominal < upper" if least == 0 else "lower < nominal < upper"
            yield Finding(("model", "bounds", name), f"must be [lower, upper] with {need} = {value}")


def complete_model(axis: AxisConfig) -> Iterator[Finding]:
    """Where no rule finds anything, the engine does not, either: values of a drawing, or merged from several."""
    if any(not _is_quiet(rule, axis) for rule in MODEL_RULES if rule is not complete_model):
        return
    model, drive = axis.model, usable_drive(axis)
    try:
        AxisModel(drive, watched_values(axis), model.monitor, scales_of(axis), bounds_of(axis))
    except KeyError:  # a wrong value counts as missing here
        return
    except ValueError as error:
        yield Finding(("model", "components" if model.components else "drive"), str(error))


# --- limits of the long-term trend -----------------------------------------------------------------------


def limited(axis: AxisConfig) -> Iterator[Finding]:
    """A limit belongs to a monitored parameter or to its reciprocal, and only to one of them."""
    monitor, seen = axis.model.monitor, dict[str, str]()
    for name in axis.model.limits:
        own = monitored_as(name, monitor)
        if own is None:
            yield Finding(("model", "limits", name), f"not monitored: {did_you_mean(name, monitor)}")
        elif own in seen:
            yield Finding(("model", "limits", name), "has one already, by", ("model", "limits", seen[own]))
        else:
            seen[own] = name


def sides(axis: AxisConfig) -> Iterator[Finding]:
    """A lower limit is below the nominal value, an upper one above, and within the bounds of the estimate."""
    model = axis_model(axis)
    for name, values in axis.model.limits.items():
        own = monitored_as(name, axis.model.monitor)
        if own is None:
            continue
        i = axis.model.monitor.index(own)
        nominal, bounds = float(model.theta0[i]), tuple(float(b) for b in model.limits[:, i])
        if own != name:
            if nominal == 0 or min(map(abs, bounds)) == 0 or bounds[0] * bounds[1] < 0:
                yield Finding(
                    ("model", "limits", name), f"{own} is monitored and may be zero: give its limit"
                )
                continue
            nominal, bounds = 1 / nominal, (1 / bounds[1], 1 / bounds[0])
        yield from _limits_of(name, values, nominal, bounds)


def _limits_of(
    name: str, values: tuple[float, ...], nominal: float, bounds: tuple[float, ...]
) -> Iterator[Finding]:
    path = ("model", "limits", name)
    if len(values) == 2 and not values[0] < nominal < values[1]:
        yield Finding(path, f"must be [lower, upper] with lower < nominal < upper, nominal = {nominal:g}")
    elif len(values) == 1 and values[0] == nominal:
        yield Finding(path, "must be above or below the nominal value, which it is")
    else:
        for value in values:
            if not bounds[0] < value < bounds[1]:
                message = (
                    f"{value:g} is never reached: the estimate stays between {bounds[0]:g} and {bounds[1]:g}"
                )
                yield Finding(path, message)


# --- skew between torque and motion ----------------------------------------------------------------------


def torque_skew(axis: AxisConfig) -> Iterator[Finding]:
    """The delay is that of the torque, no parameter of the drive, and its nominal value is given once."""
    if not watches_skew(axis):
        return
    usable_drive(axis)
    if has_own_delay(drive_of(axis)):
        message = "is how late the torque acts, but the drive has a parameter of that name: rename that one"
        yield Finding(_place(axis), message)
    elif DELAY in axis.model.nominal:
        yield Finding(
            ("model", "nominal", DELAY), "its nominal value is torque_delay_s of the axis: remove this"
        )


def skew_below_an_interval(axis: AxisConfig) -> Iterator[Finding]:
    """Beyond one interval the torque would be that of another sample."""
    if not watches_skew(axis):
        return
    h, bounds = axis.sample_interval_s, axis.model.bounds.get(DELAY)
    if bounds is not None and max(map(abs, bounds)) > h:
        yield Finding(("model", "bounds", DELAY), f"must be within sample_interval_s, [{-h}, {h}]")
    if nominal_skew(axis) >= h:
        message = f"a delay is followed up to sample_interval_s = {h}, and that is nominal here: nothing is left to see"
        yield Finding(_place(axis), message)


def _place(axis: AxisConfig) -> Keys:
    return ("model", "monitor", axis.model.monitor.index(DELAY))


# --- what the checks have in common ----------------------------------------------------------------------


def axis_model(axis: AxisConfig) -> AxisModel:
    """The model of an axis; where there is none, another check reports why."""
    drive = usable_drive(axis)
    try:
        return AxisModel(drive, watched_values(axis), axis.model.monitor, scales_of(axis), bounds_of(axis))
    except (KeyError, ValueError):  # other checks report what is wrong
        raise Undecidable("model") from None


def _is_quiet(rule: Callable[[AxisConfig], Iterator[Finding]], axis: AxisConfig) -> bool:
    try:
        return next(rule(axis), None) is None
    except Undecidable:
        return False


def _measured(axis: AxisConfig) -> Output | None:
    """The measured output; the angle where that is not stated correctly, so that other checks still have a drive."""
    with suppress(Undecidable):
        return None if axis.output else "angle"
    return "angle"


def usable_drive(axis: AxisConfig, inputs: bool = True) -> Drive:
    """The drive; with ``inputs`` one whose inputs can be computed.  If there is none, another check reports it."""
    if any(one_drive(axis)):
        raise Undecidable("drive")
    try:
        drive = watched_drive(axis, _measured(axis))
    except ModelError:
        raise Undecidable("drive") from None
    if inputs and _model_error(drive, {}):
        raise Undecidable("drive")
    return drive


def _by_name(drive: Drive) -> dict[str, Parameter]:
    """All parameters that may be given: drawn ones and merged ones."""
    return {p.name: p for p in (*drive.drawn, *drive.parameters)}


def _lacking(drive: Drive, name: str, given: Collection[str]) -> Iterator[str]:
    """The parameters whose values are missing for this one: itself, or those it is merged from."""
    definition = next((d for d in drive.definitions if d.name == name), None)
    if name in given:
        return
    if definition is None:
        yield name
    else:
        for part in sorted(definition.names):
            yield from _lacking(drive, part, given)


def _nominal(axis: AxisConfig, drive: Drive) -> dict[str, float]:
    """The valid nominal values of the parameters of the drive, including merged ones."""
    values = _known(watched_values(axis), drive)
    for d in drive.definitions:
        if d.name not in values and d.names <= values.keys():
            with suppress(ValueError):
                values[d.name] = d.value(values)
    return {p.name: values[p.name] for p in drive.parameters if p.name in values}


def _why_not(drive: Drive, name: str) -> str:
    """Why a drawn parameter is no parameter of the drive."""
    try:
        drive.parameter(name)
    except KeyError as error:
        return str(error.args[0])
    raise AssertionError(name)


def _no_parameter(name: str, known: Mapping[str, object] | list[str]) -> str:
    return f"the drive has no such parameter: {did_you_mean(name, known)}"


def _known(values: Mapping[str, float], drive: Drive) -> dict[str, float]:
    """The valid values of parameters of the drive."""
    names = _by_name(drive)
    return {name: value for name, value in values.items() if name in names}


def _model_error(
    drive: Drive, values: Mapping[str, float], monitor: str = "", scales: Mapping[str, float] = {}
) -> ValueError | None:
    """The error of a model with these values, all others being 1; None: it is valid."""
    nominal = {p.name: 1.0 for p in drive.parameters} | dict(values)
    try:
        AxisModel(drive, nominal, (monitor,) if monitor else (), scales)
    except ValueError as error:
        return error
    except ZeroDivisionError:
        return ValueError(f"{monitor} does not exist: its nominal value is 0")
    return None


MODEL_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    one_drive,
    known_drive,
    measurable,
    nominal_names,
    merged_values,
    nominal_values,
    monitored,
    monitored_sizes,
    scales_and_bounds,
    bounds,
    complete_model,
    limited,
    sides,
    torque_skew,
    skew_below_an_interval,
)
