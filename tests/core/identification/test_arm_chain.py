"""Arms whose axes are parallel or at right angles: which follows which is found by the weight on one axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp
from numpy.random import Generator

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Term
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.torque_windows import GridPart
from monitor_core.identification.weight.arm_chain import ArmJoint, ChainBalance, arm_chain, couplings
from monitor_core.identification.weight.arm_energies import MotionSignals, Poses
from monitor_core.identification.weight.arm_links import ArmSignals, link_weights
from monitor_core.identification.weight.pose_polynomials import (
    LinkVector,
    Polynomial,
    PoseEnergy,
    Products,
    without_sign,
)
from monitor_core.identification.weight.weight_balance import slow_parts

H = 0.02
DIRECTIONS = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])


@pytest.fixture
def rng(seed: int) -> Generator:
    return np.random.default_rng(seed)


def names(axes: int) -> tuple[str, ...]:
    return tuple(f"q{k + 1}" for k in range(axes))


def signals(axes: int) -> dict[str, MotionSignals]:
    return {q: MotionSignals(f"{q}-speed", f"{q}-acceleration") for q in names(axes)}


class Arm:
    """Links with a mass at an end each; the axis of each is a direction of the frame before, either way round.

    The first axis is vertical, and each is at right angles to the one before, or parallel to it where ``parallel``.
    """

    def __init__(self, rng: Generator, axes: int, parallel: tuple[int, ...] = ()) -> None:
        self.turns = [DIRECTIONS[2]]
        for k in range(1, axes):
            self.turns.append(DIRECTIONS[2 if k in parallel else rng.integers(2)] * rng.choice([-1.0, 1.0]))
        self.lengths = rng.uniform(-0.5, 0.5, (axes, 3))
        self.ends = rng.uniform(-0.3, 0.3, (axes, 3))
        self.masses = rng.uniform(1.0, 3.0, axes)

    def places(self, q: Floats) -> tuple[list[Floats], list[Floats], list[Floats]]:
        """Axes and origins of the joints, and places of the masses (N, 3), at poses (axes, N)."""
        N = q.shape[1]
        R, origin = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))
        axes, origins, ends = [], [], []
        for k, turn in enumerate(self.turns):
            z = np.einsum("nij,j->ni", R, turn)
            R = R @ _frame(turn)
            c, s, zero, unit = np.cos(q[k]), np.sin(q[k]), np.zeros(N), np.ones(N)
            R = R @ np.array([[c, -s, zero], [s, c, zero], [zero, zero, unit]]).transpose(2, 0, 1)
            axes.append(z)
            origins.append(origin)
            ends.append(origin + np.einsum("nij,j->ni", R, self.ends[k]))
            origin = origin + np.einsum("nij,j->ni", R, self.lengths[k])
        return axes, origins, ends

    def weight(self, own: int, q: Floats) -> Floats:
        """The torque of the weight on an axis (N,)."""
        axes, origins, ends = self.places(q)
        up = 9.81 * DIRECTIONS[2]
        moments = [m * np.cross(end - origins[own], up) for m, end in zip(self.masses, ends, strict=True)][own:]
        return -sum((np.einsum("ni,ni->n", axes[own], moment) for moment in moments), np.zeros(q.shape[1]))


def _frame(z: Floats) -> Floats:
    x = DIRECTIONS[(int(np.argmax(abs(z))) + 1) % 3]
    return np.column_stack([x, np.cross(z, x), z])


def motion(rng: Generator, axes: int, seconds: float) -> Floats:
    """Angles (axes, N)."""
    t = np.arange(0.0, seconds, H)
    f, phase = rng.uniform(0.05, 0.3, (2, axes, 5))
    at = 2 * np.pi * (f[..., np.newaxis] * t + phase[..., np.newaxis])
    return np.asarray(0.5 * np.sin(at).sum(axis=1))


def record(rng: Generator, own: int, torque: Floats, q: Floats) -> Record:
    """Of an axis with an inertia of 0.3 and friction, in torque noise."""
    v, a = np.gradient(q[own], H), np.gradient(np.gradient(q[own], H), H)
    u = torque + 0.3 * a + 0.5 * v + 0.4 * np.tanh(v / 0.05) + rng.normal(0, 0.1, q.shape[1])
    known = dict(zip(names(len(q)), q, strict=True))
    return Record(H * np.arange(q.shape[1], dtype=float), u, q[own], "angle", signals=known)


def balance_of(records: list[Record], own: int, axes: int) -> ChainBalance:
    parts, window = slow_parts(records, names(axes))
    return ChainBalance(parts, window, 0.05, names(axes)[own], names(axes))


@pytest.mark.parametrize(("axes", "own"), [(7, 1), (7, 3), (6, 4), (7, 5)])
def test_the_weight_is_known_in_poses_that_were_not_recorded(axes: int, own: int, rng: Generator) -> None:
    """From five minutes, of which each half holds few poses, to motions of other ranges."""
    parallel = (2, 3) if axes == 6 else ()
    arm = Arm(rng, axes, parallel)
    while np.ptp(arm.weight(own, motion(rng, axes, 60.0))) < 2.0:  # a vertical axis bears no weight
        arm = Arm(rng, axes, parallel)
    q = motion(rng, axes, 300.0)
    signals_of_arm = ArmSignals(names(axes)[own], names(axes), moving=signals(axes))
    found = link_weights([record(rng, own, arm.weight(own, q), q)], signals_of_arm)
    assert found is not None
    terms = [term for term in map(Term.read, found.terms) if set(term.signals) <= set(names(axes))]

    def values(q: Floats) -> Floats:
        known = dict(zip(names(axes), q, strict=True))
        return np.column_stack([*(term.value(known) for term in terms), np.ones(q.shape[1])])

    slopes = np.linalg.lstsq(values(q), arm.weight(own, q))[0]
    other = 1.3 * motion(rng, axes, 100.0)
    weight = arm.weight(own, other)
    assert np.std(weight - values(other) @ slopes) < 0.03 * np.std(weight)


def test_no_chain_where_nothing_follows_the_pose(rng: Generator) -> None:
    q = motion(rng, 5, 200.0)
    assert arm_chain(balance_of([record(rng, 2, np.zeros(q.shape[1]), q)], 2, 5)) is None


def test_no_chain_of_two_or_more_than_seven_axes(rng: Generator) -> None:
    """The sums of angles explain the weight of so few, and so many are not tried."""
    for axes in (3, 8):
        q = motion(rng, axes, 100.0)
        torque = 5.0 * np.sin(q[1] + q[2])
        found = link_weights([record(rng, 1, torque, q)], ArmSignals("q2", names(axes), moving=signals(axes)))
        assert found is not None
        weights = {term for term in found.terms if "speed" not in term and "acceleration" not in term}
        assert weights <= {"cos(q2 + q3)", "sin(q2 + q3)"}


def test_a_chain_has_the_weights_that_were_found_and_couplings_to_each_other_axis(rng: Generator) -> None:
    axes, own = 5, 3
    arm = Arm(rng, axes)
    q = motion(rng, axes, 300.0)
    while np.ptp(arm.weight(own, q)) < 2.0:
        arm = Arm(rng, axes)
    balance = balance_of([record(rng, own, arm.weight(own, q), q)], own, axes)
    chain = arm_chain(balance)
    assert chain is not None
    energies = balance.energies(chain, "load")
    assert {energy.load for energy in energies} == {"load"}
    assert [e.products for e in energies if not e.axes] == [products for link in chain.weights for products in link]
    coupled = [energy for energy in energies if energy.axes]
    others = {name for k, name in enumerate(names(axes)[: len(chain.joints)]) if k != own}
    assert {energy.axes for energy in coupled} == {("q4", name) for name in others}
    assert len({(energy.axes, energy.products) for energy in coupled}) == len(coupled)
    for k, name in enumerate(names(axes)):
        if name in others:
            known = set(map(without_sign, couplings(chain.joints, *sorted((k, own)))))
            assert {energy.products for energy in coupled if energy.axes[1] == name} <= known


@pytest.mark.parametrize("joint", [ArmJoint(d, opposite) for d in range(3) for opposite in (False, True)])
def test_a_joint_turns_about_its_direction(joint: ArmJoint, rng: Generator) -> None:
    """Lengths and angles stay, and so does the component along the axis; the reverse is the transposed matrix."""
    q = rng.uniform(-np.pi, np.pi, (1, 5))
    there, back = _matrices(joint.seen_from_next, q), _matrices(joint.seen_from_before, q)
    assert there @ there.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (5, 1, 1)), abs=1e-12)
    assert back == pytest.approx(there.transpose(0, 2, 1))
    assert there[:, 2] == pytest.approx(np.tile(DIRECTIONS[joint.direction], (5, 1)))
    angle = np.arccos(np.clip((np.trace(there[:1] @ there[1:].transpose(0, 2, 1), axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.cos(angle) == pytest.approx(np.cos(q[0, 1:] - q[0, 0]))


@pytest.mark.parametrize(("first", "last"), [(0, 1), (1, 2), (1, 4), (0, 4)])
def test_the_couplings_contain_the_inertia_matrix(first: int, last: int, rng: Generator) -> None:
    """Of many arms, as in most of them some terms are zero."""
    for _ in range(40):
        contain_the_inertia_matrix(first, last, rng)


def contain_the_inertia_matrix(first: int, last: int, rng: Generator) -> None:
    """That of a mass in the link after joint ``last``, or beyond it, by the derivatives of its place."""
    joints = [ArmJoint(2, False), *(ArmJoint(int(rng.integers(3)), bool(rng.integers(2))) for _ in range(4))]
    lengths, end = rng.uniform(-0.5, 0.5, (5, 3)), rng.uniform(-0.3, 0.3, 3)
    q = rng.uniform(-np.pi, np.pi, (5, 1000))

    def place(q: Floats, lengths: Floats, link: int) -> Floats:
        found = np.tile(end, (q.shape[1], 1))
        for k in range(link, -1, -1):
            turned = _matrices(joints[k].seen_from_before, q[k : k + 1])
            found = np.einsum("nij,nj->ni", turned, found) + lengths[k]
        return found

    def moment(lengths: Floats, link: int) -> Floats:
        steps = [1e-4 * (np.arange(5) == k)[:, np.newaxis] for k in (first, last)]
        by_first, by_last = (place(q + step, lengths, link) - place(q - step, lengths, link) for step in steps)
        return np.asarray(np.einsum("ni,ni->n", by_first, by_last)) / 4e-8

    between = ((np.arange(5) > first) & (np.arange(5) <= last))[:, np.newaxis]
    true = moment(lengths, last)
    if last < 4:  # of a mass beyond that link the part by the lengths between the joints
        true = moment(lengths, 4) - moment(np.where(between, 0.0, lengths), 4)
    columns = np.column_stack(
        [_values(p, q) for p in dict.fromkeys(map(without_sign, couplings(joints, first, last))) if p]
    )
    rest = true - columns @ np.linalg.lstsq(columns, true)[0]
    assert np.std(rest) < 1e-5 * max(float(np.std(true)), 1e-3)


@pytest.mark.parametrize("axes", [(), ("q2", "q1"), ("q2", "q3"), ("q1", "q1"), ("q1", "q3")])
def test_the_torque_of_a_polynomial_is_that_of_lagranges_equation(axes: tuple[str, ...], rng: Generator) -> None:
    arm, t = names(3), sp.Symbol("t")
    products: Products = (((1, 1, 0), 1), ((0, 2, 1), -1), ((2, 2, 2), 2))
    if "q2" in axes:
        products = (((1, 0, 0), 1), ((2, 0, 1), -1), ((0, 0, 2), 2))
    q = {name: sp.Function(name)(t) for name in arm}
    v = {name: sp.Symbol(f"v{name}") for name in arm}
    place = {name: sp.Symbol(name) for name in arm}
    at = {**dict(zip(place.values(), q.values(), strict=True)), **{v[n]: sp.diff(q[n], t) for n in arm}}
    functions = (lambda _: sp.Integer(1), sp.cos, sp.sin)
    f = sum(c * sp.prod([functions[k](place[n]) for k, n in zip(m, arm, strict=True)]) for m, c in products)
    now = rng.uniform(-1, 1, (3, 3))
    values = {sp.diff(q[n], t, order): now[order, k] for k, n in enumerate(arm) for order in (2, 1)}
    values |= {sign[n]: now[0, k] for sign in (q, place) for k, n in enumerate(arm)}
    if axes:
        energy = f * v[axes[0]] * v[axes[1]]
        torque = sp.diff(sp.diff(energy, v["q2"]).subs(at), t) - sp.diff(energy, place["q2"]).subs(at)
    else:
        torque = f
    known = {n: now[0, k : k + 1] for k, n in enumerate(arm)}
    known |= {f"{n}-speed": now[1, k : k + 1] for k, n in enumerate(arm)}
    known |= {f"{n}-acceleration": now[2, k : k + 1] for k, n in enumerate(arm)}
    energy_of_pose = PoseEnergy(axes, "", products, arm)
    term = Term.read(str(energy_of_pose.torque("q2", signals(3))))
    assert term.value(known)[0] == pytest.approx(float(torque.subs(values)), rel=1e-9)
    carried = PoseEnergy(axes, "", products, arm, "load").torque("q2", signals(3))
    loaded = Term.read(str(carried)).value({**known, "load": np.array([3.0])})
    assert loaded[0] == pytest.approx(3 * term.value(known)[0])


def _matrices(turn: Callable[[LinkVector, int], LinkVector], q: Floats) -> Floats:
    """What a joint does to vectors, as matrices (N, 3, 3) at angles (1, N)."""
    unity: Polynomial = {(0,): 1}
    none: Polynomial = {}
    units: list[LinkVector] = [(unity, none, none), (none, unity, none), (none, none, unity)]
    columns = [turn(unit, 0) for unit in units]
    return np.array([[_values(without_sign(p), q) * _sign(p) for p in column] for column in columns]).transpose(2, 1, 0)


def _sign(polynomial: Polynomial) -> int:
    return 1 if without_sign(polynomial) == tuple(sorted(polynomial.items())) else -1


def _values(products: Products, q: Floats) -> Floats:
    part = GridPart(q[0], q[0], H, "angle", dict(zip(names(len(q)), q, strict=True)))
    return PoseEnergy((), "", products, names(len(q))).function_values(Poses(part), "q1")[0]
