"""The values that a fit starts from: as configured, as found before, or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive, split_name
from service.config import NamedAxis, given_values
from service.identification.errors import IdentificationError
from service.identification.parameter_selection import Choice

Start = Literal["values", "search", "records"]


class Nominal(NamedTuple):
    """Values of all parameters of a drive; those of the ``unknown`` ones stand for nothing."""

    values: Mapping[str, float]
    unknown: tuple[str, ...]


def nominal_of(axis: NamedAxis, drive: Drive) -> Nominal:
    """What the configuration says, or the file of nominal values that it names."""
    names = {p.name for p in (*drive.parameters, *drive.drawn)}
    values = {name: value for name, value in given_values(axis.config).items() if name in names}
    unknown = tuple(p.name for p in drive.parameters if not _is_known(drive, p.name, values))
    stand_in = {name: 1.0 if drive.parameter(name).positive else 0.0 for name in unknown}
    return Nominal(AxisModel(drive, {**values, **stand_in}, ()).nominal, unknown)


def _is_known(drive: Drive, name: str, values: Mapping[str, float]) -> bool:
    """It is given, or all that it is merged from."""
    merged = next((d for d in drive.definitions if d.name == name), None)
    if name in values or merged is None:
        return name in values
    return all(_is_known(drive, part, values) for part in merged.names)


def start_of(nominal: Nominal, choice: Choice, wished: Start | None) -> Start:
    """Where the fit starts, unless the user says so: around the values if they are known, else at the records.

    Raises:
        IdentificationError: values are needed that are not there.
    """
    free = {split_name(name)[0] for name in choice.free}
    if held := [name for name in nominal.unknown if name not in free]:
        raise IdentificationError(
            f"no value of {_listed(held)}, to be held: give it in [robot.axis.model.nominal], or free it with --free"
        )
    if nominal.unknown and wished in ("values", "search"):
        raise IdentificationError(
            f"--start {wished} needs a value of {_listed(nominal.unknown)}: give it in [robot.axis.model.nominal], or"
            " let --start records find it"
        )
    return wished or ("records" if nominal.unknown else "search")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
