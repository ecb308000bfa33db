"""Axes with two outputs, angle and speed, and samples of them."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import Gains, gains_of_both
from monitor_core.drive.structure import Drive
from monitor_core.excitation import multisine
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.settings import Settings
from tests.core.cases import FRICTION, H
from tests.core.chains import chain, values

TORQUE, ANGLE, SPEED = 0.05, 1e-3, 0.1
"""Standard deviations of the noises."""
PAPER = ("kT", "1/Ja", "fm")


class Samples(NamedTuple):
    """Of one axis, as AxisMonitor.run takes them, and the speed."""

    t_us: NDArray[np.int64]
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    y2: NDArray[np.float64]


class Case(NamedTuple):
    """An axis with both outputs."""

    name: str
    drive: Drive
    monitored: tuple[str, ...]
    values: dict[str, float]

    @property
    def model(self) -> AxisModel:
        return AxisModel(self.drive.with_speed(), self.values, self.monitored)

    def settings(self, **changes: Any) -> Settings:
        g = _gains(self.name)
        own: dict[str, Any] = {
            "K": g.K,
            "lam0": g.lam0,
            "K_after": g.K_after,
            "second": g.second,
            "settle_s": 0.3,
        }
        own["P0"] = tuple((0.01 * self.model.scale) ** 2 / g.lam0)
        return Settings(H, **(own | changes))


CASES = (
    Case("paper", three_mass("angle"), PAPER, dict(REFERENCE_VALUES)),
    Case("friction", three_mass("angle"), ("fc", "Jm", "kg"), FRICTION),
    Case("delay", three_mass("angle").with_delay(), ("fm", "delay", "ka"), {**FRICTION, "delay": 0.001}),
    # The speed behind the gear is r times that of a state, so that C2 hangs on theta.
    Case("gear", chain(2, "angle", sensor="gear", gravity=False), ("r", "1/J2"), values(2, gravity=False)),
)


@cache
def _gains(name: str) -> Gains:
    (case,) = (case for case in CASES if case.name == name)
    return gains_of_both(case.model, H, TORQUE, ANGLE, SPEED)


def samples(seed: int, case: Case, number: int, missing: float = 0.2, jitter: float = 0.3) -> Samples:
    """With friction, jitter from 1 to 50 ms, one gap, and speeds that are missing."""
    rng = np.random.default_rng(seed)
    h_us = np.where(rng.random(number) < jitter, rng.integers(1000, 50_001, number), round(H * 1e6))
    if jitter:
        h_us[rng.integers(10, number)] = 300_000
    u = multisine(rng, number, H, (0.0, 30.0), 1.23)
    axis = SimulatedAxis(case.values, drive=case.drive)
    motion = [axis.step(torque, h * 1e-6) for torque, h in zip(u[:-1], h_us[1:], strict=True)]
    y, y2 = np.array([(0.0, 0.0), *motion]).T + rng.standard_normal((2, number)) * [[ANGLE], [SPEED]]
    y2[rng.random(number) < missing] = np.nan
    return Samples((np.cumsum(h_us) - h_us[0]).astype(np.int64), u, y, y2)


def part(of: Samples, start: int, stop: int | None = None) -> Samples:
    return Samples(of.t_us[start:stop], of.u[start:stop], of.y[start:stop], of.y2[start:stop])


def lively(case: Case, **changes: Any) -> Settings:
    """Large steps, low thresholds, bounds and outliers: much happens in few samples."""
    start = tuple((0.05 * case.model.scale) ** 2 / case.settings().lam0)
    few = {
        "lam": 0.97,
        "alpha1": 0.2,
        "alpha2": 0.2,
        "settle_s": 0.1,
        "P0": start,
        "floor": 0.05,
        "starved": 0.05,
    }
    return case.settings(**{**few, "outlier": 4.0, **changes})
