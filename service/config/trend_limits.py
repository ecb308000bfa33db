"""Limits of an axis, as the core takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from monitor_core.drive import AxisModel
from monitor_core.monitoring import Limit
from service.config.schema import AxisConfig


def reciprocal(name: str) -> str:
    """Ja of 1/Ja, and the other way round."""
    return name.removeprefix("1/") if name.startswith("1/") else f"1/{name}"


def monitored_as(name: str, monitor: Sequence[str]) -> str | None:
    """The monitored parameter that a limit of this name is about; None: there is none."""
    return next((own for own in (name, reciprocal(name)) if own in monitor), None)


def limits_of(axis: AxisConfig, model: AxisModel) -> Mapping[str, tuple[Limit, ...]]:
    """The limits of each monitored parameter that has any."""
    found = {}
    for name, values in axis.model.limits.items():
        own = monitored_as(name, model.monitored)
        assert own is not None  # a cross-check ensures it
        i = model.monitored.index(own)
        nominal, p = float(model.theta0[i]), model.parameters[i]
        nominal = nominal if own == name else 1 / nominal
        unit = p.unit if own == name else _inverse(p.unit)
        found[own] = tuple(_limit(name, unit, value, value > nominal, own != name) for value in values)
    return found


def _limit(name: str, unit: str, value: float, above: bool, inverse: bool) -> Limit:
    own = 1 / value if inverse else value
    return Limit(own, above != inverse, name, unit, value, above)


def _inverse(unit: str) -> str:
    """kg m^2 of 1/(kg m^2), and the other way round."""
    if unit == "1":
        return unit
    plain = unit.removeprefix("1/")
    if plain != unit:
        return plain.removeprefix("(").removesuffix(")")
    return f"1/({unit})" if " " in unit or "/" in unit else f"1/{unit}"
