"""Laws of the engine: other units, half the rate, and every way to supervise."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm, AlarmKey
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import gains_after
from monitor_core.drive.structure import split_name
from monitor_core.excitation.reference_experiment import NOISE, Experiment
from monitor_core.monitoring import AlarmChange, AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, H, as_columns, record
from tests.core.laws import SAMPLES, lively, part, state

WAYS: tuple[Mapping[str, float | bool], ...] = (
    {"information_floor": 0.05, "min_excitation": 0.05},
    {"information_floor": 0.3},
    {"min_excitation": 0.3},
    {"joint_state": True},
    {"outlier_limit": 3.0},
    {"covariance_reset": 20.0},
    {"random_walk": True},
    {
        "information_floor": 0.05,
        "min_excitation": 0.05,
        "joint_state": True,
        "outlier_limit": 4.0,
        "covariance_reset": 5.0,
    },
    {"information_floor": 0.1, "min_excitation": 0.05, "joint_state": True, "random_walk": True},
)
seeds, cases, ways = st.integers(0, 2**32 - 1), st.sampled_from(CASES), st.sampled_from(WAYS)
law = settings(deadline=None, max_examples=80)


def with_pause(seed: int, case: Case, samples: int = SAMPLES) -> Experiment:
    """With lost samples, outliers, and without torque in its second half."""
    rec = record(seed, case, samples, jitter=0.3, gaps=1)
    rng = np.random.default_rng(seed)
    rec.u[samples // 2 :] = 0.0
    rec.y[rng.choice(samples, 3, replace=False)] += 30 * NOISE[case.output]
    return rec


def watched(case: Case, way: Mapping[str, float | bool]) -> Settings:
    return replace(lively(case), **way)  # type: ignore[arg-type]


def gentle(case: Case) -> Settings:
    """Steps so small that rounding, which differs in other units, is not magnified."""
    return case.settings(relative_sd=0.002, lam=0.99, alpha1=0.2, alpha2=0.2, settle_s=0.1)


@law
@given(seed=seeds, case=cases, way=ways, cut=st.integers(0, SAMPLES))
def test_however_supervised_blocks_may_end_anywhere_and_states_be_saved(
    seed: int, case: Case, way: Mapping[str, float | bool], cut: int
) -> None:
    rec = with_pause(seed, case)
    whole, before, after = (AxisMonitor(case.model, watched(case, way)) for _ in range(3))
    expected = whole.update(SampleBlock(*rec))
    found = before.update(SampleBlock(*part(rec, 0, cut)))
    after.from_arrays({name: array.copy() for name, array in before.to_arrays().items()})
    changes = [*found, *after.update(SampleBlock(*part(rec, cut)))]
    assert _latest(changes) == _latest(expected)
    assert state(after) == state(whole)


def _latest(changes: Iterable[AlarmChange]) -> dict[AlarmKey, Alarm]:
    """Each alarm in its latest form: of two blocks, an alarm may be raised in one and renamed in the other."""
    return {change.alarm.key: change.alarm for change in changes}


@law
@given(seed=seeds, case=cases, way=ways)
def test_however_supervised_a_fleet_is_its_axes(
    seed: int, case: Case, way: Mapping[str, float | bool]
) -> None:
    """Nine, which run side by side, each with its own record."""
    rng, W = np.random.default_rng(seed), 9
    models, records = [], [with_pause(seed + a, case, 60) for a in range(W)]
    for _ in range(W):
        values = {name: v * rng.uniform(0.9, 1.1) for name, v in case.model.nominal.items()}
        models.append(replace(case.model, nominal=values))
    fleet = AxisBatch(models, [watched(case, way)] * W)
    events = fleet.run(*(np.stack(columns, axis=1) for columns in zip(*records, strict=True)))
    for a, (model, rec) in enumerate(zip(models, records, strict=True)):
        alone = AxisBatch([model], [watched(case, way)])
        expected = alone.run(*as_columns(rec))
        assert [event for axis, event in events if axis == a] == [event for _, event in expected]
        assert state(AxisMonitor.of_lane(fleet, a)) == state(AxisMonitor.of_lane(alone, 0))


class Units(NamedTuple):
    """New units, so many of which are an old one; powers of two."""

    torque: float
    angle: float
    time: float

    def of(self, unit: str) -> float:
        factors = {
            "kg m^2": self.time**2 / self.angle,
            "N m/rad": 1 / self.angle,
            "N m s/rad": self.time / self.angle,
            "N m": 1.0,
            "s": self.time,
            "1": 1.0,
            "rad": self.angle,
            "rad/s": self.angle / self.time,
        }
        return factors[unit]

    def model(self, model: AxisModel) -> AxisModel:
        own = {p.name: self.of(p.unit) for p in model.drive.parameters} | {"kT": 1 / self.torque}
        nominal = {name: value * own[name] for name, value in model.nominal.items()}
        sizes = {n: s * self.theta(n, own) for n, s in zip(model.monitored, model.scale, strict=True)}
        bounds = {
            n: (lo * self.theta(n, own), up * self.theta(n, own)) for n, (lo, up) in model.bounds.items()
        }
        return replace(model, nominal=nominal, scales={n: sizes[n] for n in model.scales}, bounds=bounds)

    def theta(self, name: str, own: Mapping[str, float]) -> float:
        base, inverse = split_name(name)
        return 1 / own[base] if inverse else own[base]

    def settings(self, s: Settings, model: AxisModel) -> Settings:
        output = self.of("rad" if model.drive.output == "angle" else "rad/s")
        states = [self.of(one.unit) for one in model.drive.states]
        ratio = self.model(model).scale / model.scale
        times = ("interval_s", "delay_s", "max_gap_s", "settle_s", "lost_s")
        return replace(
            s,
            **{name: getattr(s, name) * self.time for name in times},
            lam0=s.lam0 * output**2,
            K=tuple(k * x / output for k, x in zip(s.K, states, strict=False)),
            speed_scale=s.speed_scale * self.of("rad/s"),
            P0=tuple(float(v) for v in np.array(s.P0) * (ratio / output) ** 2),
        )


@law
@given(
    seed=seeds,
    case=cases,
    way=ways,
    exponents=st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.integers(0, 4)),
)
def test_units_scale_results_and_nothing_else(
    seed: int, case: Case, way: Mapping[str, float | bool], exponents: tuple[int, int, int]
) -> None:
    """Torque, angle and time in other units: theta in its units, P and g with it, alarms at the same samples.

    But for the angle where there is weight: its cosine is that of radians.
    """
    units = Units(*(2.0**e for e in exponents))
    if "gravity" in case.name:
        units = units._replace(angle=1.0)
    rec, s, model = with_pause(seed, case), replace(gentle(case), **way), case.model  # type: ignore[arg-type]
    other = units.model(model)
    output = units.of("rad" if case.output == "angle" else "rad/s")
    t = rec.t_us * round(units.time)
    _, here = AxisMonitor(model, s).update_traced(SampleBlock(*rec))
    _, there = AxisMonitor(other, units.settings(s, model)).update_traced(
        SampleBlock(t, rec.u * units.torque, rec.y * output)
    )
    size, new = model.scale, other.scale
    assert close(there.theta / new, here.theta / size)
    assert close(there.g / new, here.g / size)
    assert close(there.P * output**2 / new**2, here.P / size**2)
    assert close(there.eps / output, here.eps)


def close(a: Floats, b: Floats) -> bool:
    return bool(np.allclose(a, b, rtol=1e-6, atol=1e-9 * np.nanmax(abs(b), initial=1e-300), equal_nan=True))


@law
@given(seed=seeds, case=st.sampled_from([c for c in CASES if c.output != "mean speed"]))
def test_a_missing_sample_is_a_double_interval(seed: int, case: Case) -> None:
    """With every second sample missing, the monitor is the one of half the rate: its lambda, its gain, torque held.

    Not of a drive that averages the speed: it does so over its own cycle, whatever comes through.
    """
    s = gentle(case)
    if s.K:
        noises = H, case.torque_noise, NOISE[case.output]
        s = replace(s, K_after=gains_after(case.model, *noises))
    slow = replace(
        s, interval_s=2 * H, lam=s.lam**2, K=s.K_after[1] if s.K else (), K_after=(), delay_s=s.delay_s
    )
    rec = record(seed, case, SAMPLES)
    half = Experiment(rec.t_us[::2], rec.u[::2], rec.y[::2])
    _, missing = AxisMonitor(case.model, replace(s, lost_s=0.0)).update_traced(SampleBlock(*half))
    _, double = AxisMonitor(case.model, replace(slow, lost_s=0.0)).update_traced(SampleBlock(*half))
    for a, b in zip(missing, double, strict=True):
        assert close(a, b)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_the_ways_differ(way: Mapping[str, float | bool], seed: int) -> None:
    """Else the laws above would hold of one way only."""
    ends = []
    for settings_ in ({}, way):
        total = 0.0
        for k, case in enumerate(CASES):
            monitor = AxisMonitor(case.model, watched(case, settings_))
            monitor.update(SampleBlock(*with_pause(seed + k, case)))
            total += float((monitor.batch.state.theta[:, 0] / case.model.scale).sum())
        ends.append(total)
    assert ends[0] != ends[1]
