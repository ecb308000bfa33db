"""The minimal state-space form of a drive, exact and in symbols."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from monitor_core.drive.structure import Quantity
from monitor_core.modeling.flat import FlatInput, FlatParameter, FlatSensor
from monitor_core.modeling.laurent import Laurent

Entries = Mapping[tuple[int, int], Laurent]
"""A matrix by its entries that are not zero: (row, column) -> Laurent."""


@dataclass(frozen=True, slots=True)
class Definition:
    """``name`` = the sum of Laurent terms ``value`` in parameters and in names defined before."""

    name: str
    value: Laurent


@dataclass(frozen=True, slots=True)
class Report:
    """Counts of the elimination.

    ``flat_states``: variables whose derivative occurs in the flat equations.  ``remaining_equations``: equations that
    are left, outputs included, after all substitutions.
    """

    flat_equations: int
    flat_variables: int
    flat_states: int
    remaining_equations: int


@dataclass(frozen=True, slots=True)
class StateSpace:
    """x' = A x + B u,  y = C x, with n states, m inputs and as many outputs as ``sensors``.

    ``parameters`` are those that occur in A, B, C: the user's own, and merged ones, whose ``definitions`` in terms of
    the user's ("Jm + r^2*Jg") are to be evaluated in order; ``drawn`` are all of the user's own. ``rest`` (n, 1) is the
    state of the drive moving rigidly at output 1; ``ratio`` (m, 1) the angle at the flange of each input that depends
    on the motion, while the first sensor's angle is 1.  ``speed_states``: for each sensor, the state that is the speed
    there up to a factor, -1 if there is none. ``notes`` are sentences on what was left out and why.
    """

    name: str
    states: tuple[Quantity, ...]
    inputs: tuple[FlatInput, ...]
    sensors: tuple[FlatSensor, ...]
    A: Entries
    B: Entries
    C: Entries
    rest: Entries
    ratio: Entries
    speed_states: tuple[int, ...]
    parameters: tuple[FlatParameter, ...]
    drawn: tuple[FlatParameter, ...]
    definitions: tuple[Definition, ...]
    report: Report
    notes: tuple[str, ...]
