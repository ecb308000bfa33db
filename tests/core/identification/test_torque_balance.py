"""How much of the torque a drive explains: against torques that are written down for a motion that is given.

At the end: by how many samples a torque is late, beside friction and a weight; one that is not late stays where it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification import samples_late, shown_inertia
from monitor_core.identification.assessment.explained_torque import (
    explained_torque,
    follows_pose,
    holds_weight,
    offset_exceeds_friction,
)
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import rigid_fits
from monitor_core.identification.torque_balance.torque_windows import USUAL, TorqueTerm
from monitor_core.identification.weight.weight_balance import WeightBalance, slow_parts
from tests.core.chains import chain, one_mass, values
from tests.core.identification.record_cases import picks

INTERVAL_S, SCALE, SECONDS = 0.005, 0.3, 40.0
T = np.arange(0.0, SECONDS, INTERVAL_S)
VALUES = {**values(2), "fa": 0.0, "tau0": 0.3}
R = VALUES["r"]
SWINGS = ((0.7 / R, 0.11), (0.25 / R, 0.31))
"""Amplitude at the motor [rad] and frequency [Hz]: far below the resonance, so that the drive is rigid."""
OTHER = np.cos(0.9 * np.sin(2 * np.pi * 0.07 * T))
LOAD = 0.8
"""N m at the motor, of the arm that another axis moves."""


def moved(**other_values: float) -> tuple[Record, Problem]:
    """A record of the true drive, and the problem with other values of some parameters."""
    v = VALUES
    turns = [(a, 2 * np.pi * f) for a, f in SWINGS]
    angle = np.sum([a * np.sin(w * T) for a, w in turns], axis=0)
    speed = np.sum([a * w * np.cos(w * T) for a, w in turns], axis=0)
    acceleration = np.sum([-a * w * w * np.sin(w * T) for a, w in turns], axis=0)
    weight = R * (v["gc"] * np.cos(R * angle) + v["gs"] * np.sin(R * angle))
    inertia = v["J1"] + R**2 * v["J2"]
    taken = inertia * acceleration + v["f"] * speed + v["fc"] * np.tanh(speed / SCALE) + weight
    u = (taken - v["tau0"] - LOAD * OTHER) / v["kT"]
    held = np.append(u[:-1] + np.diff(u) / 2, u[-1])  # the mean over each interval
    record = Record(T, held, angle, "angle", signals={"load": OTHER})
    problem = Problem(
        chain(2, "angle"),
        {**v, **other_values},
        ("fc", "tau0"),
        speed_scale=SCALE,
        varying={"tau0": ("load",)},
        slopes={"tau0 per load": LOAD},
    )
    return record, problem


def test_the_true_values_explain_all_of_it() -> None:
    record, problem = moved()
    assert explained_torque([(problem, [record])]) > 99.5


@pytest.mark.parametrize(("name", "factor"), [("kT", 1.2), ("gc", 1.3), ("fc", 2.0), ("tau0", -1.0)])
def test_another_value_leaves_what_it_is_off_by(name: str, factor: float) -> None:
    """Everything takes part of the torque but what is off; both records count by their torque."""
    record, problem = moved()
    _, wrong = moved(**{name: factor * VALUES[name]})
    alone = explained_torque([(wrong, [record])])
    assert alone < 97
    both = explained_torque([(wrong, [record]), (problem, [record])])
    assert 100 - both == pytest.approx((100 - alone) / np.sqrt(2), rel=0.02)


def test_a_constant_torque_follows_its_signal() -> None:
    record, problem = moved()
    assert follows_pose(problem)
    without = replace(problem, varying={}, slopes={})
    assert not follows_pose(without)
    off = np.std(LOAD / VALUES["kT"] * (OTHER - OTHER.mean())) / np.std(record.u)
    mean = replace(without, nominal={**VALUES, "tau0": VALUES["tau0"] + LOAD * OTHER.mean()})
    assert 100 - explained_torque([(mean, [record])]) == pytest.approx(100 * off, rel=0.05)


def test_a_weight_is_gravity_or_a_torque_that_follows_signals() -> None:
    _, problem = moved(gc=0.0, gs=0.0)
    assert holds_weight(problem)
    assert not holds_weight(replace(problem, varying={}, slopes={}))
    _, problem = moved()
    assert holds_weight(replace(problem, varying={}, slopes={}))


def test_a_constant_torque_that_friction_does_not_hold_is_a_weight() -> None:
    """As on a vertical linear axis; what friction holds is an offset."""
    _, problem = moved(gc=0.0, gs=0.0)
    alone = replace(problem, varying={}, slopes={})
    for times, holds in ((0.9, False), (-1.1, True)):
        offset = times * VALUES["fc"]
        assert offset_exceeds_friction(replace(alone, nominal={**alone.nominal, "tau0": offset})) is holds


def test_friction_of_an_axis_that_stands_is_no_weight(seed: int) -> None:
    """Before it moved on it came from below at one place and from above at the other."""
    record = picks(seed)
    true = {"J": 2e-3, "fm": 5e-3, "fc": 0.5, "tau0": 0.0, "kT": 1.0}
    problem = Problem(one_mass("angle"), true, ("fc",), speed_scale=1.0)
    usual: tuple[TorqueTerm, ...] = ("viscous", "coulomb", "offset")
    with_stops, without = (rigid_fits([record], [usual], 1.0, moving=moving)[0] for moving in (False, True))
    assert with_stops is not None
    assert without is not None
    print(with_stops, without)
    assert with_stops.inertia < 0  # which nothing has
    assert without.explained > 0.98
    assert without.inertia == pytest.approx(2e-3, rel=0.03)
    assert without.torques["coulomb"] == pytest.approx(0.5, rel=0.05)
    shown = shown_inertia(record)
    assert shown is not None
    assert shown.inertia == pytest.approx(2e-3, rel=0.1)
    assert explained_torque([(problem, [record])]) > 85


def test_a_record_that_is_too_short_explains_nothing() -> None:
    record, problem = moved()
    short = Record(record.t[:20], record.u[:20], record.y[:20], "angle", signals={"load": record.signals["load"][:20]})
    assert explained_torque([(problem, [short])]) == -np.inf


def test_of_other_windows_less_is_expected_the_fewer_were_fitted(seed: int) -> None:
    """By the adjusted coefficient of determination, as windows overlap four times: hardly less where they are many."""
    record, _ = moved()
    noise = np.random.default_rng(seed).standard_normal(T.size)
    gaps = []
    for part in (200, 12.5):
        (fit,) = rigid_fits([replace(record, u=record.u + noise)], [USUAL], SCALE, shortest_s=SECONDS / part)
        assert fit is not None
        assert 0 < fit.explained < 1
        gaps.append((fit.explained - fit.expected) / (1 - fit.explained))
    many, few = gaps
    assert 0 < many < 0.2
    assert 0.3 < few < 1.0


# --- A torque that is late --------------------------------------------------------------------------------------------


H_S, N = 0.004, 12_000
TIMES = H_S * np.arange(N, dtype=np.float64)


def sent_late(rng: np.random.Generator, late_s: float, weight: float) -> Record:
    """A rigid mass that follows random accelerations, with the torque of that time sent late."""
    fine, step = H_S / 8, 8
    change = np.repeat(rng.uniform(-400, 400, N * step // 240), 240) * np.exp(-rng.uniform(0, 1))
    w = 40 * np.sin(np.cumsum(change) * fine / 40)
    angle = np.cumsum(w) * fine
    u = 0.01 * np.gradient(w, fine) + 0.01 * w + 0.3 * np.tanh(w / 0.5) + weight * np.sin(angle / 100)
    # What acts is held from a sample to the next; the mean is as good.
    u = np.repeat(u[: N * step].reshape(-1, step).mean(axis=1), step)
    sent = np.concatenate([np.full(round(late_s / fine), u[0]), u])[: N * step : step]
    sent = sent + 0.02 * rng.standard_normal(N)
    return Record(TIMES, sent, angle[: N * step : step] + 1e-4 * rng.standard_normal(N), "angle", "x")


@pytest.mark.parametrize("weight", [0.0, 4.0])
@pytest.mark.parametrize("late", [0, 1, 3, 8])
def test_a_late_torque_is_found(late: int, weight: float, seed: int) -> None:
    record = sent_late(np.random.default_rng(seed), late * H_S, weight)
    assert samples_late([record]) == late
    turned = Record(record.t, -record.u, record.y, "angle", "x")
    assert samples_late([turned]) == late


@pytest.mark.parametrize("late", [11, 17])
def test_a_torque_that_is_later_than_can_be_corrected_is_found(late: int, seed: int) -> None:
    assert samples_late([sent_late(np.random.default_rng(seed), late * H_S, 0.0)]) == 10


def test_a_force_at_the_begin_of_motions_is_no_late_torque(seed: int) -> None:
    """As a gun has when it opens: earlier, it would act while the axis stands, wherever that is."""
    rng = np.random.default_rng(seed)
    moves, stands = 300, 200
    way = np.concatenate([10 * (1 - np.cos(np.pi * np.arange(moves) / moves)), np.full(stands, 20.0)])
    cycles = N // (2 * (moves + stands))
    angle = np.tile(np.concatenate([way, 20 - way]), cycles)
    w = np.gradient(angle, H_S)
    force = np.tile(np.concatenate([np.full(10, 5.0), np.zeros(moves + stands - 10)]), 2 * cycles)
    u = 0.001 * np.gradient(w, H_S) + 0.01 * w + 0.1 * np.tanh(w / 0.5) - force
    u += 0.01 * rng.standard_normal(N)
    assert samples_late([Record(TIMES, u, angle + 1e-4 * rng.standard_normal(N), "angle", "x")]) == 0


def test_what_stands_or_is_noise_shows_no_delay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert samples_late([Record(TIMES, rng.standard_normal(N), np.zeros(N), "angle", "x")]) == 0
    assert samples_late([Record(TIMES, rng.standard_normal(N), rng.standard_normal(N), "angle", "x")]) == 0
    assert samples_late([Record(TIMES[:100], rng.standard_normal(100), TIMES[:100], "angle", "x")]) == 0


def test_a_long_record_has_windows_as_short_as_its_motions(seed: int) -> None:
    """Forty minutes of motions of a second: with longer windows friction at low speed passes for less inertia."""
    rng = np.random.default_rng(seed)
    h, J, fm, fc = 0.016, 0.05, 0.25, 0.35
    angles, place = list[Floats](), 0.0
    while sum(map(len, angles)) * h < 2400.0:
        x = np.linspace(0.0, 1.0, round(rng.uniform(0.6, 1.2) / h))
        goal = rng.uniform(-1.5, 1.5)
        angles.append(place + (goal - place) * x**3 * (10 - 15 * x + 6 * x**2))
        angles.append(np.full(round(rng.uniform(0.1, 0.6) / h), goal))
        place = goal
    angle = np.concatenate(angles)
    speed = np.gradient(angle, h)
    stribeck = 1 + 0.5 * np.exp(-((speed / 0.08) ** 2))
    torque = J * np.gradient(speed, h) + fm * speed + fc * np.tanh(speed / 0.01) * stribeck
    torque += 0.02 * rng.standard_normal(angle.size)
    t = h * np.arange(angle.size, dtype=np.float64)
    record = Record(t, torque, angle + 1e-5 * rng.standard_normal(angle.size), "angle", "x")
    parts, window = slow_parts([record], ())
    found = WeightBalance(parts, window, 0.01).rigid_mass(())
    assert found is not None
    assert found == pytest.approx((J, fm), rel=0.055)
