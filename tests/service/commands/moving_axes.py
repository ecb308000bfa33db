"""Axes of two kinds that move from place to place, as a robot works, and their configuration."""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.modeling import SimulatedAxis
from service.config.drive_sources import model_called

H = 0.005
SECONDS = 20.0
RATIO = 0.01
VALUES = {
    "one-mass": {"J": 0.004, "fm": 0.005, "fc": 0.15, "tau0": 0.0, "kT": 1.0},
    "one-mass-weight": {
        "J": 0.004,
        "fm": 0.005,
        "fc": 0.15,
        "tau0": 0.0,
        "kT": 1.0,
        "r": RATIO,
        "gc": 100.0,
        "gs": 0.0,
    },
}
"""The weight takes 1 N m of the motor where the arm lies flat."""


class Moves(NamedTuple):
    """Samples (N,)."""

    t: Floats
    torque: Floats
    angle: Floats
    speed: Floats


@cache
def moves(drive: str, seed: int, seconds: float = SECONDS) -> Moves:
    """Point to point in a position loop, with a rest after each move."""
    plant = SimulatedAxis(VALUES[drive], 1.0, 3, drive=model_called(drive, None, "angle").drive)
    rng = np.random.default_rng(seed)
    wanted: Floats = _points(rng, round(seconds / H))
    speed = np.gradient(wanted, H)
    found = Moves(np.asarray(H * np.arange(wanted.size), np.float64), *(np.zeros(wanted.size) for _ in range(3)))
    held = 0.0
    for k in range(wanted.size):
        found.angle[k] = plant.angle + 1e-4 * rng.standard_normal()
        found.speed[k] = plant.speed + 0.02 * rng.standard_normal()
        error = speed[k] + 10 * (wanted[k] - plant.angle) - plant.speed
        held += error * H
        found.torque[k] = 0.08 * (error + 5 * held)
        plant.step(found.torque[k] + 0.02 * rng.standard_normal(), H)
    return found


def _points(rng: np.random.Generator, count: int) -> Floats:
    """Wanted angle (count,), rad: smooth moves up to 200 rad to either side."""
    parts, place, done = [], 0.0, 0
    while done < count:
        goal = rng.uniform(-200, 200)
        s = np.linspace(0, 1, max(100, round(abs(goal - place) / 60 / H)))
        parts += [place + (goal - place) * (10 * s**3 - 15 * s**4 + 6 * s**5), np.full(80, goal)]
        place, done = goal, done + s.size + 80
    return np.concatenate(parts)[:count]


def axis_text(drive: str, output: str, known: bool, lacking: Collection[str] = (), **changed: float) -> str:
    """Of the configuration: an axis with the columns t, u and y; its nominal values are known but for an eighth.

    ``lacking``: those that are not given.
    """
    values = {**VALUES[drive], **changed}
    values["J"] *= 0.88
    given = values if known else {name: values[name] for name in ("kT", "r") if name in values}
    nominal = ", ".join(f"{name} = {value}" for name, value in given.items() if name not in lacking)
    return f"""
[[robot.axis]]
name = "a1"
sample_interval_s = {H}
time = {{ column = "t" }}
torque = {{ column = "u" }}
{output} = {{ column = "y" }}
estimator = {{ torque_noise = 1.0, output_noise = 1.0 }}
model = {{ drive = "{drive}", monitor = ["kT", "fm"], nominal = {{ {nominal} }} }}
"""
