"""Healthy axes with white and with coloured innovations: records to calibrate on, and how often thresholds alarm."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from monitor_core.arrays import Floats
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS
from monitor_core.kernel.compile import entry
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model
from monitor_core.monitoring import AxisBatch
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings, Threshold

TORQUE_NOISE, OUTPUT_NOISE = 0.3, 1.0
MEMORY = 200
LANES = 32
CHUNK = 20 * MEMORY
"""Samples made and run at once."""
MOTION = 50 * MEMORY
"""Samples of one motion; then another is drawn, as how often a test alarms differs from motion to motion."""


class Plant(NamedTuple):
    """An axis, how it is watched, and the colour of what disturbs its torque (pole; 0: white)."""

    model: AxisModel
    settings: Settings
    colour: float

    @property
    def axis(self) -> MonitoredAxis:
        """What is calibrated."""
        return MonitoredAxis(self.model, self.settings)


def plant_with(colour: float, memory: int = MEMORY) -> Plant:
    """The reference drive; its predictor believes that the torque noise is white."""
    model = reference_model("speed")
    gain, lam0 = filter_gain(model, INTERVAL_S, TORQUE_NOISE, OUTPUT_NOISE)
    lam = 1 - 1 / memory
    settings = Settings.paper(INTERVAL_S, lam=lam, lam0=lam0, K=tuple(float(k) for k in gain), settle_s=1.0)
    return Plant(model, settings, colour)


class Axes:
    """Axes side by side, each with torque and noise of its own, in chunks without end."""

    def __init__(self, plant: Plant, rng: np.random.Generator, axes: int) -> None:
        self._plant, self._rng, self._axes = plant, rng, axes
        self._torque = np.zeros((0, axes))
        self._x: Floats | None = None
        self._state = np.zeros((1, axes))
        self._at = 0
        self.values: Mapping[str, float] = REFERENCE_VALUES
        """Of the drive from now on"""

    def take(self, samples: int) -> SampleBlock:
        """The next samples: t_us, u and y (samples, axes)."""
        index = np.arange(self._at, self._at + samples)
        while len(self._torque) < samples:
            self._torque = np.concatenate([self._torque, self._motion()])
        u, self._torque = self._torque[:samples], self._torque[samples:]
        noise = self._rng.standard_normal(u.shape)
        if a := self._plant.colour:
            noise, self._state = lfilter([np.sqrt(1 - a * a)], [1, -a], noise, axis=0, zi=self._state)
        acting = u + TORQUE_NOISE * noise
        y, self._x = simulate_linear(self._plant.model.drive, self.values, acting, INTERVAL_S, self._x)
        y += OUTPUT_NOISE * self._rng.standard_normal(u.shape)
        self._at += samples
        t_us = np.repeat(index[:, np.newaxis] * round(INTERVAL_S * 1e6), self._axes, axis=1)
        return SampleBlock(t_us, u, y, name="simulated")

    def _motion(self) -> Floats:
        """Torque (MOTION, axes)."""
        each = [multisine(self._rng, MOTION, INTERVAL_S, BAND_HZ, TORQUE_RMS) for _ in range(self._axes)]
        return np.stack(each, axis=1)


def record(plant: Plant, seed: int, samples: int) -> SampleBlock:
    """A healthy record of one axis."""
    axis = Axes(plant, np.random.default_rng(seed), 1).take(samples)
    return SampleBlock(axis.t_us[:, 0], axis.u[:, 0], axis.y[:, 0], name="simulated")


def count(plant: Plant, settings: Sequence[tuple[Threshold, ...]], seed: int, samples: int) -> tuple[Floats, int]:
    """False alarms with each of these thresholds (len(settings),), all tests together, in so many samples of watching.

    Healthy axes are watched with all of them at once.
    """
    axes = Axes(plant, np.random.default_rng(seed), LANES)
    batch = AxisBatch([plant.model] * LANES, [plant.axis.without_tests.settings] * LANES)
    values = [[(t.alpha1, t.alpha2, t.allowance) for t in each] for each in settings]
    own = np.ascontiguousarray(np.moveaxis(np.array(values), 0, -1))  # (p, 3, settings)
    g = np.zeros((LANES, len(own), 2, len(settings)))
    alarms, seen, scale = np.zeros(len(settings)), 0, plant.model.scale
    start = plant.settings.seed_updates + 400
    chunk = axes.take(start)
    batch.run(chunk.t_us, chunk.u, chunk.y)
    while seen < samples:
        chunk = axes.take(CHUNK)
        trace = batch.trace(chunk.t_us, chunk.u, chunk.y)
        d = (trace.theta - plant.model.theta0[:, np.newaxis]) / scale[:, np.newaxis]
        s = np.sqrt(plant.settings.lam0 * trace.P) / scale[:, np.newaxis]
        _cusum(d, s, own, g, alarms)
        seen += CHUNK * LANES
    return alarms, seen


@entry
def _cusum(d: Floats, s: Floats, own: Floats, g: Floats, alarms: Floats) -> None:
    for w in range(d.shape[2]):
        for i in range(d.shape[1]):
            alpha1, h, allowance = own[i]
            up, down = g[w, i]
            for k in range(d.shape[0]):
                deviation, sd = d[k, i, w], s[k, i, w]
                for c in range(alarms.size):  # innermost: side by side
                    nu = alpha1[c] * sd + allowance[c]
                    more, less = max(0.0, up[c] + deviation - nu), max(0.0, down[c] - deviation - nu)
                    alarms[c] += (1.0 if more > h[c] else 0.0) + (1.0 if less > h[c] else 0.0)
                    up[c] = 0.0 if more > h[c] else more
                    down[c] = 0.0 if less > h[c] else less
