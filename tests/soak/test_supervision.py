"""A day of an axis that hardly moves, and a hundred million updates of P."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, faulty
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import steady_p
from tests.core.supervised import FLOOR, MODEL, SUPERVISED, TORQUE_NOISE, H

pytestmark = pytest.mark.soak

HOUR = round(3600 / H)
CHUNK = 100_000
UPDATES = 100_000_000


class Axis:
    """The reference drive, run on in chunks, and its monitor."""

    def __init__(self, settings: Settings, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.monitor = AxisMonitor(MODEL, settings)
        self.x: Floats | None = None
        self.samples = 0
        self.alarms: list[tuple[int, str]] = []

    def run(self, kind: str, samples: int, fault: dict[str, float] | None = None) -> None:
        values = faulty(REFERENCE_VALUES, fault or {})
        for start in range(0, samples, CHUNK):
            u = self._torque(kind, min(CHUNK, samples - start))
            moved = 0.0 if kind == "braked" else TORQUE_NOISE
            acting = (u + moved * self.rng.standard_normal(len(u)))[:, np.newaxis]
            y, self.x = simulate_linear(three_mass("speed"), values, acting, H, self.x)
            t = self.samples + np.arange(len(u))
            noisy = y[:, 0] + self.rng.standard_normal(len(u))
            block = SampleBlock((t * round(H * 1e6)).astype(np.int64), u, noisy)
            changes = self.monitor.update(block)
            self.alarms += [(alarm.raised_us, alarm.parameter) for kind, alarm in changes if kind == "raised"]
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
        st, P0 = self.monitor.batch.state, np.array(self.monitor.settings.P0)
        P = st.P[:, :, 0] / np.sqrt(np.outer(P0, P0))
        assert (P == P.T).all()
        assert np.linalg.eigvalsh(P).min() > 0
        assert np.diag(P).max() <= 1 / FLOOR
        assert (abs(st.theta[:, 0] / MODEL.theta0 - 1) < 2).all()


@pytest.fixture(scope="module")
def settings() -> Settings:
    return replace(SUPERVISED, P0=steady_p(MODEL, SUPERVISED, range(50)))


FRESH, AGAIN, FAULTY = 4000, 1000, 3000
"""Samples: of motion before the fault without a pause, with one, and behind the fault."""
AXES = 200


def delays(settings: Settings, fault: dict[str, float], seed: int, day: Axis | None) -> Floats:
    """Seconds to the first alarm of the fault (AXES,): of axes that go on from the end of the day, or fresh ones.

    They differ in torque and noise only.  None in the time there is counts as all of it.
    """
    rng, lively = np.random.default_rng((seed, day is None)), AGAIN if day else FRESH
    bank = AxisBatch([MODEL] * AXES, [replace(settings, run_on=True)] * AXES)
    x = None
    if day:
        assert day.x is not None
        x = np.repeat(day.x, AXES, axis=1)
        for a in range(AXES):
            bank.restore(a, *day.monitor.batch.column(0))
    crossed, found = settings.alpha2 * MODEL.scale, np.full(AXES, FAULTY)
    for values, samples in ((REFERENCE_VALUES, lively), (faulty(REFERENCE_VALUES, fault), FAULTY)):
        u = np.stack([multisine(rng, samples, H, BAND_HZ, TORQUE_RMS) for _ in range(AXES)], axis=1)
        acting = u + TORQUE_NOISE * rng.standard_normal(u.shape)
        y, x = simulate_linear(three_mass("speed"), values, acting, H, x)
        start = (day.samples if day else 0) + (0 if values is REFERENCE_VALUES else lively)
        t = (start + np.arange(samples, dtype=np.int64))[:, np.newaxis] * round(H * 1e6)
        trace = bank.trace(np.repeat(t, AXES, axis=1), u, y + rng.standard_normal(u.shape))
        over = trace.g[:, :, MODEL.monitored.index(next(iter(fault)))].max(axis=1) > crossed[0]
        found = np.where(over.any(axis=0), over.argmax(axis=0), samples)
    return np.asarray(found * H)


@pytest.mark.parametrize(
    ("lam", "joint", "fault"), [(0.995, False, {"kT": 1.2}), (0.98, True, {"kT": 1.5})], ids=["1s", "0.25s"]
)
@pytest.mark.parametrize("kind", ["standing", "braked", "constant speed", "sine"])
def test_a_day_with_an_hour_of_motion(kind: str, lam: float, joint: bool, fault: dict[str, float], seed: int) -> None:
    """The fault comes right after the long pause and five seconds of motion: medians of 200 axes each.

    With 0.98, a quarter of a second, a change of 20 % would be four standard deviations: the fault is larger there.
    That memory is as short as the predictor's slowest time constant, for which the state has to move with theta:
    without, a day of a sine raised six alarms of fm.
    """
    settings = replace(SUPERVISED, lam=lam, joint_state=joint)
    settings = replace(settings, P0=steady_p(MODEL, settings, range(50)))
    day = Axis(settings, seed)
    day.run("moving", HOUR)
    day.run(kind, 23 * HOUR)
    print(f"\n24 h, 23 of them {kind}: alarms {day.alarms}, counters {day.monitor.status().counters}")
    assert day.alarms == []
    rested, fresh = delays(settings, fault, seed, day), delays(settings, fault, seed, None)
    ratio = np.median(rested) / np.median(fresh)
    print(f"delay after the pause {np.median(rested):.2f} s, without one {np.median(fresh):.2f} s: {ratio:.3f}")
    assert 0.8 < ratio < 1.2


def test_a_hundred_million_updates(settings: Settings, seed: int) -> None:
    axis = Axis(replace(settings, min_excitation=0.0), seed)
    kinds = ("moving", "standing", "constant speed", "sine")
    while axis.monitor.status().counters["used"] < UPDATES:
        axis.run(str(axis.rng.choice(kinds)), CHUNK)
    print(f"\n{axis.monitor.status().counters['used']} updates: P symmetric and positive definite throughout")
