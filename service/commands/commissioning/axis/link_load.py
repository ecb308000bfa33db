"""What commissioning tries if the links of an arm, a measured load or a contact force act on an axis.

A torque offset then follows the angles of axes, their speeds and accelerations, and the signals of that axis; a gate
leaves out the time in which the axis presses.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import Term
from monitor_core.identification import (
    ArmSignals,
    ContactForce,
    LinkWeights,
    MotionSignals,
    Record,
    contact_force,
    gear_ratios,
    link_weights,
)
from service.commands.commissioning.signals.checked_axis import configured
from service.config import Config, NamedAxis, gear_ratio
from service.config.commissioned import GATE, SIGNAL, Correction, corrected
from service.config.unit_names import unit_in
from service.ingest.loaded_records import load

_MUCH_LESS = 0.5
_SETTLE_S = 0.1
"""Time after a signal says that an axis does not press any more until it moves freely [s]."""
_MOST_TURN = 4 * np.pi
"""Largest range of the angle of an arm's axis [rad]; a larger one is that of a motor before its gearbox."""


class LinkLoad(NamedTuple):
    """Changes for another identification."""

    signals: tuple[Correction, ...]
    """Angles, speeds and accelerations of axes, as signals of this axis; angles also where the records do not tell
    whether the load follows them"""
    terms: tuple[str, ...]
    """Terms of the torque offset: "cos(axis2 + axis3)", "axis2-acceleration", "payload", .."""
    explained: float
    """Share of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """The same without these terms"""

    @property
    def explains_much_more(self) -> bool:
        """Whether the terms leave less than half of the squared errors."""
        return _leaves_much_less(self.explained, self.before)


def _leaves_much_less(explained: float, before: float) -> bool:
    return (1 - explained) ** 2 < _MUCH_LESS * (1 - before) ** 2


def link_load(text: str, axis_id: str, records: Sequence[str], folder: Path) -> LinkLoad | None:
    """The angles, their derivatives, and the signals on which the load of links on an axis depends.

    None: the torque shows no such load, or only a weight that depends on the angle of the axis itself.

    ``text``: the configuration, valid in ``folder``; ``records``: files, each with or without a range.

    Raises:
        RecordError, DescriptionError, IngestError: a record cannot be read.
    """
    config, axis = configured(text, axis_id, folder)
    candidates = _candidates(config, axis)
    if not candidates.angles and not candidates.loads:
        return None
    recorded = _recorded(candidates, text, axis_id, records, folder)
    found, ratios = _weights_and_ratios(recorded)
    if found is None:
        return None
    used = {signal for term in found.terms for signal in Term.read(term).signals}
    if used == {recorded.own} and not axis.config.coupling:  # else no drive has it: the angle in it is the motor's
        return None
    changes = [
        _undetermined(change) if change.key[1] in found.undetermined and change.key[-1] == "axis" else change
        for change in _changes(candidates, ratios, used.union(found.undetermined))
    ]
    return LinkLoad(tuple(changes), found.terms, found.explained, found.before)


def pressing_gate(
    text: str, axis_id: str, records: Sequence[str], folder: Path
) -> tuple[ContactForce, tuple[Correction, ...]] | None:
    """The force that acts while a signal of the axis has one of its two values, and the gate that leaves it out.

    None: no signal tells of such a force.  Arguments and errors as of ``link_load``.
    """
    candidates = _candidates(*configured(text, axis_id, folder))
    if not candidates.loads:
        return None
    recorded = _recorded(candidates, text, axis_id, records, folder)
    found = contact_force(recorded.records, recorded.loads)
    if found is None:
        return None
    key = "below" if found.free < found.pressing else "above"
    reason = (
        f"while {found.signal} is {found.pressing:g}, a force acts that no motion of the axis explains; without that"
        f" part one mass explains {100 * found.explained:.0f} % of the torque"
    )
    settling = "then the force has gone, and the prediction has forgotten it"
    return found, (
        Correction((GATE, found.signal, key), (found.free + found.pressing) / 2, reason),
        Correction((GATE, found.signal, "settle_s"), _SETTLE_S, settling),
    )


# --- The signals that the load may depend on --------------------------------------------------------------------------


class _LoadSignals(NamedTuple):
    """Signals on which the load of an axis may depend, as changes of its configuration, by the names of axes."""

    axis: str
    angles: Mapping[str, tuple[Correction, ...]]
    """Of the axes of its arm, own too; empty: it has no arm"""
    derivatives: Mapping[str, tuple[tuple[Correction, ...], ...]]
    """Speed and acceleration of these; empty where they are not known"""
    loads: tuple[str, ...]
    """Names of its signals that are not the motion of an axis, and no gates: a gate leaves out what they tell"""
    of_arm: frozenset[str]
    """Names of the angles that are those of the arm in any case, not those of motors"""

    @property
    def searched(self) -> list[Correction]:
        """The changes that add the angles and the accelerations of other axes: those that records must have."""
        return [*chain.from_iterable(self.angles.values()), *chain.from_iterable(self.accelerations)]

    @property
    def accelerations(self) -> list[tuple[Correction, ...]]:
        """Accelerations of other axes."""
        return [found[1] for name, found in self.derivatives.items() if found and name != self.axis]

    @property
    def names(self) -> dict[str, str]:
        """The name of the signal that is the angle of each axis."""
        return {name: changes[0].key[1] for name, changes in self.angles.items()}

    def motion_signals(self, axis: str) -> MotionSignals | None:
        """Names of the signals that are speed and acceleration of an axis; None: they are not known."""
        found = self.derivatives.get(axis)
        return MotionSignals(*(changes[0].key[1] for changes in found)) if found else None


def _candidates(config: Config, axis: NamedAxis) -> _LoadSignals:
    """The angles of the arm only if the axis itself is one of them, and not the only one, unless it may bear a load."""
    others = list(_arm(config, axis))
    gates = {gate.signal for gate in axis.config.gate}
    known = gates.union(axis.config.coupling)
    loads = tuple(s.name for s in axis.config.signal if s.axis is None and s.name not in known)
    if axis.id not in {other.id for other in others} or (len(others) < 2 and not loads and not axis.config.coupling):
        others = []
    angles = {other.config.name: _signal(axis, other) for other in others}
    given = {signal.name for signal in axis.config.signal}
    turning = {angles[other.config.name][0].key[1] for other in others if _turns_on(other)}
    derivatives = {other.config.name: _derivatives(axis, other) for other in others}
    return _LoadSignals(axis.config.name, angles, derivatives, loads, frozenset(given | turning))


def _changes(candidates: _LoadSignals, ratios: Mapping[str, float], used: Collection[str]) -> Iterator[Correction]:
    """The changes of the configuration that add the used signals, with the gear ratios that were found."""
    motions = [*candidates.angles.values(), *chain.from_iterable(candidates.derivatives.values())]
    yield from (change for change in chain.from_iterable(motions) if change.key[1] in used)
    axes = {signal: axis for axis, signal in candidates.names.items()}
    for name, ratio in ratios.items():
        for signal in (name, *(candidates.motion_signals(axes[name]) or ())):
            if signal in used:
                yield _gear(signal, ratio)


def _undetermined(change: Correction) -> Correction:
    """The change that adds an angle, so that it is part of the pose although no term has it."""
    reason = f"the load may follow the angle of {change.value}, too: these records do not show whether it does"
    return change._replace(reason=reason)


# --- The search in the records ----------------------------------------------------------------------------------------


class _Recorded(NamedTuple):
    """The records of an axis, and which of the candidates they have."""

    records: Sequence[Record]
    own: str
    """The angle of the axis itself; "": it has no arm"""
    angles: Mapping[str, float]
    """Ranges of the angles of its arm in the records [rad]"""
    motors: Collection[str]
    """Those of them that are the angles of motors before their gears"""
    moving: Mapping[str, MotionSignals]
    """Speed and acceleration by the name of the angle, where they are known"""
    loads: Sequence[str]
    accelerations: Sequence[str]


def _recorded(candidates: _LoadSignals, text: str, axis_id: str, names: Sequence[str], folder: Path) -> _Recorded:
    """The records of these names, read with the candidates as signals; other arguments as of ``link_load``."""
    config, _ = configured(corrected(text, axis_id, candidates.searched), axis_id, folder)
    records = [load(name, config, axis_id).record for name in names]
    ranges = {n: float(np.max([_extent(r.signals.get(n)) for r in records])) for n in candidates.names.values()}
    angles = {name: extent for name, extent in ranges.items() if math.isfinite(extent)}

    def varying(signals: Iterable[str]) -> list[str]:
        return [name for name in signals if all(_extent(record.signals.get(name)) > 0 for record in records)]

    motions = {signal: candidates.motion_signals(axis) for axis, signal in candidates.names.items()}
    return _Recorded(
        records,
        candidates.names.get(candidates.axis, ""),
        angles,
        [name for name, extent in angles.items() if extent >= _MOST_TURN and name not in candidates.of_arm],
        {name: motion for name, motion in motions.items() if motion is not None},
        varying(candidates.loads),
        varying(changes[0].key[1] for changes in candidates.accelerations),
    )


def _weights_and_ratios(r: _Recorded) -> tuple[LinkWeights | None, Mapping[str, float]]:
    """The terms of the load, and the gear ratios with which angles of motors are in them."""
    ratios: Mapping[str, float] = {}
    if r.own in r.motors:
        ratios = gear_ratios(r.records, r.own, list(r.angles), r.motors, r.accelerations)
    angles = [name for name, extent in r.angles.items() if extent < _MOST_TURN or name in ratios]
    if r.own not in angles:
        angles = []
    geared = [_behind_gears(record, ratios) for record in r.records]
    moving = {name: motion for name, motion in r.moving.items() if name in r.angles}
    found = link_weights(geared, ArmSignals(r.own, angles, r.loads, r.accelerations, moving))
    if r.own in r.motors and r.own in moving and r.loads:
        # It may be a linear axis, whose load follows no angle.
        plain = link_weights(r.records, ArmSignals(r.own, (), r.loads, r.accelerations, moving))
        if plain is not None and (found is None or not _leaves_much_less(found.explained, plain.explained)):
            return plain, {}
    return found, ratios


def motors_without_ratio(text: str, axis_id: str, records: Sequence[str], folder: Path) -> tuple[str, ...]:
    """The axes of the same robot, by name, whose angles are those of motors with an unknown gear ratio.

    Their angles turn by more than those of an arm do.  Linear axes are not among them, if their unit tells.  None, if
    a ratio is configured for some axis of the robot: then the others are linear.

    Arguments and errors as of ``link_load``.
    """
    config, axis = configured(text, axis_id, folder)
    arm = {other.config.name: other for other in _arm(config, axis)}
    if any(gear_ratio(other.config) != 1.0 for other in arm.values()):
        return ()
    candidates = _candidates(config, axis)
    motors = _recorded(candidates, text, axis_id, records, folder).motors
    return tuple(name for name, angle in candidates.names.items() if angle in motors and not _is_linear(arm[name]))


def _is_linear(axis: NamedAxis) -> bool:
    angle = axis.config.angle
    unit = None if angle is None else unit_in(angle.column or angle.signal, "angle")
    return unit is not None and unit.linear


def _arm(config: Config, axis: NamedAxis) -> Iterator[NamedAxis]:
    """The axes of the same robot, including this one, whose angles may be signals of this axis."""
    for other in config.axes:
        angle = other.config.angle
        known = angle is not None and (angle.wrap_period is None or _turns_on(other))
        known = known and other.config.output == "angle"
        if known and other.robot == axis.robot and other.config.bus == axis.config.bus:
            yield other


def _turns_on(axis: NamedAxis) -> bool:
    """Whether the angle starts again after a turn of the axis, which does not change its cosine."""
    ratio = gear_ratio(axis.config)
    return axis.config.angle is not None and axis.config.angle.wraps_after_a_turn(ratio)


def _signal(axis: NamedAxis, other: NamedAxis) -> tuple[Correction, ...]:
    """The angle of an arm's axis as a signal, with its name in the configuration, or that of the axis."""
    names = {s.axis: s.name for s in axis.config.signal if not s.is_derivative}
    own = other.config.name
    name = _lettered(own)
    name = names.get(own, f"{name}-angle" if name in names.values() else name)
    reason = f"the torque shows the load of links, which follows the angle of {own}"
    found = [Correction((SIGNAL, name, "axis"), own, reason)]
    return tuple(found) if own in names else (*found, *_geared(name, other))


def _geared(name: str, other: NamedAxis) -> Iterator[Correction]:
    """The given gear ratio of an axis as the factor of a signal; none if there is none."""
    ratio = gear_ratio(other.config)
    if ratio != 1.0:
        reason = "the gear ratio: the motion of the arm, not of the motor"
        yield Correction((SIGNAL, name, "factor"), ratio, reason)


def _lettered(own: str) -> str:
    """The name of an axis with a letter in it, as a number is no name of a signal."""
    return own if any(c.isalpha() for c in own) else f"axis{own}"


def _derivatives(axis: NamedAxis, other: NamedAxis) -> tuple[tuple[Correction, ...], ...]:
    """Speed and acceleration of an axis with the same sample interval, as signals; none if its angle wraps."""
    own, angle = other.config.name, other.config.angle
    if angle is None or angle.wrap_period is not None or not other.config.is_sampled_as(axis.config):
        return ()
    found = list[tuple[Correction, ...]]()
    for key, reason in (
        ("speed", f"the links couple the axis to the motion of {own}"),
        ("acceleration", f"the links couple the axis to the acceleration of {own}"),
    ):
        given = [s.name for s in axis.config.signal if s.axis == own and getattr(s, key)]
        name = next(iter(given), f"{_lettered(own)}-{key}")
        changes = (
            Correction((SIGNAL, name, "axis"), own, reason),
            Correction((SIGNAL, name, key), True, reason),
        )
        found.append(changes if given else (*changes, *_geared(name, other)))
    return tuple(found)


def _extent(angle: Floats | None) -> float:
    """Range of a signal [rad]; NaN: unknown."""
    known = np.zeros(0) if angle is None else angle[np.isfinite(angle)]
    return float(np.ptp(known)) if known.size else math.nan


def _behind_gears(record: Record, ratios: Mapping[str, float]) -> Record:
    """The record with angles of the arm instead of those of the motors."""
    turned = {name: ratio * record.signals[name] for name, ratio in ratios.items()}
    return replace(record, signals={**record.signals, **turned})


def _gear(name: str, ratio: float) -> Correction:
    reason = f"the weight turns about as with a gear of 1/{1 / ratio:.3g}; the data sheet has the exact ratio"
    return Correction((SIGNAL, name, "factor"), float(f"{ratio:.3g}"), reason)
