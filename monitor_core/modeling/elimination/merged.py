"""The parameters of a state space: the user's own that occur, and merged ones with unit, meaning and value."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from monitor_core.modeling.components.units import parse
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.laurent import Laurent

_TOGETHER = "taken together: "


def parameters_of(
    drawn: Sequence[FlatParameter], definitions: Mapping[str, Laurent], occurring: Collection[str]
) -> tuple[FlatParameter, ...]:
    """The occurring parameters in the order in which they were drawn, a merged one where its first part stood."""
    known = {p.name: p for p in drawn}
    for name, value in definitions.items():
        known[name] = _merged(name, value, known)
    rank = {p.name: k for k, p in enumerate(drawn)}
    for name, value in definitions.items():
        rank[name] = min(rank[part] for part in value.names)
    return tuple(known[name] for name in sorted(occurring, key=lambda name: (rank[name], name)))


def _merged(name: str, value: Laurent, known: Mapping[str, FlatParameter]) -> FlatParameter:
    parts = [p for p in known.values() if p.name in value.names]
    meanings = [(p.meaning or p.name).removeprefix(_TOGETHER) for p in parts]
    said = dict.fromkeys(meaning for listed in meanings for meaning in listed.split(", "))
    numbers = {p.name: p.value for p in parts if p.value is not None}
    return FlatParameter(
        name=name,
        unit=_unit(value, known),
        meaning=_TOGETHER + ", ".join(said),
        value=float(value.value(numbers)) if len(numbers) == len(parts) else None,
        positive=all(p.positive for p in parts) and all(c > 0 for _, c in value),
        origin=parts[0].origin,
    )


def _unit(value: Laurent, known: Mapping[str, FlatParameter]) -> str:
    """The unit of the first term; that all terms agree is checked when the drive is read."""
    monomial, _ = next(iter(value))
    units = [known[name].unit for name, _ in monomial]
    if not all(units):
        return ""
    total = parse("1")
    for unit, (_, power) in zip(units, monomial, strict=True):
        total = total * parse(unit) ** power
    return str(total)
