"""Records that the tests of records share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.identification import Record
from monitor_core.modeling.simulated_axis import SimulatedAxis
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass

H = 0.005
VALUES = {**REFERENCE_VALUES, "fc": 0.4, "tau0": 0.1}
NOISE: dict[Output, float] = {"speed": 0.5, "angle": 0.01}


@st.composite
def records(draw: st.DrawFn, least: int = 2) -> Record:
    """Any record: jitter, gaps, samples that are missing, a signal."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(least, 60))
    intervals = rng.choice([H, 0.3 * H, 1.7 * H, 40 * H], count, p=[0.7, 0.1, 0.1, 0.1])
    y = rng.normal(size=count)
    y[rng.random(count) < draw(st.sampled_from([0.0, 0.2]))] = np.nan
    quantity: Output = draw(st.sampled_from(["speed", "angle"]))
    return Record(np.cumsum(intervals), rng.normal(size=count), y, quantity, "a", signals={"s": rng.normal(size=count)})


def picks(seed: int, stiction: float = 0.0, moves: int = 40) -> Record:
    """``moves`` to and fro between two places, with rests in which the torque stays as friction holds it.

    One mass of 2e-3 kg m^2 with a viscous friction of 5e-3 N m s/rad and a Coulomb friction of 0.5 N m, to which slow
    motion adds ``stiction`` [N m], with a Stribeck speed of 3 rad/s.
    """
    rng = np.random.default_rng(seed)
    way, pieces = 40.0, list[Floats]()
    for k in range(moves):
        s = np.arange(0.0, 1.0, H / rng.uniform(0.8, 1.6))
        move = way * (10 * s**3 - 15 * s**4 + 6 * s**5)
        pieces += [move if k % 2 == 0 else way - move, np.full(rng.integers(150, 300), way * (k % 2 == 0))]
    angle = np.concatenate(pieces)
    t: Floats = H * np.arange(len(angle), dtype=np.float64)
    speed: Floats = np.gradient(angle, H)
    moving = abs(speed) > 1e-6
    last = np.maximum.accumulate(np.where(moving, np.arange(len(t)), 0))
    u = (
        2e-3 * np.gradient(speed, H)
        + 5e-3 * speed
        + (0.5 + stiction * np.exp(-((speed / 3.0) ** 2))) * np.sign(speed[last])
    )
    return Record(
        t,
        np.asarray(u + 0.01 * rng.standard_normal(len(t)), np.float64),
        angle + 1e-4 * rng.standard_normal(len(t)),
        "angle",
    )


def same(a: Record, b: Record) -> bool:
    """Whether two records are equal to the last bit."""
    arrays = zip((a.t, a.u, a.y, *a.signals.values()), (b.t, b.u, b.y, *b.signals.values()), strict=True)
    equal = all(np.array_equal(x, y, equal_nan=True) for x, y in arrays)
    return equal and np.array_equal(a.measured, b.measured) and (a.quantity, a.name) == (b.quantity, b.name)


def healthy(
    rng: np.random.Generator, quantity: Output, closed: bool = False, samples: int = 4000, noise: float = 1.0
) -> Record:
    """The reference drive with Coulomb friction, excited by its torque or by the reference of a speed controller."""
    axis = SimulatedAxis(VALUES, substeps=2, drive=three_mass("angle"))
    irregular = 0.3 * rng.random() * rng.uniform(-1, 1, samples) * (rng.random() < 0.5)
    intervals = H * (1 + irregular)
    extra, wanted = multisine(rng, samples, H, (0, 30), 1.23), multisine(rng, samples, H, (0.05, 3), 5.0)
    u, y, angle, speed = np.zeros(samples), np.zeros(samples), 0.0, 0.0
    for k in range(samples):
        y[k] = (angle if quantity == "angle" else speed) + noise * NOISE[quantity] * rng.standard_normal()
        known = speed if quantity == "angle" else y[k]
        u[k] = 0.3 * (wanted[k] - known) + 0.2 * extra[k] if closed else extra[k]
        angle, speed = axis.step(u[k], intervals[k])
    return Record(np.cumsum(intervals), u, y, quantity, "healthy")


def with_y(record: Record, y: Floats) -> Record:
    """Another output at the same times."""
    return replace(record, y=y)


def with_u(record: Record, u: Floats) -> Record:
    """Another torque at the same times."""
    return replace(record, u=u)
