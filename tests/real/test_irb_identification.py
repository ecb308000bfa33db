"""A real robot axis, identified off line at 2 kHz as recorded: three masses, Coulomb friction, torque offset.

Published for this record: a model with 13 parameters, friction among them with a Stribeck part, simulates it with
79 % at its start values and with 88.6 % fitted.  Here there are ten, and the friction is fc tanh(w).
"""

from __future__ import annotations

import re

import pytest

from monitor_core.identification import IdentificationOptions, Record, between, identify
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import MotionSource, PredictorKind, Problem
from monitor_core.modeling.standard_drives import three_mass
from monitor_core.samples import SampleBlock
from tests.real.irb import model_and_settings

pytestmark = [pytest.mark.records, pytest.mark.usefixtures("without_pictures")]

FREE = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm", "fc", "tau0")
J, A_M, A_G = 0.03291699877416, 0.17910964111956, 0.61206166914114
START = {
    "Jm": J * A_M,
    "Jg": J * A_G,
    "Ja": J * (1 - A_M - A_G),
    "kg": 20.59269827430799,
    "ka": 20.23072060978318,
    "dg": 0.0624181404729,
    "da": 0.00987527995798,
    "fm": 0.00986346744839,
    "fc": 0.74302635727901,
    "tau0": 0.0,
    "kT": 1.0,
    "r": 1.0,
}
"""The published start values; of the friction those parts that this drive has."""
SIMULATES = 88.5
FRICTION = ("fm", "fc")


@pytest.fixture(scope="module")
def record(irb_record: SampleBlock) -> Record:
    t_us = irb_record.t_us
    return Record((t_us - t_us[0]) * 1e-6, irb_record.u, irb_record.y, "speed", "robot_arm.mat")


@pytest.fixture(scope="module")
def simulation(record: Record) -> Estimate:
    return fit(problem("output-error"), [record])


@pytest.fixture(scope="module", params=[0, 1], ids=["first half", "second half"])
def half(record: Record, request: pytest.FixtureRequest) -> Estimate:
    middle = record.duration_s / 2
    return fit(problem("output-error"), [between(record, request.param * middle, (request.param + 1) * middle)])


def problem(predictor: PredictorKind) -> Problem:
    """Output error: a free run, its friction from the simulated speed, its initial state estimated."""
    motion: MotionSource = "simulated" if predictor == "output-error" else "measured"
    return Problem(three_mass("speed"), START, FREE, predictor=predictor, motion=motion)


def test_simulation(simulation: Estimate) -> None:
    print(f"irb simulated: {simulation.fit_simulation[0]:.2f} %, {simulation.iterations} evaluations")
    for name, value, sd in zip(simulation.names, simulation.theta, simulation.sd, strict=True):
        print(f"    {name} = {value:.5g} +- {sd:.2g}")
    assert simulation.converged
    assert simulation.interval_s == 0.0005
    assert simulation.fit_simulation[0] >= SIMULATES
    assert any(word.startswith("fm and fc cannot both be determined") for word in simulation.words)
    i = simulation.names.index("fm")
    deviation = simulation.accuracy.standard_deviations[i]
    assert deviation == pytest.approx(simulation.sd[i] / simulation.theta[i], rel=0.2)


def test_one_step_ahead(record: Record, simulation: Estimate) -> None:
    """The innovations form predicts the next sample; what it has to say of the friction is not another thing."""
    found = fit(problem("innovations"), [record])
    print(
        f"irb innovations: {found.fit[0]:.2f} % one step ahead, {found.fit_simulation[0]:.2f} % simulated;"
        f" {' '.join(found.words)}"
    )
    assert found.converged
    assert found.fit[0] > 97
    assert found.fit_simulation[0] <= simulation.fit_simulation[0]


@pytest.mark.soak
def test_values_in_innovations_form_are_physical_and_as_good_as_by_output_error(record: Record) -> None:
    """By ``identify``, from values with which a search alone ends at dampers below zero; half against half."""
    model, _ = model_and_settings()
    values = {name: model.nominal[name] for name in START}
    middle = record.duration_s / 2
    halves = [between(record, k * middle, (k + 1) * middle) for k in range(2)]
    options = IdentificationOptions(monitored=("kT", "1/Ja", "fm"))
    explains = {}
    for predictor in ("innovations", "output-error"):
        given = Problem(three_mass("speed"), values, FREE, predictor=predictor)
        result = identify(given, halves[:1], halves[1:], options)
        found = result.estimate.values
        print(predictor, result.verdict, result.held, {name: round(float(found[name]), 5) for name in FREE})
        assert min(found[name] for name in FREE if name != "tau0") >= 0
        assert {"fm", "fc"} & set(result.held) <= {"fc"}
        assert result.rejection is None
        explains[predictor] = result.verdict.validation
    assert explains["innovations"] > explains["output-error"] - 1


def test_friction_of_half_a_record(half: Estimate) -> None:
    """Viscous and Coulomb friction go together, and it is said."""
    value, sd, r = half.theta, half.sd, correlation(half)
    i, j = (half.names.index(name) for name in FRICTION)
    print(f"irb: fm = {value[i]:.4f} +- {sd[i]:.2g}, fc = {value[j]:.3f} +- {sd[j]:.2g}, correlation {r:.3f}")
    assert r == pytest.approx(-0.98, abs=0.01)
    assert sd[j] > 0.3 * abs(value[j])
    match = re.search(r"fm and fc correlate by (-0\.\d\d)\.", " ".join(half.words))
    assert match, half.words
    assert float(match[1]) == pytest.approx(r, abs=0.01)


def correlation(found: Estimate) -> float:
    i, j = (found.names.index(name) for name in FRICTION)
    return float(found.correlation[i, j])
