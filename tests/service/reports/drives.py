"""Drives for reports: the three-mass one of the library, and the same with other parameters."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from monitor_core.drive.structure import Output
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import Definition, Entries, Report, StateSpace
from service.config.drive_sources import model_of_library


@cache
def space(output: Output = "speed", name: str = "three-mass") -> StateSpace:
    """The three-mass drive of the paper, with a note and other counts of its elimination."""
    note = "the angle of the whole drive cannot be seen by a speed sensor: it is no state"
    report = Report(flat_equations=71, flat_variables=70, flat_states=11, remaining_equations=6)
    return replace(
        model_of_library("three-mass", None, output).space, name=name, notes=(note,), report=report
    )


def merged(drive: StateSpace, name: str = "Jm") -> StateSpace:
    """The same with Jm = J1 + n^2 J2, as two rigidly joined inertias give it, under this name."""
    symbol = Laurent.symbol
    one = FlatParameter("J1", "kg m^2", "rotor", 0.005, True)
    two = FlatParameter("J2", "kg m^2", "brake", 0.001, True)
    ratio = FlatParameter("n", "1", "ratio of the brake", 0.5)
    kept = tuple(p for p in drive.drawn if p.name != "Jm")
    definition = Definition(name, symbol("J1") + symbol("n", 2) * symbol("J2"))
    return replace(renamed(drive, {"Jm": name}), drawn=(one, two, ratio, *kept), definitions=(definition,))


def renamed(drive: StateSpace, names: Mapping[str, str]) -> StateSpace:
    """The same drive with other names of its parameters."""
    symbols = {old: Laurent.symbol(new) for old, new in names.items()}

    def of(entries: Entries) -> Entries:
        return {place: value.substitute(symbols) for place, value in entries.items()}

    parameters = tuple(replace(p, name=names.get(p.name, p.name)) for p in drive.parameters)
    return replace(
        drive, parameters=parameters, drawn=parameters, A=of(drive.A), B=of(drive.B), C=of(drive.C)
    )
