"""Finds the signal that tells when a force acts on an arm that none of its motions, and no load of links, explains.

A robot that grinds, presses or joins holds its links, too.  Their weight hides that one mass explains the torque while
the tool is not in contact, and the signal of the contact looks like that of a load.  So the load of links is looked for
in the rest of the time alone; and while the force acts, not even the best load of links for that part explains the
torque, as it does where something is carried.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.drive.gates import Gate, OpenGates
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.contact_force import (
    MIN_EXPLAINED,
    MIN_FREE,
    ContactForce,
    two_values,
)
from monitor_core.identification.torque_balance.torque_windows import leaves_much_less
from monitor_core.identification.weight.arm_links import ArmSignals
from monitor_core.identification.weight.arm_load import ArmLoad, arm_load


class ArmContact(NamedTuple):
    """A force that acts on an axis of an arm for a part of the time."""

    force: ContactForce
    load: ArmLoad
    """The load of links in the rest of the time"""
    free_share: float
    """Part of the time in which the force does not act"""


def arm_contact(records: Sequence[Record], signals: ArmSignals, explained: float, settle_s: float) -> ArmContact | None:
    """The force that acts on an axis of an arm while a signal has one of its two values; None: no signal tells of one.

    Args:
        records: of the axis, with these signals, which vary there (``recorded_signals``).
        signals: their loads are the signals that may tell.
        explained: share of the torque that the loads explain at all times; in the rest of the time much more must be.
        settle_s: time after a change of the signal until the force has come or gone, which is left out [s].
    """
    if not signals.own:
        return None
    found = [
        contact
        for name, values in two_values(records, signals.loads)
        for contact in _contacts(records, signals, name, values, explained, settle_s)
    ]
    best = max((contact.force.explained for contact in found), default=0.0)
    # Of those that leave about as little torque, the one that leaves most of the time for the monitor.
    good = [contact for contact in found if not leaves_much_less(best, contact.force.explained)]
    return max(good, key=lambda contact: contact.free_share, default=None)


def _contacts(
    records: Sequence[Record],
    signals: ArmSignals,
    name: str,
    values: tuple[float, float],
    explained: float,
    settle_s: float,
) -> Iterator[ArmContact]:
    for free, pressing in (values, values[::-1]):
        share = float(np.mean(np.concatenate([record.signals[name] == free for record in records])))
        load = _load_while(records, signals, Gate(name, (free,), settle_s=settle_s)) if share >= MIN_FREE else None
        if load is None or load.weights.explained < MIN_EXPLAINED:
            continue
        if not leaves_much_less(load.weights.explained, explained):
            continue
        beside = _load_while(records, signals, Gate(name, (pressing,), settle_s=settle_s))
        if beside is None or beside.weights.explained < MIN_EXPLAINED:
            yield ArmContact(ContactForce(name, free, pressing, load.weights.explained), load, share)


def _load_while(records: Sequence[Record], signals: ArmSignals, gate: Gate) -> ArmLoad | None:
    """The load of links while this gate is open; None: there is none, or only one axis to look at."""
    others = [load for load in signals.loads if load != gate.signal]
    if len(signals.angles) < 2 and not others:
        return None  # drives of the library have the weight of a single axis
    found = arm_load([_gated(record, gate) for record in records], signals._replace(loads=others))
    return found if found is not None and found.weights.is_load else None


def _gated(record: Record, gate: Gate) -> Record:
    """The record with this gate, too, as the monitor will have it."""
    t_us = np.rint(record.t * 1e6).astype(np.int64)
    return replace(record, gate=record.judged & OpenGates([gate]).take(t_us, record.signals))
