"""Factors of a motor that also moves with other axes, found from its friction; none without a coupling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification import Record, likely_coupling, motor_coupling

H_S, COUNT = 0.02, 30_000
BEFORE = ("roll", "bend")
WEIGHT = ("cos(bend)", "cos(turn) * sin(bend)")
"""Terms of the load of links"""
WRISTS = 8
"""Number of redrawn wrists"""


class Wrist:
    """Three axes that move each on its own, or together in a program of ``points`` that differ a little each time.

    The last motor holds by its friction what is put on it while it stands: then its torque does not change, although
    the weight on it does as the other axes move.
    """

    def __init__(self, seed: int, factors: Sequence[float] = (0.0, 0.0), points: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.factors = dict(zip(BEFORE, factors, strict=True))
        if points:
            self.angles = _program(rng, _goals(rng, points, 3))
        else:
            self.angles = np.concatenate([_program(rng, _goals(rng, COUNT, 1)) for _ in range(3)], axis=1)
        # A torque is held from one sample to the next.
        during = (self.angles + np.roll(self.angles, -1, axis=0)) / 2
        speeds = np.gradient(during, H_S, axis=0)
        accelerations = np.gradient(speeds, H_S, axis=0)
        along = np.array([*factors, 1.0])
        speed, acceleration = speeds @ along, accelerations @ along
        fc, fm, J = rng.uniform(0.4, 0.8), rng.uniform(0.1, 0.3), rng.uniform(0.02, 0.08)
        bend, turn = during[:, 1], during[:, 2]
        links = rng.uniform(0.3, 1.0) * np.cos(bend) + rng.uniform(0.3, 1.0) * np.cos(turn) * np.sin(bend)
        links += accelerations[:, :2] @ rng.uniform(-0.1, 0.1, 2)
        free = J * acceleration + fm * speed + links
        self.torque = _with_friction(free, speed, fc) + rng.normal(scale=0.02, size=COUNT)

    @property
    def record(self) -> Record:
        signals = dict(zip((*BEFORE, "turn"), self.angles.T, strict=True))
        return Record(H_S * np.arange(COUNT, dtype=float), self.torque, self.angles[:, 2], "angle", signals=signals)


def _goals(rng: np.random.Generator, points: int, axes: int) -> Floats:
    """Angles at the points of a program; an axis in three keeps its angle (P, axes)."""
    goals = rng.uniform(-1.5, 1.5, (points, axes))
    for k in range(1, points):
        stands = rng.random(axes) < 1 / 3
        goals[k, stands] = goals[k - 1, stands]
    return goals


def _program(rng: np.random.Generator, goals: Floats) -> Floats:
    """Moves from point to point, again and again; the axes start and stop together, and pause (N, axes)."""
    found, last, k = list[Floats](), goals[0], 0
    while sum(map(len, found)) < COUNT:
        k += 1
        new, before = goals[k % len(goals)], goals[(k - 1) % len(goals)]
        goal = np.where(new == before, last, new + rng.normal(scale=0.03, size=len(new)))
        steps = max(int(rng.uniform(0.8, 1.2) * np.max(np.abs(goal - last)) / 1.5 / H_S), 10)
        s = np.arange(1, steps + 1) / steps
        found += [last + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, goal - last), np.tile(goal, (10, 1))]
        last = goal
    return np.concatenate(found)[:COUNT]


def _with_friction(free: Floats, speed: Floats, fc: float) -> Floats:
    """The torque (N,) with Coulomb friction; where the motor stands it stays, as far as friction holds it."""
    found, last = free + fc * np.sign(speed), 0.0
    for k in range(len(found)):
        if abs(speed[k]) < 1e-3:
            found[k] = min(max(last, free[k] - fc), free[k] + fc)
        last = found[k]
    return found


def factors_of(seed: int) -> tuple[float, float]:
    """Factors of a redrawn wrist, of roll and bend."""
    rng = np.random.default_rng(seed + 100)
    roll, bend = rng.uniform((0.2, 0.4), (0.4, 0.8)) * rng.choice([-1, 1], 2)
    return float(roll), float(bend)


@pytest.mark.parametrize("number", range(WRISTS))
def test_the_factors_of_a_coupled_wrist_are_found(number: int, seed: int) -> None:
    wrist = Wrist(seed + number, factors_of(seed + number))
    first = motor_coupling([wrist.record], BEFORE, WEIGHT)
    assert first is not None
    both = motor_coupling([wrist.record], BEFORE, WEIGHT, list(first.factors))
    print(wrist.factors, both)
    assert both is not None
    assert both.factors.keys() == wrist.factors.keys()
    for name, factor in both.factors.items():
        # An interval of 90 % misses one in ten: of 48 factors in three seeds one, by a fifth of its half width.
        assert factor.value == pytest.approx(wrist.factors[name], abs=1.5 * factor.error)


@pytest.mark.parametrize("number", range(WRISTS))
@pytest.mark.parametrize(("points", "terms"), [(12, WEIGHT), (40, ())])
def test_none_are_found_without_a_coupling(points: int, terms: Sequence[str], number: int, seed: int) -> None:
    assert motor_coupling([Wrist(seed + number, points=points).record], BEFORE, terms) is None


@pytest.mark.parametrize("number", range(WRISTS))
def test_a_large_factor_is_likely_although_the_load_is_not_known(number: int, seed: int) -> None:
    """Without it nothing is shown in six of eight; with a factor that is about right the load can be found."""
    found = likely_coupling([Wrist(seed + number, (0.0, 0.8)).record], BEFORE)
    assert found is not None
    assert found.factors.keys() == {"bend"}
    assert found.factors["bend"].value == pytest.approx(0.8, rel=0.12)
    without = likely_coupling([Wrist(seed + number).record], BEFORE)
    assert without is None or all(abs(factor.value) < 0.1 for factor in without.factors.values())


def test_no_factor_is_likely_if_the_halves_of_the_records_differ(seed: int) -> None:
    records = [Wrist(seed, (0.0, factor)).record for factor in (0.8, 0.4)]
    assert likely_coupling(records, BEFORE) is None
    assert likely_coupling(records[:1], ()) is None


@pytest.mark.parametrize("factor", [-1.0, 1.0])
def test_an_elbow_whose_angle_counts_from_the_horizontal(factor: float, seed: int) -> None:
    """Some controllers show it so; its motor turns by the difference to the shoulder."""
    found = motor_coupling([Wrist(seed, (0.0, factor)).record], BEFORE, WEIGHT)
    assert found is not None
    assert found.factors.keys() == {"bend"}
    assert found.factors["bend"].value == pytest.approx(factor, rel=0.05)
