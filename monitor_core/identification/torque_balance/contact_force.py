"""Finds the signal that tells when a force acts on an axis that none of its motions explains.

A welding gun, a press or a clamp moves freely for a part of its cycle and presses for the rest.  While it presses, the
torque is that of a spring, of a workpiece, or of a controller of the force: no drive predicts it.  A controller knows
that it presses, by an output of two values.  With that part left out, one mass explains the torque.

A load that is carried is another case: it adds to the torque and to the inertia, and both parts can be used.  A spring
gives way with the torque, so as one mass the axis has no inertia or a negative one while it presses.  So has a
pendulum: a weight that turns must be looked for as well (arm_links.py).  An axis of an arm that presses holds its
links, too (arm_contact.py).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import Rigid, rigid_fits, speed_scales
from monitor_core.identification.torque_balance.torque_windows import SIGNAL, USUAL, TorqueTerm, leaves_much_less

MIN_FREE = 0.2
"""Least share of the time in which the axis must move freely."""
MIN_EXPLAINED = 0.85
"""Least share of the torque that one mass, or one mass with the load of links, explains in that time."""
_MIN_SIGMAS = 5.0
"""The inertia of that mass exceeds so many of its standard deviations; while it presses, the apparent one does not."""


class ContactForce(NamedTuple):
    """A signal of two values, during one of which a force acts that no motion explains."""

    signal: str
    free: float
    """Value of the signal while the axis moves freely"""
    pressing: float
    """Value while that force acts"""
    explained: float
    """Share of the torque that is explained while the axis moves freely"""


def contact_force(records: Sequence[Record], signals: Sequence[str]) -> ContactForce | None:
    """The signal that tells best when the axis moves freely; None: none does, or a load explains the torque as well.

    ``records``: of the axis, with these signals.
    """
    found = [force for name, values in two_values(records, signals) for force in _forces(records, name, values)]
    return max(found, key=lambda force: force.explained, default=None)


def two_values(records: Sequence[Record], signals: Sequence[str]) -> Iterator[tuple[str, tuple[float, float]]]:
    """Those of these signals that have only two values in the records, with these values, the smaller one first."""
    for name in signals:
        known = [values[np.isfinite(values)] for record in records for values in [record.signals[name]]]
        values = np.unique(np.concatenate(known))
        if len(values) == 2:
            yield name, (float(values[0]), float(values[1]))


def _forces(records: Sequence[Record], name: str, values: tuple[float, float]) -> Iterator[ContactForce]:
    loaded = [replace(record, signals={SIGNAL: record.signals[name]}) for record in records]
    constant = _explained(_rigid(loaded, (*USUAL, "signal")))
    parts = [[_where(record, name, value) for record in records] for value in values]
    for k, (during, beside) in enumerate((parts, parts[::-1])):
        fit = _rigid(during, USUAL)
        force = ContactForce(name, values[k], values[1 - k], _explained(fit))
        if fit is None or force.explained < MIN_EXPLAINED or not leaves_much_less(force.explained, constant):
            continue
        pressing = _rigid(beside, USUAL)
        share = np.mean(np.concatenate([record.judged for record in during]))
        if share > MIN_FREE and _has_inertia(fit) and not (pressing and _has_inertia(pressing)):
            yield force


def _where(record: Record, name: str, value: float) -> Record:
    """The record with a gate that is open while the signal has this value."""
    return replace(record, gate=record.judged & (record.signals[name] == value))


def _has_inertia(fit: Rigid) -> bool:
    return fit.inertia > _MIN_SIGMAS * fit.sd


def _rigid(records: Sequence[Record], terms: Sequence[TorqueTerm]) -> Rigid | None:
    return rigid_fits(records, [terms], speed_scales(records)[1], moving=True)[0]


def _explained(fit: Rigid | None) -> float:
    """Share of the torque of other windows that a mass explains."""
    return 0.0 if fit is None else 1 - float(np.sqrt(max(1 - fit.expected, 0.0)))
