"""Which links load an axis: the sums of joint angles are found whatever their signs, and none where none is.

What is found of a single record depends on its noise and on its motion.  So each case is drawn some times, and a number
of draws must succeed.  The rates below are lower bounds (99 %) by at least 150 other draws: where the true rate is at
least so large, a case fails for less than one seed in ten thousand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import binom

from monitor_core.arrays import Floats
from monitor_core.identification import (
    ArmSignals,
    LinkWeights,
    Record,
    arm_load,
    motor_angles,
    recorded_signals,
    turning_weight,
)
from monitor_core.identification.weight.arm_links import link_terms, link_weights
from monitor_core.identification.weight.gear_ratios import gear_ratios

ANGLES = ("q1", "q2", "q3", "q4")
RATE_HZ, SECONDS = 100, 60.0
Torque = Callable[[Mapping[str, Floats]], Floats]
DRAWS = 12
BY_LUCK = 1e-4
"""Probability that a case fails although each draw succeeds at its rate."""


def often(succeeds: Callable[[int], bool], seed: int, rate: float, draws: int = DRAWS) -> None:
    """Check that as many draws succeed as must at this rate of success, but for one seed in ten thousand.

    Once as many have succeeded the others decide nothing, so they are not drawn.
    """
    least = int(binom.ppf(BY_LUCK, draws, rate))
    assert least > 0
    succeeded, failed = 0, list[int]()
    for number in range(seed, seed + draws):
        if succeeds(number):
            succeeded += 1
        else:
            failed.append(number)
        if succeeded == least or len(failed) > draws - least:
            break
    print(f"{succeeded} draws succeed, at least {least} of {draws} must; not those with seeds {failed}")
    assert succeeded == least


def has_terms(found: LinkWeights | None, terms: set[str], explained: float = -1.0) -> bool:
    """Whether exactly these terms were found, and explain more than that."""
    return found is not None and set(found.terms) == terms and found.explained > explained


def moved(rng: np.random.Generator, t: Floats, reach: float = 0.9) -> Floats:
    """A smooth motion over a radian or two, of many frequencies below 0.6 Hz."""
    f, phase = rng.uniform(0.05, 0.6, 6), rng.uniform(0, 2 * np.pi, 6)
    wave = np.sin(2 * np.pi * np.outer(t, f) + phase) / f
    return np.asarray(rng.uniform(-1, 1) + reach * (wave / np.abs(wave).sum(axis=1).max()).sum(axis=1))


def recorded(
    torque: Torque,
    rng: np.random.Generator,
    own: str = "q2",
    still: tuple[str, ...] = (),
    seconds: float = SECONDS,
    reach: float = 0.9,
) -> Record:
    """An axis of 2 kg m^2 with friction, that torque and noise of a tenth of it, while all others move or stand."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    q = {name: np.full(len(t), rng.uniform(-1, 1)) if name in still else moved(rng, t, reach) for name in ANGLES}
    speed = np.gradient(q[own], t)
    u = 2.0 * np.gradient(speed, t) + 1.5 * speed + 1.0 * np.tanh(speed / 0.05) + torque(q)
    return Record(t, u + rng.normal(0, 0.1 * u.std(), len(t)), q[own], "angle", signals=q)


@pytest.mark.parametrize(
    ("own", "torque", "terms", "rate"),
    [
        ("q2", lambda q: 8 * np.cos(q["q2"]) + 4 * np.cos(q["q2"] + q["q3"]), {"cos(q2)", "cos(q2 + q3)"}, 0.91),
        ("q2", lambda q: 8 * np.cos(q["q2"]) + 4 * np.cos(q["q2"] - q["q3"]), {"cos(q2)", "cos(q2 - q3)"}, 0.9),
        ("q3", lambda q: 5 * np.cos(q["q2"] + q["q3"] - 0.8), {"cos(q2 + q3)", "sin(q2 + q3)"}, 0.97),
        ("q4", lambda q: 3 * np.sin(q["q2"] + q["q3"] + q["q4"]), {"sin(q2 + q3 + q4)"}, 0.9),
        # The forearm is counted from the ground: its own angle alone.
        ("q3", lambda q: 5 * np.cos(q["q3"]), {"cos(q3)"}, 0.94),
    ],
)  # fmt: skip
def test_the_links_are_found(own: str, torque: Torque, terms: set[str], rate: float, seed: int) -> None:
    def succeeds(number: int) -> bool:
        found = link_weights([recorded(torque, np.random.default_rng(number), own)], ArmSignals(own, ANGLES))
        return found is not None and has_terms(found, terms, max(0.8, found.before))

    often(succeeds, seed, rate, 40)


def test_terms_of_a_small_weight_are_no_load_but_name_the_angles(seed: int) -> None:
    """A wrist whose weight explains a thousandth of the variance of the torque, and yet a tenth of what is left."""
    few = list[bool]()

    def succeeds(number: int) -> bool:
        def weight(q: Mapping[str, Floats]) -> Floats:
            return np.asarray(0.4 * np.cos(q["q2"] + q["q3"] + q["q4"]))

        given = [recorded(weight, np.random.default_rng(number), "q4")], ArmSignals("q4", ANGLES)
        found = link_terms(*given)
        assert found is not None
        assert found.is_load == (link_weights(*given) is not None)
        few.append(not found.is_load)
        return found.explains_clearly_more and found.signals == {"q2", "q3", "q4"}

    often(succeeds, seed, 0.7, 20)
    assert np.mean(few) > 0.4


def test_a_tool_beside_the_last_axis_loads_the_one_that_bends_the_wrist(seed: int) -> None:
    """Its weight is nine such sums, of which some explain little beside the others."""

    def succeeds(number: int) -> bool:
        rng = np.random.default_rng(number)
        tilt, beside = rng.uniform(0.6, 0.8), 0.6

        def weight(q: Mapping[str, Floats]) -> Floats:
            c, s, turned = np.cos(q["q3"]), np.sin(q["q3"]), beside * np.cos(q["q4"])
            level = -np.cos(tilt) * (s + c * turned) + np.sin(tilt) * np.cos(q["q2"]) * (c - s * turned)
            return np.asarray(6 * level)

        found = link_weights([recorded(weight, rng, "q3", seconds=240, reach=3.0)], ArmSignals("q3", ANGLES))
        return found is not None and found.explained > 0.85

    often(succeeds, seed, 0.7, 20)


def test_how_far_a_weight_turns_is_found(seed: int) -> None:
    """Of the angle of a motor before a gear of 1/81; the steps of the trials alone are a tenth of it."""

    def succeeds(number: int) -> bool:
        rec = recorded(lambda q: 8 * np.cos(2 * q["q2"] + 0.4), np.random.default_rng(number))
        found = turning_weight(replace(rec, y=162 * rec.y))
        assert found is not None
        return found.least < 1 / 81 < found.most and pytest.approx(1 / 81, rel=0.03) == found.ratio

    often(succeeds, seed, 0.85, 20)


def test_without_a_weight_nothing_is_found(seed: int) -> None:
    def succeeds(number: int) -> bool:
        record = recorded(lambda q: 0 * q["q2"], np.random.default_rng(number))
        return link_weights([record], ArmSignals("q2", ANGLES)) is None

    often(succeeds, seed, 0.97)


def test_what_friction_holds_at_standstill_is_no_weight(seed: int) -> None:
    often(nothing_in_what_friction_holds, seed, 0.97)


def nothing_in_what_friction_holds(seed: int) -> bool:
    """A program stops at the same places again and again, and friction holds there what the last motion has left."""
    rng, stop, go = np.random.default_rng(seed), 3 * RATE_HZ, RATE_HZ
    places, s = rng.uniform(-1, 1, (5, len(ANGLES))), np.linspace(0, 1, go)
    course, u = list[Floats](), list[Floats]()
    for k in range(40):
        a, b = places[k % 5], places[(k + 1) % 5]
        q = np.concatenate([a + (b - a) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None], np.tile(b, (stop, 1))])
        speed = np.gradient(q[:, 1]) * RATE_HZ
        towards = np.sign(b[1] - a[1])
        course.append(q)
        u.append(2.0 * np.gradient(speed) * RATE_HZ + 1.5 * speed + 3.0 * towards)
    q, torque = np.concatenate(course), np.concatenate(u)
    t = np.arange(len(q)) / RATE_HZ
    signals = dict(zip(ANGLES, q.T, strict=True))
    record = Record(t, torque + rng.normal(0, 0.1, len(t)), q[:, 1], "angle", signals=signals)
    return link_weights([record], ArmSignals("q2", ANGLES)) is None


def test_a_torque_of_something_else_is_no_weight(seed: int) -> None:
    def succeeds(number: int) -> bool:
        rng = np.random.default_rng(number)
        drift = 5 * np.cumsum(rng.normal(0, 0.02, round(SECONDS * RATE_HZ)))
        return link_weights([recorded(lambda q: drift + 0 * q["q2"], rng)], ArmSignals("q2", ANGLES)) is None

    often(succeeds, seed, 0.97)


@pytest.mark.parametrize(
    ("torque", "angles", "terms", "rate"),
    [
        (lambda _, load: 6 * load, ANGLES, {"load"}, 0.94),
        (lambda _, load: 6 * load, (), {"load"}, 0.94),
        (lambda q, load: 8 * load * np.cos(q["q2"]), ANGLES, {"load * cos(q2)"}, 0.83),
        (lambda q, load: (8 + 5 * load) * np.cos(q["q2"]), ANGLES, {"cos(q2)", "load * cos(q2)"}, 0.82),
        (lambda q, _: 8 * np.cos(q["q2"]), ANGLES, {"cos(q2)"}, 0.92),
    ],
)  # fmt: skip
def test_a_measured_load_adds_itself_or_multiplies(
    torque: Callable[[Mapping[str, Floats], Floats], Floats],
    angles: tuple[str, ...],
    terms: set[str],
    rate: float,
    seed: int,
) -> None:
    """A signal that is no load, beside it, is not taken."""

    def succeeds(number: int) -> bool:
        rng = np.random.default_rng(number)
        levels, count = [0.0, 1.0, 0.5, 1.0, 0.2, 0.8], round(SECONDS * RATE_HZ)
        load, other = (np.repeat(rng.permutation(levels), count // 6) for _ in range(2))
        record = recorded(lambda q: torque(q, load), rng)
        record = replace(record, signals={**record.signals, "load": load, "other": other})
        return has_terms(link_weights([record], ArmSignals("q2", angles, ("other", "load"))), terms)

    often(succeeds, seed, rate)


def test_a_load_that_comes_and_goes_hides_no_link(seed: int) -> None:
    """At a wrist, what the hand carries is most of the torque, and turns with the sum of three angles."""

    def succeeds(number: int) -> bool:
        rng, count = np.random.default_rng(number), round(SECONDS * RATE_HZ)
        load = np.repeat(rng.permutation(np.tile([0.0, 4.0, 0.0, 7.0], 6)), count // 24)

        def weight(q: Mapping[str, Floats]) -> Floats:
            return np.asarray((1 + load) * np.cos(q["q2"] + q["q3"] + q["q4"]) + 2 * np.cos(q["q3"] + q["q4"]))

        record = recorded(weight, rng, "q4")
        record = replace(record, signals={**record.signals, "load": load})
        found = link_weights([record], ArmSignals("q4", ANGLES, ("load",)))
        assert found is not None
        return {"load * cos(q2 + q3 + q4)", "cos(q3 + q4)"} <= set(found.terms) and found.explained > 0.85

    often(succeeds, seed, 0.94)


def test_of_axes_that_stand_still_nothing_can_be_told(seed: int) -> None:
    """The weight of all links turns with the one axis that moves: the simplest sum says all."""

    def weight(q: Mapping[str, Floats]) -> Floats:
        return np.asarray(8 * np.cos(q["q2"]) + 4 * np.cos(q["q2"] + q["q3"]))

    def succeeds(number: int) -> bool:
        record = recorded(weight, np.random.default_rng(number), still=("q1", "q3", "q4"))
        found = link_weights([record], ArmSignals("q2", ANGLES))
        return found is not None and set(found.terms) <= {"cos(q2)", "sin(q2)"}

    often(succeeds, seed, 0.97)


def test_what_accelerates_another_axis_is_found_beside_a_weight_or_alone(seed: int) -> None:
    """One that moves with it, and turns nothing of it, is not taken; nor is any where the links are not coupled."""
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ

    def accelerated(record: Record) -> Record:
        found = {f"{n}_accel": np.gradient(np.gradient(q, t), t) for n, q in record.signals.items() if n != "q2"}
        return replace(record, signals={**record.signals, **found})

    def coupled(q: Mapping[str, Floats]) -> Floats:
        return np.asarray((1.5 + 0.5 * np.cos(q["q3"])) * np.gradient(np.gradient(q["q3"], t), t))

    def both(q: Mapping[str, Floats]) -> Floats:
        return np.asarray(coupled(q) + 4 * np.cos(q["q2"]))

    names = ("q1_accel", "q3_accel", "q4_accel")
    for torque, terms, rate in (
        (coupled, {"q3_accel"}, 0.96),
        (both, {"cos(q2)", "q3_accel"}, 0.84),
        (lambda q: 4 * np.cos(q["q2"]), {"cos(q2)"}, 0.91),
    ):

        def succeeds(number: int, torque: Torque = torque, terms: set[str] = terms) -> bool:
            record = accelerated(recorded(torque, np.random.default_rng(number)))
            return has_terms(link_weights([record], ArmSignals("q2", ANGLES, (), names)), terms)

        often(succeeds, seed, rate)


def test_what_accelerates_other_axes_is_taken_where_it_hides_the_inertia(seed: int) -> None:
    often(accelerations_are_taken, seed, 0.97)


def accelerations_are_taken(seed: int) -> bool:
    """All axes move together, to places and with pauses; the coupling of the wrist is more than its own inertia."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, RATE_HZ)
    places = rng.uniform(-1, 1, (120, len(ANGLES)))
    places[:, 3] = 0.5 * places[:, 3] - 0.7 * (places[:, 1] + places[:, 2])  # the hand stays about level
    moves = [a + (b - a) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None] for a, b in pairwise(places)]
    q = dict(zip(ANGLES, np.concatenate(moves).T, strict=True))
    speed = {n: np.gradient(v) * RATE_HZ for n, v in q.items()}
    accel = {f"{n}_accel": np.gradient(v) * RATE_HZ for n, v in speed.items()}
    own = 0.02 * accel["q4_accel"] + 0.06 * accel["q3_accel"] + 0.06 * accel["q2_accel"]
    held = 12 * np.cos(q["q2"] + q["q3"] + q["q4"]) + 0.5 * np.tanh(speed["q4"] / 0.05)
    torque = own + held + rng.normal(0, 0.2, len(held))
    t = np.arange(len(torque)) / RATE_HZ
    others = {name: values for name, values in accel.items() if name != "q4_accel"}
    record = Record(t, torque, q["q4"], "angle", signals={**q, **others})
    found = link_weights([record], ArmSignals("q4", ANGLES, (), tuple(others)))
    return found is not None and {"q2_accel", "q3_accel"} == set(found.terms) & set(others)


def test_the_gear_ratio_shows_beside_a_coupled_axis(seed: int) -> None:
    """Whose acceleration takes more torque than the weight, and hides it else."""

    def torque(q: Mapping[str, Floats]) -> Floats:
        return np.asarray(10 * np.gradient(np.gradient(q["q3"])) * RATE_HZ**2 + 8 * np.cos(q["q2"]))

    def ratio(record: Record, *accelerations: str) -> float:
        return 80 * gear_ratios([record], "q2", ("q2",), ("q2",), accelerations).get("q2", 0.0)

    found, draws = [], 40
    for number in range(draws):
        rec = recorded(torque, np.random.default_rng(seed + number), seconds=180.0, reach=1.5)
        coupled = np.asarray(np.gradient(np.gradient(rec.signals["q3"])) * RATE_HZ**2)
        signals = {"q2": 80 * rec.signals["q2"], "q3_accel": coupled}
        geared = replace(rec, y=80 * rec.y, signals=signals)
        found.append((ratio(geared), ratio(geared, "q3_accel")))
    without, beside = np.array(found).T
    right, by_chance = (np.count_nonzero(abs(ratios - 1) < 1 / 3) for ratios in (beside, without))
    print(right, by_chance)
    assert right >= binom.ppf(BY_LUCK, draws, 0.89)
    assert by_chance <= binom.isf(BY_LUCK, draws, 0.18)  # an upper bound of that rate


def test_long_records_and_several_are_used_together(seed: int) -> None:
    def weight(q: Mapping[str, Floats]) -> Floats:
        return np.asarray(8 * np.cos(q["q2"]) + 4 * np.cos(q["q2"] + q["q3"]))

    def succeeds(number: int) -> bool:
        rng = np.random.default_rng(number)
        records = [recorded(weight, rng, seconds=400.0), recorded(weight, rng)]
        return has_terms(link_weights(records, ArmSignals("q2", ANGLES)), {"cos(q2)", "cos(q2 + q3)"})

    often(succeeds, seed, 0.95, 8)


def test_signals_that_never_came_tell_nothing(seed: int) -> None:
    record = recorded(lambda q: 8 * np.cos(q["q2"]), np.random.default_rng(seed))
    lost = Record(record.t, record.u, record.y, "angle", signals={**record.signals, "q3": np.full(len(record), np.nan)})
    assert link_weights([lost], ArmSignals("q2", ANGLES)) is None


GEARS = {"q1": 60.0, "q2": 90.0, "q3": 80.0, "q4": 50.0}


def of_motors(record: Record, gears: Mapping[str, float]) -> Record:
    """The same record with angles that turn so many times as far: those of motors for those of the arm, or back."""
    return replace(record, signals={name: gears.get(name, 1.0) * angle for name, angle in record.signals.items()})


@pytest.mark.parametrize(
    ("own", "torque", "turning", "rate"),
    [
        ("q2", lambda q: 8 * np.cos(q["q2"]), {"q2"}, 0.88),
        ("q2", lambda q: 8 * np.cos(q["q2"]) + 4 * np.cos(q["q2"] - q["q3"]), {"q2", "q3"}, 0.97),
        ("q3", lambda q: 5 * np.cos(q["q2"] + q["q3"] - 0.8), {"q2", "q3"}, 0.97),
        ("q4", lambda q: 3 * np.sin(q["q2"] + q["q3"] + q["q4"]) + np.cos(q["q3"] + q["q4"]), {"q2", "q3", "q4"}, 0.68),
    ],
)  # fmt: skip
def test_the_gear_ratios_of_motors_are_found(
    own: str, torque: Torque, turning: set[str], rate: float, seed: int
) -> None:
    def succeeds(number: int) -> bool:
        rec = of_motors(recorded(torque, np.random.default_rng(number), own), GEARS)
        found = gear_ratios([rec], own, ANGLES, ANGLES)
        # A motion over a radian and a half tells no more than a third.
        if set(found) != turning or any(abs(ratio * GEARS[n] - 1) > 1 / 3 for n, ratio in found.items()):
            return False
        explained = link_weights([of_motors(rec, found)], ArmSignals(own, list(found)))
        return explained is not None and explained.explained > max(0.9, explained.before)

    often(succeeds, seed, rate, 16)


def test_angles_that_are_known_keep_their_ratio(seed: int) -> None:
    """The shoulder is measured at the arm, the elbow at its motor."""
    torque: Torque = lambda q: 5 * np.cos(q["q2"] + q["q3"])  # noqa: E731

    def succeeds(number: int) -> bool:
        rec = of_motors(recorded(torque, np.random.default_rng(number), "q3"), {"q3": 80.0})
        found = gear_ratios([rec], "q3", ANGLES, ("q3",))
        return set(found) == {"q3"} and pytest.approx(1 / 80, rel=0.05) == found["q3"]

    often(succeeds, seed, 0.83, 40)


def test_the_load_on_a_motor_follows_angles_of_the_arm(seed: int) -> None:
    """Whose record may lack some of the signals; an angle that is that of the arm in any case is no motor's."""
    torque: Torque = lambda q: 5 * np.cos(q["q2"] + q["q3"])  # noqa: E731
    signals = ArmSignals("q3", [*ANGLES, "q9"], ("load", "still"))

    def succeeds(number: int) -> bool:
        rec = of_motors(recorded(torque, np.random.default_rng(number), "q3"), {"q1": 60.0, "q3": 80.0})
        rec = replace(rec, signals={**rec.signals, "still": np.zeros(len(rec))})
        known = recorded_signals([rec], signals)
        assert (known.angles, known.loads) == (list(ANGLES), [])
        assert motor_angles([rec], known) == ["q1", "q3"]
        assert motor_angles([rec], known._replace(of_arm=("q1",))) == ["q3"]
        found = arm_load([rec], known)
        if found is None or set(found.ratios) != {"q3"} or not {"q2", "q3"} <= found.weights.signals:
            return False
        return pytest.approx(1 / 80, rel=0.05) == found.ratios["q3"]

    often(succeeds, seed, 0.83)


def test_a_motor_whose_weight_does_not_turn_has_no_ratio(seed: int) -> None:
    def succeeds(number: int) -> bool:
        rec = of_motors(recorded(lambda q: 3 + 0 * q["q2"], np.random.default_rng(number)), GEARS)
        found = gear_ratios([rec], "q2", ANGLES, ANGLES)
        return not found or link_weights([of_motors(rec, found)], ArmSignals("q2", list(found))) is None

    often(succeeds, seed, 0.97)
