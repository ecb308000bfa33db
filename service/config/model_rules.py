"""Rules for an axis's model and estimator, asked of the engine's own model where it has the rule."""

import math
from collections.abc import Iterator, Mapping
from typing import TypeVar

from monitor_core.model import AxisModel, Drive, Output, split_name
from service.config.drives import DRIVES
from service.config.schema import AxisConfig
from service.config.tables import ABSENT, Absent
from service.config.wording import Finding
from service.words import did_you_mean

T = TypeVar("T")


def known_drive(axis: AxisConfig) -> Iterator[Finding]:
    """The drive exists."""
    if axis.model.drive not in DRIVES:
        yield Finding(("model", "drive"), f"no such drive: {did_you_mean(axis.model.drive, DRIVES)}")


def nominal_names(axis: AxisConfig) -> Iterator[Finding]:
    """Nominal values are of parameters of the drive, and of all of them."""
    known = {p.name: p for p in _drive(axis).parameters}
    for name in axis.model.nominal:
        if name not in known:
            yield Finding(("model", "nominal", name), _no_parameter(name, known))
    for name, p in known.items():
        if name not in axis.model.nominal:
            yield Finding(("model", "nominal", name), f"missing ({p.meaning} [{p.unit}])")


def nominal_values(axis: AxisConfig) -> Iterator[Finding]:
    """Each nominal value is one that the drive can have."""
    drive = _drive(axis)
    for name, value in _known(axis.model.nominal, drive).items():
        if problem := _refusal(drive, {name: value}):
            message = problem.removeprefix(f"nominal {name} = {value}: ")  # a finding says that anyway
            yield Finding(("model", "nominal", name), message)


def monitored(axis: AxisConfig) -> Iterator[Finding]:
    """Monitored parameters exist, once each, with a size that gives a threshold."""
    drive, seen = _drive(axis), set[str]()
    names = [p.name for p in drive.parameters]
    for i, name in enumerate(axis.model.monitor):
        base, inverse = split_name(name)
        if base not in names:
            known = [f"1/{n}" for n in names] if inverse else names
            yield Finding(("model", "monitor", i), _no_parameter(name, known))
        elif base in seen:
            yield Finding(("model", "monitor", i), f"{base} is monitored twice")
        seen.add(base)


def monitored_sizes(axis: AxisConfig) -> Iterator[Finding]:
    """Each monitored parameter has a size: its nominal value or a scale."""
    drive, model = _drive(axis), axis.model
    nominal = _known(model.nominal, drive)
    for i, name in enumerate(model.monitor):
        base = split_name(name)[0]
        if base not in nominal or _refusal(drive, {base: nominal[base]}) or model.scales.get(name) is ABSENT:
            continue
        if problem := _refusal(drive, {base: nominal[base]}, name, _present(model.scales)):
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


def bounds(axis: AxisConfig) -> Iterator[Finding]:
    """The nominal value lies between the bounds, and a positive parameter stays positive."""
    drive, model = _drive(axis), axis.model
    nominal = _known(model.nominal, drive)
    for name, (lower, upper) in _present(model.bounds).items():
        base, inverse = split_name(name)
        if base not in nominal or (inverse and nominal[base] == 0):
            continue
        value = 1 / nominal[base] if inverse else nominal[base]
        least = 0.0 if drive.parameter(name).positive else -math.inf
        if not least <= lower < value < upper or lower == least:
            need = "0 < lower < nominal < upper" if least == 0 else "lower < nominal < upper"
            yield Finding(("model", "bounds", name), f"must be [lower, upper] with {need} = {value}")


def predictor(axis: AxisConfig) -> Iterator[Finding]:
    """The predictor fits what is measured."""
    estimator = axis.estimator
    if estimator.predictor == "output-error":
        if axis.output == "angle":
            message = 'needs speed; from the angle without a gain it diverges: use "innovations"'
            yield Finding(("estimator", "predictor"), message)
        if estimator.gain:
            yield Finding(("estimator", "gain"), 'the predictor "output-error" has none: remove it')
    elif estimator.gain and axis.output == "angle" and not any(estimator.gain):
        yield Finding(("estimator", "gain"), "must not be zero: with the angle the prediction diverges")


def noises(axis: AxisConfig) -> Iterator[Finding]:
    """What the filter gain and lambda_0 are to be computed from is there."""
    estimator = axis.estimator
    pair = {"torque_noise": estimator.torque_noise, "output_noise": estimator.output_noise}
    missing = [name for name, value in pair.items() if value is None]
    if estimator.predictor == "output-error":
        if estimator.innovation_variance is None and estimator.output_noise is None:
            yield Finding(("estimator", "output_noise"), "missing: give output_noise or innovation_variance")
    elif not estimator.gain:
        for name in missing:
            message = "missing: the filter gain needs torque_noise and output_noise (or give gain)"
            yield Finding(("estimator", name), message)
    elif estimator.innovation_variance is None and missing:
        message = "missing: beside a gain give it, or torque_noise and output_noise"
        yield Finding(("estimator", "innovation_variance"), message)


def gain_length(axis: AxisConfig) -> Iterator[Finding]:
    """One gain for each state."""
    states = _drive(axis, axis.output).states
    gain = axis.estimator.gain
    if gain and len(gain) != len(states):
        names = ", ".join(state.name for state in states)
        message = f"has {len(gain)} numbers, must have {len(states)}, one for each state: {names}"
        yield Finding(("estimator", "gain"), message)


def initial_p(axis: AxisConfig) -> Iterator[Finding]:
    """P(0) is given for all monitored parameters or for none."""
    given = axis.estimator.initial_p
    for name in axis.model.monitor:
        if given and name not in given:
            yield Finding(("estimator", "initial_p", name), "missing: give all monitored parameters, or none")


def _drive(axis: AxisConfig, output: Output = "speed") -> Drive:
    """The drive; its parameters are the same for both outputs, its states are not."""
    if axis.model.drive not in DRIVES:
        raise Absent("drive")
    return DRIVES[axis.model.drive](output)


def _no_parameter(name: str, known: Mapping[str, object] | list[str]) -> str:
    return f"the drive has no such parameter: {did_you_mean(name, known)}"


def _present(values: Mapping[str, T]) -> dict[str, T]:
    return {name: value for name, value in values.items() if value is not ABSENT}


def _known(values: Mapping[str, float], drive: Drive) -> dict[str, float]:
    """The values that are right in themselves, of parameters of the drive."""
    names = {p.name for p in drive.parameters}
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


MODEL_RULES = (
    known_drive,
    nominal_names,
    nominal_values,
    monitored,
    monitored_sizes,
    scales_and_bounds,
    bounds,
    predictor,
    noises,
    gain_length,
    initial_p,
)
