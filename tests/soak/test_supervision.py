"""A day of an axis that hardly moves, and a hundred million updates of P."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.excitation import multisine
from monitor_core.kernel.tables import Floats
from monitor_core.library import REFERENCE_VALUES, three_mass
from monitor_core.monitor import AxisMonitor
from monitor_core.reference import BAND_HZ, TORQUE_RMS, faulty
from monitor_core.settings import Settings
from monitor_core.simulation import simulate_linear
from tests.core.figures import steady_p
from tests.core.test_supervision import FLOOR, MODEL, SUPERVISED, TORQUE_NOISE, H

pytestmark = pytest.mark.soak

HOUR = round(3600 / H)
CHUNK = 100_000
UPDATES = 100_000_000


class Axis:
    """The reference drive, run on in chunks, and its monitor."""

    def __init__(self, settings: Settings, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.monitor = AxisMonitor.alone(MODEL, settings)
        self.x: Floats | None = None
        self.samples = 0
        self.alarms: list[tuple[int, str]] = []

    def run(self, kind: str, samples: int, fault: dict[str, float] | None = None) -> None:
        values = faulty(REFERENCE_VALUES, fault or {})
        for start in range(0, samples, CHUNK):
            u = self._torque(kind, min(CHUNK, samples - start))
            acting = (u + TORQUE_NOISE * self.rng.standard_normal(len(u)))[:, np.newaxis]
            y, self.x = simulate_linear(three_mass("speed"), values, acting, H, self.x)
            t = self.samples + np.arange(len(u))
            noisy = y[:, 0] + self.rng.standard_normal(len(u))
            episodes = self.monitor.run((t * round(H * 1e6)).astype(np.int64), u, noisy)
            self.alarms += [
                (e.raised_us, e.parameter) for e in episodes if e.crossings == 1 and not e.ended_us
            ]
            self.samples += len(u)
            self.check()

    def _torque(self, kind: str, n: int) -> Floats:
        t = (self.samples + np.arange(n)) * H
        if kind == "moving":
            return multisine(self.rng, n, H, BAND_HZ, TORQUE_RMS)
        if kind == "sine":
            return np.asarray(1.5 * np.sin(2 * np.pi * 1.3 * t))
        return np.full(n, 0.5 if kind == "constant speed" else 0.0)

    def check(self) -> None:
        st, P0 = self.monitor.bank.state, np.array(self.monitor.settings.P0)
        P = st.P[:, :, 0] / np.sqrt(np.outer(P0, P0))
        assert (P == P.T).all()
        assert np.linalg.eigvalsh(P).min() > 0
        assert np.diag(P).max() <= 1 / FLOOR
        assert (abs(st.theta[:, 0] / MODEL.theta0 - 1) < 2).all()


@pytest.fixture(scope="module")
def settings() -> Settings:
    return replace(SUPERVISED, P0=steady_p(MODEL, SUPERVISED, range(50)))


def delay_s(axis: Axis, fault: dict[str, float]) -> float:
    before, at = len(axis.alarms), axis.samples
    axis.run("moving", 4000, fault)
    raised, name = axis.alarms[before]
    assert name == next(iter(fault))
    return raised * 1e-6 - at * H


@pytest.mark.parametrize("kind", ["standing", "constant speed", "sine"])
def test_a_day_with_an_hour_of_motion(kind: str, settings: Settings, seed: int) -> None:
    """The fault comes right after the long pause and five seconds of motion; the median of nine such days' ends."""
    day = Axis(settings, seed)
    day.run("moving", HOUR)
    day.run(kind, 23 * HOUR)
    print(f"\n24 h, 23 of them {kind}: alarms {day.alarms}, counters {day.monitor.facts().counters}")
    assert day.alarms == []
    rested, fresh = [], []
    for k in range(9):
        axis = Axis(settings, seed + k)
        axis.monitor.from_arrays(day.monitor.to_arrays())
        axis.x, axis.samples = day.x, day.samples
        axis.run("moving", 1000)
        rested.append(delay_s(axis, {"kT": 1.2}))
        other = Axis(settings, seed + k)
        other.run("moving", 4000)
        fresh.append(delay_s(other, {"kT": 1.2}))
    print(f"delay after the pause {np.median(rested):.2f} s, without one {np.median(fresh):.2f} s")
    assert np.median(rested) < 1.2 * np.median(fresh)


def test_a_hundred_million_updates(settings: Settings, seed: int) -> None:
    axis = Axis(replace(settings, starved=0.0), seed)
    kinds = ("moving", "standing", "constant speed", "sine")
    while axis.monitor.facts().counters["used"] < UPDATES:
        axis.run(str(axis.rng.choice(kinds)), CHUNK)
    print(f"\n{axis.monitor.facts().counters['used']} updates: P symmetric and positive definite throughout")
