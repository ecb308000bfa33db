"""Rules for limits: they are of what is monitored, on the right side of its nominal value, and can be reached."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from monitor_core.drive.axis_model import AxisModel
from monitor_core.suggestions import did_you_mean
from service.config.base_table import ABSENT, Absent
from service.config.model_rules import usable_drive
from service.config.schema import AxisConfig
from service.config.skew import bounds_of, scales_of, watched_values
from service.config.trend_limits import monitored_as
from service.config.validation_messages import Finding


def limited(axis: AxisConfig) -> Iterator[Finding]:
    """A limit is of a monitored parameter or of its reciprocal, and of one of them only."""
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
    """A lower limit is below the nominal value, an upper one above, and the estimate may go so far."""
    model = _model(axis)
    for name, values in axis.model.limits.items():
        own = monitored_as(name, axis.model.monitor)
        if own is None or values is ABSENT:
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
        yield from _of(name, values, nominal, bounds)


def _of(name: str, values: tuple[float, ...], nominal: float, bounds: tuple[float, ...]) -> Iterator[Finding]:
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


def _model(axis: AxisConfig) -> AxisModel:
    drive = usable_drive(axis)
    try:
        return AxisModel(drive, watched_values(axis), axis.model.monitor, scales_of(axis), bounds_of(axis))
    except (KeyError, ValueError):  # other rules say what is wrong
        raise Absent("model") from None


LIMIT_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (limited, sides)
