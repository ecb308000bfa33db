"""Finds the links of an arm that load an axis: cosines and sines of sums of joint angles in its torque.

The potential energy of a serial arm is a sum of products of cosines and sines of its joint angles, and so of cosines
and sines of their sums and differences.  The weight that an axis holds is its derivative by the angle of that axis:
terms without that angle drop out.  The zero and the direction of each joint angle do not matter: each sum is tried with
both signs of the other angles, and with cosine and sine.

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u,    s_i = q_own +- q_j +- q_k

A measured load, as that of a hoist or of a gripper, is a further term, or a factor of these terms.  The acceleration of
another axis is a further term: if links are dynamically coupled, accelerating one needs a torque on the other, too.

``link_balance`` rates the terms by cross-validation.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.drive.signal_terms import Term
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import leaves_much_less
from monitor_core.identification.weight.arm_chain import MOST_AXES, ChainBalance, arm_chain
from monitor_core.identification.weight.arm_energies import MotionSignals, possible_energies
from monitor_core.identification.weight.link_balance import (
    CLEARLY_LESS,
    MAX_REMAINING,
    LinkBalance,
    cosines_and_sines,
    plain_term,
    term_values,
)
from monitor_core.identification.weight.link_energies import AnyEnergy, EnergyBalance, LinkEnergies, link_energies
from monitor_core.identification.weight.pose_polynomials import PoseEnergy
from monitor_core.identification.weight.weight_balance import (
    MOST_OTHERS,
    moving_parts,
    slow_parts,
)

_MIN_EXPLAINED = 0.5
"""Least share of the torque that must be explained; otherwise the terms are no load."""

_MIN_VARIANCE = 0.003
"""Least share of the variance of the torque that a load explains; less may be an error of the friction model."""


class ArmSignals(NamedTuple):
    """Names of the signals in the records of an axis, by what they may be for the arm that it belongs to."""

    own: str
    """The angle of the axis itself [rad]"""
    angles: Sequence[str]
    """All angles of the arm [rad], own too, from the base to the hand; none: no weight of links is looked for"""
    loads: Sequence[str] = ()
    """Signals that may be loads"""
    accelerations: Sequence[str] = ()
    """The accelerations of other axes [rad/s^2]"""
    moving: Mapping[str, MotionSignals] = MappingProxyType({})
    """Of angles that do not wrap, own too, the signals of their speed and acceleration; records need not have these.

    The torque of kinetic energies is then looked for, too: of the own angle alone that of the inertia of a load, and of
    what is not in ``angles``, as the angle of the motor of a linear axis, that of a coupling which follows no pose.
    """
    of_arm: Collection[str] = ()
    """Angles that are those of the arm in any case, not those of motors before their gears"""


class LinkWeights(NamedTuple):
    """The terms of the load on an axis, and how well they explain its torque."""

    terms: tuple[str, ...]
    """"cos(axis2 + axis3)", "axis2-acceleration", "payload", .."""
    explained: float
    """part of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these terms"""
    undetermined: tuple[str, ...] = ()
    """further angles that the load may follow as well: the records do not tell"""

    @property
    def is_load(self) -> bool:
        """Whether the terms explain enough of the torque to be a load on the axis."""
        enough = (1 - self.before) ** 2 - (1 - self.explained) ** 2 >= _MIN_VARIANCE
        return bool(self.terms) and enough and self.explained >= _MIN_EXPLAINED

    @property
    def explains_much_more(self) -> bool:
        """Whether much less of the torque remains than without these terms."""
        return leaves_much_less(self.explained, self.before)

    @property
    def explains_clearly_more(self) -> bool:
        """Whether clearly less of the torque remains than without these terms, though perhaps not much less."""
        return (1 - self.explained) ** 2 < CLEARLY_LESS * (1 - self.before) ** 2

    @property
    def signals(self) -> set[str]:
        """Names of the signals in the terms."""
        return {signal for term in self.terms for signal in Term.read(term).signals}


def link_weights(records: Sequence[Record], signals: ArmSignals) -> LinkWeights | None:
    """The weights, and the motion of other axes, in the torque of an axis; None: they do not explain it.

    ``records``: of the axis, whose angle is measured, with these signals.
    """
    found = link_terms(records, signals)
    return found if found is not None and found.is_load else None


def link_terms(records: Sequence[Record], signals: ArmSignals) -> LinkWeights | None:
    """As ``link_weights``, with terms that may explain too little to be a load; None: the records are too short."""
    found = _weights(records, signals)
    if found is not None and signals.own in signals.moving and (len(signals.moving) > 1 or signals.loads):
        return _with_energies(found, records, signals)
    return found


def _weights(records: Sequence[Record], signals: ArmSignals) -> LinkWeights | None:
    """The weights, loads and accelerations alone; None: the records are too short."""
    accelerations = [plain_term(name) for name in signals.accelerations]
    parts, window = slow_parts(records, (*signals.angles, *signals.loads, *signals.accelerations))
    if not parts:
        return None
    balance = LinkBalance(parts, window, speed_scales(records)[1], signals.own, signals.angles)
    before = balance.explained(())
    balance = balance.coupled_with(accelerations)
    chosen = _chosen(balance, signals)
    balance = balance.without_needless(chosen)
    if not chosen and not balance.coupled:
        return LinkWeights((), before, before)
    needed = balance.needed(chosen)
    balance = balance.with_positive_inertia(needed, accelerations)
    return LinkWeights(tuple(map(str, (*needed, *balance.coupled))), balance.explained(needed), before)


def _chosen(balance: LinkBalance, signals: ArmSignals) -> list[Term]:
    """The weights and loads that reduce the error: without a carried load, or with the one that explains clearly more.

    Without angles, only the loads.
    """
    if not signals.angles:
        return _with_loads(balance, [], [], signals.loads)
    alone = cosines_and_sines([((1, signals.own),)])

    def with_carried(load: Term | None) -> list[Term]:
        return _with_loads(balance, cosines_and_sines(balance.sums(load), load), alone, signals.loads)

    chosen = with_carried(None)
    for load in signals.loads:
        carrying = with_carried(plain_term(load))
        if balance.error(carrying) < CLEARLY_LESS * balance.error(chosen):
            chosen = carrying
    return chosen


def _with_energies(found: LinkWeights, records: Sequence[Record], signals: ArmSignals) -> LinkWeights:
    """These terms with the torques of energies, of the arm alone or also of a carried load; else as they are."""
    own, moving = signals.own, signals.moving
    terms = [Term.read(text) for text in found.terms]
    parts, window = moving_parts(records, [*moving, *signals.loads, *(name for term in terms for name in term.signals)])
    if not parts:
        return found
    values = [np.concatenate([term_values(term, part) for part in parts]) for term in terms]
    arm = [angle for angle in signals.angles if angle in moving]
    beside = [angle for angle in moving if angle not in arm and angle != own]
    balance = partial(EnergyBalance, parts, window, speed_scales(records)[1], own)
    best, energies = terms, None
    if len(moving) > 1:
        energies = link_energies(balance(possible_energies(own, arm, beside), values))
    chained = _energies_of_chain(records, signals, arm)
    if chained is not None:
        # The sums that were found without the chain stand for its weights, so the search begins anew.
        linked = link_energies(balance((*chained(""), *possible_energies(own, arm, beside)), []))
        if energies is None or _leaves_clearly_less(linked, energies):
            best, energies = [], linked
    for load in signals.loads:
        # Terms that were found without the energies of the load stand for them, so the search begins anew.
        possible: Sequence[AnyEnergy] = possible_energies(own, arm, beside, load)
        if chained is not None:
            possible = (*chained(""), *chained(load), *possible)
        carrying = link_energies(balance(possible, []))
        if energies is None or _leaves_clearly_less(carrying, energies):
            best, energies = [], carrying
    if energies is None or not energies.found:
        return found
    # An acceleration stays, as it may be there for a positive inertia.
    needed = [term for k, term in enumerate(best) if k not in energies.needless or not term.turns]
    torques = [energy.torque(own, moving) for energy in energies.found]
    return LinkWeights(
        tuple(dict.fromkeys(map(str, (*needed, *torques)))),
        energies.explained,
        min(found.before, energies.before),
        energies.undetermined,
    )


def _leaves_clearly_less(found: LinkEnergies, other: LinkEnergies) -> bool:
    return (1 - found.explained) ** 2 < CLEARLY_LESS * (1 - other.explained) ** 2


def _energies_of_chain(
    records: Sequence[Record], signals: ArmSignals, arm: Sequence[str]
) -> Callable[[str], Sequence[PoseEnergy]] | None:
    """Energies of an arm with a wrist, also times a load, whose axes follow each other as its weight shows.

    None: the arm has no wrist, or its weight shows nothing.
    """
    if signals.own not in arm or not MOST_OTHERS + 1 < len(arm) <= MOST_AXES:
        return None
    parts, window = slow_parts(records, (*arm, *signals.accelerations))
    if not parts:
        return None
    balance = ChainBalance(parts, window, speed_scales(records)[1], signals.own, arm, signals.accelerations)
    chain = arm_chain(balance)
    return None if chain is None else partial(balance.energies, chain)


def _with_loads(
    balance: LinkBalance, chosen: Sequence[Term], alone: Sequence[Term], loads: Sequence[str]
) -> list[Term]:
    """The chosen terms, with measured loads that reduce the error: as terms of their own, or as factors of weights.

    ``alone``: the weights of the axis itself, which may be visible only together with a load.
    """
    found = list(chosen)

    def error_with(more: Sequence[Term]) -> float:
        return balance.error([*found, *more])

    for load in map(plain_term, loads):
        turning = [Term.product(*load.factors, *term.factors) for term in dict.fromkeys((*found, *alone))]
        options = ([load], turning, *([term] for term in turning))
        missing = [term for term in alone if term not in found]
        best = min(options, key=error_with)
        fuller = min(([*option, *missing] for option in options), key=error_with)
        if error_with(fuller) < MAX_REMAINING * error_with(best):
            best = fuller
        if error_with(best) < MAX_REMAINING * error_with(()):
            found += best
    return found
