"""The type of a frequency response, and responses of drives against simulations and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Complexes
from monitor_core.excitation import multisine
from monitor_core.identification.assessment.drive_response import drive_response, held_response
from monitor_core.identification.black_boxes.frequency_response import DECIBEL, by_gradient, root_of
from monitor_core.identification.predictor.held_drive import LinearDrive
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from tests.core.identification.systems import INTERVAL_S

law = settings(deadline=None, max_examples=15)
seeds = st.integers(0, 2**32 - 1)

# --- the type ----------------------------------------------------------------------------------------------


@law
@given(seeds, st.integers(1, 6))
def test_deviations_are_those_of_samples(seed: int, p: int) -> None:
    """The delta method against small random steps along the gradient."""
    rng = np.random.default_rng(seed)
    G, dG = np.array([1 + 2j]), rng.normal(size=(1, p)) + 1j * rng.normal(size=(1, p))
    root = 1e-5 * rng.normal(size=(p, p))
    steps = rng.normal(size=(20000, p)) @ root.T
    w = np.log((G + steps @ dG[0]) / G)
    found = by_gradient(np.array([1.0]), G, dG, root_of(root @ root.T))
    assert found.sd_db[0] == pytest.approx(DECIBEL * w.real.std(), rel=0.03)
    assert found.sd_phase[0] == pytest.approx(w.imag.std(), rel=0.03)


# --- drives ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay_s", [0.0, 0.0015, INTERVAL_S, 2.5 * INTERVAL_S])
def test_drive_is_what_a_simulation_shows(seed: int, delay_s: float) -> None:
    """The last of three periods of a multisine, its torque late by splitting each interval, line by line."""
    M, fine, shift = 2000, round(INTERVAL_S / 5e-4), round(delay_s / 5e-4)
    u = np.tile(multisine(np.random.default_rng(seed), M, INTERVAL_S, (0.5, 60.0), 1.0), 3)
    late = np.concatenate([np.zeros(shift), np.repeat(u, fine)[: 3 * M * fine - shift]])
    y = simulate_linear(three_mass("speed"), REFERENCE_VALUES, late[:, None], 5e-4)[0][::fine, 0]
    U, Y = np.fft.rfft(u[-M:]), np.fft.rfft(y[-M:])
    excited = np.flatnonzero(abs(U) > 1e-3 * abs(U).max())
    f, measured = excited / (M * INTERVAL_S), Y[excited] / U[excited]
    model = drive_response(three_mass("speed"), REFERENCE_VALUES, INTERVAL_S, f, delay_s=delay_s)
    assert excited.size > 100
    assert pytest.approx(model.G, rel=1e-3, abs=1e-3 * float(np.median(abs(model.G)))) == measured


NAMES = ("Jm", "1/Ja", "fm", "kg", "delay")


def moved(i: int, step: float) -> tuple[dict[str, float], float]:
    values, delay = dict(REFERENCE_VALUES), 0.002
    name = NAMES[i]
    if name == "delay":
        return values, delay + step
    base = name.removeprefix("1/")
    values[base] = 1 / (1 / values[base] + step) if base != name else values[base] + step
    return values, delay


def size(i: int) -> float:
    values, delay = moved(i, 0.0)
    base = NAMES[i].removeprefix("1/")
    return delay if base == "delay" else 1 / values[base] if base != NAMES[i] else values[base]


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("i", range(len(NAMES)))
def test_deviations_of_a_drive_are_its_derivatives(output: str, i: int) -> None:
    f = np.array([0.5, 3.0, 8.0, 13.0, 45.0])
    drive, sd = three_mass("speed" if output == "speed" else "angle"), 0.01 * size(i)
    covariance = np.zeros((5, 5))
    covariance[i, i] = sd**2
    values, delay = moved(i, 0.0)
    found = drive_response(drive, values, INTERVAL_S, f, dict(zip(NAMES, covariance, strict=True)), delay)
    ends = []
    for step in (1e-5 * size(i), -1e-5 * size(i)):
        values, delay = moved(i, step)
        ends.append(drive_response(drive, values, INTERVAL_S, f, delay_s=delay).G)
    w = (np.log(ends[0]) - np.log(ends[1])) / 2e-5 * 0.01
    assert found.sd_db == pytest.approx(DECIBEL * abs(w.real), rel=1e-4, abs=1e-7)
    assert found.sd_phase == pytest.approx(abs(w.imag), rel=1e-4, abs=1e-8)


@law
@given(seeds, st.sampled_from([0.0, 0.002]))
def test_derivatives_of_any_linear_model(seed: int, delay_s: float) -> None:
    """Also of C, which no drive of the library has: along a random direction of A, B and C, by differences."""
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(3, 3)) - 4 * np.eye(3), rng.normal(size=(3, 2)), rng.normal(size=3)
    dA, dB, dC = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=3)
    f, torque, none = np.array([1.0, 30.0, 90.0]), np.array([False, True]), np.zeros

    def response(step: float) -> tuple[Complexes, Complexes]:
        moved = A + step * dA, B + step * dB, C + step * dC, none(3), none(2)
        linear = LinearDrive(*moved, dA[..., None], dB[..., None], dC[:, None], none((3, 1)), none((2, 1)))
        return held_response(linear, torque, INTERVAL_S, f, delay_s)

    difference = (response(1e-6)[0] - response(-1e-6)[0]) / 2e-6
    slope = response(0.0)[1][:, 0]
    assert slope == pytest.approx(difference, rel=1e-5, abs=1e-6 * float(abs(slope).max()))


def test_what_is_not_told_makes_the_band_infinite() -> None:
    drive, f = three_mass("speed"), np.array([1.0, 20.0])
    covariance = np.array([[np.inf, np.nan, 0.0], [np.nan, 1e-8, 0.0], [0.0, 0.0, np.inf]])
    names = ("kT", "Jm", "fm per temperature")
    lost = drive_response(drive, REFERENCE_VALUES, INTERVAL_S, f, dict(zip(names, covariance, strict=True)))
    assert np.isinf(lost.sd_db).all()
    finite = dict(zip(names[1:], covariance[1:, 1:], strict=True))
    known = drive_response(drive, REFERENCE_VALUES, INTERVAL_S, f, finite)
    assert np.isfinite(known.sd_db).all()
    assert (known.sd_db > 0).all()
