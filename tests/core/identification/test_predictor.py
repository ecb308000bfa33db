"""Prediction errors and their gradient: against the monitor's recursion, the transcribed paper, and differences."""

from dataclasses import replace
from functools import partial
from itertools import product
from typing import Literal

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DELAY
from monitor_core.identification import Record
from monitor_core.identification.greybox.criterion import criterion, fit_starts, settled
from monitor_core.identification.predictor.prediction_errors import Errors, RecordPredictor
from monitor_core.identification.predictor.prepared_record import MOST_LEVELS, series
from monitor_core.identification.problem import Disturbance, Problem
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.cases import BY_NAME, Case
from tests.core.chains import chain, values
from tests.core.identification.problems import (
    EIGHT,
    all_errors,
    all_gradients,
    case_record,
    check_gradients,
    reference_record,
)
from tests.shares import soaked


def as_monitor(case: Case, **changes: object) -> Problem:
    """The case as a problem: its gain, from the first output, as the monitor does it."""
    settings, model = case.settings(), case.model
    given = {
        "predictor": "innovations" if settings.K else "output-error",
        "K": settings.K or None,
        "delay_s": case.delay_s,
        "speed_scale": case.speed_scale,
        "initial": "first",
        **changes,
    }
    if DELAY not in case.monitored:
        return Problem(model.drive, model.nominal, case.monitored, **given)  # type: ignore[arg-type]
    # There the delay is a parameter, here it is one of the problem.
    nominal = {name: value for name, value in model.nominal.items() if name != DELAY}
    free = tuple(name for name in case.monitored if name != DELAY)
    given |= {"free_delay": True, "delay_s": model.nominal[DELAY], **changes}
    return Problem(three_mass(model.drive.output), nominal, free, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", BY_NAME)
def test_errors_and_gradients_are_those_of_the_monitor(name: str, seed: int) -> None:
    """Its recursion with theta pinned.  What hangs on the gear ratio at the flanges is constant there, not here."""
    case = BY_NAME[name]
    rec = case_record(seed, case, 400, jitter=0.3)
    pinned = case.settings(settle_s=0.0, P0=tuple(1e-60 * case.model.scale**2))
    t_us = np.rint(rec.t * 1e6).astype(np.int64)
    _, trace = AxisMonitor(case.model, pinned).update_traced(SampleBlock(t_us, rec.u, rec.y))
    predictor = RecordPredictor(as_monitor(case), [rec], None)
    (found,) = predictor.errors(predictor.start())
    scale = float(np.nanstd(trace.eps))
    np.testing.assert_allclose(found.eps[1:], trace.eps[1:], rtol=0, atol=1e-9 * scale)
    if "r" not in case.monitored:
        size = abs(trace.psi[1:]).max(axis=0)
        psi = found.psi[:, [predictor.layout.names.index(parameter) for parameter in case.monitored]]
        np.testing.assert_allclose(psi[1:] / size, trace.psi[1:] / size, rtol=0, atol=1e-9)


TESTED = (
    "speed-zero-nominals",
    "angle-skew",
    "mean-speed",
    "angle-joint",
    "angle-gear",
    "gravity-behind-the-gear",
)


@pytest.mark.parametrize(
    ("name", "motion"),
    soaked(product(BY_NAME, ("measured", "simulated")), *((name, "measured") for name in TESTED)),
)
def test_gradients_of_every_case(name: str, motion: str, seed: int) -> None:
    """All kinds of input, jitter, samples that are missing, free initial state, free delay."""
    case = BY_NAME[name]
    rec = case_record(seed, case, 300, jitter=0.2)
    rec = replace(rec, valid=np.random.default_rng(seed).random(300) > 0.1)
    problem = as_monitor(case, motion=motion, initial="free", free_delay=True, delay_s=0.0004)
    predictor = RecordPredictor(problem, [rec], None)
    check_gradients(predictor, 1e-6)


@pytest.mark.parametrize("output", ["speed", "angle"])
@pytest.mark.parametrize("initial", ["free", "first"])
def test_gradients_through_the_gain(output: str, initial: str, seed: int) -> None:
    """K follows theta, the noise levels and their time constant; two records."""
    case = Case("", output, ("Jm", "1/Ja", "kg", "da", "r", "fc"))  # type: ignore[arg-type]
    records = [case_record(seed, case, 300), case_record(seed + 1, case, 200, jitter=0.1)]
    ratio = 0.3 if output == "speed" else 100.0
    noise = Disturbance(torque=ratio, slow=ratio, time_constant_s=0.1, free=("torque", "slow", "time_constant"))
    problem = as_monitor(case, K=None, initial=initial, predictor="innovations", free_delay=True, delay_s=0.001)
    predictor = RecordPredictor(problem, records, noise)
    assert predictor.layout.levels == ("torque", "slow")
    assert predictor.layout.names[-2:] == ("Td", "delay")
    check_gradients(predictor, 3e-6)


def test_gradients_through_the_gain_where_the_output_depends_on_theta(seed: int) -> None:
    """The sensor is behind the gear: C holds the ratio, which is free."""
    drive = chain(2, "speed", sensor="gear", gravity=False)
    noise = Disturbance(torque=5.0, slow=2.0, time_constant_s=0.1)
    problem = Problem(drive, values(2, gravity=False), ("r", "J1", "1/k1"), initial="first")
    rec = reference_record(seed, 300)
    check_gradients(RecordPredictor(problem, [rec], noise), 3e-6)


def test_the_initial_states_are_those_of_least_squares(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two records, the second of which starts far from rest: the errors are linear in them, one step is enough."""
    records = [
        reference_record(seed, 300),
        replace(reference_record(seed + 1, 300), t=np.asarray(np.arange(300) * 0.01)),
    ]
    records[1] = replace(records[1], y=records[1].y + 50 * np.exp(-np.arange(300) / 40))
    predictor = RecordPredictor(Problem(three_mass("speed"), REFERENCE_VALUES, ("Jm",)), records, Disturbance(3.0))
    start, shared = predictor.start(), predictor.layout.shared
    J = all_gradients(predictor, start)[:, shared:]
    best = start[shared:] - np.linalg.lstsq(J, all_errors(predictor, start), rcond=None)[0]
    looked, errors = list[Floats](), predictor.errors_by_starts

    def watched(xi: Floats) -> list[Errors]:
        looked.append(xi)
        return errors(xi)

    monkeypatch.setattr(predictor, "errors_by_starts", watched)
    found = fit_starts(predictor)
    assert len(looked) <= 2
    np.testing.assert_array_equal(found[:shared], start[:shared])
    np.testing.assert_allclose(J @ found[shared:], J @ best, rtol=0, atol=1e-7 * abs(J @ best).max())
    assert abs(J @ (best - start[shared:])).max() > 1


@pytest.mark.parametrize("output", ["speed", "angle", "mean speed"])
def test_derivatives_by_initial_states_alone_are_the_same(output: str, seed: int) -> None:
    """To the last bit: of two records, with friction, a late torque whose delay is free, and a value that varies."""
    name = {"speed": "speed-output-error-late", "angle": "angle-friction", "mean speed": "mean-speed"}[output]
    case = BY_NAME[name]
    records = [case_record(seed + k, case, 300, jitter=0.2) for k in range(2)]
    records = [replace(rec, signals={"heat": np.linspace(0.0, 1.0, 300)}) for rec in records]
    free = case.model.monitored
    problem = as_monitor(
        case, K=None, initial="free", predictor="innovations", free_delay=True, delay_s=0.001,
        varying={free[0]: ("heat",)},
    )  # fmt: skip
    predictor = RecordPredictor(problem, records, Disturbance(torque=1.0))
    xi, shared = predictor.start(), predictor.layout.shared
    xi[:shared] += 1e-3
    for part, all_ in zip(predictor.errors_by_starts(xi), predictor.errors(xi), strict=True):
        np.testing.assert_array_equal(part.eps, all_.eps)
        np.testing.assert_array_equal(part.psi, all_.psi[:, shared:])
        assert part.good
        assert part.psi.any()


def test_the_errors_are_those_of_the_vector_as_it_is_now(seed: int) -> None:
    """The last ones are kept, but not for a vector that was written to meanwhile."""
    predictor = RecordPredictor(
        Problem(three_mass("speed"), REFERENCE_VALUES, EIGHT), [reference_record(seed, 100)], Disturbance(1.0)
    )
    xi = predictor.start()
    before = all_errors(predictor, xi)
    xi[0] += 0.1
    after = all_errors(predictor, xi)
    assert (before != after).any()
    xi[0] -= 0.1
    np.testing.assert_allclose(all_errors(predictor, xi), before, rtol=0, atol=1e-9 * abs(before).max())


@pytest.mark.parametrize("motion", ["measured", "simulated"])
def test_friction_and_gravity_held_at_zero_are_as_if_they_were_not_there(motion: str, seed: int) -> None:
    """They act no more, but what is free keeps its derivative where it is zero."""
    case = BY_NAME["gravity"]
    nominal = {**case.model.nominal, **dict.fromkeys(("fc", "tau0", "gc", "gs"), 0.0)}
    rec, some = case_record(seed, case, 200), replace(as_monitor(case, motion=motion), nominal=nominal)
    held, free = ("J1", "fa"), ("J1", "fa", "fc", "tau0", "gc", "gs")
    without, all_ = (RecordPredictor(replace(some, free=names), [rec], None) for names in (held, free))
    expected = all_errors(all_, all_.start())
    found = all_errors(without, without.start())
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * abs(expected).max())
    assert all_gradients(all_, all_.start())[:, 2:].any(axis=0).all()
    check_gradients(all_, 1e-6)


def test_gravity_of_a_measured_angle_that_a_free_ratio_scales(seed: int) -> None:
    """Not a sample missing and no friction: nothing else gives an input derivatives."""
    still = {**values(3), "fc": 0.0, "fa": 0.0, "tau0": 0.0}
    case = Case("", "angle", ("r", "gc", "gs"), still, drive=partial(chain, 3))
    check_gradients(RecordPredictor(as_monitor(case), [case_record(seed, case, 200)], None), 3e-6)


def test_what_is_slow_corrects_the_state_but_does_not_count(seed: int) -> None:
    """All other errors and gradients are the same to the last bit."""
    case = BY_NAME["speed-springs"]
    rec, problem = case_record(seed, case, 400), as_monitor(case)
    least = float(np.median(abs(rec.y)))
    predictors = (
        RecordPredictor(replace(problem, min_speed=speed), [rec], problem.disturbance) for speed in (0.0, least)
    )
    (every,), (fast,) = (predictor.errors(predictor.start()) for predictor in predictors)
    counts = abs(rec.y) >= least
    np.testing.assert_array_equal(fast.eps, np.where(counts, every.eps, 0.0))
    np.testing.assert_array_equal(fast.psi, np.where(counts[:, None], every.psi, 0.0))
    predictor = RecordPredictor(replace(problem, min_speed=least), [rec], problem.disturbance)
    found = criterion(predictor, predictor.start(), np.inf)
    assert found.samples == np.count_nonzero(counts)
    assert found.cost == pytest.approx(float(fast.eps @ fast.eps))
    with pytest.raises(ValueError, match="nowhere as fast as 1e"):
        RecordPredictor(replace(problem, min_speed=1e9), [rec], None)


def test_a_signal_that_was_not_measured_everywhere_keeps_its_value(seed: int) -> None:
    rec = reference_record(seed, 100)
    smooth, holes = np.linspace(1.0, 2.0, 100), np.repeat(np.linspace(1.0, 2.0, 100)[::10], 10)
    holes[np.arange(100) % 10 > 0] = np.nan
    steps = series(replace(rec, signals={"s": holes}), ["s"])
    np.testing.assert_allclose(steps.signals[steps.level, 0], np.repeat(smooth[::10], 10))
    parts = series(replace(rec, signals={"s": smooth}), ["s"])
    assert len(parts.signals) == MOST_LEVELS
    assert abs(parts.signals[parts.level, 0] - smooth).max() <= 0.5 / MOST_LEVELS + 0.01
    late = series(replace(rec, signals={"s": np.where(np.arange(100) < 50, np.nan, 3.0)}), ["s"])
    np.testing.assert_array_equal(late.signals[late.level, 0], 3.0)


def test_parameters_that_follow_a_signal(seed: int) -> None:
    """fm = fm0 + b s, of a signal that is now this, now that: two drives in turn."""
    signal, b = np.where(np.arange(600) < 300, 20.0, 50.0), -1e-3
    rec = reference_record(seed, 600, noise=0.0)
    x, y = None, []
    for half, value in ((slice(0, 300), 20.0), (slice(300, 600), 50.0)):
        values = {**REFERENCE_VALUES, "fm": REFERENCE_VALUES["fm"] + b * value}
        out, x = simulate_linear(three_mass("speed"), values, rec.u[half, None], 0.005, x)
        y.append(out[:, 0])
    rec = Record(rec.t, rec.u, np.concatenate(y), "speed", signals={"temperature": signal})
    problem = Problem(
        three_mass("speed"),
        REFERENCE_VALUES,
        EIGHT,
        predictor="output-error",
        varying={"fm": ("temperature",)},
        slopes={"fm per temperature": b},
    )
    predictor = RecordPredictor(problem, [rec], None)
    assert predictor.layout.names == (*EIGHT, "fm per temperature")
    errors = all_errors(predictor, predictor.start())
    assert abs(errors).max() < 1e-10 * np.std(rec.y)
    check_gradients(RecordPredictor(problem, [replace(rec, y=rec.y + 1)], None), 1e-6)


@pytest.mark.parametrize("noise", [None, Disturbance(torque=0.1, output=1e-3)])
def test_a_constant_torque_that_follows_a_signal_is_an_exact_input(noise: Disturbance | None, seed: int) -> None:
    """tau0 = tau00 + b s acts as a torque that is larger by b s, however s moves."""
    rec = reference_record(seed, 600, noise=1e-3)
    signal = np.sin(np.arange(600) / 37) + 0.2 * np.random.default_rng(seed).standard_normal(600)
    b, drive = 0.3, three_mass("speed")
    given = {**REFERENCE_VALUES, "tau0": 0.1}
    kind: Literal["innovations", "output-error"] = "output-error" if noise is None else "innovations"
    plain = Problem(drive, given, ("kT", "fm", "tau0"), kind, disturbance=noise)
    problem = replace(plain, varying={"tau0": ("s",)}, slopes={"tau0 per s": b})
    follows = RecordPredictor(problem, [replace(rec, signals={"s": signal})], noise)
    larger = RecordPredictor(plain, [replace(rec, u=rec.u + b * signal)], noise)
    errors = all_errors(follows, follows.start())
    np.testing.assert_allclose(errors, all_errors(larger, larger.start()), rtol=0, atol=1e-10 * float(np.std(rec.y)))
    assert follows.layout.names == ("kT", "fm", "tau0", "tau0 per s")
    assert settled(follows, follows.start()).slopes == {"tau0 per s": b}
    check_gradients(follows, 1e-6)


def test_a_missing_sample_is_not_looked_at(seed: int) -> None:
    """Whatever stands where nothing was measured, and with friction and gravity of the measured motion."""
    case = BY_NAME["gravity"]
    rec = case_record(seed, case, 300)
    valid = np.random.default_rng(seed).random(300) > 0.2
    other = np.where(valid, rec.y, 1e3)
    found = [
        all_errors(p := RecordPredictor(as_monitor(case), [replace(rec, y=y, valid=valid)], None), p.start())
        for y in (rec.y, other)
    ]
    np.testing.assert_array_equal(found[0], found[1])
    assert (found[0][~valid] == 0).all()


def test_values_that_make_no_sense_are_not_good(seed: int) -> None:
    rec = reference_record(seed, 2000)
    predictor = RecordPredictor(
        Problem(
            three_mass("speed"), {**REFERENCE_VALUES, "fm": -50.0}, ("fm",), "output-error",
            bounds={"fm": (-100.0, 1.0)},
        ),
        [rec],
        None,
    )  # fmt: skip
    assert [e.good for e in predictor.errors(predictor.start())] == [False]
