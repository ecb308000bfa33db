"""The same monitor in other units, in those of nominal, and at half the rate."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import gains_after
from monitor_core.drive.parameter_names import split_name
from monitor_core.excitation.reference_experiment import NOISE, Experiment
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, H, record
from tests.core.laws import SAMPLES, Way, cases, law, seeds, ways, with_pause


def gentle(case: Case) -> Settings:
    """Steps so small that rounding, which differs in other units, is not magnified."""
    return case.settings(relative_sd=0.002, lam=0.99, alpha1=0.2, alpha2=0.2, settle_s=0.1)


def close(a: Floats, b: Floats) -> bool:
    return bool(np.allclose(a, b, rtol=1e-6, atol=1e-9 * np.nanmax(abs(b), initial=1e-300), equal_nan=True))


class Units(NamedTuple):
    """New units, so many of which are an old one; powers of two."""

    torque: float
    angle: float
    time: float

    def factor(self, unit: str) -> float:
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
        own = {p.name: self.factor(p.unit) for p in model.drive.parameters} | {"kT": 1 / self.torque}
        theta = {n: own[base] ** (-1 if inverse else 1) for n in model.monitored for base, inverse in [split_name(n)]}
        return replace(
            model,
            nominal={name: value * own[name] for name, value in model.nominal.items()},
            scales={n: float(model.scale[model.monitored.index(n)]) * theta[n] for n in model.scales},
            bounds={n: (lo * theta[n], up * theta[n]) for n, (lo, up) in model.bounds.items()},
        )

    def settings(self, s: Settings, model: AxisModel) -> Settings:
        output = self.factor("rad" if model.drive.output == "angle" else "rad/s")
        states = [self.factor(state.unit) for state in model.drive.states]
        ratio = self.model(model).scale / model.scale
        times = ("interval_s", "delay_s", "max_gap_s", "settle_s", "lost_s")
        return replace(
            s,
            **{name: getattr(s, name) * self.time for name in times},
            lam0=s.lam0 * output**2,
            K=tuple(k * x / output for k, x in zip(s.K, states, strict=False)),
            speed_scale=s.speed_scale * self.factor("rad/s"),
            P0=tuple(float(v) for v in np.array(s.P0) * (ratio / output) ** 2),
        )


@law
@given(
    seed=seeds,
    case=cases,
    way=ways,
    exponents=st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.integers(0, 4)),
)
def test_units_scale_results_and_nothing_else(seed: int, case: Case, way: Way, exponents: tuple[int, int, int]) -> None:
    """Torque, angle and time in other units: theta in its units, P and g with it, alarms at the same samples.

    But for the angle where there is weight: its cosine is that of radians; and for the time where outliers are passed
    over: a jolt lasts a second, in whatever unit.
    """
    torque, angle, time = (2.0**e for e in exponents)
    units = Units(torque, angle, 1.0 if "outlier_limit" in way else time)
    if "gravity" in case.name:
        units = units._replace(angle=1.0)
    rec, s, model = with_pause(seed, case), replace(gentle(case), **way), case.model  # type: ignore[arg-type]
    other = units.model(model)
    output = units.factor("rad" if case.output == "angle" else "rad/s")
    t = rec.t_us * round(units.time)
    _, original = AxisMonitor(model, s).update_traced(SampleBlock(*rec))
    _, converted = AxisMonitor(other, units.settings(s, model)).update_traced(
        SampleBlock(t, rec.u * units.torque, rec.y * output)
    )
    size, new = model.scale, other.scale
    assert close(converted.theta / new, original.theta / size)
    assert close(converted.g / new, original.g / size)
    assert close(converted.P * output**2 / new**2, original.P / size**2)
    assert close(converted.eps / output, original.eps)


@law
@given(seed=seeds, case=st.sampled_from([c for c in CASES if c.output != "mean speed"]))
def test_a_missing_sample_is_a_double_interval(seed: int, case: Case) -> None:
    """With every second sample missing, the monitor is the one of half the rate: its lambda, its gain, torque held.

    Not of a drive that averages the speed: it does so over its own cycle, whatever comes through.
    """
    s = replace(gentle(case), lost_s=0.0)
    if s.K:
        s = replace(s, K_after=gains_after(case.model, H, case.torque_noise, NOISE[case.output]))
    slow = replace(s, interval_s=2 * H, lam=s.lam**2, K=s.K_after[1] if s.K else (), K_after=())
    rec = record(seed, case, SAMPLES)
    half = SampleBlock(*Experiment(rec.t_us[::2], rec.u[::2], rec.y[::2]))
    (_, missing), (_, double) = (AxisMonitor(case.model, x).update_traced(half) for x in (s, slow))
    for a, b in zip(missing, double, strict=True):
        assert close(a, b)
