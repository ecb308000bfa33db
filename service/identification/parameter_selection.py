"""Which parameters of a drive are to be found: all that its sensors can tell, or as the user says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.drive.structure import Drive, split_name
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.statespace import StateSpace
from service.identification.errors import IdentificationError
from service.texts.suggestions import did_you_mean

RELATIVE = ("kT", "r")
"""Torque constant and gear ratio: known from data sheets, so they are held unless the user frees them."""


class Choice(NamedTuple):
    """Names that are free, and those that are held at their nominal values, each with the reason."""

    free: tuple[str, ...]
    held: Mapping[str, str]


def choose(
    space: StateSpace, drive: Drive, nominal: Mapping[str, float], free: Sequence[str], fix: Sequence[str]
) -> Choice:
    """The parameters to be found.

    Args:
        space: the drive's, for what can be told at all.
        drive: whose parameters they are.
        nominal: values of all of them; friction that is held at zero tells nothing.
        free: names that the user wants, "1/Ja" for the reciprocal of Ja; empty: all that can be told.
        fix: names that stay as they are.

    Raises:
        IdentificationError: no such name, a name that is both, or parameters that no record can tell apart.
    """
    _check_names(drive, (*free, *fix))
    both = {split_name(name)[0] for name in free} & {split_name(name)[0] for name in fix}
    if both:
        raise IdentificationError(f"{', '.join(sorted(both))}: cannot be both free and fixed")
    fixed = {split_name(name)[0]: "fixed by --fix" for name in fix}
    chosen = _chosen(drive, free, fixed) if free else _default(space, drive, fixed)
    if not chosen.free:
        raise IdentificationError(f"nothing is free: of {_names(drive)} all are held")
    _check_told(space, chosen.free, _acting(drive, nominal, chosen.free))
    return chosen


def _check_names(drive: Drive, names: Sequence[str]) -> None:
    known = [p.name for p in drive.parameters]
    for name in names:
        base, _ = split_name(name)
        if base in known:
            continue
        if base in {p.name for p in drive.drawn}:
            try:
                drive.parameter(base)
            except KeyError as error:
                raise IdentificationError(str(error.args[0]).replace("monitor that", "name that")) from None
        raise IdentificationError(f"the drive has no parameter {base}: {did_you_mean(base, known)}")


def _chosen(drive: Drive, free: Sequence[str], fixed: Mapping[str, str]) -> Choice:
    bases = {split_name(name)[0] for name in free}
    rest = {p.name: "not in --free" for p in drive.parameters if p.name not in bases}
    return Choice(tuple(dict.fromkeys(free)), {**rest, **fixed})


def _default(space: StateSpace, drive: Drive, fixed: Mapping[str, str]) -> Choice:
    """All but what is fixed, torque constant, gear ratio, and what then still cannot be told."""
    names = [p.name for p in drive.parameters]
    held = {**{name: "known from the data sheet" for name in RELATIVE if name in names}, **fixed}
    drawn = [p.name for p in space.drawn if p.name not in held]
    reason = "the sensors cannot tell it from the others"
    held |= (
        {name: reason for name in structural(space, drawn).suggestion if name not in held} if drawn else {}
    )
    return Choice(tuple(n for n in names if n not in held), {n: held[n] for n in names if n in held})


def _acting(drive: Drive, nominal: Mapping[str, float], free: Sequence[str]) -> list[int]:
    """The inputs that do anything with these parameters free."""
    bases = {split_name(name)[0] for name in free}
    values = {name: value or float(name in bases) for name, value in nominal.items()}
    return [int(column) for column in np.flatnonzero(drive.matrix("B", values).any(axis=0))]


def _check_told(space: StateSpace, free: Sequence[str], inputs: Sequence[int]) -> None:
    """That some record could tell them; merged parameters are told by what they are merged for."""
    drawn = {p.name for p in space.drawn}
    bases = [split_name(name)[0] for name in free]
    if not set(bases) <= drawn:
        return
    told = structural(space, bases, inputs=inputs)
    if told.suggestion:
        raise IdentificationError(
            f"{len(bases)} parameters are free, but torque and motion can tell only {told.count} numbers:"
            f" {' '.join(told.words())}"
        )


def _names(drive: Drive) -> str:
    return ", ".join(p.name for p in drive.parameters)
