"""The fit as a whole: known truth comes back within the deviations it states, and it says what it cannot tell."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from monitor_core.arrays import Floats
from monitor_core.drive.kalman import filter_gain
from monitor_core.identification import Record
from monitor_core.identification.greybox import Estimate, fit, traces_of
from monitor_core.identification.greybox.criterion import choose_disturbance, outliers
from monitor_core.identification.predictor.prediction_errors import RecordPredictor
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from tests.core.identification.problems import EIGHT, TRUE, perturbed, reference_problem, reference_record
from tests.core.simulated import simulated

SAMPLES = 2000


def pulls(found: Estimate, true: Floats = TRUE) -> Floats:
    """Errors in standard deviations."""
    return np.asarray((found.theta[: true.size] - true) / found.sd[: true.size])


def test_deviations_are_cramer_and_raos(seed: int) -> None:
    """At the optimum of white errors: lambda_0 (J'J)^-1, J by differences of the whole simulation."""
    rec = reference_record(seed, 600)
    rec = replace(rec, y=np.where(rec.t == 0, 0.0, rec.y))  # From rest, and known to be.
    found = fit(reference_problem(initial="first"), [rec])
    columns = []
    for i in range(len(EIGHT)):
        ends = []
        for sign in (1, -1):
            moved = found.theta * np.exp(sign * 1e-4 * np.eye(len(EIGHT))[i])
            values = {**REFERENCE_VALUES, **dict(zip(EIGHT, moved.tolist(), strict=True))}
            drive = three_mass("speed")
            start = drive.matrix("rest", values) * rec.y[0]
            ends.append(simulate_linear(drive, values, rec.u[:, None], 0.005, start)[0][:, 0])
        columns.append((ends[0] - ends[1]) / 2e-4 / found.theta[i])
    J = np.stack(columns, axis=1)
    if found.coloured == 0:
        np.testing.assert_allclose(found.covariance, found.lam0 * np.linalg.inv(J.T @ J), rtol=2e-3)
    assert found.coloured <= 2


@pytest.mark.parametrize("number", range(8))
def test_a_search_that_is_stopped_has_converged_where_no_parameter_would_still_move(number: int, seed: int) -> None:
    """Wherever it stops: what it calls converged is little more than a tenth of a deviation off."""
    rec = reference_record(seed + number, SAMPLES)
    start = reference_problem(nominal={**REFERENCE_VALUES, **{n: 1.01 * REFERENCE_VALUES[n] for n in EIGHT}})
    end = fit(start, [rec])
    stopped = [fit(start, [rec], most_iterations=most) for most in range(2, 9)]
    off = [float(np.max(np.abs(found.theta - end.theta) / end.sd)) for found in stopped]
    print([(found.converged, round(o, 4)) for found, o in zip(stopped, off, strict=True)])
    for found, o in zip(stopped, off, strict=True):
        assert found.converged == (not found.moving)
        assert found.converged == (not any("not converged" in word for word in found.words))
        assert not found.converged or o < 0.15
    assert {found.converged for found in stopped} == {True, False}


def test_kT_free_is_singular_and_said(seed: int) -> None:
    found = fit(reference_problem(free=("kT", *EIGHT)), [reference_record(seed, SAMPLES)])
    assert found.converged
    assert np.isinf(found.sd).all()
    assert "singular" in found.words[0]
    assert "best kT" in found.words[0]
    held = fit(reference_problem(), [reference_record(seed, SAMPLES)])
    assert found.cost == pytest.approx(held.cost, rel=1e-6)
    np.testing.assert_allclose(found.theta[1:] / found.theta[0], held.theta, rtol=1e-3)
    assert not any("singular" in word for word in held.words)


def test_lost_samples_jitter_and_missing_outputs_cost_no_accuracy(seed: int) -> None:
    """The plant's output at irregular times; a fifth of it not measured."""
    rng = np.random.default_rng(seed)
    fine = reference_record(seed, 10_000, noise=0.0)
    u, k = np.empty(fine.u.size), np.sort(rng.choice(10_000, 5000, replace=False))
    for start, end in zip(k, [*k[1:], 10_000], strict=True):
        u[start:end] = fine.u[start]
    u[: k[0]] = 0.0
    y, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, u[:, None], 0.0025)
    rec = Record(
        np.asarray(k * 0.0025),
        u[k],
        y[k, 0] + rng.standard_normal(k.size),
        "speed",
        valid=rng.random(k.size) > 0.2,
    )
    found = fit(reference_problem(nominal={**REFERENCE_VALUES, **perturbed(rng, 0.05)}), [rec])
    assert np.abs(pulls(found)).max() < 4.5
    assert (found.sd / TRUE < 0.15).all()


@pytest.mark.parametrize("late", [8, -17, 62])
def test_the_skew_is_estimated(late: int, seed: int) -> None:
    """In 25th parts of the interval: also a torque that acts too early, and one that is two and a half samples late.

    Left out, it is put into the motor's inertia.
    """
    h, parts = 0.005, 25
    rec = reference_record(seed, SAMPLES, noise=0.0)
    fine = rec.u[np.clip((np.arange(SAMPLES * parts) - late) // parts, 0, SAMPLES - 1)]
    y, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, fine[:, None], h / parts)
    y = y[::parts, 0] + np.random.default_rng(seed).standard_normal(SAMPLES)
    rec = Record(rec.t, rec.u, y, "speed")
    found = fit(reference_problem(free_delay=True), [rec])
    assert found.names[-1] == "delay"
    assert found.delay_s == pytest.approx(late * h / parts, abs=4.5 * found.sd[-1])
    assert found.sd[-1] < 2e-4
    assert np.abs(pulls(found)).max() < 4.5
    assert any("more than one interval" in word for word in found.words) == (not 0 <= late <= parts)
    if late == 8:
        ignored = fit(reference_problem(), [rec])
        assert ignored.values["Jm"] > found.values["Jm"] + 2 * found.sd[0]
        assert ignored.cost > found.cost + 30 * found.lam0


def test_outliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rec = reference_record(seed, SAMPLES)
    rec = replace(rec, y=rec.y + np.where(rng.random(SAMPLES) < 0.03, 60.0, 0.0) * rng.standard_normal(SAMPLES))
    squares, huber = (fit(reference_problem(loss=loss), [rec]) for loss in ("squares", "huber"))
    assert np.abs(pulls(huber)).max() < 4.5
    assert np.exp(np.mean(np.log(huber.sd / squares.sd))) < 0.25  # a tenth, were it not for chance
    # Three per cent of outliers, clipped, add five per cent.
    assert huber.lam0 == pytest.approx(1.05, abs=0.16)


def test_outliers_do_not_enter_the_state(seed: int) -> None:
    """One in a hundred, twenty times as large as any noise, where K is large: as if they were not there.

    The errors that they leave through K are clipped, but many; with squares the estimates are five times as far away.
    """
    rng, away = np.random.default_rng(seed), []
    for k in range(3):
        clean = noisy_torque_record(seed + k, SAMPLES, 0.6, 0.3)
        gross = rng.random(SAMPLES) < 0.01
        rec = replace(clean, y=clean.y + np.where(gross, rng.choice([-20.0, 20.0], SAMPLES), 0.0))
        problem = reference_problem(predictor="innovations", disturbance=Disturbance(torque=0.6, output=0.3))
        best, found = fit(problem, [clean]), fit(replace(problem, loss="huber"), [rec])
        away.append((found.theta - best.theta) / best.sd)
        assert found.outliers == (gross.sum(),)
        assert any(word.startswith(f"{found.outliers[0]} outputs are outliers") for word in found.words)
        assert found.lam0 == pytest.approx(best.lam0, rel=0.1)
    assert np.sqrt(np.mean(np.square(away))) < 0.6
    assert sum(fit(replace(problem, loss="huber"), [clean]).outliers) <= 1


def test_several_records_tell_more_than_one(seed: int) -> None:
    records = [reference_record(seed + k, 1000) for k in range(4)]
    single, all_ = fit(reference_problem(), records[:1]), fit(reference_problem(), records)
    assert len(all_.fit) == 4
    assert np.abs(pulls(all_)).max() < 4.5
    np.testing.assert_allclose(all_.sd / single.sd, 0.5, atol=0.15)
    assert (all_.excess == 1).all()  # the drive lacks nothing; by chance otherwise once in 125 seeds


def test_a_slope_on_a_signal_is_found(seed: int) -> None:
    """Friction that falls with the temperature, in four records."""
    b, records = -5e-4, []
    for k, temperature in enumerate((20.0, 30.0, 45.0, 60.0)):
        rec = reference_record(seed + k, 1500, noise=0.0)
        values = {**REFERENCE_VALUES, "fm": REFERENCE_VALUES["fm"] + b * temperature}
        y, _ = simulate_linear(three_mass("speed"), values, rec.u[:, None], 0.005)
        y = y[:, 0] + np.random.default_rng(seed + k).standard_normal(1500)
        records.append(Record(rec.t, rec.u, y, "speed", signals={"temperature": np.full(1500, temperature)}))
    found = fit(reference_problem(varying={"fm": ("temperature",)}), records)
    assert found.names == (*EIGHT, "fm per temperature")
    assert np.abs(pulls(found, np.append(TRUE, b))).max() < 4.5
    assert found.sd[-1] < 1e-4


def test_bounds_hold_and_are_said(seed: int) -> None:
    low, high = 0.9 * REFERENCE_VALUES["Jm"], 0.95 * REFERENCE_VALUES["Jm"]
    problem = reference_problem(
        nominal={**REFERENCE_VALUES, "Jm": 0.92 * REFERENCE_VALUES["Jm"]}, bounds={"Jm": (low, high)}
    )
    found = fit(problem, [reference_record(seed, SAMPLES)])
    assert found.values["Jm"] == pytest.approx(high)
    assert any(word.startswith("Jm ended at its bound") for word in found.words)


@pytest.mark.parametrize("predictor", ["output-error", "innovations"])
def test_friction_that_would_be_negative_is_zero(predictor: str, seed: int) -> None:
    """In a record whose torque lacks more than the friction takes; the start is negative, as of a former fit."""
    record = reference_record(seed, SAMPLES)
    problem = reference_problem(predictor=predictor, nominal={**REFERENCE_VALUES, "fm": -0.1})
    found = fit(problem, [replace(record, u=record.u - 0.1 * record.y)])
    assert found.values["fm"] == 0
    assert any(word.startswith("fm ended at its bound 0") for word in found.words)
    assert fit(problem, [record]).values["fm"] > 0.03


def test_a_noise_level_that_is_not_there_vanishes(seed: int) -> None:
    problem = reference_problem(predictor="innovations", disturbance=Disturbance(torque=0.1))
    found = fit(problem, [reference_record(seed, SAMPLES)])
    assert found.converged
    assert found.noise["torque"] < 0.1


def test_the_noise_levels_are_found(seed: int) -> None:
    """Torque noise of 0.3 N m and output noise of 0.5 rad/s: K is then that of the monitor."""
    truth = (0.3, 0.5)
    rec = noisy_torque_record(seed, 8000, *truth)
    found = fit(reference_problem(predictor="innovations"), [rec])
    assert found.noise["torque"] == pytest.approx(truth[0], rel=0.2)
    assert found.noise["output"] == pytest.approx(truth[1], rel=0.05)
    assert np.abs(pulls(found)).max() < 4.5
    assert found.whiteness.p_value > 1e-4
    simulated = fit(reference_problem(), [rec])
    # In truth none is larger; both are estimates.
    assert (found.sd < 1.1 * simulated.sd).all()
    assert np.exp(np.mean(np.log(found.sd / simulated.sd))) < 0.85
    assert simulated.coloured > 0
    assert np.abs(pulls(simulated)).max() < 4.5


def noisy_torque_record(seed: int, samples: int, torque: float, output: float) -> Record:
    """The reference experiment, its torque and its speed with white noise of these standard deviations."""
    rng, rec = np.random.default_rng(seed), reference_record(seed, samples, noise=0.0)
    return replace(rec, y=simulated(rng, three_mass("speed"), rec.u, torque, output).y)


def test_what_the_drive_leaves_out_is_said(seed: int) -> None:
    """An arm that is not there: the errors depend on the torque."""
    free = ("Jm", "Jg", "kg", "dg", "fm")
    stiff = {**REFERENCE_VALUES, "ka": 50 * REFERENCE_VALUES["ka"]}
    found = fit(reference_problem(free=free, nominal=stiff), [reference_record(seed, SAMPLES)])
    assert any("depend on past torque" in word for word in found.words)


def test_validation_on_another_record(seed: int) -> None:
    found = fit(reference_problem(), [reference_record(seed, SAMPLES)])
    other = reference_record(seed + 1, 1000)
    (right,) = traces_of(found.problem, [other])
    (again,) = traces_of(found.problem, [reference_record(seed, SAMPLES)])
    assert again.fit_simulation == pytest.approx(found.fit_simulation[0], abs=1e-6)
    (wrong,) = traces_of(replace(found.problem, nominal={**found.problem.nominal, "Jm": 0.012}), [other])
    assert right.fit_simulation == pytest.approx(found.fit_simulation[0], abs=3)
    assert wrong.fit_simulation < right.fit_simulation - 10


def test_a_simulation_is_another_thing_than_the_prediction(seed: int) -> None:
    """In innovations form, whether a fit is asked for it at once or a copy of it later."""
    record = noisy_torque_record(seed, 1000, 0.3, 1.0)
    found = fit(replace(reference_problem(), predictor="innovations"), [record])
    (trace,) = traces_of(found.problem, [record])
    assert found.fit[0] == pytest.approx(trace.fit, abs=1e-6)
    assert found.fit_simulation[0] == pytest.approx(trace.fit_simulation, abs=1e-6)
    assert replace(found, words=()).fit_simulation == found.fit_simulation
    assert found.fit_simulation[0] < found.fit[0] - 1


def test_mistakes() -> None:
    rec = reference_record(0, 100)
    with pytest.raises(ValueError, match="no record"):
        fit(reference_problem(), [])
    with pytest.raises(ValueError, match="holds the speed, the drive's output is the angle"):
        fit(Problem(three_mass("angle"), REFERENCE_VALUES, EIGHT), [rec])
    with pytest.raises(ValueError, match="no output was measured"):
        fit(reference_problem(), [replace(rec, valid=np.zeros(100, bool))])
    with pytest.raises(KeyError, match="has no parameter 'Jx'"):
        reference_problem(free=("Jx",))
    with pytest.raises(ValueError, match="Ja is free twice"):
        reference_problem(free=("Ja", "1/Ja"))
    with pytest.raises(ValueError, match="no signal 'temperature'"):
        fit(reference_problem(varying={"fm": ("temperature",)}), [rec])
    with pytest.raises(ValueError, match="K has 2 entries, the drive 5 states"):
        reference_problem(predictor="innovations", K=(1.0, 2.0))
    with pytest.raises(ValueError, match=r"Jm starts at .* outside its bounds"):
        fit(reference_problem(bounds={"Jm": (1.0, 2.0)}), [rec])
    drives = reference_problem(nominal={**REFERENCE_VALUES, "fm": -50.0}, bounds={"fm": (-100.0, 1.0)})
    with pytest.raises(ValueError, match="unstable at the start"):
        fit(drives, [reference_record(0, 2000)])


# --- A slow torque disturbance: its level and time constant are found, and with them the drive ------------------------


def test_levels_time_constant_and_drive_are_found(seed: int) -> None:
    """d of 0.4 N m and 0.3 s, white torque noise of 0.1 N m, output noise of 0.5 rad/s."""
    N, h, T, slow, white, output = 6000, 0.005, 0.3, 0.4, 0.1, 0.5
    rng, clean = np.random.default_rng(seed), reference_record(seed, N, noise=0.0)
    a = np.exp(-h / T)
    d = lfilter([1], [1, -a], slow * np.sqrt(1 - a**2) * rng.standard_normal(N))
    torque = clean.u + d + white * rng.standard_normal(N)
    y, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, torque[:, None], h)
    rec = Record(clean.t, clean.u, y[:, 0] + output * rng.standard_normal(N), "speed")
    noise = Disturbance(slow=1.0, time_constant_s=1.0, free=("torque", "slow", "time_constant"))
    found = fit(reference_problem(predictor="innovations", disturbance=noise), [rec])
    assert found.converged
    assert found.names == (*EIGHT, "Td")
    assert np.abs((found.theta[:8] - TRUE) / found.sd[:8]).max() < 4.5
    assert found.values["Td"] == pytest.approx(T, abs=4.5 * found.sd[8])
    assert found.noise["slow"] == pytest.approx(slow, rel=0.4)
    assert found.noise["output"] == pytest.approx(output, rel=0.06)
    assert found.whiteness.p_value > 1e-4
    simulated = fit(reference_problem(), [rec])
    assert (found.sd[:8] < simulated.sd).all()


def test_the_monitor_gets_this_very_gain(seed: int) -> None:
    """From the estimate's drive, values and noise: K in physical states, lambda_0."""
    rec = reference_record(seed, 3000)
    noise = Disturbance(torque=0.3, free=())
    found = fit(reference_problem(predictor="innovations", disturbance=noise), [rec])
    K, lam0 = filter_gain(found.model(), found.interval_s, found.noise["torque"], found.noise["output"])
    np.testing.assert_allclose(found.K, K, rtol=1e-6, atol=1e-9 * abs(K).max())
    assert found.lam0 == pytest.approx(lam0, rel=1e-9)
    assert len(found.K) == len(found.drive.states) == 5


# --- Outliers one by one: those that are, not those that K made of them -----------------------------------------------


SHORT = 600
LIMIT = 5.0  # standard deviations of the innovations


def predictor_of(rec: Record) -> RecordPredictor:
    """K is large: a torque noise of .6 N m beside an output noise of .3 rad/s."""
    problem = reference_problem(predictor="innovations", disturbance=Disturbance(torque=0.6, output=0.3))
    return RecordPredictor(problem, [rec], choose_disturbance(problem, [rec]))


def with_errors(rec: Record, which: np.ndarray, size: float) -> Record:
    y = rec.y.copy()
    y[which] += size
    return Record(rec.t, rec.u, y, rec.quantity)


@pytest.mark.parametrize(
    "which",
    [[0], [300], [300, 301], [300, 302, 305, 306], [300, 325, 350], [0, 1, 599], list(range(300, 315))],
)
def test_those_that_are(which: list[int], seed: int) -> None:
    clean = reference_record(seed, SHORT, noise=0.01)
    rec = with_errors(clean, np.array(which), 30.0)
    predictor = predictor_of(rec)
    xi = predictor_of(clean).start()
    [found] = outliers(predictor, xi, LIMIT)
    np.testing.assert_array_equal(np.flatnonzero(found), which)
    [e] = predictor.errors(xi)
    if 599 not in which:
        assert np.count_nonzero(np.abs(e.eps) > LIMIT) > len(which)  # K carried them on


@pytest.mark.parametrize(("size", "count"), [(0.9 * LIMIT, 0), (1.1 * LIMIT, 1)])
def test_beyond_the_limit(size: float, count: int, seed: int) -> None:
    clean = reference_record(seed, SHORT, noise=0.01)
    predictor = predictor_of(with_errors(clean, np.array([300]), size))
    [found] = outliers(predictor, predictor.start(), LIMIT)
    assert found.sum() == count


def test_a_stretch_in_which_nothing_fits_counts_whole(seed: int) -> None:
    """300 samples from elsewhere: twenty looks take the first ones, the last look takes the rest."""
    rec = reference_record(seed, SHORT, noise=0.01)
    stretch = np.arange(200, 500)
    y = rec.y.copy()
    y[stretch] = np.random.default_rng(seed).choice([-1e3, 1e3], stretch.size)
    predictor = predictor_of(Record(rec.t, rec.u, y, rec.quantity))
    [found] = outliers(predictor, predictor.start(), LIMIT)
    assert found[stretch].mean() > 0.99
    assert not found[:200].any()
