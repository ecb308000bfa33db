"""Chains grow to the number of masses that the drive has, and say so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.structure import Output
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting import Growth, grow, mass_count
from monitor_core.identification.starting.chains import Chain, ChainParameters, chain, problem_of
from monitor_core.identification.starting.growing_chains import (
    ChainMode,
    Modal,
    grown_chains,
    joined,
    lacking,
    shape,
)
from monitor_core.identification.starting.mass_count import doubt_of, is_supported, verdict
from monitor_core.identification.starting.response import measure
from monitor_core.identification.starting.search import errors
from monitor_core.identification.starting.starting_fits import best_fit
from tests.core.identification.starting_cases import CASES, THREE, TWO, Case

MASSES = {"two": 2, "three": 3, "five": 5}
SHORT_TWO = replace(TWO, seconds=10.0)


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("name", CASES)
def test_chains_are_the_drawn_drives(name: str, output: Output, seed: int) -> None:
    """Matrix by matrix, where the gear is 1:1."""
    drawn, n, rng = CASES[name].drive(output), MASSES[name], np.random.default_rng(seed)
    of_chain = chain(n, output)
    values = {p.name: float(np.exp(rng.normal())) for p in of_chain.parameters}
    same = {p.name: value for p, value in zip(drawn.parameters, [*values.values(), 1.0, 1.0], strict=True)}
    assert [p.name for p in drawn.parameters][-2:] == ["kT", "r"]
    for which in ("A", "B", "C", "rest", "ratio"):
        np.testing.assert_allclose(of_chain.matrix(which, values), drawn.matrix(which, same), rtol=1e-14)
    assert of_chain.speed_state == drawn.speed_state
    assert of_chain.inputs == drawn.inputs


def test_what_a_further_mode_gains_is_what_least_squares_gain(seed: int) -> None:
    """The score test against least squares with the slopes and the mode together."""
    measured = measure([THREE.record(seed)])
    (chain,) = grown_chains(problem_of(1, "speed", friction=("fm",)), measured)
    target, x = measured.target(), chain.end.x
    e, J = errors("linear", target, *chain.response.at(x, target))
    mode = lacking(chain.response, x, measured)[0]
    column = target.weight * shape(target, mode.p, mode.decay, "speed") / target.G
    wide = np.column_stack([J, column])
    both, right = np.vstack([wide.real, wide.imag]), np.concatenate([e.real, e.imag])
    found, left, *_ = np.linalg.lstsq(both, right)
    before = np.linalg.lstsq(both[:, :-1], right)[1]
    assert found[-1] == pytest.approx(mode.a, rel=1e-6)
    assert before[0] - left[0] == pytest.approx(mode.gain, rel=1e-6)


@pytest.fixture(scope="module")
def growth(seed: int) -> Growth:
    """Of two masses, with a record kept aside, by innovations with Huber's loss."""
    like = replace(TWO.problem(), predictor="innovations", loss="huber", free=("Jm",))
    records = [[SHORT_TWO.record(seed + k)] for k in range(2)]
    return grow(records[0], 3, like=like, friction=["fm"], validation=records[1])


def test_settings_and_criteria(growth: Growth, seed: int) -> None:
    assert growth.recommended == 2
    assert growth.words[0].startswith("2 masses suffice.")
    model = growth.models[1]
    assert model.estimate.problem.predictor == "innovations"
    assert model.estimate.problem.loss == "huber"
    assert model.estimate.names == ("J1", "J2", "k1", "d1", "fm")
    assert len(model.validation) == 1
    samples = len(SHORT_TWO.record(seed))
    assert 0.9 * samples < model.samples <= samples
    assert model.bic - model.aic == pytest.approx(5 * (np.log(model.samples) - 2))
    lost = model.bic - growth.models[0].bic
    ratio = model.estimate.cost / growth.models[0].estimate.cost
    # Three parameters and two initial states more.
    assert lost == pytest.approx(model.samples * np.log(ratio) + 3 * np.log(model.samples) + 4)


def test_who_asks_for_one_more(growth: Growth) -> None:
    """Each of the three criteria alone says no."""
    small = growth.models[0]
    large = replace(growth.models[1], bic=small.bic - 1.0, validation=(small.validation[0] + 1.0,), doubt="")
    assert is_supported(small, large)
    by_chance = replace(large, bic=small.bic + 1.0)
    worse = replace(large, validation=(small.validation[0] - 1.0,))
    none = replace(large, doubt="one of them is a fly")
    for other, word in (
        (by_chance, "BIC rises by 1"),
        (worse, "kept aside"),
        (none, "but one of them is a fly"),
    ):
        assert not is_supported(small, other)
        found = verdict([small, other], "")
        assert found.recommended == 1
        assert word in found.words[0]
        assert found.words[0].startswith("One mass suffices.")
    assert verdict([small, large], "").recommended == 2
    assert "most that was tried" in verdict([small, large], "").words[0]
    assert "could be fitted: no luck." in verdict([small, large], "no luck").words[0]


def test_whiteness_in_words(growth: Growth) -> None:
    best = growth.models[1]
    for p_value, words in ((0.011, "errors are white"), (0.009, "errors are not white (p = 0.009)")):
        estimate = replace(best.estimate, whiteness=best.estimate.whiteness._replace(p_value=p_value))
        assert words in verdict([growth.models[0], replace(best, estimate=estimate)], "").words[1]
    assert best.estimate.whiteness.p_value > 1e-5
    assert "errors are not white" in verdict(growth.models[:1], "").words[1]


def test_masses_that_are_none() -> None:
    J, k = np.array([1.0, 1.0]), np.array([2 * np.pi**2])
    slow = np.sqrt(2 * k[0]) / (2 * np.pi)
    assert doubt_of(Chain(J, k), 0.99 * slow) == ""
    assert "is below" in doubt_of(Chain(J, k), 1.01 * slow)
    assert "whole inertia" in doubt_of(Chain(J * [1.0, 0.9e-3], k), 0.0)
    assert doubt_of(Chain(J * [1.0, 1.1e-3], k), 0.0) == ""
    assert doubt_of(Chain(J[:1], k[:0]), 1.0) == ""


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_one_mass_needs_only_itself(output: Output, seed: int) -> None:
    """Its inertia is between that of the motor and that of all masses, though the response has a resonance."""
    measured = measure([TWO.record(seed, output=output)])
    (chain,) = grown_chains(problem_of(1, output, friction=("fm",)), measured)
    for found in (chain.response.values, chain.response.named(chain.end.x)):
        assert 0.5 * TWO.values["Jm"] < found["J1"] < 1.5 * sum(behind(TWO))


def behind(case: Case) -> list[float]:
    """Masses as the motor sees them."""
    r = case.values["r"]
    return [value * (1 if name == "Jm" else r**2) for name, value in case.values.items() if name[0] == "J"]


def test_a_mode_joins_in_its_place() -> None:
    """In order of frequency; its weight is no smaller than a hundredth of the largest and no larger than that."""
    known = Modal(np.array([0.0, 5.0]), np.array([2.0, 1.0]), np.array([0.1, 0.2]))
    between = joined(known, ChainMode(3.0, 9.0, 0.3, 1.0))
    np.testing.assert_array_equal(between, [[0.0, 3.0, 5.0], [2.0, 2.0, 1.0], [0.1, 0.3, 0.2]])
    assert joined(known, ChainMode(3.0, 0.001, 0.3, 1.0)).a[1] == 0.02


def test_decays_of_light_dampers_are_those_of_the_poles() -> None:
    """Of the whole drive, lightly damped, by its eigenvalues."""
    light = {name: value * (1e-2 if name[0] in "df" else 1) for name, value in THREE.values.items()}
    poles = np.linalg.eigvals(THREE.speed.matrix("A", light))
    poles = poles[poles.imag >= 0]
    poles = poles[np.argsort(np.abs(poles))]
    np.testing.assert_allclose(ChainParameters(THREE.problem()).decays(light)[1:], -poles.real[1:], rtol=1e-2)


def test_a_search_that_failed_is_no_evidence(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """More masses with larger errors: the shorter chain is among them, so only the search went wrong."""
    original = best_fit

    def worse(problem: Problem, *rest: Any) -> Estimate:
        found = original(problem, *rest)
        return replace(found, cost=1e4 * found.cost) if len(found.names) > 2 else found

    monkeypatch.setattr(mass_count, "best_fit", worse)
    result = grow([TWO.record(seed)], 3, friction=("fm",))
    assert (result.recommended, len(result.models)) == (1, 1)
    assert "No chain of 2 masses could be fitted" in result.words[0]
    assert "%" not in result.words[0]
