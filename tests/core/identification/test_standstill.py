"""An axis that stops often: what its friction holds at rest is not in the estimates."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.excitation import multisine
from monitor_core.identification import IdentificationOptions, Problem, identify
from monitor_core.identification.assessment.verdict import Effect, FitQuality
from monitor_core.identification.greybox import fit
from monitor_core.identification.parameter_selection import ScheduledTerm
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.standstill import find_standstill
from monitor_core.identification.weight.weight_balance import with_torque_of_links
from tests.core.chains import one_mass
from tests.core.identification.record_cases import H, healthy, picks
from tests.shares import soaked

NAMES = ("J", "fm", "fc", "tau0")
TRUE = {"J": 2e-3, "fm": 5e-3, "fc": 0.5}


@pytest.mark.parametrize("stiction", soaked([0.0, 0.15], 0.15))
def test_the_estimates_are_those_of_the_motion(seed: int, stiction: float) -> None:
    """With a friction that is larger in the slow motion of each start and stop, too, which is left out then."""
    record = picks(seed, stiction, moves=16)
    start = {"J": 3e-3, "fm": 3e-3, "fc": 0.3, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("angle"), start, NAMES, speed_scale=0.5)
    options = IdentificationOptions("values", speed_scales=speed_scales([record]))
    found = identify(problem, [record], options=options)
    print(found.estimate.values, found.verdict)
    assert found.standstill is not None
    assert found.estimate.problem.min_speed >= found.standstill.speed
    assert (found.slow_left_out > 0.0) == (stiction > 0.0)
    assert found.verdict.quality is FitQuality.GOOD
    for name, value in TRUE.items():
        assert found.estimate.values[name] == pytest.approx(value, rel=0.1), name


@pytest.mark.parametrize("stands_s", [0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 20.0])
def test_an_axis_that_stands_at_first_is_identified(seed: int, stands_s: float) -> None:
    """No error that counts shows its initial speed then, as the predictor forgets it before the axis moves."""
    rng, step = np.random.default_rng(seed), 0.004
    t = np.arange(0.0, stands_s + 20.0, step)
    w = np.where(t < stands_s, 0.0, 40.0 * np.sin(2 * np.pi * 0.5 * (t - stands_s)))
    u = 2e-3 * np.gradient(w, step) + 5e-3 * w + 0.5 * np.tanh(w / 0.5)
    w, u = w + rng.normal(0, 0.02, t.size), u + rng.normal(0, 0.02, t.size)
    given = {**TRUE, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("speed"), given, tuple(TRUE), speed_scale=0.5, min_speed=2.0)
    found = fit(problem, [Record(t, u, w, "speed")])
    assert found.converged
    for name, value in TRUE.items():
        assert found.values[name] == pytest.approx(value, rel=0.05), name


def test_at_rest_it_is_the_torque_of_the_weight(seed: int) -> None:
    """At the angle where the axis stands, on both sides of a gap, too; in motion the torque stays."""
    record = picks(seed)
    weight = 0.3 + 0.8 * np.cos(record.y / 40.0)
    record = replace(record, u=record.u + weight)
    late = np.arange(len(record)) > len(record) // 2
    record = replace(record, t=record.t + 5.0 * late)
    found = find_standstill([record])
    assert found is not None
    assert 0.3 < found.share < 0.7
    (held,) = found.records
    rests = held.u != record.u
    assert np.mean(rests) == pytest.approx(found.share)
    assert np.abs(held.u[rests] - weight[rests]).max() < 0.1
    assert np.abs(record.u[rests] - weight[rests]).mean() > 0.4  # what friction held
    moving = np.abs(np.gradient(record.y, H)) > 3 * found.speed
    assert not (rests & moving).any()


def test_at_rest_it_is_the_torque_of_links_that_load_the_axis(seed: int) -> None:
    """Other axes move them, so its own angle does not show their weight: without them it is not known to stand."""
    record = picks(seed)
    rng, t = np.random.default_rng(seed + 1), record.t
    swings = {name: np.cos(2 * np.pi * rng.uniform(0.02, 0.05) * t + rng.uniform(0, 6)) for name in ("cos", "sin")}
    weight = 6.0 * swings["cos"] - 4.0 * swings["sin"]
    record = replace(record, u=record.u + weight, signals=swings)
    assert find_standstill([record]) is None
    assert with_torque_of_links([record], ()) == [record]
    (linked,) = with_torque_of_links([record], ("cos", "sin"))
    found = find_standstill([linked])
    assert found is not None
    assert 0.3 < found.share < 0.7
    rests = found.records[0].u != record.u
    assert np.abs(found.records[0].u[rests] - weight[rests]).max() < 0.1
    # What is identified with these terms stands, too.
    start = {"J": 3e-3, "fm": 3e-3, "fc": 0.3, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("angle"), start, NAMES, speed_scale=0.5, varying={"tau0": ("cos", "sin")})
    terms = tuple(ScheduledTerm("tau0", name, 0.0, -1.0, 1.0) for name in swings)
    options = IdentificationOptions("values", speed_scales=speed_scales([record]), scheduled=terms)
    identified = identify(problem, [record], options=options)
    assert identified.standstill is not None
    assert identified.estimate.values["J"] == pytest.approx(TRUE["J"], rel=0.1)


def test_an_axis_that_seldom_stands_keeps_its_torque(seed: int) -> None:
    assert find_standstill([healthy(np.random.default_rng(seed), "angle", closed=True)]) is None


def braked(seed: int, at_s: float, seconds: float, friction: float = TRUE["fc"], left: float = 0.0) -> Record:
    """A vertical axis that seldom stands; once its brake closes and its motor is switched off for so long.

    ``friction``: Coulomb friction [N m]; ``left``: torque that the motor keeps meanwhile, of 1.5 N m.
    """
    rng, n, rest = np.random.default_rng(seed), 12_000, round(seconds / H)
    w = 12.0 * multisine(rng, n, H, (0.3, 4.0), 2.0)
    u = TRUE["J"] * np.gradient(w, H) + TRUE["fm"] * w + friction * np.tanh(w / 0.5) + 1.5
    y, k = np.cumsum(w) * H, round(at_s / H)
    k += int(np.argmin(np.abs(w[k : k + 400])))
    u, y, t = np.insert(u, k, np.full(rest, left)), np.insert(y, k, np.full(rest, y[k])), np.arange(n + rest) * H
    noisy_u, noisy_y = u + rng.normal(0, 0.02, t.size), y + rng.normal(0, 1e-4, t.size)
    return Record(np.asarray(t, np.float64), noisy_u, noisy_y, "angle")


def test_a_brake_that_holds_the_axis_for_seconds_does_not_spoil_the_fit(seed: int) -> None:
    """In a record of a minute that the axis otherwise moves throughout."""
    record, other = braked(seed, 20.0, 3.0), braked(seed + 1, 40.0, 2.0)
    found = find_standstill([record])
    assert found is not None
    assert found.speed == 0.0
    assert found.share == pytest.approx(3.0 / 63.0, rel=0.05)
    (held,) = found.records
    changed = np.flatnonzero(held.u != record.u)
    assert held.u[changed] == pytest.approx(1.5, abs=0.1)
    (validation,) = found.held([other])
    assert np.count_nonzero(validation.u != other.u) * H == pytest.approx(2.0, rel=0.05)
    start = {"J": 3e-3, "fm": 3e-3, "fc": 0.3, "tau0": -1.0, "kT": 1.0}
    problem = Problem(one_mass("angle"), start, NAMES, speed_scale=0.5)
    options = IdentificationOptions("values", speed_scales=speed_scales([record]))
    fitted, without = (identify(problem, [r], options=options) for r in (record, braked(seed, 20.0, 0.0)))
    assert fitted.estimate.problem.min_speed == 0.0
    assert without.standstill is None
    for name in NAMES:
        assert fitted.estimate.values[name] == pytest.approx(without.estimate.values[name], rel=0.02), name


def test_where_friction_holds_what_the_motor_does_not_bear_no_brake_is_seen(seed: int) -> None:
    """It may hold half as much again as Coulomb friction."""
    for left, seen in ((0.0, True), (0.4, False)):
        assert (find_standstill([braked(seed, 20.0, 3.0, friction=0.9, left=left)]) is not None) == seen


def test_without_a_weight_no_brake_is_looked_for(seed: int) -> None:
    record = braked(seed, 20.0, 3.0)
    level = replace(record, u=np.where(np.abs(record.u) < 0.2, record.u, record.u - 1.5))
    assert find_standstill([level]) is None


def test_a_slow_motion_is_no_standstill(seed: int) -> None:
    """At a fiftieth of the speed: friction is that of the motion, and tells Coulomb friction from viscous friction."""
    record = picks(seed)
    slow = np.arange(len(record)) % 2000 < 1000
    creeps = replace(record, y=record.y + 0.4 * np.cumsum(np.where(slow, H, -H)))
    assert find_standstill([creeps]) is None


def conveyor(seed: int) -> Record:
    """Stops and starts in one direction; at rest friction holds what the controller has left, as its torque."""
    rng, step = np.random.default_rng(seed), 0.02
    speeds, rests, before = list[np.ndarray](), list[np.ndarray](), 0.0
    for speed in rng.permutation(np.tile([0.0, 60.0, 100.0, 140.0], 10)):
        ramp = np.linspace(before, speed, 30)
        lasting = np.full(rng.integers(100, 200) if speed == 0 else rng.integers(300, 900), speed)
        speeds += [ramp, lasting]
        rests += [np.zeros(ramp.size), np.full(lasting.size, rng.uniform(0.4, 0.9) * (speed == 0))]
        before = speed
    w, rest = np.convolve(np.concatenate(speeds), np.full(15, 1 / 15), "same"), np.concatenate(rests)
    t = np.arange(w.size) * step
    friction = TRUE["fc"] * (1 - 0.1 * t / t[-1])
    taken = TRUE["J"] * np.gradient(w, step) + TRUE["fm"] / 10 * w + friction
    u = np.where(w > 0.5, taken, rest * friction)
    noisy_u, noisy_w = u + rng.normal(0, 0.005, t.size), w + rng.normal(0, 0.05, t.size)
    return Record(np.asarray(t, np.float64), noisy_u, np.asarray(noisy_w, np.float64), "speed")


def test_an_axis_that_moves_one_way_has_no_offset_and_no_weight(seed: int) -> None:
    """An offset is the same as its Coulomb friction, and what changes with the time does so with its angle."""
    record = conveyor(seed)
    start = {"J": 1e-3, "fm": 1e-4, "fc": 0.2, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("speed"), start, NAMES, speed_scale=1.0)
    options = IdentificationOptions("records", speed_scales=speed_scales([record]), monitored=("kT", "fc", "fm"))
    found = identify(problem, [record], options=options)
    print(found.estimate.values, found.verdict)
    assert found.estimate.values["tau0"] == 0
    assert found.held["tau0"] == "the axis moves in one direction only, so it cannot be told from fc"
    assert found.verdict.quality is not FitQuality.POOR
    assert Effect.POSE not in found.verdict.missing
    assert found.estimate.values["J"] == pytest.approx(TRUE["J"], rel=0.1)
    usual = 100.0  # rad/s; friction that falls with the time hides what is viscous
    friction = found.estimate.values["fc"] + usual * found.estimate.values["fm"]
    assert friction == pytest.approx(0.95 * TRUE["fc"] + usual * TRUE["fm"] / 10, rel=0.02)
