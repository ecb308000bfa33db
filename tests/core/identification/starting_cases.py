"""Drives whose parameters are found without a good guess, and how far from the optimum a fit ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from monitor_core.drive.structure import Drive, Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS
from monitor_core.identification import Record
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting import fit_from, fit_from_scratch
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import (
    EXAMPLE_VALUES,
    INTERVAL_S,
    REFERENCE_VALUES,
    five_mass,
    three_mass,
    two_mass,
)

Way = Literal["scratch", "given"]
R = REFERENCE_VALUES["r"]
OTHERS = {"fc": 0.0, "tau0": 0.0, "kT": 1.0, "r": R}
AT_OPTIMUM = 1.001
WRONG = 3.0
"""Given values are wrong by factors between this and its reciprocal."""


@dataclass(frozen=True)
class Case:
    """A drive, its true values, how long its record is, and how many fits in a hundred must end at the optimum."""

    name: str
    speed: Drive
    angle: Drive
    values: Mapping[str, float]
    seconds: float
    of_hundred: int

    @property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in self.values if name not in OTHERS)

    def drive(self, output: Output) -> Drive:
        return self.speed if output == "speed" else self.angle

    def problem(self, values: Mapping[str, float] | None = None, output: Output = "speed") -> Problem:
        nominal = {**self.values, **(values or {})}
        return Problem(self.drive(output), nominal, self.free, predictor="output-error")

    def record(self, seed: int, noise: float = 1.0, output: Output = "speed") -> Record:
        """As the reference experiment; ``noise`` is a factor on its noise."""
        rng, N = np.random.default_rng(seed), round(self.seconds / INTERVAL_S)
        u = multisine(rng, N, INTERVAL_S, BAND_HZ, TORQUE_RMS)
        y, _ = simulate_linear(self.drive(output), self.values, u[:, None], INTERVAL_S)
        y = y[:, 0] + noise * NOISE[output] * rng.standard_normal(N)
        return Record(INTERVAL_S * np.arange(N, dtype=np.float64), u, y, output)

    def wrong(self, seed: int, factor: float = WRONG) -> dict[str, float]:
        rng, most = np.random.default_rng([seed, 1]), np.log(factor)
        return {name: self.values[name] * float(np.exp(rng.uniform(-most, most))) for name in self.free}

    def away(self, seed: int, way: Way, noise: float = 1.0, output: Output = "speed") -> float:
        """Cost of the fit without a guess over that of the fit from the truth."""
        record = self.record(seed, noise, output)
        best = fit(self.problem(None, output), [record])
        return self.found(record, way, self.wrong(seed)).cost / best.cost

    def found(self, record: Record, way: Way, wrong: Mapping[str, float]) -> Estimate:
        fitted = fit_from if way == "given" else fit_from_scratch
        return fitted(self.problem(wrong, record.quantity), [record])


def behind_gear(motor: float, *others: float) -> list[float]:
    """What the motor sees, as it is on the arm's side."""
    return [motor, *(value / R**2 for value in others)]


def five_masses() -> dict[str, float]:
    J = behind_gear(5.9e-3, 8e-3, 12e-3, 4.6e-3, 2.4e-3)
    _, *k = behind_gear(0, 28, 45, 38, 12)
    _, *d = behind_gear(0, 0.05, 0.04, 0.02, 0.01)
    names = [
        "Jm",
        *(f"J{i}" for i in range(1, 5)),
        *(f"k{i}" for i in range(1, 5)),
        *(f"d{i}" for i in range(1, 5)),
    ]
    return {**dict(zip(names, J + k + d, strict=True)), "fm": 0.06, **OTHERS}


def two_masses() -> dict[str, float]:
    v = REFERENCE_VALUES
    return {**EXAMPLE_VALUES["two-mass"], "Ja": v["Jg"], "k": v["kg"], "d": v["dg"], **OTHERS}


TWO = Case("two", two_mass("speed"), two_mass("angle"), two_masses(), 20.0, 95)
THREE = Case("three", three_mass("speed"), three_mass("angle"), REFERENCE_VALUES, 20.0, 95)
FIVE = Case("five", five_mass("speed"), five_mass("angle"), five_masses(), 60.0, 80)
CASES = {case.name: case for case in (TWO, THREE, FIVE)}
