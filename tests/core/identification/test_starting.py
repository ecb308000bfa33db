"""Fits that need no guess end where the fit from the truth ends; the closed form is exact where there is no loss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS
from monitor_core.identification import Record
from monitor_core.identification.greybox import fit
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting import fit_from, fit_from_scratch, grow
from monitor_core.identification.starting.chains import (
    Chain,
    ChainParameters,
    chain_of_modes,
    modes_of_chain,
    problem_of,
)
from monitor_core.identification.starting.response import Response, Target, measure
from monitor_core.identification.starting.starting_fits import from_records
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import (
    INTERVAL_S,
)
from tests.core.identification import monte_carlo
from tests.core.identification.starting_cases import (
    AT_OPTIMUM,
    CASES,
    FIVE,
    THREE,
    TWO,
    Case,
    R,
    Way,
)
from tests.shares import soaked

law = settings(deadline=None, max_examples=20)


def ignored(_: int) -> None:
    """No report of progress."""


@pytest.mark.parametrize(("name", "way"), [("two", "scratch"), ("three", "given")])
def test_ends_at_the_optimum(name: str, way: Way, seed: int) -> None:
    """The share that must is counted in the soaks; here one of three, the first as a rule.

    With a fresh seed that fails once in 8000 runs, with five masses once in 125, if just as many succeed as must.
    """
    assert any(CASES[name].away(seed + k, way) <= AT_OPTIMUM for k in range(3))


@pytest.mark.parametrize("name", soaked(CASES, "two"))
def test_from_the_measured_angle(name: str, seed: int) -> None:
    """Where the nominal values are of no use; the fit of the record itself is not asked."""
    case = CASES[name]
    record = case.record(seed, output="angle")
    best, *_ = from_records(case.problem(case.wrong(seed), "angle"), measure([record]), ignored)
    found = {n: best.values[n] / case.values[n] for n in case.free if n[0] in "Jk"}
    assert np.abs(np.log(list(found.values()))).max() < 0.3, found


chains = st.integers(2, 5).flatmap(
    lambda n: st.tuples(
        st.lists(st.floats(0.3, 3.0), min_size=n, max_size=n),
        st.lists(st.floats(0.3, 3.0), min_size=n - 1, max_size=n - 1),
    )
)


def stiffness(k: Floats) -> Floats:
    """K (n, n) of springs k (n - 1,) in a row."""
    B = np.eye(k.size + 1)[:-1] - np.eye(k.size + 1, k=1)[:-1]
    return np.asarray(B.T @ (k[:, None] * B))


@law
@given(chains)
def test_modes_of_a_chain_are_that_chain(drawn: tuple[list[float], list[float]]) -> None:
    """Resonances are scipy's, Y(s) at some points is that of the force balance, and back again."""
    J, k = np.array(drawn[0]), np.array(drawn[1])
    p, a = modes_of_chain(Chain(J, k))
    np.testing.assert_allclose(p[1:] ** 2, sla.eigvalsh(stiffness(k), np.diag(J))[1:], rtol=1e-9)
    for s in (0.3, 1.0 + 0.5j, 4.0j):
        balance = np.linalg.inv(np.diag(J) * s + stiffness(k) / s)[0, 0]
        assert np.sum(a * s / (s**2 + p**2)) == pytest.approx(balance, rel=1e-6)
    np.testing.assert_allclose(np.concatenate(chain_of_modes(p, a)), np.concatenate([J, k]), rtol=1e-8)


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("name", CASES)
def test_masses_and_springs_find_their_names(name: str, output: Output, seed: int) -> None:
    """Whatever the nominal values are; dampers by their modal damping, which is exact while they are small."""
    case = CASES[name]
    slots = ChainParameters(case.problem(case.wrong(seed, 10.0), output))
    assert len(slots.dampers) == slots.masses, "each mode tells the damping of one damper"
    J = np.array([v * (1 if n == "Jm" else R**2) for n, v in case.values.items() if n[0] == "J"])
    k = np.array([v * R**2 for n, v in case.values.items() if n[0] == "k" and n != "kT"])
    light = {n: v * (1e-4 if n[0] in "df" else 1) for n, v in case.values.items()}
    A = AxisModel(case.speed, light, ()).matrices()[0]
    poles = np.linalg.eigvals(A)
    poles = poles[poles.imag >= 0]
    decay: Floats = -poles[np.argsort(np.abs(poles))].real.astype(np.float64)
    found = slots.values(Chain(J, k), decay)
    for n in case.free:
        assert found[n] == pytest.approx(light[n], rel=1e-4 if n[0] in "Jk" else 1e-2), n


def test_a_drive_of_which_a_mass_is_held_is_no_free_chain() -> None:
    problem = replace(THREE.problem(), free=tuple(n for n in THREE.free if n != "Ja"))
    with pytest.raises(ValueError, match="free parameter"):
        ChainParameters(problem)


def test_dampers_that_are_held_stay(seed: int) -> None:
    """Masses and springs are found beside them."""
    problem = replace(TWO.problem(), free=("Jm", "Ja", "k"))
    found = fit_from_scratch(problem, [TWO.record(seed)])
    assert {name: found.values[name] for name in ("d", "fm")} == {n: TWO.values[n] for n in ("d", "fm")}
    assert found.cost <= AT_OPTIMUM * fit(problem, [TWO.record(seed)]).cost


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("shift", [0.0, 12.0])
def test_response_and_its_slopes(output: Output, shift: float, seed: int) -> None:
    """Against the held drive solved directly, and differences."""
    problem = replace(FIVE.problem(FIVE.wrong(seed), output), delay_s=0.002)
    response, f = Response(problem), np.linspace(0.5, 40, 30)
    z = np.exp((shift + 2j * np.pi * f) * INTERVAL_S)
    target = Target(z, np.ones(30, complex), np.ones(30), INTERVAL_S)
    G, dG = response.at(response.start, target)
    A, B, C = AxisModel(problem.drive, problem.nominal, ()).matrices()
    Ad, Bd = zero_order_hold(A, B[:, :1], INTERVAL_S)
    direct = [(C @ np.linalg.solve(w * np.eye(len(A)) - Ad, Bd))[0, 0] * w**-0.4 for w in z]
    np.testing.assert_allclose(G, direct, rtol=1e-6)
    for i in range(response.start.size):
        e = 1e-5 * np.eye(response.start.size)[i]
        ahead, behind = (response.at(response.start + s * e, target)[0] for s in (1, -1))
        slope = (ahead - behind) / 2e-5
        np.testing.assert_allclose(dG[:, i], slope, atol=1e-5 * np.abs(dG).max())


def irregular(case: Case, seed: int) -> Record:
    """Samples every 4 to 6 ms at random."""
    rng, fine = np.random.default_rng(seed), 1e-3
    at = np.concatenate([[0], np.cumsum(rng.integers(4, 7, round(case.seconds / INTERVAL_S)))])
    u = multisine(rng, at.size, INTERVAL_S, BAND_HZ, TORQUE_RMS)
    held = np.repeat(u[:-1], np.diff(at))
    y, _ = simulate_linear(case.speed, case.values, np.append(held, 0.0)[:, None], fine)
    return Record(fine * at.astype(np.float64), u, y[at, 0] + 0.3 * rng.standard_normal(at.size), "speed")


@pytest.mark.soak
@pytest.mark.parametrize("way", ["scratch", "given"])
def test_irregular_and_lost_samples(way: Way, seed: int) -> None:
    record = irregular(THREE, seed)
    record = record.without(np.random.default_rng(seed).random(len(record)) < 0.002)
    best = fit(THREE.problem(), [record])
    assert THREE.found(record, way, THREE.wrong(seed, 1.5)).cost <= AT_OPTIMUM * best.cost


def test_reciprocals_offsets_and_words(seed: int) -> None:
    """1/Ja is free, too, and so are friction and offset, of which no frequency response tells."""
    record = THREE.record(seed, 0.3)
    free = (*("1/Ja" if name == "Ja" else name for name in THREE.free), "fc", "tau0")
    problem = replace(THREE.problem(), free=free)
    best = fit(problem, [record])
    found = fit_from_scratch(replace(problem, nominal={**THREE.values, **THREE.wrong(seed)}), [record])
    assert found.cost <= AT_OPTIMUM * best.cost
    assert "a chain that was extended mass by mass" in found.started_from
    wrong = {**THREE.values, "Ja": 0.5 * THREE.values["Ja"], "kg": 0.5 * THREE.values["kg"]}
    from_given = fit_from(replace(problem, nominal=wrong), [record])
    assert from_given.cost <= AT_OPTIMUM * best.cost
    assert from_given.started_from.startswith("Started from a search around the values given")


def test_a_record_of_noise_alone_is_refused(seed: int) -> None:
    """Three in four hundred look by chance as if the torque moved them."""
    record = THREE.record(seed)
    rng = np.random.default_rng(seed)
    noises = [replace(record, y=rng.standard_normal(len(record))) for _ in range(8)]
    assert sum(refused(noise, "frequency response") for noise in noises) >= 6


def refused(record: Record, words: str) -> bool:
    try:
        measure([record])
    except ValueError as error:
        return words in str(error)
    return False


@pytest.mark.parametrize("way", soaked(["scratch", "given", "grow"], "given", "grow"))
def test_progress_grows_from_step_to_step_to_the_end(way: Way | Literal["grow"], seed: int) -> None:
    problem, record, reported = TWO.problem(TWO.wrong(seed)), TWO.record(seed), list[tuple[int, int]]()
    if way == "grow":
        grow([record], 2, progress=lambda *step: reported.append(step))
    else:
        fitted = fit_from_scratch if way == "scratch" else fit_from
        fitted(problem, [record], progress=lambda *step: reported.append(step))
    done, totals = zip(*reported, strict=True)
    assert len(set(totals)) == 1
    assert done[-1] == totals[0]
    assert len(done) > 2
    assert list(done) == sorted(set(done))


# --- Where records are not those of an open loop with white noise -----------------------------------------------------


SLOW = monte_carlo.START_OF_NOISE
INNOVATIONS = replace(THREE.problem(), predictor="innovations")


def closed_loop(seed: int) -> Record:
    return monte_carlo.closed_loop([seed])[0]


def disturbed(seed: int) -> Record:
    return monte_carlo.closed_loop([seed], monte_carlo.SLOW)[0]


def with_outliers(seed: int) -> Record:
    """One sample in fifty is off by 30 rad/s."""
    record, rng = THREE.record(seed), np.random.default_rng(seed)
    hit = rng.random(len(record)) < 0.02
    return replace(record, y=record.y + np.where(hit, 30 * rng.standard_normal(len(record)), 0.0))


ELSEWHERE: dict[str, tuple[Problem, Callable[[int], Record]]] = {
    "closed loop": (THREE.problem(), closed_loop),
    "closed loop with a slow disturbance": (replace(INNOVATIONS, disturbance=SLOW), disturbed),
    "innovations": (INNOVATIONS, THREE.record),
    "outliers": (replace(THREE.problem(), loss="huber"), with_outliers),
}


@pytest.mark.parametrize(
    ("name", "way"),
    soaked(
        [*((name, "scratch") for name in ELSEWHERE), ("closed loop", "given")],
        ("closed loop with a slow disturbance", "scratch"),
    ),
)
def test_ends_at_the_optimum_elsewhere(name: str, way: Way, seed: int) -> None:
    """One of three must, the first as a rule: of 72 that were counted none failed, one in fifty might."""
    assert any(at_optimum(name, way, seed + k) for k in range(3))


def at_optimum(name: str, way: Way, seed: int) -> bool:
    problem, record_of = ELSEWHERE[name]
    record, wrong = record_of(seed), THREE.wrong(seed)
    elsewhere = replace(problem, nominal={**problem.nominal, **wrong})
    found = fit_from_scratch(elsewhere, [record]) if way == "scratch" else fit_from(elsewhere, [record])
    return found.cost <= AT_OPTIMUM * fit(problem, [record]).cost


def test_where_only_noise_goes_round_a_loop_nothing_is_told(seed: int) -> None:
    """Beyond the band of the reference u and y show the controller, and that sharply."""
    f = measure([closed_loop(seed)]).frequency_hz
    assert f[0] < 1
    assert f[-1] < BAND_HZ[1] + 0.5
    assert f[-1] > BAND_HZ[1] - 5
    opened = measure([THREE.record(seed)]).frequency_hz
    assert opened[-1] > BAND_HZ[1] - 5


def test_a_single_mass(seed: int) -> None:
    """It has no resonance; friction and inertia come from the response all the same."""
    problem, values = (
        problem_of(1, "speed", friction=("fm",)),
        {"J1": 0.03, "fm": 0.06, "fc": 0.0, "tau0": 0.0},
    )
    rigid = Case("one", problem.drive, problem_of(1, "angle").drive, values, 10.0, 95)
    record = rigid.record(seed)
    best = fit(replace(problem, nominal=values), [record])
    assert fit_from_scratch(problem, [record]).cost <= AT_OPTIMUM * best.cost


@pytest.mark.soak
def test_a_damper_never_drives(seed: int) -> None:
    """Even in a record whose first spring does."""
    values = {**TWO.values, "d": -0.05 * TWO.values["d"], "fm": 0.2}
    case = replace(TWO, values=values)
    record, problem = case.record(seed, 0.1), replace(TWO.problem(), nominal=TWO.values)
    for found in (fit_from_scratch(problem, [record]), fit(problem, [record])):
        assert found.values["d"] == 0
        assert sum(word.startswith("d ended at its bound 0") for word in found.words) == 1, found.words
    usual = fit_from_scratch(TWO.problem(), [TWO.record(seed)])
    assert not any("bound" in word for word in usual.words)
