"""What comes out can be believed: verdict, missing effects, what is held, what can be watched; axes of known truth.

The axes are rigid, in a closed loop, some under a weight; starting values are far off.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
import pytest

from monitor_core.drive import LOAD
from monitor_core.identification import (
    IdentificationOptions,
    IdentificationResult,
    Obstacle,
    Problem,
    Record,
    identification_procedure,
    identify,
    most_moving_parts,
    speed_scales,
)
from monitor_core.identification.assessment.bode import bode_of
from monitor_core.identification.assessment.explained_torque import explained_torque
from monitor_core.identification.assessment.outlook import Outlook
from monitor_core.identification.assessment.verdict import (
    Effect,
    FitQuality,
    Measure,
    VerdictBasis,
    missing_effects,
)
from monitor_core.identification.greybox import Estimate, agreeing, fit
from monitor_core.identification.greybox.criterion import choose_disturbance
from monitor_core.identification.holding import hold_undetermined
from monitor_core.identification.parameter_selection import scheduled_terms, with_terms
from monitor_core.identification.starting import fit_from_torque_balance, hold_balanced_inertia
from monitor_core.identification.torque_balance.rigid_body import rigid_fits
from monitor_core.identification.torque_balance.torque_windows import POSE
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.settings import DOUBTFUL, TOGETHER
from tests.real.drives import one_mass

H = 0.005
VALUES = {"kT": 1.0, "J": 2.0, "fv": 1.5, "fc": 2.0, "tau0": 0.1}
WEIGHT = {"gc": 12.0, "gs": 4.0}
SCALE = 0.05
ALL = ("J", "fv", "fc", "tau0")


@cache
def record(
    seed: int,
    *,
    weight: bool = False,
    one_speed: bool = False,
    seconds: float = 20.0,
    disturbed: float = 0.0,
    travel: float = 0.0,
) -> Record:
    """A position controller follows sines, or goes to and fro at one speed; encoder noise; a white torque disturbs.

    ``travel``: mean speed, rad/s.
    """
    rng = np.random.default_rng(seed)
    values = {**VALUES, **(WEIGHT if weight else {})}
    axis = SimulatedAxis(values, substeps=4, drive=one_mass(gravity=weight), speed_scale=SCALE)
    t = np.asarray(H * np.arange(round(seconds / H)), dtype=np.float64)
    phases = rng.uniform(0, 2 * np.pi, 5)
    wanted = sum(
        a * np.sin(2 * np.pi * f * t + p)
        for a, f, p in zip((0.5, 0.3, 0.1, 0.05, 0.01), (0.11, 0.37, 0.9, 2.3, 5.1), phases, strict=True)
    )
    if one_speed:
        wanted = 0.8 * np.abs((t / 4) % 2 - 1)
    wanted = np.asarray(wanted) - wanted[0] + travel * t
    u, y, angle, speed, before = np.zeros(t.size), np.zeros(t.size), 0.0, 0.0, 0.0
    for k, goal in enumerate(wanted):
        y[k] = angle + 2e-5 * rng.standard_normal()
        u[k] = 300 * (goal - y[k]) + 40 * ((goal - before) / H - speed) + 0.3 * rng.standard_normal()
        angle, speed = axis.step(u[k] + disturbed * rng.standard_normal(), H)
        before = goal
    return Record(t, u, y, "angle", "axis")


def found(records: list[Record], *, gravity: bool = False, **options: object) -> IdentificationResult:
    drive = one_mass(gravity=gravity)
    free = (*ALL, *(WEIGHT if gravity else ()))
    nominal = {p.name: 1.0 if p.name in ("kT", "J") else 0.0 for p in drive.parameters}
    problem = Problem(drive, nominal, free, speed_scale=SCALE)
    given = {"start": "values", "monitored": ("kT", "fv", "fc"), "unknown": free, **options}
    return identify(problem, records, (), IdentificationOptions(**given))  # type: ignore[arg-type]


@cache
def usual(seed: int) -> IdentificationResult:
    """Of a record without anything special."""
    return found([record(seed)])


@pytest.mark.parametrize("weight", [False, True])
def test_an_axis_in_a_closed_loop_is_found_from_values_far_off(weight: bool, seed: int) -> None:
    result = found([record(seed, weight=True)], gravity=True) if weight else usual(seed)
    true = {**VALUES, **(WEIGHT if weight else {})}
    e = result.estimate
    assert result.held == {}
    for name, value, sd in zip(e.names, e.theta, e.sd, strict=True):
        print(f"{name} = {value:.4g} +- {sd:.2g}, true {true[name]:g}")
        assert value == pytest.approx(true[name], abs=max(0.03 * abs(true[name]), 5 * sd))
    assert result.verdict.quality is FitQuality.GOOD
    assert result.verdict.basis is VerdictBasis.HALVES
    assert result.verdict.missing == ()
    assert result.rejection is None


def test_a_motion_that_is_repeated_is_reported_with_the_verdict(seed: int) -> None:
    """A half of the records is then the motion of the other half."""
    assert usual(seed).verdict.repeats_s is None
    once = record(seed)
    again = replace(once, u=np.tile(once.u, 2), y=np.tile(once.y, 2), t=H * np.arange(2.0 * len(once)), valid=None)
    assert found([again]).verdict.repeats_s == pytest.approx(once.duration_s + H, rel=0.01)


def test_terms_of_a_load_that_are_alike_are_counted_not_listed(seed: int) -> None:
    """Each of them may be anything, but their sum is known; friction that is uncertain is still named."""
    plain = record(seed)
    rng = np.random.default_rng(seed)
    turning = np.sin(0.7 * plain.t)
    signals = {name: turning + 1e-5 * rng.standard_normal(turning.size) for name in ("a", "b", "c")}
    loaded = replace(plain, u=plain.u + 2 * turning, signals={**signals, "d": np.cos(0.3 * plain.t)})
    nominal = {**VALUES, "tau0": 0.0}
    problem = Problem(one_mass(), nominal, ALL, speed_scale=SCALE, varying={"tau0": ("a", "b", "c", "d")})
    words = fit(problem, [loaded]).words
    assert [w for w in words if "tau0 per" in w] == []
    assert any(" of the 4 terms that tau0 follows cannot be determined one by one" in w for w in words)
    alone = fit(replace(problem, varying={"fv": ("a", "b")}), [loaded]).words
    assert any(w.startswith("fv per a") and "cannot" in w for w in alone)


@pytest.mark.parametrize(("size", "ringing"), [(3.0, 0.0), (1.0, 0.5)], ids=["several times", "half as large again"])
def test_an_axis_is_not_moved_by_its_own_measured_acceleration(size: float, ringing: float) -> None:
    """The inertia follows the pose of another axis, beside a torque of other links that no term describes.

    The measured acceleration, of which half is later, explains the motion by itself: with an inertia many times too
    large, and as large a torque for that acceleration, hardly any torque of the motor is needed.
    """
    plain = record(3)
    t, y = plain.t, plain.y
    other = np.asarray(0.4 * np.sin(t / 2.3), np.float64)
    lag = 3
    later, before = np.roll(y, -lag), np.roll(y, lag)
    acceleration = (later - 2 * y + before) / (lag * H) ** 2
    acceleration[: 2 * lag] = acceleration[-2 * lag :] = 0.0
    links = size * np.sin(3.1 * t) * np.cos(1.7 * t) + ringing * np.sin(37.0 * t)
    signals = {"other": other, "own": acceleration}
    moved = replace(plain, u=plain.u + links + 0.8 * acceleration * np.cos(other), signals=signals)
    term = "own * cos(other)"
    scheduled = scheduled_terms({"tau0": (term,)}, [moved])
    nominal = {**dict.fromkeys(VALUES, 0.0), "kT": 1.0, "J": 1.0}
    problem = Problem(one_mass(), nominal, ALL, speed_scale=SCALE, varying={"tau0": (term,)})
    options = IdentificationOptions(start="records", monitored=("kT", "fc"), scheduled=scheduled, unknown=ALL)
    found = identify(problem, [with_terms(moved, scheduled)], (), options)
    assert found.rejection is None
    assert found.estimate.values["J"] == pytest.approx(VALUES["J"], rel=0.3)
    assert "J" in found.held


def test_an_inertia_of_the_torque_balance_that_fits_worse_is_not_taken(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Should the balance go wrong beside the torque of links: the fit tells."""

    def too_small(problem: Problem, records: Sequence[Record], terms: Sequence[str]) -> Problem | None:
        balanced = hold_balanced_inertia(problem, records, terms)
        assert balanced is not None
        return replace(balanced, nominal={**balanced.nominal, "J": balanced.nominal["J"] / 1.3})

    plain = record(seed)
    load = np.asarray(0.5 * np.sin(3.1 * plain.t), np.float64)
    loaded = replace(plain, u=plain.u + load, signals={"load": load})
    scheduled = scheduled_terms({"tau0": ("load",)}, [loaded])
    problem = Problem(one_mass(), VALUES, ALL, speed_scale=SCALE, varying={"tau0": ("load",)})
    options = IdentificationOptions(start="records", monitored=("kT", "fc"), scheduled=scheduled, unknown=ALL)
    given = problem, [with_terms(loaded, scheduled)], (), options
    before = identify(*given)
    monkeypatch.setattr(identification_procedure, "hold_balanced_inertia", too_small)
    found = identify(*given)
    assert before.verdict.quality is FitQuality.GOOD
    assert found.estimate.values["J"] == pytest.approx(before.estimate.values["J"])
    assert "J" not in found.held


def test_the_torque_balance_gives_a_start_beside_the_torque_of_links() -> None:
    """That torque goes against the acceleration most of the time, so that alone the axis has a negative inertia."""
    plain = record(3)
    t = plain.t
    change = np.gradient(np.gradient(np.convolve(plain.y, np.full(15, 1 / 15), mode="same"), H), H)
    change[:40] = change[-40:] = 0.0
    load = np.asarray(-8.0 * change * (1 + 0.8 * np.sin(t / 1.7)), np.float64)
    loaded = replace(plain, u=plain.u + load, signals={"load": load})
    problem = Problem(one_mass(), VALUES, ALL, speed_scale=SCALE)
    with pytest.raises(ValueError, match="gives no starting values"):
        fit_from_torque_balance(problem, [loaded])
    found = fit_from_torque_balance(replace(problem, varying={"tau0": ("load",)}), [loaded])
    assert found.values["J"] == pytest.approx(VALUES["J"], rel=0.2)


def test_a_long_record_is_fitted_as_it_is(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of it tells only where the fit starts."""
    rec = record(seed)
    direct = usual(seed).estimate
    monkeypatch.setattr(identification_procedure, "most_moving_parts", partial(most_moving_parts, most=len(rec) // 4))
    by_part = found([rec]).estimate
    assert by_part.theta == pytest.approx(direct.theta, rel=1e-3)
    assert by_part.sd == pytest.approx(direct.sd, rel=0.01)


def test_a_weight_that_the_drive_lacks_is_named(seed: int) -> None:
    result = found([record(seed, weight=True)])
    print(result.verdict)
    assert result.verdict.quality is FitQuality.POOR
    assert result.verdict.missing[0] is Effect.POSE


def test_a_weight_that_is_the_same_everywhere_is_judged_by_its_torque(seed: int) -> None:
    """As of a vertical linear axis: a simulation runs away where a payload comes and goes."""
    rec = record(seed)
    load = 3.0 * (np.sin(2 * np.pi * rec.t / 7) > 0)
    result = found([replace(rec, u=rec.u + 20.0 + load)])
    print(result.verdict)
    assert result.verdict.measure is Measure.TORQUE
    assert Effect.POSE not in result.verdict.missing


def test_an_axis_that_mostly_rubs_is_judged_by_its_torque(seed: int) -> None:
    """Friction falls by a fifth while it warms up: a simulation of such a drive tells nothing."""
    rec = record(seed)
    speed = np.gradient(rec.y, H)
    fc = np.linspace(60.0, 48.0, len(rec))
    result = found([replace(rec, u=rec.u + fc * np.tanh(speed / SCALE))])
    print(result.verdict, result.estimate.values)
    assert result.verdict.measure is Measure.TORQUE
    assert result.verdict.quality is not FitQuality.POOR
    assert result.estimate.values["J"] == pytest.approx(VALUES["J"], rel=0.15)


@pytest.mark.parametrize(
    ("weight", "missing"),
    [(0.0, (Effect.FAST,)), (0.5, (Effect.FAST, Effect.POSE)), (3.0, (Effect.POSE,))],
)
def test_a_weight_that_takes_hardly_any_torque_is_looked_for_after_springs(
    weight: float, missing: tuple[Effect, ...], seed: int
) -> None:
    """Of 19 N m; it needs another torque for the same motion."""
    rec = record(seed)
    borne = replace(rec, u=rec.u + weight * np.sin(3 * rec.y))
    assert missing_effects(Problem(one_mass(), VALUES, ALL, speed_scale=SCALE), [borne]) == missing


@pytest.mark.parametrize(
    ("interval_s", "quality", "missing"),
    [(0.8, FitQuality.POOR, (Effect.SAMPLES,)), (0.05, FitQuality.GOOD, ())],
)
def test_samples_that_are_too_far_apart_are_named_instead_of_an_effect(
    interval_s: float, quality: FitQuality, missing: tuple[Effect, ...], seed: int
) -> None:
    """Of an axis that goes to and fro within two seconds each; with forty samples in each all is well."""
    rng, s = np.random.default_rng(seed), np.linspace(0, 1, round(2 / H))
    places = rng.uniform(0.5, 1.5, 300) * np.resize([1.0, -1.0], 300)
    y = np.concatenate([a + (b - a) * (10 * s**3 - 15 * s**4 + 6 * s**5) for a, b in pairwise(places)])
    v = np.gradient(y, H)
    u = VALUES["J"] * np.gradient(v, H) + VALUES["fv"] * v + VALUES["fc"] * np.tanh(v / SCALE)
    every = slice(None, None, round(interval_s / H))
    t = np.asarray(H * np.arange(y.size), dtype=np.float64)
    result = found([Record(t[every], u[every], y[every], "angle", "slow")])
    assert result.verdict.quality is quality
    assert result.verdict.missing == missing


def creeping(seed: int, speed: float = 0.02) -> Record:
    """As a wrist that welds: friction that sticks and slips takes all torque."""
    rng, s = np.random.default_rng(seed), np.linspace(0, 1, round(1 / H))
    y, stuck = [np.zeros(1)], [np.zeros(1)]
    for k in range(12):
        far = (1 if k % 2 else -1) * rng.uniform(0.5, 1)
        y.append(y[-1][-1] + far * (10 * s**3 - 15 * s**4 + 6 * s**5))
        creep = speed * np.sign(far) * H * np.arange(1, 4 * s.size)
        y.append(y[-1][-1] + creep)
        slip = np.convolve(rng.standard_normal(creep.size), np.ones(40) / 40**0.5, mode="same")
        stuck += [np.zeros(s.size), slip]
    angle = np.concatenate(y)
    w = np.gradient(angle, H)
    u = VALUES["J"] * np.gradient(w, H) + VALUES["fv"] * w + VALUES["fc"] * np.tanh(w / 0.01)
    t = np.asarray(H * np.arange(angle.size))
    measured = angle + 2e-5 * rng.standard_normal(angle.size)
    return Record(t, u + np.concatenate(stuck), measured, "angle", "axis")


def test_an_axis_that_mostly_creeps_is_identified_from_its_faster_motion(seed: int) -> None:
    problem = Problem(one_mass(), VALUES, ALL, speed_scale=0.01)
    result = identify(problem, [creeping(seed)], (), IdentificationOptions(start="values"))
    J = result.estimate.values["J"]
    print(result.verdict, J)
    assert 0.02 < result.slow_left_out < 0.1
    assert result.verdict.quality is FitQuality.GOOD
    assert pytest.approx(VALUES["J"], rel=0.05) == J


def test_what_is_left_out_counts_in_no_balance(seed: int) -> None:
    problem = Problem(one_mass(), {**VALUES, "tau0": 0.0}, ALL, speed_scale=0.01)
    slow = [creeping(seed, 0.05)]
    all_of_it, faster = (explained_torque([(replace(problem, min_speed=speed), slow)]) for speed in (0.0, 0.1))
    print(all_of_it, faster)
    assert all_of_it < 95 < 98 < faster


def test_the_few_windows_of_fast_motion_do_not_explain_noise(seed: int) -> None:
    """Seven values would, of a dozen windows that overlap."""
    shares = []
    for number in range(12):
        moved, rng = creeping(seed + number), np.random.default_rng(seed + number)
        at = np.arange(0.0, moved.t[-1] + 1.0, 0.7)
        noise = replace(moved, u=np.interp(moved.t, at, rng.standard_normal(at.size)))
        (fit,) = rigid_fits([noise], [POSE], 0.01, moving=True, min_speed=1.2)
        shares.append(0.0 if fit is None else fit.explained)
    print(shares)
    assert max(shares) < 0.75


def test_the_speed_scale_is_found(seed: int) -> None:
    """Between those that are tried."""
    rec = record(seed)
    scales = speed_scales([rec])
    result = found([rec], speed_scales=scales)
    scale = result.estimate.problem.speed_scale
    print(scale, scales)
    assert scale not in scales
    assert scale == pytest.approx(SCALE, rel=0.1)


def test_friction_at_one_speed_is_not_divided(seed: int) -> None:
    """One of the two is held, and the other one then has a standard deviation that a monitor can work with."""
    rec = record(seed, one_speed=True, seconds=30, disturbed=3.0)
    free = fit(Problem(one_mass(), VALUES, ALL, speed_scale=SCALE), [rec])
    i, j = (free.names.index(name) for name in ("fv", "fc"))
    assert abs(free.correlation[i, j]) > TOGETHER
    result = found([rec], monitored=("kT", "fc"))
    print(result.held, result.estimate.values)
    assert set(result.held) == {"fv"}
    assert "fc" in result.estimate.names
    e = result.estimate
    k = e.names.index("fc")
    assert e.sd[k] < DOUBTFUL * e.theta[k]
    (row,) = (row for row in result.rows() if row.name == "fv")
    assert row.held.startswith("the records")


@pytest.mark.parametrize("correlation", [-0.99, -0.5])
@pytest.mark.parametrize("configured", [0.0, VALUES["fv"]])
def test_zero_beside_a_partner_is_no_finding(correlation: float, configured: float, seed: int) -> None:
    """Of two frictions that go together the best may be none: a configured value that the record allows is kept."""
    problem = Problem(one_mass(), VALUES, ("J", "fv", "fc"), speed_scale=SCALE)
    estimate = fit(problem, [record(seed, seconds=4.0)])
    k, other = (estimate.names.index(name) for name in ("fv", "fc"))
    theta, covariance = estimate.theta.copy(), np.diag(np.full(estimate.theta.size, 1e-6))
    theta[k], covariance[k, k] = 0.0, 1.0
    covariance[k, other] = covariance[other, k] = correlation * 1e-3
    kept = list[Problem]()

    def refit(held: Problem) -> Estimate:
        kept.append(held)
        raise ValueError("only what would be held is asked for")

    hold_undetermined(
        replace(estimate, theta=theta, covariance=covariance), {**VALUES, "fv": configured}, ("fc",), refit
    )
    assert kept[0].nominal["fv"] == (configured if abs(correlation) > TOGETHER else 0.0)


def test_the_level_of_torque_noise_is_looked_for_where_it_is(seed: int) -> None:
    """However far the axis travels: a search from another level ends in another minimum."""
    rec = record(seed, disturbed=0.5, travel=20.0)
    noise = choose_disturbance(Problem(one_mass(), VALUES, ("J", "fv", "fc"), speed_scale=SCALE), [rec])
    assert noise is not None
    assert noise.torque is not None
    assert abs(np.log10(noise.torque / noise.output / (0.5 / 2e-5))) < 1


def test_where_the_torque_rings_the_inertia_is_that_of_the_torque_balance(seed: int) -> None:
    """The next sample of a slow motion is predicted best without a torque that is mostly what the arm does."""
    rng, t = np.random.default_rng(seed), H * np.arange(12_000)
    phase = rng.uniform(0, 2 * np.pi, 4)
    y = sum(
        a * np.sin(2 * np.pi * f * t + p)
        for a, f, p in zip((0.5, 0.3, 0.1, 0.05), (0.11, 0.37, 0.9, 1.3), phase, strict=True)
    )
    speed = np.gradient(y, H)
    ringing = np.cumsum(rng.normal(0, 0.3, t.size))
    ringing = 15 * np.sin(2 * np.pi * 11 * t + ringing)
    u = VALUES["J"] * np.gradient(speed, H) + VALUES["fv"] * speed + VALUES["fc"] * np.tanh(speed / SCALE) + 0.1
    u = np.asarray(u + ringing, np.float64)
    rec = Record(np.asarray(t, np.float64), u, y + 2e-5 * rng.standard_normal(t.size), "angle", "axis")
    result = found([rec], start="records")
    e = result.estimate
    print(result.verdict, result.held, e.values)
    assert result.rejection is None
    assert e.values["J"] == pytest.approx(VALUES["J"], rel=0.2)
    assert e.values["fc"] == pytest.approx(VALUES["fc"], rel=0.2)


def test_the_shortest_memory_that_shows_small_changes_is_taken(seed: int) -> None:
    rec = record(seed, disturbed=0.5, seconds=40.0)
    shown = {memory: found([rec], memory_s=memory).watched for memory in (0.05, 0.8)}
    few, many = (max(w.change for w in watched) for watched in shown.values())
    assert many < 0.2 < few
    chosen = found([rec], memories_s=(0.05, 0.8, 1.0))
    assert chosen.memory_s == 0.8
    assert chosen.watched == shown[0.8]


@pytest.mark.parametrize(("memories_s", "expected"), [((0.4, 0.8, 2.0), 1.2), ((5.0, 10.0), 5.0)])
def test_no_memory_is_taken_with_which_the_record_is_too_short(
    memories_s: tuple[float, ...], expected: float, seed: int
) -> None:
    """Forty seconds are 33 memories of 1.2 s; the usual memory is taken all the same."""
    assert found([record(seed, disturbed=3.0, seconds=40.0)], memories_s=memories_s).memory_s == expected


def test_outlook(seed: int) -> None:
    """With a long memory all show; with a short one little does; a value of zero has no size."""
    rec = record(seed)
    long = found([rec], memory_s=20.0)
    assert [w.obstacle for w in long.watched] == [None] * 3
    short = found([record(seed, disturbed=3.0)], memory_s=0.05)
    assert Obstacle.NOT_SHOWN in {w.obstacle for w in short.watched}
    drive = one_mass()
    nominal = {**VALUES, "fv": 0.0}
    held = identify(
        Problem(drive, nominal, ("J", "fc"), speed_scale=SCALE), [rec], (),
        IdentificationOptions(start="values", monitored=("fv", "fc")),
    )  # fmt: skip
    assert held.watched[0].obstacle is Obstacle.NO_SIZE


def with_weight(
    seed: int, size: float, seconds: float, *, asked: bool = False, memories_s: tuple[float, ...] = ()
) -> tuple[Record, IdentificationResult]:
    """A record of an axis that bears the weight of a link, which turns with an angle of its own; what it tells."""
    plain = record(seed, seconds=seconds)
    other = np.asarray(1.3 * np.sin(plain.t / 3), np.float64)
    heavy = replace(plain, u=plain.u + size * np.cos(other), signals={"other": other})
    scheduled = scheduled_terms({"tau0": ("cos(other)",)}, [heavy])
    problem = Problem(one_mass(), VALUES, ALL, speed_scale=SCALE, varying={"tau0": ("cos(other)",)})
    options = IdentificationOptions(
        start="values", monitored=("kT", "fv", "fc"), scheduled=scheduled,
        load=asked, memory_s=1.0, memories_s=memories_s,
    )  # fmt: skip
    return with_terms(heavy, scheduled), identify(problem, [with_terms(heavy, scheduled)], (), options)


def test_the_outlook_follows_a_weight_that_is_not_monitored(seed: int) -> None:
    """The same as of the record without the weight; without it in mind, the errors would be those of a wrong drive."""
    heavy, found = with_weight(seed, 5.0, 20.0)
    loaded, light = (
        Outlook(estimate, [rec]).watched(("fv", "fc"), 5.0)
        for estimate, rec in ((found.estimate, heavy), (usual(seed).estimate, record(seed)))
    )
    for own, expected in zip(loaded, light, strict=True):
        assert own.obstacle is None
        assert own.change == pytest.approx(expected.change, rel=0.1)


def test_the_load_is_offered_where_the_record_tells_it(seed: int) -> None:
    """With a memory that is long enough to tell it from the torque constant, and one parameter of four less sure."""
    heavy, found = with_weight(seed, 5.0, 40.0, memories_s=(0.25, 0.5))
    *others, load = found.watched
    assert (load.name, load.obstacle, found.memory_s) == (LOAD, None, 1.0)
    assert load.change < 0.3
    assert [w.name for w in others] == ["kT", "fv", "fc"]
    alone = {w.name: w.change for w in Outlook(found.estimate, [heavy]).watched(("kT", "fv", "fc"), 1.0)}
    assert all(w.change >= alone[w.name] for w in others)
    heavier = with_weight(seed, 10.0, 40.0, memories_s=(0.25, 0.5))[1].watched[-1]
    assert 0.4 * load.change < heavier.change < load.change


@pytest.mark.parametrize(("size", "seconds"), [(0.01, 40.0), (5.0, 30.0)], ids=["a small weight", "too short"])
def test_a_load_that_the_record_does_not_tell_is_not_offered_unless_asked(
    seed: int, size: float, seconds: float
) -> None:
    names = [w.name for w in with_weight(seed, size, seconds)[1].watched]
    assert names == ["kT", "fv", "fc"]
    asked = with_weight(seed, size, seconds, asked=True)[1].watched
    assert [w.name for w in asked] == [*names, LOAD]


def test_a_slow_motion_leaves_enough_for_the_black_box(seed: int) -> None:
    """Sampled each millisecond, with a torque below 1 Hz."""
    t = np.asarray(0.001 * np.arange(20_000), dtype=np.float64)
    u = np.asarray(sum(np.sin(2 * np.pi * f * t + f) for f in (0.1, 0.25, 0.4)))
    speed = np.cumsum(u) * 0.001 / 2.0
    y = np.concatenate(([0.0], np.cumsum(speed)[:-1] * 0.001)) + 1e-6 * np.random.default_rng(seed).standard_normal(
        t.size
    )
    rec = Record(t, u, y, "angle", "slow")
    estimate = fit(Problem(one_mass(), {**VALUES, "fv": 0.0, "fc": 0.0}, ("J",), speed_scale=SCALE), [rec])
    bode = bode_of(estimate, None, [rec])
    assert bode.words == ()
    assert bode.black_box is not None


def test_a_prediction_that_runs_away_says_nothing_aloud(seed: int) -> None:
    """A step into the unstable is rejected; numpy does not warn."""
    rec = record(seed, seconds=10)
    problem = Problem(one_mass(), VALUES, ALL, "output-error", speed_scale=SCALE, bounds={"fv": (-1e6, 1e6)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(replace(problem, nominal={**VALUES, "J": 0.01, "fv": -0.02}), [rec])


def test_times_in_whole_milliseconds_have_frequency_responses(seed: int) -> None:
    """Of samples 10.6 ms apart, most intervals are 11 ms then: longer than that of the drive."""
    rec = record(seed)
    rounded = np.round(0.0106 * np.arange(len(rec)), 3)
    assert np.median(np.diff(rounded)) > 0.0106
    estimate = usual(seed).estimate
    bode = bode_of(replace(estimate, interval_s=0.0106), None, [replace(rec, t=rounded)])
    assert bode.black_box is not None
    assert bode.measured is not None


def test_estimates_that_the_halves_contradict_are_not_stated_as_sure(seed: int) -> None:
    """A torque with the speed that the drive lacks, in one half only: friction is another one there."""
    right = record(seed)
    result = found([right])
    speed = np.gradient(right.y, H)
    off = replace(right, u=right.u + np.where(right.t > right.t[-1] / 2, 2.0 * speed, 0.0))
    wrong = found([off])
    k = wrong.estimate.names.index("fv")
    first_half, other_half = (float(half.theta[half.names.index("fv")]) for half in wrong.verdict.halves)
    assert other_half - first_half == pytest.approx(2.0, abs=0.5)
    assert wrong.estimate.sd[k] > 0.2 * (other_half - first_half)
    assert wrong.estimate.sd[k] > 3 * result.estimate.sd[k]
    assert any("halves of the records do not agree" in words and "fv is" in words for words in wrong.estimate.words)
    assert not any("halves of the records" in words for words in result.estimate.words)


def test_the_balanced_inertia_is_that_of_the_mean_pose() -> None:
    """The inertia follows the pose of another axis that bends little, beside a torque of other links.

    With that term, the halves of the equations differ about it.
    """
    plain, lag = record(3, seconds=60.0), 3
    t, y = plain.t, plain.y
    bent = np.asarray(np.sin(0.15 * np.sin(t / 2.3) - 1.5), np.float64)
    acceleration = (np.roll(y, -lag) - 2 * y + np.roll(y, lag)) / (lag * H) ** 2
    acceleration[: 2 * lag] = acceleration[-2 * lag :] = 0.0
    links = 3.0 * np.sin(3.1 * t) * np.cos(1.7 * t)
    signals = {"own * bent": acceleration * bent}
    moved = replace(plain, u=plain.u + links + 0.8 * acceleration * bent, signals=signals)
    problem = Problem(one_mass(), {**dict.fromkeys(VALUES, 0.0), "kT": 1.0, "J": 1.0}, ALL, speed_scale=SCALE)
    found = hold_balanced_inertia(problem, [moved], ["own * bent"])
    assert found is not None
    assert found.nominal["J"] == pytest.approx(VALUES["J"] + 0.8 * bent.mean(), rel=0.02)


def test_deviations_cover_a_ripple_that_comes_back_with_the_motion(seed: int) -> None:
    """An axis goes to and fro at one speed; its gear takes a torque at each place, another one each way."""
    plain, reported = [], []
    for k in range(4):
        rng, own = np.random.default_rng(seed + k), record(seed + k, one_speed=True, seconds=80.0)
        way = np.sign(np.gradient(own.y))
        ripple = sum(
            0.3 * rng.standard_normal() * np.cos(waves * own.y + rng.uniform(0, 2 * np.pi) + turn * way)
            for waves in (6, 9, 13)
            for turn in (0.0, 1.0)
        )
        problem = Problem(one_mass(), VALUES, ("J", "fc", "tau0"), speed_scale=SCALE)
        estimate = fit(problem, [replace(own, u=own.u + ripple)])
        off = estimate.theta - np.array([VALUES[name] for name in estimate.names])
        plain.append(off / estimate.sd)
        reported.append(off / agreeing(estimate, ()).sd)
    assert np.abs(plain)[:, 0].max() > 4  # of the inertia
    assert np.sqrt(np.mean(np.square(reported), axis=0)).max() < 2.5


def test_halves_that_agree_leave_the_standard_deviations(seed: int) -> None:
    estimate = usual(seed).estimate
    assert agreeing(estimate, (estimate, estimate)).sd == pytest.approx(estimate.sd, rel=1e-12)
    assert agreeing(estimate, ()).sd == pytest.approx(estimate.sd, rel=1e-12)
    moved = replace(estimate, theta=estimate.theta + 5 * np.sqrt(2) * estimate.sd)
    assert agreeing(estimate, (estimate, moved)).sd == pytest.approx(5 * estimate.sd, rel=1e-9)
    far = np.abs(moved.theta - estimate.theta) > 0.5 * np.abs(estimate.theta)
    assert (agreeing(estimate, (estimate, moved)).words != estimate.words) == far.any()
    back = replace(estimate, excess=np.full(estimate.sd.size, 3.0))  # with the motion
    assert agreeing(back, ()).sd == pytest.approx(3 * estimate.sd, rel=1e-12)
    assert agreeing(back, (estimate, moved)).sd == pytest.approx(5 * estimate.sd, rel=1e-9)
    assert agreeing(agreeing(back, ()), ()).sd == pytest.approx(3 * estimate.sd, rel=1e-12)
    near = replace(estimate, theta=estimate.theta + 0.5 * np.sqrt(2) * estimate.sd)
    assert agreeing(estimate, (estimate, near)).sd == pytest.approx(estimate.sd, rel=1e-12)
