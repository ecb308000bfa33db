"""Multisines: power, period, band, low peaks; planned experiments: within all limits, telling what was predicted."""

import re
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, minimize

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import Drive
from monitor_core.excitation import multisine
from monitor_core.excitation.design import Command, ExcitationTask, PlannedExperiment, plan, warnings
from monitor_core.excitation.motions import ExcitationError, ExperimentPhases, MotionLimits, fitted
from monitor_core.excitation.multisine_signals import (
    Complex,
    Lines,
    Multisine,
    crest_factor,
    flattened,
    lines_in,
    log_peak_norm,
)
from monitor_core.excitation.planned_drive import DriveMotion, Plant
from monitor_core.excitation.prediction import Estimation, distinguishable, information, optimal_powers
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import two_mass
from tests.core.chains import chain, values
from tests.shares import soaked

WHICH: st.SearchStrategy[Lines] = st.sampled_from(["all", "odd"])


@st.composite
def multisines(draw: st.DrawFn) -> Multisine:
    N = draw(st.integers(16, 500))
    which: Lines = draw(WHICH)
    lines = lines_in(N, 0.01, (0.0, draw(st.floats(15.0, 49.0))), which)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    amplitudes = draw(st.floats(0.1, 10.0)) * (rng.random(len(lines)) + 0.01)
    return replace(Multisine.random(rng, N, 0.01, lines), amplitudes=amplitudes)


@given(multisines())
def test_it_is_the_sum_of_cosines_that_it_says(m: Multisine) -> None:
    n = np.arange(m.N)[:, np.newaxis]
    written = (m.amplitudes * np.cos(2 * np.pi * m.lines * n / m.N + m.phases)).sum(axis=1)
    assert m.samples() == pytest.approx(written, abs=1e-9 * m.rms)
    assert np.sqrt(np.mean(m.samples() ** 2)) == pytest.approx(m.rms, rel=1e-12)


@given(multisines(), st.integers(0, 2**32))
def test_behind_a_system_every_line_is_scaled_and_turned(m: Multisine, seed: int) -> None:
    rng = np.random.default_rng(seed)
    G = rng.standard_normal(len(m.lines)) + 1j * rng.standard_normal(len(m.lines))
    before, after = (np.fft.rfft(s.samples())[m.lines] for s in (m, m.through(G)))
    assert after == pytest.approx(G * before, rel=1e-9, abs=1e-9)


def test_the_ends_of_the_band_belong_to_it() -> None:
    assert lines_in(2000, 0.005, (0.3, 30.0)).tolist() == list(range(3, 301))
    assert lines_in(2000, 0.005, (0.3, 30.0), "odd").tolist() == list(range(3, 301, 2))
    assert lines_in(400, 0.005, (10.0, 10.0)).tolist() == [20]
    assert lines_in(64, 0.005, (0.0, 1e9)).tolist() == list(range(1, 32))
    with pytest.raises(ValueError, match=r"2000 samples 0\.005 s apart have no line between 0\.41 and 0\.49 Hz"):
        lines_in(2000, 0.005, (0.41, 0.49))


@pytest.mark.parametrize(
    ("N", "band"), [(2000, (0.0, 30.0)), (1999, (0.5, 20.0)), (400, (10.0, 10.0)), (64, (0.0, 1e9))]
)
def test_the_short_form_has_the_lines_and_the_rms_value_asked_for(N: int, band: tuple[float, float], seed: int) -> None:
    x = multisine(np.random.default_rng(seed), N, 0.005, band, 1.23)
    assert np.sqrt(np.mean(x**2)) == pytest.approx(1.23, rel=1e-12)
    spectrum, lines = np.abs(np.fft.rfft(x)), lines_in(N, 0.005, band)
    assert spectrum[lines] == pytest.approx(spectrum[lines[0]], rel=1e-9)
    assert np.delete(spectrum, lines) == pytest.approx(0.0, abs=1e-9)


def test_phases_are_uniform_and_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (multisine(rng, 2000, 0.005, (0.0, 90.0), 1.0) for _ in range(2))
    assert abs(np.mean(first * second)) < 0.2
    phase = np.angle(np.fft.rfft(first)[1:901])
    # The mean of 900 unit vectors of uniform phase is longer than 0.15 once in a billion.
    assert abs(np.exp(1j * phase).mean()) < 0.15
    assert abs(np.exp(2j * phase).mean()) < 0.15


@pytest.mark.parametrize("which", ["all", "odd"])
def test_peaks_become_low_and_the_spectrum_stays(which: Lines, seed: int) -> None:
    lines = lines_in(2000, 0.005, (0.0, 30.0), which)
    m = Multisine.random(np.random.default_rng(seed), 2000, 0.005, lines)
    flat = flattened(m)
    assert flat.amplitudes is m.amplitudes
    assert crest_factor(flat.samples()) < 1.45
    assert crest_factor(m.samples()) > 2.0


@given(multisines(), st.sampled_from([1, 2, 8, 64]), st.integers(0, 2**32))
def test_slopes_of_the_norm_of_several_signals(m: Multisine, p: int, seed: int) -> None:
    """Against differences, in a random direction."""
    rng = np.random.default_rng(seed)
    gains: Complex = m.amplitudes * (1 + rng.random((2, 1)) * np.exp(2j * np.pi * rng.random(len(m.lines))))
    direction, h = rng.standard_normal(len(m.lines)), 1e-5
    ends = [log_peak_norm(m.phases + sign * h * direction, gains, m.lines, m.N, p)[0] for sign in (1, -1)]
    _, slopes = log_peak_norm(m.phases, gains, m.lines, m.N, p)
    tolerance = 1e-6 * p * float(np.linalg.norm(direction))
    assert slopes @ direction == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=tolerance)


# --- Planned experiments: within all limits whatever the drive, from rest to rest, and telling what was predicted -----


H = 0.005
TWO = {
    "Jm": 0.004, "Ja": 0.01, "k": 50.0, "d": 0.05, "fm": 0.05, "fc": 0.0, "tau0": 0.0, "kT": 1.0, "r": 1.0
}  # fmt: skip


def two_masses(**changed: float) -> dict[str, float]:
    return {**TWO, **changed}


def task(limits: MotionLimits, given_values: dict[str, float] | None = None, **changes: object) -> ExcitationTask:
    nominal = given_values or two_masses()
    plant = Plant(two_mass("angle"), nominal, H)
    estimation = Estimation(two_mass("speed"), nominal, H, lam0=0.01)
    return replace(ExcitationTask(plant, estimation, limits, period=400), **changes)  # type: ignore[arg-type]


def planned(seed: int, asked: ExcitationTask) -> PlannedExperiment:
    return plan(asked, np.random.default_rng(seed))


def replayed(plant: Plant, torque: Floats) -> tuple[Floats, Floats]:
    """Angle and speed (N,) of another simulation of the drive."""
    axis = SimulatedAxis(plant.values, plant.speed_scale, drive=plant.drive)
    motion = [(0.0, 0.0), *(axis.step(float(u), plant.interval_s) for u in torque[:-1])]
    angle, speed = np.array(motion).T
    return angle, speed


LIMIT = st.floats(0.5, 50.0)
OPEN = [(two_mass("angle"), two_masses(fc=fc, tau0=tau0)) for fc in (0.0, 0.2) for tau0 in (0.0, 0.1)]
WEIGHTS = [(chain(n, "angle"), values(n)) for n in (1, 2, 3)]


@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(OPEN + WEIGHTS), st.floats(0.5, 50.0), LIMIT, LIMIT, st.integers(0, 2**32))
def test_torques_and_motions_keep_within_all_limits(
    drive: tuple[Drive, dict[str, float]], torque: float, speed: float, angle: float, seed: int
) -> None:
    """A weight is moved by a controller."""
    plant = Plant(*drive, H)
    if drive in OPEN:
        asked = task(MotionLimits(torque, speed, angle), drive[1], plant=plant, period=200)
    else:
        estimation = Estimation(plant.drive, plant.values, H, 1e-6)
        limits = MotionLimits(torque + 2.5, speed, angle)
        asked = task(limits, plant=plant, estimation=estimation, command="angle", period=200)
    check_limits(planned_or_none(seed, asked), plant)


def planned_or_none(seed: int, asked: ExcitationTask) -> PlannedExperiment | None:
    """None where the text says that there is none, which a linear drive without offset always has."""
    try:
        return planned(seed, asked)
    except ExcitationError:
        if asked.plant.is_linear and asked.plant.values["tau0"] == 0:
            raise
        return None


def check_limits(x: PlannedExperiment | None, plant: Plant) -> None:
    if x is None:
        return
    angle, speed = replayed(plant, x.motion.torque)
    limits = x.task.limits
    assert np.abs(x.motion.torque).max() <= limits.torque
    assert np.abs(speed).max() <= limits.speed * (1 + 1e-6)
    assert np.abs(angle).max() <= limits.angle * (1 + 1e-6)
    assert x.motion.angle == pytest.approx(angle, abs=1e-6 * (1 + np.abs(angle).max()))
    assert max(x.used, key=lambda name: x.used[name]) == x.trial.fitted.binding


COMMANDS: tuple[Command, ...] = ("torque", "speed", "angle")
LIMITS = (MotionLimits(torque=2), MotionLimits(speed=8), MotionLimits(angle=1), MotionLimits(2, 8, 1))


@pytest.mark.parametrize(
    ("command", "limits"), soaked(product(COMMANDS, LIMITS), *zip((*COMMANDS, "torque"), LIMITS, strict=True))
)
def test_the_binding_limit_is_used_fully(command: Command, limits: MotionLimits, seed: int) -> None:
    x = planned(seed, task(limits, command=command))
    assert 0.98 < x.used[x.trial.fitted.binding] <= 1


def test_a_linear_drive_starts_and_ends_at_rest_and_repeats_its_periods(seed: int) -> None:
    x = planned(seed, task(MotionLimits(2, 20), periods=3))
    s, motion = x.task.schedule, x.motion
    assert len(motion.torque) == s.samples == 400 * 4 + 200
    assert abs(motion.angle[-1]) < 2e-3 * np.abs(motion.angle).max()
    assert abs(motion.speed[-1]) < 2e-3 * np.abs(motion.speed).max()
    periods = motion.torque[s.evaluated].reshape(3, -1)
    assert periods[1:] == pytest.approx(periods[:-1], abs=1e-9)
    spectrum = np.abs(np.fft.rfft(periods[0])) * 2 / 400
    assert spectrum[x.task.grid] == pytest.approx(x.trial.signal.amplitudes, rel=1e-9)
    outside = np.delete(spectrum, [0, *x.task.grid])
    assert outside == pytest.approx(0.0, abs=1e-9)
    angle = motion.angle[s.evaluated].reshape(3, -1)[-1]
    assert abs(angle.max() + angle.min()) < 0.05 * np.ptp(angle)


def test_an_offset_is_borne_so_that_nothing_drifts(seed: int) -> None:
    x = planned(seed, task(MotionLimits(2, 20), two_masses(tau0=0.3), periods=4))
    evaluated = x.task.schedule.evaluated
    means = x.motion.angle[evaluated].reshape(4, -1).mean(axis=1)
    assert means == pytest.approx(means[0], abs=0.01 * np.abs(x.motion.angle).max())
    assert x.motion.torque[evaluated].mean() == pytest.approx(-0.3, abs=1e-9)


@pytest.mark.parametrize("limits", [MotionLimits(2, 20), MotionLimits(angle=0.5)])
def test_how_far_it_ends_from_rest_with_other_friction_is_said(limits: MotionLimits, seed: int) -> None:
    """Against another simulation, with 20 % more and less of it; a controller, or a linear drive, needs no words."""
    x = planned(seed, task(limits, two_masses(fc=0.3)))
    messages = [words for words in warnings(x) if "Coulomb friction" in words]
    motions = [replayed(replace(x.task.plant, values=two_masses(fc=fc)), x.motion.torque) for fc in (0.24, 0.36)]
    away, speed = (max(abs(m[i][-1]) for m in motions) for i in range(2))
    largest = max(np.abs(angle).max() for angle, _ in motions)
    assert len(messages) == 1
    (numbers,) = re.findall(r"ends up to (\S+) rad away, at up to (\S+) rad/s", messages[0])
    assert [float(n) for n in numbers] == pytest.approx([away, speed], rel=0.06)
    assert (f"{100 * largest / limits.angle:.0f} % of the angle limit" in messages[0]) == (largest > limits.angle)
    for other in (task(limits, two_masses(fc=0.3), command="angle"), task(limits)):
        assert not [words for words in warnings(planned(seed, other)) if "Coulomb friction" in words]


def test_what_has_the_limit_gets_the_low_peaks(seed: int) -> None:
    """The angle, where that is limited: a peak of 1.2 rms values, which phases made for the torque do not give it."""
    x = planned(seed, task(MotionLimits(angle=1.0)))
    to_angle = x.task.plant.response(x.task.frequency_hz)[0]
    assert crest_factor(x.trial.signal.through(to_angle).samples()) < 1.3
    assert crest_factor(x.trial.signal.samples()) > 1.6


def test_a_torque_and_a_reference_are_of_one_motion(seed: int) -> None:
    """With friction, too: the drive under the torque alone goes where a good controller would have led it."""
    given, followed = (
        planned(seed, task(MotionLimits(2, 20), two_masses(fc=0.3), command=c)) for c in ("torque", "angle")
    )
    np.testing.assert_array_equal(given.motion.torque, followed.motion.torque)
    angle, _ = replayed(given.task.plant, given.motion.torque)
    reference = followed.trial.reference[0]
    assert angle == pytest.approx(reference, abs=0.05 * np.abs(reference).max())


def test_a_weight_cannot_be_moved_by_torque_alone(seed: int) -> None:
    plant = Plant(chain(2, "angle"), {**values(2), "gc": 0.0, "gs": -30.0}, H)  # upside down
    estimation = Estimation(plant.drive, plant.values, H, 1e-6)
    with pytest.raises(ExcitationError, match="weight moves it away"):
        planned(seed, task(MotionLimits(torque=5, angle=3), plant=plant, estimation=estimation))


def test_limits_that_hold_for_no_amplitude() -> None:
    borne = np.full(3, 2.0)
    with pytest.raises(ExcitationError, match="the torque limit does not hold, however small the signal"):
        fitted(lambda size: DriveMotion(borne + size, borne * 0, borne * 0, borne), MotionLimits(torque=1.0), 1.0)


@pytest.mark.parametrize(
    ("limits", "message"),
    [({}, "no limit"), ({"torque": 0.0}, "torque limit 0"), ({"speed": np.nan}, "speed limit nan")],
)
def test_limits_that_make_no_sense(limits: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MotionLimits(**limits)


# --- what it tells ----------------------------------------------------------------------------------------

NAMES = ("Jm", "Ja", "k", "d", "fm")


@pytest.mark.parametrize("torque_noise", [0.0, 0.2])
def test_information_by_lines_is_that_of_the_record(torque_noise: float, seed: int) -> None:
    """Whichever predictor: the sum over lines, and the sum over the samples of one period."""
    K = None
    if torque_noise:
        K, _ = filter_gain(AxisModel(two_mass("speed"), two_masses(), ()), H, torque_noise, 0.1)
    estimation = Estimation(two_mass("speed"), two_masses(), H, 0.3, K)
    lines = lines_in(400, H, (0.0, 30.0))
    m = Multisine.random(np.random.default_rng(seed), 400, H, lines)
    M = np.tensordot(m.amplitudes**2 / 2, information(estimation.responses(NAMES, m.frequency_hz)), axes=1)
    inputs = np.zeros((400 * 20, len(two_mass("speed").inputs)))
    inputs[:, 0] = np.tile(m.samples(), 20)
    S = estimation.accuracy(NAMES, inputs).S[-400:] / np.sqrt(0.3)
    scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
    assert S.T @ S / 400 / scale == pytest.approx(M / scale, abs=1e-6)


@pytest.mark.parametrize("torque_noise", [0.0, 0.15])
def test_predicted_deviations_are_those_of_many_estimates(torque_noise: float, seed: int) -> None:
    """One Gauss-Newton step from the truth, with slopes of the predictor by differences, over 150 noises."""
    names, noise, runs = ("Ja", "fm"), 0.1, 150
    rng = np.random.default_rng(seed)
    K, lam0 = np.zeros(3), noise**2
    if torque_noise:
        K, lam0 = filter_gain(AxisModel(two_mass("speed"), two_masses(), ()), H, torque_noise, noise)
    asked = task(MotionLimits(1.0), free=names)
    x = planned(seed, replace(asked, estimation=replace(asked.estimation, lam0=lam0, K=K)))
    u = x.motion.torque
    w, v = torque_noise * rng.standard_normal((len(u), runs)), noise * rng.standard_normal((len(u), runs))
    y = filtered(two_masses(), u[:, None] + w, None, K * 0)[0] + v
    at = two_masses()
    eps = filtered(at, u[:, None], y, K)[1]
    psi = np.stack(
        [
            (
                filtered({**at, n: at[n] * 0.9999}, u[:, None], y, K)[1]
                - filtered({**at, n: at[n] * 1.0001}, u[:, None], y, K)[1]
            )
            / 2e-4
            for n in names
        ]
    )
    found = np.array([np.linalg.solve(p @ p.T, p @ e) for p, e in zip(psi.transpose(2, 0, 1), eps.T, strict=True)])
    ratio = found.std(axis=0) / x.accuracy.standard_deviations
    assert ratio == pytest.approx(1.0, abs=5 / np.sqrt(2 * runs))


def filtered(at: dict[str, float], u: Floats, y: Floats | None, K: Floats) -> tuple[Floats, Floats]:
    """yhat and eps (N, W) of x+ = Ad (x + K eps) + Bd u, written out; without y eps is zero."""
    drive = two_mass("speed")
    A, B, C = drive.matrices(drive.complete(at))
    Ad, Bd = zero_order_hold(A, B[:, :1], H)
    W = (u if y is None else y).shape[1]
    xs, yhat, eps = np.zeros((len(A), W)), np.empty((len(u), W)), np.zeros((len(u), W))
    for k in range(len(u)):
        yhat[k] = (C @ xs)[0]
        if y is not None:
            eps[k] = y[k] - yhat[k]
        xs = Ad @ (xs + np.outer(K, eps[k])) + Bd * u[k]
    return yhat, eps


def test_what_cannot_be_told_apart_is_held_pure_numbers_first(seed: int) -> None:
    x = planned(seed, task(MotionLimits(1.0)))
    assert "kT" in x.held
    assert set(x.held) <= {"kT", "r"}
    assert np.isfinite(x.accuracy.standard_deviations).all()
    with pytest.raises(ExcitationError, match=r"^(kT|r|kT and r) cannot be estimated beside"):
        distinguishable(x.task.estimation, x.motion.inputs, ("kT", "r"))


# --- spectra ----------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32), st.integers(1, 3), st.integers(1, 3))
@settings(max_examples=15, deadline=None)
def test_optimal_powers_are_the_best_there_are(seed: int, limits: int, parameters: int) -> None:
    """No general method for convex problems finds better ones."""
    rng = np.random.default_rng(seed)
    L = 8
    M = information(rng.standard_normal((L, parameters)) + 1j * rng.standard_normal((L, parameters)))
    costs, wanted = rng.random((limits, L)) + 0.1, rng.random(parameters) + 0.1

    def criterion(p: Floats) -> float:
        return float(wanted @ np.diag(np.linalg.inv(np.tensordot(np.abs(p) + 1e-12, M, axes=1))))

    found = optimal_powers(M, costs, wanted)
    assert (costs @ found.powers).max() == pytest.approx(1.0)
    assert (found.powers >= 0).all()
    start = np.full(L, 1 / costs.sum(axis=1).max())
    other = minimize(
        criterion, start, method="SLSQP", bounds=[(0, None)] * L,
        constraints=[LinearConstraint(costs, -np.inf, 1)], options={"maxiter": 300},
    )  # fmt: skip
    assert criterion(found.powers) <= other.fun * (1 + max(2e-3, found.excess)) + 1e-9
    assert found.excess < 0.02
    assert criterion(found.powers) / (1 + found.excess) <= other.fun * (1 + 1e-3) + 1e-9


def test_a_spectrum_for_a_parameter_tells_more_of_it_than_a_flat_one(seed: int) -> None:
    x = planned(seed, task(MotionLimits(1.0), find=("fm", "1/Ja"), period=800))
    assert x.gains["fm"] > 1.3
    assert set(x.task.find) <= set(x.accuracy.names)
    assert (x.trial.signal.amplitudes > 0).all()


def test_words_on_what_is_poorly_told(seed: int) -> None:
    asked = task(MotionLimits(0.05), band_hz=(0.5, 3.0))
    messages = warnings(planned(seed, asked))
    (of_k,) = [words for words in messages if words.startswith(("k ", "Ja and k", "k and"))][:1]
    assert "cannot" in of_k
    assert any("excite up to" in words and "times as long" in words for words in messages)
    assert warnings(planned(seed, task(MotionLimits(20.0)))) == ()


# --- mistakes ---------------------------------------------------------------------------------------------


def test_schedule() -> None:
    s = ExperimentPhases(100, 2, 25)
    assert s.samples == 325
    window = s.window()
    assert (window[0], window[25:300].min(), window[300:].max()) == (0.0, 1.0, 1.0)
    assert all(a <= b for a, b in pairwise(window[:26]))


def test_what_cannot_be_planned(seed: int) -> None:
    with pytest.raises(ExcitationError, match="widen the band or lengthen the period"):
        planned(seed, task(MotionLimits(1.0), band_hz=(0.6, 0.9)))
    with pytest.raises(ExcitationError, match="must be among the free parameters"):
        planned(seed, task(MotionLimits(1.0), free=("Ja",), find=("fm",)))
    with pytest.raises(ExcitationError, match=r"do not determine .* parameters"):
        planned(seed, task(MotionLimits(1.0), free=NAMES, find=("fm",), band_hz=(1.4, 1.6)))
