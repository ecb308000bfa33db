"""What is suspicious is found, named and shown; a healthy record gives no finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.identification import (
    KnownAxis,
    Record,
    check_record,
    has_wrong_sign,
    known_axis,
    matching_torques,
    moves,
    received_interval,
    shown_inertia,
)
from monitor_core.identification.record_checks import motion_checks
from monitor_core.identification.record_checks.findings import RecordFinding
from monitor_core.identification.record_checks.known_axis import antiresonance_s, rigid_inertia
from monitor_core.identification.record_checks.sample_checks import outliers
from monitor_core.identification.torque_balance.rigid_body import Rigid, rigid_fit
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import DRAWINGS, EXAMPLE_VALUES, three_mass, two_mass
from monitor_core.modeling.statespace import drive_of
from tests.core.identification.record_cases import VALUES, H, healthy, with_u, with_y

HEALTHY = 3
"""Records."""
KNOWN = known_axis(three_mass("angle"), VALUES, parameters=8)
OUTPUTS: tuple[Output, ...] = ("speed", "angle")


@pytest.fixture(params=OUTPUTS)
def record(request: pytest.FixtureRequest, seed: int) -> Record:
    return healthy(np.random.default_rng(seed), request.param, samples=2000)


def kinds(record: Record, known: KnownAxis = KNOWN) -> list[tuple[str, str]]:
    return [(finding.kind, finding.severity) for finding in check_record(record, known)]


def only(record: Record, known: KnownAxis = KNOWN) -> RecordFinding:
    (finding,) = check_record(record, known)
    return finding


@pytest.mark.parametrize("closed", [False, True], ids=["open-loop", "closed-loop"])
@pytest.mark.parametrize("quantity", OUTPUTS)
def test_a_healthy_record_gives_no_finding(quantity: Output, closed: bool, seed: int) -> None:
    rng = np.random.default_rng([seed, closed])
    for _ in range(HEALTHY):
        record = healthy(rng, quantity, closed, samples=int(rng.integers(1200, 3000)))
        assert check_record(record, KNOWN) == ()


def test_torque_and_angle_that_are_exchanged_are_named(seed: int) -> None:
    """A speed explains its torque either way, so there nothing can be found out."""
    for quantity in OUTPUTS:
        record = healthy(np.random.default_rng(seed), quantity, samples=2000)
        found = check_record(replace(record, u=record.y, y=record.u), KNOWN)
        assert [(f.kind, f.severity) for f in found if f.kind == "exchanged"] == [("exchanged", "refuse")] * (
            quantity == "angle"
        )
        if quantity == "angle":
            assert [f.kind for f in found] == ["exchanged"]
            assert found[0].sentence.startswith("torque and angle are exchanged, in the configuration or in the")
            assert found[0].number > 0.9


def random_binary(rng: np.random.Generator, count: int) -> Floats:
    return np.repeat(rng.choice([-1.5, 1.5], count // 5), 5)


def sine_in_steps(rng: np.random.Generator, count: int) -> Floats:
    return np.asarray(0.01 * np.rint(150 * np.sin(2 * np.pi * rng.uniform(0.5, 2) * H * np.arange(count))))


def fast_sine(rng: np.random.Generator, count: int) -> Floats:
    return np.asarray(1.5 * np.sin(2 * np.pi * rng.uniform(20, 30) * H * np.arange(count)))


def square(rng: np.random.Generator, count: int) -> Floats:
    return np.asarray(
        2.0 * np.sign(np.sin(2 * np.pi * 0.4 * H * np.arange(count))) + multisine(rng, count, H, (1, 30), 0.5)
    )


@pytest.mark.parametrize("torque", [random_binary, sine_in_steps, fast_sine, square], ids=lambda f: f.__name__)
def test_other_torques_are_healthy_too(torque: Callable[[np.random.Generator, int], Floats], seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = torque(rng, 3000)
    drive = three_mass("speed")
    values = {**VALUES, "fc": 0.0, "tau0": 0.0}
    y, _ = simulate_linear(drive, values, u[:, np.newaxis], H)
    y = y[:, 0] + 0.1 * rng.standard_normal(len(u))
    assert check_record(Record(H * np.arange(len(u), dtype=float), u, y, "speed"), KNOWN) == ()


def test_too_short(record: Record) -> None:
    finding = only(record.select(slice(40)), KnownAxis(parameters=8))
    assert (finding.kind, finding.severity, finding.number) == ("too-short", "refuse", 40)
    assert finding.sentence == "only 40 measured samples; at least 80 are needed for 8 parameters"
    assert ("too-short", "refuse") in kinds(record.select(slice(100)), KnownAxis(slowest_s=1.0))
    assert kinds(record.select(slice(600)), KnownAxis(slowest_s=1.0)) == [("too-short", "warn")]
    assert kinds(record.select(slice(1100)), KnownAxis(slowest_s=0.9)) == []


def test_constant_torque(record: Record) -> None:
    finding = only(with_u(record, np.full(len(record), 0.7)))
    assert (finding.kind, finding.severity, finding.number) == ("constant-torque", "refuse", 0.7)
    assert "the torque is 0.7 N m throughout" in finding.sentence
    steps = np.repeat(np.arange(len(record) // 50) % 7, 50).astype(float)
    assert ("constant-torque", "warn") in kinds(with_u(record, steps))


@pytest.mark.parametrize("ends", [(-1.5, 1.5), (-9, 1.5), (-1.5, 9)])
def test_saturated_torque(record: Record, ends: tuple[float, float]) -> None:
    u = np.clip(record.u, *ends)
    found = [finding for finding in check_record(with_u(record, u), KnownAxis()) if finding.kind == "saturated"]
    assert len(found) == sum(abs(end) < 9 for end in ends)
    for finding in found:
        at_end = np.mean(u == (u.max() if "largest" in finding.sentence else u.min()))
        assert finding.number == pytest.approx(at_end)
        assert f"{100 * at_end:.3g} % of the samples" in finding.sentence


def test_output_that_never_moves(record: Record) -> None:
    finding = only(with_y(record, np.full(len(record), 0.25)))
    assert (finding.kind, finding.severity, finding.number) == ("stuck", "refuse", 0.25)


@pytest.mark.parametrize("quantity", OUTPUTS)
@pytest.mark.parametrize(("interval_s", "refused"), [(0.005, True), (0.05, True), (0.2, False)])
def test_an_axis_that_stands_in_its_noise(quantity: Output, interval_s: float, refused: bool, seed: int) -> None:
    """Of samples that are far apart it is not known: a fast motion looks the same."""
    rng = np.random.default_rng(seed)
    u, y = 2.0 + 0.1 * rng.standard_normal(4000), 0.3 * (quantity == "angle") + 1e-5 * rng.standard_normal(4000)
    y[1000:1003] = np.nan
    record = Record(interval_s * np.arange(4000.0), u, y, quantity, "still")
    found = [f.sentence for f in check_record(record) if (f.kind, f.severity) == ("still", "refuse")]
    assert bool(found) == refused
    if refused:
        assert found[0].startswith(f"the {quantity} shows nothing but noise of 1e-05 rad")


def test_a_constant_speed_is_not_still(seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = Record(0.005 * np.arange(4000.0), rng.standard_normal(4000), 100 + rng.standard_normal(4000), "speed", "x")
    assert "still" not in [kind for kind, _ in kinds(record, KnownAxis())]


@pytest.mark.parametrize("kind", ["drifts", "moves once"])
def test_an_axis_that_hardly_moves_is_not_still(kind: str, seed: int) -> None:
    rng, t = np.random.default_rng(seed), 0.005 * np.arange(4000.0)
    y = 1e-5 * rng.standard_normal(4000) + (
        4e-5 * np.sin(t) if kind == "drifts" else np.where(abs(t - 9) < 0.03, 1.0, 0)
    )
    assert "still" not in [
        kind for kind, _ in kinds(Record(t, rng.standard_normal(4000), y, "angle", "x"), KnownAxis())
    ]


def test_stuck_output(record: Record) -> None:
    """At the largest speed, or where the angle goes far in the meantime."""
    y, frozen = record.y.copy(), 60
    missed = abs(y if record.quantity == "speed" else np.append(y[frozen:], np.full(frozen, y[-1])) - y)
    start = 500 + int(np.argmax(missed[500:1200]))
    y[start : start + frozen] = y[start]
    findings = [finding for finding in check_record(with_y(record, y), KNOWN) if finding.kind == "stuck"]
    assert [(finding.severity, finding.number) for finding in findings] == [("warn", 60)]
    assert f"from {record.t[start] - record.t[0]:.3f} s on" in findings[0].sentence


def test_a_speed_that_is_stuck_anywhere_but_at_zero(seed: int) -> None:
    """A constant speed under a changing torque is none, be it a fifth of the usual one.

    Once in a thousand times the next speed is the same but for the last digits: no step to be seen.
    """
    rng, found = np.random.default_rng(seed), 0
    record = healthy(rng, "speed", samples=1500)
    fast = 100 + np.flatnonzero(abs(record.y[100:1400]) > 0.2 * np.median(abs(record.y)))
    for start in rng.choice(fast, 20):
        y = record.y.copy()
        y[start : start + 60] = y[start]
        found += "stuck" in [kind for kind, _ in kinds(with_y(record, y))]
    assert found >= 19


@pytest.mark.parametrize("quantity", OUTPUTS)
def test_standstill_is_not_stuck(quantity: Output, seed: int) -> None:
    """The axis rests first; its encoder shows the same number, while the torque is below the friction."""
    rng = np.random.default_rng(seed)
    record = healthy(rng, quantity, samples=2000, noise=0.0)
    rest = 600
    u = np.concatenate((0.1 * rng.standard_normal(rest), record.u))
    t = np.concatenate((record.t[0] - H * np.arange(rest, 0, -1), record.t))
    start = record.y[0] if record.quantity == "angle" else 0.0
    y = np.round(np.concatenate((np.full(rest, start), record.y)), 4)
    assert kinds(Record(t, u, y, record.quantity)) == []
    there_and_back = np.concatenate((y[rest:][::-1], y))
    t = H * np.arange(len(there_and_back), dtype=float)
    assert kinds(Record(t, np.concatenate((record.u, u)), there_and_back, record.quantity), KnownAxis()) == []


def jerk(rng: np.random.Generator) -> tuple[float, Output, Floats]:
    """One end of a standstill may be as abrupt as that of a frozen sensor, not both."""
    steps = np.append(0.01, rng.uniform(1e-4, 0.01, 899))
    return H, "angle", np.concatenate((np.zeros(100), np.cumsum(steps)))


def coarse_encoder(_: np.random.Generator) -> tuple[float, Output, Floats]:
    t = 0.001 * np.arange(8000, dtype=float)
    return 0.001, "angle", 0.01 * np.rint(0.1 * np.cumsum(0.5 + 0.4 * np.sin(2 * np.pi * 0.5 * t)))


def coarse_speed(rng: np.random.Generator) -> tuple[float, Output, Floats]:
    t = 0.001 * np.arange(8000, dtype=float)
    return 0.001, "speed", np.rint(rng.choice([20, 100]) * (1 + np.sin(np.pi * t)))


def slow_speed(rng: np.random.Generator) -> tuple[float, Output, Floats]:
    """Each value comes 25 times."""
    return 0.001, "speed", np.repeat(10 * rng.integers(1, 90, 320), 25).astype(float)


@pytest.mark.parametrize("motion", [jerk, coarse_encoder, coarse_speed, slow_speed], ids=lambda f: f.__name__)
def test_equal_values_that_are_not_stuck(
    motion: Callable[[np.random.Generator], tuple[float, Output, Floats]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    h, quantity, y = motion(rng)
    record = Record(h * np.arange(y.size, dtype=float), rng.normal(size=y.size), y, quantity)
    assert "stuck" not in [kind for kind, _ in kinds(record, KnownAxis())]


def test_nothing_is_stuck_while_the_torque_does_not_move_either(record: Record) -> None:
    y, u = record.y.copy(), record.u.copy()
    start = 500 + int(np.argmax(abs(y[500:1200])))
    y[start : start + 60], u[start : start + 60] = y[start], u[start]
    assert "stuck" not in [kind for kind, _ in kinds(with_u(with_y(record, y), u))]


def test_wrong_sign(record: Record) -> None:
    finding = only(with_u(record, -record.u))
    assert (finding.kind, finding.severity) == ("wrong-sign", "refuse")
    assert finding.number < 0
    assert "torque or motion has the wrong sign" in finding.sentence
    assert kinds(with_y(record, -record.y)) == [("wrong-sign", "refuse")]


def picks(rng: np.random.Generator, inertia: float, weight: float) -> Record:
    """An axis of an arm, between five poses again and again, with pauses, friction, and a ripple of its gear."""
    interval_s, count, poses, pieces = 0.008, 15_000, rng.uniform(-1.2, 1.2, 5), list[Floats]()
    while sum(map(len, pieces)) < count:
        begin, end = poses[len(pieces) // 2 % 5], poses[(len(pieces) // 2 + 1) % 5]
        s = np.arange(0, 1, interval_s / (0.6 + 0.6 * abs(end - begin)))
        pieces += [begin + (end - begin) * (10 * s**3 - 15 * s**4 + 6 * s**5)]
        pieces += [np.full(rng.integers(25, 150), end)]
    q = np.concatenate(pieces)[:count]
    speed = np.gradient(q, interval_s)
    u = inertia * np.gradient(speed, interval_s) + 0.04 * speed + 0.35 * np.tanh(speed / 0.01)
    u += weight * np.cos(q) + 0.02 * np.sin(100 * q) + 0.01 * rng.standard_normal(count)
    return Record(np.asarray(interval_s * np.arange(count), np.float64), u, q, "angle", "picks")


@pytest.mark.parametrize(("inertia", "weight"), [(0.026, 0.0), (0.3, 2.0)])
def test_the_sign_of_an_axis_that_repeats_its_motion(inertia: float, weight: float, seed: int) -> None:
    """Windows as long as its cycle hold the weight or friction only: of the inertia they say nothing."""
    for k in range(4):
        record = picks(np.random.default_rng([seed, k]), inertia, weight)
        turned = with_u(record, -record.u)
        assert check_record(record) == ()
        assert [finding.kind for finding in check_record(turned)] == ["wrong-sign"]
        assert not has_wrong_sign(record)
        assert has_wrong_sign(turned)
        mass = shown_inertia(record)
        assert mass is not None
        assert mass.inertia == pytest.approx(inertia, rel=0.15)


@pytest.mark.parametrize("quantity", OUTPUTS)
@pytest.mark.parametrize("samples", [1, 4])
def test_a_torque_without_its_sign(samples: int, quantity: Output, seed: int) -> None:
    """As the rms of a current, over one sample or some."""
    for k in range(4):
        record = picks(np.random.default_rng([seed, k]), 0.026 if k % 2 else 0.3, 0.0)
        if quantity == "speed":
            record = replace(record, y=np.gradient(record.y, record.t), quantity=quantity)
        rms = np.sqrt(np.convolve(record.u**2, np.full(samples, 1 / samples), "same"))
        (finding,) = check_record(with_u(record, rms))
        assert (finding.kind, finding.severity) == ("unsigned", "refuse")
        assert "record torque or current with the sign" in finding.sentence
        assert finding.number > 0.7
        assert check_record(record) == ()


@pytest.mark.parametrize("weight", [0.0, 2.0])
def test_a_torque_that_is_never_negative_may_have_its_sign(weight: float, seed: int) -> None:
    """With an offset, or a weight that always pulls one way, which leaves no torque at one pose; or one-way motion."""
    for k in range(4):
        record = picks(np.random.default_rng([seed, k]), 0.026, weight)
        lifted = with_u(record, record.u - record.u.min())
        assert "unsigned" not in [finding.kind for finding in check_record(lifted)]
        turned = np.cumsum(abs(np.diff(record.y, prepend=record.y[0])))
        speed = np.gradient(turned, record.t)
        driven = 0.4 * np.tanh(speed / 0.01) + 0.1 * speed + 0.01 * np.random.default_rng(k).random(speed.size)
        assert "unsigned" not in [finding.kind for finding in check_record(replace(record, u=driven, y=turned))]


def test_the_sign_of_an_axis_that_others_push(seed: int) -> None:
    """Of an arm with little friction, whose other axes turn the load: the work tells nothing, so nothing is turned."""
    t = np.asarray(0.004 * np.arange(10_000), np.float64)
    for k in range(6):
        rng = np.random.default_rng([seed, k])
        phase = rng.uniform(0, 2 * np.pi, 4)
        q = 0.5 * np.sin(0.63 * t + phase[0]) + 0.2 * np.sin(1.26 * t + phase[1])
        other = 0.9 * np.sin(0.83 * t + phase[2]) + 0.5 * np.sin(1.71 * t + phase[3])
        speed = np.gradient(q, t)
        u = 0.5 * np.gradient(speed, t) + 0.3 * speed + 0.4 * np.tanh(speed / 0.01) + 12 * np.sin(q + 2 * other)
        assert not has_wrong_sign(Record(t, u + 0.05 * rng.standard_normal(t.size), q, "angle"))


def test_an_inertia_against_all_work_is_not_believed(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Should a fit go wrong: an axis that only takes work, and again and again, is driven by its torque."""
    record = picks(np.random.default_rng(seed), 0.026, 0.0)
    wrong = Rigid(-0.08, 0.003, {"coulomb": -0.1}, 0.99)
    monkeypatch.setattr(motion_checks, "shown_inertia", lambda *_: wrong)
    assert check_record(record) == ()


@pytest.mark.parametrize(
    ("torque", "motion", "mistake"),
    [
        (1000, 1, "a torque in N mm or mN m"),
        (1, 1000, "a motion in mrad"),
        (1, 180 / np.pi, "a motion in degrees"),
        (1, np.pi / 180, "a motion converted from degrees to radians twice"),
        (1, 30 / np.pi, "revolutions per minute"),
        (1, 1 / 118**2, "are units and gear ratio right?"),
    ],
)
def test_wrong_units(record: Record, torque: float, motion: float, mistake: str) -> None:
    wrong = with_y(with_u(record, torque * record.u), motion * record.y)
    finding = only(wrong, replace(KNOWN, speed_scale=motion))
    assert (finding.kind, finding.severity) == ("units", "warn")
    assert finding.number == pytest.approx(torque / motion, rel=0.4)
    assert mistake in finding.sentence


def test_gaps_and_lost_samples(record: Record, seed: int) -> None:
    t = record.t + 0.3 * (np.arange(len(record)) >= 700)
    cut = Record(t, record.u, record.y, record.quantity)
    finding = only(cut, KnownAxis())
    assert (finding.kind, finding.severity) == ("gaps", "warn")
    assert finding.number == pytest.approx(0.3, abs=0.01)
    assert (
        f"once nothing was recorded for more than 10 intervals, longest for {finding.number:.3g} s" in finding.sentence
    )
    few, many = (np.random.default_rng(seed).random(len(record)) > share for share in (0.005, 0.1))
    assert "lost" not in [kind for kind, _ in kinds(record.select(few), KnownAxis())]
    (lost,) = [finding for finding in check_record(record.select(many), KnownAxis()) if finding.kind == "lost"]
    assert lost.number == pytest.approx(1 - many.mean(), abs=0.02)


@pytest.mark.parametrize("quantity", OUTPUTS)
@pytest.mark.parametrize(
    ("interval_s", "period_s", "end_s", "slow"),
    [(0.75, 6.0, 600.0, True), (0.375, 6.0, 600.0, False), (0.075, 0.6, 60.0, False), (0.75, 6.0, 30.0, False)],
)
def test_samples_too_far_apart_for_the_motion(
    quantity: Output, interval_s: float, period_s: float, end_s: float, slow: bool, seed: int
) -> None:
    """Four from one reversal to the next; eight; as few within tenths of a second, as of vibration; a short record."""
    t = np.arange(0.0, end_s, interval_s)
    noise = 0.1 * np.random.default_rng(seed).standard_normal((2, len(t)))
    angle, speed = np.sin(2 * np.pi * t / period_s), np.cos(2 * np.pi * t / period_s)
    record = Record(t, speed + noise[0], (angle if quantity == "angle" else speed) + noise[1], quantity, "slow")
    found = [f.sentence for f in check_record(record) if f.kind == "too-slow"]
    assert bool(found) == slow
    if slow:
        assert found[0].startswith("samples are 0.75 s apart, which is 4 from one reversal of the axis to the next")
        assert found[0].endswith("record at least every 0.07 s")


def test_late_stamps_but_not_irregular_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    r = healthy(rng, "speed", samples=2000)
    k = np.arange(len(r))
    late = Record(H * (k + rng.uniform(0, 0.4, len(r))), r.u, r.y, "speed")
    finding = only(late, KnownAxis())
    assert (finding.kind, finding.severity) == ("jitter", "warn")
    assert finding.number == pytest.approx(H * 0.4 / 12**0.5 * 2**0.5, rel=0.1)
    irregular = Record(np.cumsum(H * rng.uniform(0.8, 1.2, len(r))), r.u, r.y, "speed")
    assert check_record(irregular, KnownAxis()) == ()


@pytest.mark.parametrize("what", ["torque", "output"])
def test_outliers(record: Record, what: str, seed: int) -> None:
    where = np.sort(np.random.default_rng(seed).choice(np.arange(10, 1900, 10), 5, replace=False))
    values = (record.u if what == "torque" else record.y).copy()
    values[where] += 3 * np.ptp(values)
    broken = (with_u if what == "torque" else with_y)(record, values)
    assert np.flatnonzero(outliers(values)).tolist() == where.tolist()
    found = [finding for finding in check_record(broken, KNOWN) if finding.kind == "outliers"]
    assert [(finding.severity, finding.number) for finding in found] == [("warn", 5)]
    assert f"the first at {record.t[where[0]] - record.t[0]:.3f} s" in found[0].sentence
    values[np.arange(5, 1995, 40)] += 3 * np.ptp(record.u)
    values[np.arange(5, 1995, 40)] *= 50
    broken = (with_u if what == "torque" else with_y)(record, values)
    assert ("outliers", "refuse") in kinds(broken)


def test_a_jump_is_no_outlier() -> None:
    assert not outliers(np.repeat([0.0, 1.0, -5.0, 7.0, 7.5], 20)).any()
    assert not outliers(np.array([1.0, 100.0, 1.0])).any()
    # As a real drive swung when it was stopped.
    stop = [-6.96, -0.31, -5.06, -9.6, -11.6, -11.7, -11.5, -11.6]
    assert not outliers(np.concatenate((np.tile([9.3, 9.4], 50), stop, np.tile([-11.5, -11.6], 50)))).any()


def test_missing_samples(record: Record) -> None:
    finding = only(record.without(slice(100, 120)))
    assert (finding.kind, finding.severity) == ("missing", "warn")
    assert finding.number == pytest.approx(20 / len(record))
    assert f"at 20 of {len(record)} samples, 1 %" in finding.sentence
    assert ("missing", "refuse") in kinds(record.without(slice(100, 1400)))


@pytest.mark.parametrize("interval_s", [0.005, 0.5])
def test_a_motion_that_is_never_measured(interval_s: float) -> None:
    t = interval_s * np.arange(100.0)
    never = Record(t, np.sin(t), np.full(100, np.nan), "angle", "never")
    assert [f.kind for f in check_record(never) if f.kind in ("missing", "too-slow", "still")] == ["missing"]


def test_absurd_numbers(record: Record) -> None:
    y = record.y.copy()
    y[[5, 77]] = 5.9e293
    finding = check_record(with_y(record, y), KNOWN)[0]
    assert (finding.kind, finding.severity, finding.number) == ("absurd", "refuse", 5.9e293)
    assert "at 2 samples, up to 5.9e+293" in finding.sentence


@pytest.mark.parametrize("output", OUTPUTS)
def test_the_rigid_inertia_is_the_sum_of_all(output: Output) -> None:
    r = VALUES["r"]
    total = VALUES["Jm"] + r**2 * (VALUES["Jg"] + VALUES["Ja"])
    assert rigid_inertia(three_mass(output), VALUES) == pytest.approx(total, rel=1e-6)
    assert rigid_inertia(three_mass(output), {**VALUES, "kT": 2.0, "fm": 0.0}) == pytest.approx(total / 2, rel=1e-6)
    two = {**EXAMPLE_VALUES["two-mass"], "Jm": VALUES["Jm"], "Ja": VALUES["Ja"], "r": r}
    assert rigid_inertia(two_mass(output), two) == pytest.approx(VALUES["Jm"] + r**2 * VALUES["Ja"], rel=1e-6)
    alone = {"kT": 1.0, "J": 0.03, "fm": 0.0, "fc": 0.4, "tau0": 0.0}
    assert rigid_inertia(drive_of(eliminate(DRAWINGS["one-mass"].flat(), output)), alone) == pytest.approx(
        0.03, rel=1e-6
    )


def test_the_lowest_antiresonance() -> None:
    """The two masses behind the gear swing against the motor held fast."""
    k = {name: VALUES[name] for name in ("kg", "ka", "Jg", "Ja")}
    M, K = np.diag([k["Jg"], k["Ja"]]), np.array([[k["kg"] + k["ka"], -k["ka"]], [-k["ka"], k["ka"]]])
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min())
    assert KNOWN.antiresonance_s == pytest.approx(2 * np.pi / omega, rel=1e-3)
    rigid = {name: VALUES.get(name, 1.0) for name in (p.name for p in two_mass("angle").parameters)}
    assert antiresonance_s(two_mass("angle"), {**rigid, "d": 1e4, "k": 1.0}) is None


@pytest.mark.parametrize("quantity", OUTPUTS)
def test_one_mass_is_explained_entirely(quantity: Output, seed: int) -> None:
    rng = np.random.default_rng(seed)
    h, J = rng.uniform(0.001, 0.01, 3000), rng.uniform(0.1, 10)
    u = rng.normal(size=3000) + np.repeat(rng.normal(size=30), 100)
    speed = np.concatenate(([0.0], np.cumsum(u * h / J)))
    angle = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * h)))
    y = (speed if quantity == "speed" else angle)[:-1]
    fit = rigid_fit(Record(np.concatenate(([0.0], np.cumsum(h)[:-1])), u, y, quantity))
    assert fit is not None
    assert fit.inertia == pytest.approx(J, rel=1e-3)
    assert fit.explained > 1 - 1e-6


@pytest.mark.parametrize(
    ("kind", "quantity", "right"),
    [
        ("noise", "angle", False),
        ("last digit", "angle", False),
        ("slow", "angle", True),
        ("still", "angle", False),
        ("constant", "speed", True),
        ("noise", "speed", False),
    ],
)
def test_whether_it_moves(kind: str, quantity: Output, right: bool, seed: int) -> None:
    rng, t = np.random.default_rng(seed), np.arange(2000) * 0.005
    values = {
        "noise": rng.standard_normal(t.size),
        "last digit": np.rint(0.5 + 0.2 * rng.standard_normal(t.size)),
        "slow": np.rint(3 * t),
        "still": np.full(t.size, 0.3),
        "constant": 100 + rng.standard_normal(t.size),
    }
    assert moves(values[kind], quantity) == right


def test_which_torque_drives_which_motion(seed: int) -> None:
    """A record that is shorter is from another time, and keeps its own; a clock may begin later for some axes."""
    rng = np.random.default_rng(seed)
    first, second, third = (healthy(rng, "angle", samples=2000) for _ in range(3))
    own, exchanged = [first, second, third], [with_u(first, second.u), with_u(second, first.u), third]
    assert matching_torques(own, [0.0, 0.0, 0.0]) == [0, 1, 2]
    assert matching_torques(exchanged, [0.0, 0.0, 0.0]) == [1, 0, 2]
    assert matching_torques([exchanged[0], exchanged[1].select(slice(1880))], [0.0, 0.0]) == [0, 1]
    later = replace(exchanged[1].select(slice(90, None)), t=exchanged[1].t[:-90])
    assert matching_torques([exchanged[0], later], [5.0, 5.0 + 90 * H]) == [1, 0]


def test_the_interval_of_frames_that_come_late(seed: int) -> None:
    """Hardly any of which comes at once, and before which the controller was off."""
    rng, interval_s = np.random.default_rng(seed), 0.004
    cycle = np.arange(3000.0)
    late = np.maximum.accumulate(cycle * interval_s + rng.exponential(0.002, cycle.size))
    found, off = received_interval(np.concatenate([late[:500] - 60.0, late]), np.concatenate([cycle[:500], cycle]))
    assert found == pytest.approx(interval_s, rel=1e-4)
    assert off < 1e-4
    assert received_interval(late[:90], cycle[:90]) == (0.0, np.inf)
