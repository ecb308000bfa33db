"""Axes, settings and records that the tests of the engine share."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import Drive, Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import NOISE, Experiment
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.settings import Settings
from tests.core.chains import chain, values

FRICTION = {**REFERENCE_VALUES, "fc": 0.4, "tau0": 0.1}
H = 0.005


class Case(NamedTuple):
    """An axis that is monitored in a certain way."""

    name: str
    output: Output
    monitored: tuple[str, ...]
    values: Mapping[str, float] = FRICTION
    torque_noise: float = 0.05
    delay_s: float = 0.0
    zero: tuple[str, ...] = ()  # parameters whose nominal value is zero though the true one is not
    drive: Callable[[Output], Drive] = three_mass
    speed_scale: float = 1.0
    lost_s: float = 0.0
    joint: bool = False
    within: float | None = None  # share of their sizes by which the monitored parameters may change

    @property
    def model(self) -> AxisModel:
        nominal = {k: 0.0 if k in self.zero else v for k, v in self.values.items()}
        scales = {name: abs(self.values[name]) for name in self.zero}
        free = AxisModel(self.drive(self.output), nominal, self.monitored, scales)
        if self.within is None:
            return free
        bounds = free.theta0[:, np.newaxis] + np.outer(free.scale, (-self.within, self.within))
        return replace(free, bounds={n: (lo, up) for n, (lo, up) in zip(self.monitored, bounds, strict=True)})

    def settings(self, relative_sd: float = 0.01, **changes: float | bool | tuple[float, ...]) -> Settings:
        """Settings with this standard deviation (relative) of theta at the start."""
        gain, lam0 = filter_gain(self.model, H, self.torque_noise, NOISE[self.output])
        start = (relative_sd * self.model.scale) ** 2 / lam0
        own = {
            "K": tuple(gain) if self.torque_noise else (),
            "lost_s": self.lost_s,
            "joint_state": self.joint,
            "lam0": lam0,
            "delay_s": self.delay_s,
            "max_gap_s": 0.05,
            "settle_s": 0.3,
            "speed_scale": self.speed_scale,
            "P0": tuple(start),
        }
        return Settings.paper(H, **(own | changes))


def delayed(output: Output) -> Drive:
    return three_mass(output).with_delay()


def averaged(output: Output) -> Drive:
    """Of the speed, where that is asked for."""
    return three_mass(output)


PAPER = ("kT", "1/Ja", "fm")
CASES = (
    Case("paper", "speed", PAPER, REFERENCE_VALUES, torque_noise=0.0),
    Case("speed-output-error-late", "speed", ("Jm", "fc", "tau0"), torque_noise=0.0, delay_s=0.0013),
    Case("speed-zero-nominals", "speed", ("fc", "fm", "tau0"), zero=("fc", "tau0")),
    Case("speed-springs", "speed", ("1/Jm", "kg", "ka"), delay_s=0.005),
    Case("speed-skew", "speed", ("1/Jm", "fm", "delay"), {**FRICTION, "delay": 0.001}, drive=delayed),
    Case(
        "angle-skew",
        "angle",
        ("kg", "delay", "kT"),
        {**FRICTION, "delay": 0.0005},
        zero=("delay",),
        drive=delayed,
    ),
    Case("mean-speed", "mean speed", ("kT", "1/Ja", "r"), FRICTION, drive=averaged, delay_s=0.0045),
    Case("mean-speed-output-error", "mean speed", PAPER, REFERENCE_VALUES, torque_noise=0.0, drive=averaged),
    Case("speed-joint", "speed", ("kT", "fc", "ka"), torque_noise=0.0, joint=True),
    Case("angle-joint", "angle", ("Jm", "fc", "kg"), delay_s=0.001, joint=True),
    Case("angle-paper", "angle", PAPER, REFERENCE_VALUES, torque_noise=0.01),
    Case("angle-friction", "angle", ("fc", "tau0", "1/kT"), zero=("fc", "tau0"), delay_s=0.002),
    Case("angle-gear", "angle", ("r", "Jg", "da")),
    Case("angle-alone", "angle", ("fc",), torque_noise=0.2),
    Case(
        "gravity",
        "angle",
        ("fa", "gc", "gs"),
        values(2),
        delay_s=0.001,
        zero=("gc",),
        drive=partial(chain, 2),
    ),
    Case(
        "gravity-behind-the-gear",
        "angle",
        ("r", "fc", "gs"),
        values(2),
        drive=partial(chain, 2, sensor="gear"),
        speed_scale=3.0,
        within=0.5,  # further away the weight falls over, and the predictor magnifies rounding
    ),
    Case(
        "speed-behind-the-gear",
        "speed",
        ("fa", "fc", "1/J2"),
        values(2, gravity=False),
        drive=partial(chain, 2, sensor="gear", gravity=False),
        speed_scale=0.3,
    ),
)
BY_NAME = {case.name: case for case in CASES}


def as_columns(rec: Experiment) -> Experiment:
    """A record as the samples of a batch of one axis."""
    return Experiment(rec.t_us[:, np.newaxis], rec.u[:, np.newaxis], rec.y[:, np.newaxis])


def record(
    seed: int,
    case: Case,
    samples: int,
    *,
    jitter: float = 0.0,
    gaps: int = 0,
    true: Mapping[str, float] | None = None,
) -> Experiment:
    """A record with noise; the share ``jitter`` of its intervals is anything from 1 to 50 ms.

    The plant knows no torque delay; ``true`` are its values, by default those of the case.
    """
    rng = np.random.default_rng(seed)
    h_us = np.where(rng.random(samples) < jitter, rng.integers(1000, 50_001, samples), round(H * 1e6))
    h_us[rng.choice(np.arange(10, samples), gaps, replace=False)] = 300_000
    u = multisine(rng, samples, H, (0.0, 30.0), 1.23)
    axis = SimulatedAxis(true or case.values, case.speed_scale, drive=case.drive("angle"))
    motion = [axis.step(torque, h * 1e-6) for torque, h in zip(u[:-1], h_us[1:], strict=True)]
    angle, speed = np.array([(0.0, 0.0), *motion]).T
    mean = np.append(0.0, np.diff(angle) / (h_us[1:] * 1e-6))
    y = {"angle": angle, "speed": speed, "mean speed": mean}[case.output]
    t_us = np.cumsum(h_us) - h_us[0]
    return Experiment(t_us.astype(np.int64), u, y + NOISE[case.output] * rng.standard_normal(samples))
