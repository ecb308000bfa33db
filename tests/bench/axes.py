"""Banks of axes with their records, to be timed: the reference axis, and one of five masses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS, Experiment, experiments
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, reference_model
from monitor_core.monitoring import AxisBatch, Fleet
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.chains import chain, values
from tests.core.figures import ANGLE_TORQUE_NOISE, settings_of

ONE_BY_ONE, LANES = 1_000_000, 1
"""Values of FEWEST_LANES that force a shape of the kernel."""

SUPERVISED = 0.05
"""Floor and starved, the defaults of a configuration."""

BLOCKS = 10
"""Blocks until a record begins again."""


@cache
def settings(output: Output, seed: int) -> Settings:
    """Of the reference experiment, with P(0), so that theta moves from the start, and P supervised as in the daemon."""
    return replace(settings_of(output, seed), information_floor=SUPERVISED, min_excitation=SUPERVISED)


def run_of(output: Output, axes: int, samples: int, seed: int) -> Callable[[], object]:
    """A call that runs the next so many samples of so many axes; three masses, kT, 1/Ja and fm."""
    rec = experiments(range(seed, seed + axes), output=output, samples=max(BLOCKS * samples, 2000))
    return _turning(reference_model(output), settings(output, seed), rec, samples)


def five_masses(output: Output) -> AxisModel:
    """Five masses and six parameters, with Coulomb friction of motor and arm, which the plant does not have."""
    linear = {**values(5, gravity=False), "fc": 0.0, "fa": 0.0}
    return AxisModel(chain(5, output, gravity=False), linear, ("kT", "f", "1/J5", "J2", "k1", "k4"))


def five_masses_settings(output: Output) -> Settings:
    """With the paper's output error for the speed, a Kalman gain for the angle, as the reference axis."""
    model = five_masses(output)
    gain, lam0 = filter_gain(model, INTERVAL_S, ANGLE_TORQUE_NOISE, NOISE[output])
    start = tuple((0.01 * model.scale) ** 2 / lam0)
    return Settings.paper(INTERVAL_S, lam0=lam0, K=tuple(gain) if output == "angle" else (), P0=start)


def five_masses_record(output: Output, axes: int, samples: int, seed: int) -> Experiment:
    """Records of as many axes, excited as the reference axis."""
    rng = np.random.default_rng(seed)
    u = np.stack([multisine(rng, samples, INTERVAL_S, BAND_HZ, TORQUE_RMS) for _ in range(axes)], axis=1)
    model = five_masses(output)
    y, _ = simulate_linear(model.drive, model.nominal, u, INTERVAL_S)
    t_us = np.arange(samples, dtype=np.int64) * round(INTERVAL_S * 1e6)
    return Experiment(t_us, u, y + NOISE[output] * rng.standard_normal(y.shape))


def run_of_five_masses(output: Output, axes: int, samples: int, seed: int) -> Callable[[], object]:
    """As ``run_of``, for five masses and six parameters."""
    rec = five_masses_record(output, axes, max(BLOCKS * samples, 2000), seed)
    return _turning(five_masses(output), five_masses_settings(output), rec, samples)


def _turning(model: AxisModel, settings: Settings, rec: Experiment, samples: int) -> Callable[[], object]:
    """A call that runs the next so many samples of the records (N, axes).

    At their end the bank restarts with them: a jump would throw theta to its bounds.
    """
    length, axes = rec.u.shape
    bank = AxisBatch([model] * axes, [settings] * axes)
    start = [bank.column(a) for a in range(axes)]
    t_us, u, y = np.repeat(rec.t_us[:, np.newaxis], axes, axis=1), rec.u, rec.y
    at = 0

    def run() -> object:
        nonlocal at
        if at == length:
            at = 0
            for a, state in enumerate(start):
                bank.restore(a, *state)
        block, at = slice(at, at + samples), at + samples
        return bank.run(t_us[block], u[block], y[block])

    return run


def run_of_fleet(axes: int, samples: int, drives: int, seed: int) -> Callable[[], object]:
    """A call that runs the next so many samples of a fleet: the reference axis, and others that monitor less of it.

    Twenty times, then the records are at their end.
    """
    model = reference_model("speed")
    models = [replace(model, monitored=model.monitored[: 3 - a % drives]) for a in range(axes)]
    one = replace(settings("speed", seed), settle_s=0.0)
    fleet = Fleet(models, [replace(one, P0=one.P0[: len(m.monitored)]) for m in models])
    rec = experiments(range(seed, seed + 10), samples=2 * BLOCKS * samples)
    at = 0

    def run() -> object:
        nonlocal at
        block, at = slice(at, at + samples), at + samples
        return fleet.update(
            {a: SampleBlock(rec.t_us[block], rec.u[block, a % 10], rec.y[block, a % 10]) for a in range(axes)}
        )

    return run


def forced(run: Callable[[], object], fewest_lanes: int) -> Callable[[], object]:
    """The same call in one shape of the kernel."""

    def in_shape() -> object:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(bank_module, "FEWEST_LANES", fewest_lanes)
            return run()

    return in_shape
