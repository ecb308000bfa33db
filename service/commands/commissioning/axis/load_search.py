"""What loads an axis beside its own mass: the links of an arm, a measured load, or a contact force.

For links and loads a torque offset follows the angles of axes, their speeds and accelerations, and the signals of the
axis; a gate leaves out the time in which the axis presses.  The core finds them (``arm_load``, ``contact_force``,
``arm_contact``); this file reads the records with the signals that they may need, and makes changes of the
configuration of what is found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from monitor_core.identification import (
    ArmLoad,
    ArmSignals,
    ContactForce,
    LinkWeights,
    MotionSignals,
    Record,
    arm_contact,
    arm_load,
    contact_force,
    motor_angles,
    recorded_signals,
)
from service.config import Config, NamedAxis, gear_ratio
from service.config.schema import FurtherSignalConfig
from service.config.unit_names import unit_in
from service.config.written.commissioned import configured, corrected
from service.config.written.corrections import GATE, SIGNAL, Correction
from service.ingest.records.loaded_records import load
from service.ingest.roles_by_name import is_temperature

_TOO_LITTLE = "no term of the load is needed in these records, but in other poses it may follow the angle of"
_SETTLE_S = 0.1
"""Time after a signal says that an axis does not press any more until it moves freely [s]."""


class LinkLoad(NamedTuple):
    """The load of links, and the changes that give the axis the signals which it follows.

    These are angles, speeds and accelerations of axes; angles also where the records do not tell whether it follows
    them.
    """

    weights: LinkWeights
    changes: tuple[Correction, ...]

    @property
    def poses(self) -> tuple[Correction, ...]:
        """Only the angles, as signals without a term: in poses that no record has nothing is tested then.

        None, if the terms leave about as much of the torque as one mass does.
        """
        if not self.weights.explains_clearly_more:
            return ()
        moving = {change.key[1] for change in self.changes if change.key[-1] in ("speed", "acceleration")}
        angles = [change for change in self.changes if change.key[0] == SIGNAL and change.key[1] not in moving]
        return tuple(
            change._replace(reason=f"{_TOO_LITTLE} {change.value}") if change.key[-1] == "axis" else change
            for change in angles
        )


class PressingGate(NamedTuple):
    """A force that no motion explains, and the gate that leaves out the time in which it acts."""

    force: ContactForce
    changes: tuple[Correction, ...]
    links: LinkLoad | None = None
    """The load of links in the rest of the time; None: one mass explains the torque there"""


class LoadSearch:
    """What loads an axis, by its records.  Each search takes a while; it runs once, when its result is needed.

    Args:
        text: the configuration, valid in ``folder``.
        axis_id: "robot.axis".
        records: files, each with or without a range.
        folder: where the configuration is valid.

    Raises:
        RecordError, DescriptionError, IngestError: by a search, if a record cannot be read.
    """

    def __init__(self, text: str, axis_id: str, records: Sequence[str], folder: Path) -> None:
        self._text, self._axis_id, self._files, self._folder = text, axis_id, records, folder

    @cached_property
    def configuration(self) -> tuple[Config, NamedAxis]:
        """The configuration of the text, and the axis."""
        return configured(self._text, self._axis_id, self._folder)

    @cached_property
    def terms(self) -> LinkLoad | None:
        """The terms that reduce the error of the torque, however little, and the signals that they need.

        None: the records are too short, or no axis or signal is known on which a load may depend, or it depends only on
        the angle of the axis itself.
        """
        motions, candidates = self._candidates
        if not motions and not candidates.loads:
            return None
        found = arm_load(*self._recorded())
        if found is None:
            return None
        if found.weights.signals == {candidates.own} and not self.configuration[1].config.coupling:
            return None  # a drive has that weight, but not of a coupled axis: the angle in it is the motor's
        return LinkLoad(found.weights, tuple(_changes(motions, found)))

    @cached_property
    def links(self) -> LinkLoad | None:
        """The terms that are a load on the axis; None: the torque shows no such load."""
        return self.terms if self.terms is not None and self.terms.weights.is_load else None

    @cached_property
    def pressing(self) -> PressingGate | None:
        """The force that acts while a signal has one of its two values; None: no signal tells of such a force.

        Where one mass does not explain the rest of the time, the load of links is looked for there, too.
        """
        motions, candidates = self._candidates
        if not candidates.loads:
            return None
        records, signals = self._recorded()
        found = contact_force(records, signals.loads)
        if found is not None:
            return PressingGate(found, _gate(found, "one mass explains"))
        explained = self.links.weights.explained if self.links else 0.0
        contact = arm_contact(records, signals, explained, _SETTLE_S)
        if contact is None:
            return None
        links = LinkLoad(contact.load.weights, tuple(_changes(motions, contact.load)))
        return PressingGate(contact.force, _gate(contact.force, "one mass with the load of links explains"), links)

    @cached_property
    def motors_without_ratio(self) -> tuple[str, ...]:
        """The axes of the same robot, by name, whose angles are those of motors with an unknown gear ratio.

        Their angles turn by more than those of an arm do.  Linear axes are not among them, if their unit tells.  None,
        if a ratio is configured for some axis of the robot: then the others are linear.
        """
        arm = {other.config.name: other for other in _arm(*self.configuration)}
        if any(gear_ratio(other.config) != 1.0 for other in arm.values()):
            return ()
        motions, _ = self._candidates
        motors = motor_angles(*self._recorded())
        names = (motion.axis for motion in motions if motion.name in motors)
        return tuple(name for name in names if not _is_linear(arm[name]))

    @cached_property
    def _candidates(self) -> tuple[Sequence[_MotionSignal], ArmSignals]:
        return _candidates(*self.configuration)

    def _recorded(self) -> tuple[list[Record], ArmSignals]:
        """The records, read with the angles and the accelerations of other axes, and the candidates that they have.

        Each search reads them: kept, they would take as much memory again while the axis is identified.
        """
        motions, signals = self._candidates
        read = {*signals.angles, *signals.accelerations}
        searched = [change for motion in motions if motion.name in read for change in motion.changes]
        config, _ = configured(corrected(self._text, self._axis_id, searched), self._axis_id, self._folder)
        records = [load(file, config, self._axis_id).record for file in self._files]
        return records, recorded_signals(records, signals)


class LoadSearches:
    """The searches of one axis, each with a configuration: the last one is kept.

    A search may take half a minute.  Commissioning looks for coupled motors and identifies the axis, mostly with the
    same configuration, so both take the same search.
    """

    def __init__(self, axis_id: str, records: Sequence[str], folder: Path) -> None:
        self._axis_id, self._files, self._folder = axis_id, records, folder
        self._last: LoadSearch | None = None

    def search(self, text: str) -> LoadSearch:
        """The search with the configuration of this text, which may be written in another way.

        Raises:
            ConfigErrors: all problems of the text.
        """
        search = LoadSearch(text, self._axis_id, self._files, self._folder)
        if self._last is None or self._last.configuration != search.configuration:
            self._last = search
        return self._last


# --- The signals that the load may depend on --------------------------------------------------------------------------


class _MotionSignal(NamedTuple):
    """The motion of an axis of the arm as a signal, which the configuration has or would get."""

    name: str
    axis: str
    changes: tuple[Correction, ...]
    """Those of the configuration that add it"""


def _candidates(config: Config, axis: NamedAxis) -> tuple[Sequence[_MotionSignal], ArmSignals]:
    """The signals on which the load may depend: angles, speeds and accelerations of the arm; all, by what they are.

    No arm, unless the axis itself is in it, with others or with something that may be a load.  Signals that gates use
    are no loads: a gate leaves out what they tell.  Nor are temperatures, which rise while the friction falls.
    """
    arm, own = list(_arm(config, axis)), axis.config.name
    known = {gate.signal for gate in axis.config.gate}.union(axis.config.coupling)
    loads = [s.name for s in axis.config.signal if s.axis is None and s.name not in known and not _is_temperature(s)]
    if axis.id not in {other.id for other in arm} or (len(arm) < 2 and not loads and not axis.config.coupling):
        arm = []
    angles = {other.config.name: _angle(axis, other) for other in arm}
    derivatives = {other.config.name: _derivatives(axis, other) for other in arm}
    moving = {name: MotionSignals(*(motion.name for motion in found)) for name, found in derivatives.items() if found}
    turning = {angles[other.config.name].name for other in arm if _turns_on(other)}
    signals = ArmSignals(
        angles[own].name if arm else "",
        [angle.name for angle in angles.values()],
        loads,
        [motion.acceleration for name, motion in moving.items() if name != own],
        {angles[name].name: motion for name, motion in moving.items()},
        turning.union(signal.name for signal in axis.config.signal),
    )
    return [*angles.values(), *chain.from_iterable(derivatives.values())], signals


def _is_temperature(signal: FurtherSignalConfig) -> bool:
    return any(is_temperature(name, "") for name in (signal.name, signal.column or "", signal.signal or ""))


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


def _is_linear(axis: NamedAxis) -> bool:
    angle = axis.config.angle
    unit = None if angle is None else unit_in(angle.column or angle.signal, "angle")
    return unit is not None and unit.linear


def _angle(axis: NamedAxis, other: NamedAxis) -> _MotionSignal:
    """The angle of an arm's axis as a signal, with its name in the configuration, or that of the axis."""
    names = {s.axis: s.name for s in axis.config.signal if not s.is_derivative}
    own = other.config.name
    name = _lettered(own)
    name = names.get(own, f"{name}-angle" if name in names.values() else name)
    reason = f"the torque shows the load of links, which follows the angle of {own}"
    added = Correction((SIGNAL, name, "axis"), own, reason)
    return _MotionSignal(name, own, (added, *(() if own in names else _geared(name, other))))


def _derivatives(axis: NamedAxis, other: NamedAxis) -> tuple[_MotionSignal, ...]:
    """Speed and acceleration of an axis with the same sample interval, as signals; none if its angle wraps."""
    angle = other.config.angle
    if angle is None or angle.wrap_period is not None or not other.config.is_sampled_as(axis.config):
        return ()
    return _derivative(axis, other, "speed", "motion"), _derivative(axis, other, "acceleration", "acceleration")


def _derivative(axis: NamedAxis, other: NamedAxis, key: str, word: str) -> _MotionSignal:
    own = other.config.name
    given = [s.name for s in axis.config.signal if s.axis == own and getattr(s, key)]
    name = next(iter(given), f"{_lettered(own)}-{key}")
    reason = f"the links couple the axis to the {word} of {own}"
    added = (Correction((SIGNAL, name, "axis"), own, reason), Correction((SIGNAL, name, key), True, reason))
    return _MotionSignal(name, own, (*added, *(() if given else _geared(name, other))))


def _lettered(own: str) -> str:
    """The name of an axis with a letter in it, as a number is no name of a signal."""
    return own if any(c.isalpha() for c in own) else f"axis{own}"


def _geared(name: str, other: NamedAxis) -> Iterator[Correction]:
    """The given gear ratio of an axis as the factor of a signal; none if there is none."""
    ratio = gear_ratio(other.config)
    if ratio != 1.0:
        reason = "the gear ratio, as it follows the motion of the arm, not of the motor"
        yield Correction((SIGNAL, name, "factor"), ratio, reason)


# --- Changes of the configuration -------------------------------------------------------------------------------------


def _changes(motions: Sequence[_MotionSignal], found: ArmLoad) -> Iterator[Correction]:
    """Those that add the signals of a load, with the gear ratios that were found.

    Of an angle that the load may follow as well there is a signal without a term, so that it is part of the pose.
    """
    undetermined = found.weights.undetermined
    used = [motion for motion in motions if motion.name in found.weights.signals.union(undetermined)]
    for motion in used:
        added, *others = motion.changes
        if motion.name in undetermined:
            reason = f"the load may follow the angle of {motion.axis}, too: these records do not show whether it does"
            added = added._replace(reason=reason)
        yield from (added, *others)
    axes = {motion.name: motion.axis for motion in motions}
    for name, ratio in found.ratios.items():
        reason = f"the weight turns about as with a gear of 1/{1 / ratio:.3g}; the data sheet has the exact ratio"
        for motion in used:
            if motion.axis == axes[name]:
                yield Correction((SIGNAL, motion.name, "factor"), float(f"{ratio:.3g}"), reason)


def _gate(found: ContactForce, explains: str) -> tuple[Correction, Correction]:
    """The gate that is open while the axis does not press; ``explains``: what explains the torque in the rest."""
    key = "below" if found.free < found.pressing else "above"
    reason = (
        f"while {found.signal} is {found.pressing:g}, a force acts that no motion of the axis explains; without that"
        f" part {explains} {100 * found.explained:.0f} % of the torque"
    )
    settling = "then the force has gone, and the prediction has forgotten it"
    return (
        Correction((GATE, found.signal, key), (found.free + found.pressing) / 2, reason),
        Correction((GATE, found.signal, "settle_s"), _SETTLE_S, settling),
    )
