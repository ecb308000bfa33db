"""Rules for an axis's model, asked of the engine's own model where it has the rule."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from typing import TypeVar

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import DELAY, Drive, Output, Parameter, split_name
from monitor_core.modeling.flat import ModelError
from monitor_core.suggestions import did_you_mean
from service.config.base_table import ABSENT, Absent
from service.config.drives import place_of
from service.config.schema import AxisConfig
from service.config.skew import bounds_of, scales_of, watched_drive, watched_values
from service.config.validation_messages import Finding

T = TypeVar("T")

_SAME = 1e-6


def one_drive(axis: AxisConfig) -> Iterator[Finding]:
    """A drive is named or drawn, not both."""
    model = axis.model
    for key in ("drive", "drive_model"):
        if model.components and key in model.model_fields_set:
            message = "the drive is drawn already: remove this, or"
            yield Finding(("model", key), message, ("model", "components"))


def known_drive(axis: AxisConfig) -> Iterator[Finding]:
    """The drive exists, and can be modelled."""
    try:
        watched_drive(axis, _measured(axis))
    except ModelError as error:
        yield Finding(place_of(error, axis.model), str(error))


def measurable(axis: AxisConfig) -> Iterator[Finding]:
    """What the drive's inputs depend on can be had from what is measured."""
    if problem := _refusal(usable_drive(axis, inputs=False), {}):
        yield Finding(("model", "components" if axis.model.components else "drive"), problem)


def nominal_names(axis: AxisConfig) -> Iterator[Finding]:
    """Nominal values are of parameters of the drive, and, if it is watched, of all of them."""
    drive = usable_drive(axis)
    known = _by_name(drive)
    for name in axis.model.nominal:
        if name not in known:
            yield Finding(("model", "nominal", name), _no_parameter(name, known))
    if axis.records_only:  # an identification finds what is missing
        return
    given = {*watched_values(axis), *axis.model.nominal}  # also what is given wrongly
    for name in dict.fromkeys(part for p in drive.parameters for part in _lacking(drive, p.name, given)):
        p = known[name]
        yield Finding(("model", "nominal", name), f"missing ({p.meaning} [{p.unit}])")


def merged_values(axis: AxisConfig) -> Iterator[Finding]:
    """A merged parameter that is given has the value of what it is merged from, if that is given, too."""
    given = _present(axis.model.nominal)
    for merged in usable_drive(axis).definitions:
        if merged.name in given and merged.names <= given.keys():
            with suppress(ValueError):
                value = merged.value(given)
                if not math.isclose(value, given[merged.name], rel_tol=_SAME):
                    message = f"is given twice: {', '.join(sorted(merged.names))} make {value:.6g}"
                    yield Finding(("model", "nominal", merged.name), message)


def nominal_values(axis: AxisConfig) -> Iterator[Finding]:
    """Each nominal value is one that the drive can have."""
    drive = usable_drive(axis)
    for name, value in _known(axis.model.nominal, drive).items():
        if problem := _refusal(drive, {name: value}):
            message = problem.removeprefix(f"nominal {name} = {value}: ")  # a finding says that anyway
            yield Finding(("model", "nominal", name), message)


def monitored(axis: AxisConfig) -> Iterator[Finding]:
    """Monitored parameters exist, once each, with a size that gives a threshold."""
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
        if base not in nominal or _refusal(drive, {base: nominal[base]}) or model.scales.get(name) is ABSENT:
            continue
        if problem := _refusal(drive, {base: nominal[base]}, name, scales):
            yield Finding(("model", "monitor", i), problem)


def scales_and_bounds(axis: AxisConfig) -> Iterator[Finding]:
    """Scales, bounds and P(0) are of monitored parameters."""
    model = axis.model
    for path, names in (
        (("model", "scales"), list(model.scales)),
        (("model", "bounds"), list(model.bounds)),
        (("estimator", "initial_p"), list(axis.estimator.initial_p)),
    ):
        for name in names:
            if name not in model.monitor:
                yield Finding((*path, name), f"not monitored: {did_you_mean(name, model.monitor)}")


def limits(axis: AxisConfig) -> Iterator[Finding]:
    """The nominal value lies between the bounds, and a positive parameter stays positive."""
    drive, model = usable_drive(axis), axis.model
    nominal = _nominal(axis, drive)
    for name, (lower, upper) in _present(model.bounds).items():
        base, inverse = split_name(name)
        if base not in nominal or (inverse and nominal[base] == 0):
            continue
        value = 1 / nominal[base] if inverse else nominal[base]
        least = 0.0 if drive.parameter(name).positive else -math.inf
        if not least <= lower < value < upper or lower == least:
            need = "0 < lower < nominal < upper" if least == 0 else "lower < nominal < upper"
            yield Finding(("model", "bounds", name), f"must be [lower, upper] with {need} = {value}")


def whole(axis: AxisConfig) -> Iterator[Finding]:
    """Where no rule finds anything, the engine does not, either: values of a drawing, or merged from several."""
    if any(not _is_quiet(rule, axis) for rule in MODEL_RULES if rule is not whole):
        return
    model, drive = axis.model, usable_drive(axis)
    try:
        AxisModel(drive, watched_values(axis), model.monitor, scales_of(axis), bounds_of(axis))
    except KeyError:  # a value that is wrong in itself is as good as missing here
        return
    except ValueError as error:
        yield Finding(("model", "components" if model.components else "drive"), str(error))


def _is_quiet(rule: Callable[[AxisConfig], Iterator[Finding]], axis: AxisConfig) -> bool:
    try:
        return next(rule(axis), None) is None
    except Absent:
        return False


def _measured(axis: AxisConfig) -> Output | None:
    """The angle where it is not rightly said what is measured, so that the other rules still see a drive."""
    with suppress(Absent):
        return None if axis.output else "angle"
    return "angle"


def usable_drive(axis: AxisConfig, inputs: bool = True) -> Drive:
    """The drive; with ``inputs`` one whose inputs can be had.  Where there is none, another rule says so."""
    if any(one_drive(axis)):
        raise Absent("drive")
    try:
        drive = watched_drive(axis, _measured(axis))
    except ModelError:
        raise Absent("drive") from None
    if inputs and _refusal(drive, {}):
        raise Absent("drive")
    return drive


def _by_name(drive: Drive) -> dict[str, Parameter]:
    """All parameters that may be given: those that were drawn, and merged ones."""
    return {p.name: p for p in (*drive.drawn, *drive.parameters)}


def _lacking(drive: Drive, name: str, given: Collection[str]) -> Iterator[str]:
    """The parameters whose values are missing for this one: itself, or what it is merged from."""
    definition = next((d for d in drive.definitions if d.name == name), None)
    if name in given:
        return
    if definition is None:
        yield name
    else:
        for part in sorted(definition.names):
            yield from _lacking(drive, part, given)


def _nominal(axis: AxisConfig, drive: Drive) -> dict[str, float]:
    """The nominal values of the drive's parameters, merged ones too, as far as they are right in themselves."""
    values = _known(watched_values(axis), drive)
    for d in drive.definitions:
        if d.name not in values and d.names <= values.keys():
            with suppress(ValueError):
                values[d.name] = d.value(values)
    return {p.name: values[p.name] for p in drive.parameters if p.name in values}


def _why_not(drive: Drive, name: str) -> str:
    """Why a parameter that was drawn is none of the drive's."""
    try:
        drive.parameter(name)
    except KeyError as error:
        return str(error.args[0])
    raise AssertionError(name)


def _no_parameter(name: str, known: Mapping[str, object] | list[str]) -> str:
    return f"the drive has no such parameter: {did_you_mean(name, known)}"


def _present(values: Mapping[str, T]) -> dict[str, T]:
    return {name: value for name, value in values.items() if value is not ABSENT}


def _known(values: Mapping[str, float], drive: Drive) -> dict[str, float]:
    """The values that are right in themselves, of parameters of the drive."""
    names = _by_name(drive)
    return {name: value for name, value in values.items() if name in names and value is not ABSENT}


def _refusal(
    drive: Drive, values: Mapping[str, float], monitor: str = "", scales: Mapping[str, float] = {}
) -> str:
    """Why the engine refuses these values, all others being 1; empty if it does not."""
    nominal = {p.name: 1.0 for p in drive.parameters} | dict(values)
    try:
        AxisModel(drive, nominal, (monitor,) if monitor else (), scales)
    except ValueError as error:
        return str(error)
    except ZeroDivisionError:
        return f"{monitor} does not exist: its nominal value is 0"
    return ""


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
    limits,
    whole,
)
