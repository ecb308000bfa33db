"""The EMPS benchmark (Janot, Gautier, Brunot 2019): a cart on a ball screw, position measured, closed loop, friction.

The cart moves along a line.  To the program it is a shaft whose "angle" in rad is the position in m: a rack on a
pinion of 1 m radius, gear ratio 1.  So N m stand for N, J in kg m^2 for M in kg, N m s/rad for N/(m/s).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from monitor_core.identification.greybox import Estimate, Problem, fit, traces_of
from monitor_core.identification.records import Record
from tests.real.drives import loaded, one_mass

pytestmark = pytest.mark.records

DRIVE = one_mass()
FREE = ("J", "fv", "fc", "tau0")
FIXED = {p.name: 1.0 for p in DRIVE.parameters if p.name not in FREE}
PUBLISHED = {"J": 95.1089, "fv": 203.5034, "fc": 20.3935, "tau0": 3.1648}
"""Inverse model, least squares, filtered at 100 Hz.  Their offset brakes with -3.1648 N; tau0 drives."""
SPEED_SCALE = 1e-3
"""m/s, of tanh in place of the sign; the cart goes up to 0.13 m/s."""
START_FACTOR = 3.0
INTERVAL_S = 0.001


@pytest.fixture(scope="module")
def record(records_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Record:
    path = records_dir / "emps" / "DATA_EMPS.mat"
    file = scipy.io.loadmat(path)
    columns: dict[str, dict[str, Any]] = {
        "time": {"column": "t"},
        "torque": {"column": "vir", "factor": float(np.squeeze(file["gtau"]))},
        "angle": {"column": "qm"},
    }
    found = loaded(path, tmp_path_factory.mktemp("emps"), INTERVAL_S, columns).record
    assert len(found) == file["qg"].size  # nothing was dropped
    return found


@pytest.fixture(scope="module")
def found(record: Record, seed: int) -> Estimate:
    """Fitted from values that are wrong by random factors up to 3."""
    rng = np.random.default_rng(seed)
    factors = START_FACTOR ** rng.uniform(-1, 1, len(FREE))
    start = {name: PUBLISHED[name] * float(f) for name, f in zip(FREE, factors, strict=True)}
    return fit(problem(start), [record])


def problem(values: Mapping[str, float]) -> Problem:
    return Problem(DRIVE, {**FIXED, **values}, FREE, speed_scale=SPEED_SCALE)


def test_values_are_the_published_ones(found: Estimate) -> None:
    """Within 1 %, though fitted to the position as recorded: no filter, no derivative, no decimation."""
    assert found.converged
    for name, value, sd in zip(found.names, found.theta, found.sd, strict=True):
        apart = 100 * (value / PUBLISHED[name] - 1)
        print(f"EMPS {name}: {value:.4f} +- {sd:.2g}, published {PUBLISHED[name]}: {apart:+.2f} %")
    assert dict(zip(found.names, found.theta, strict=True)) == pytest.approx(PUBLISHED, rel=0.01)
    off = (found.theta - [PUBLISHED[name] for name in found.names]) / found.sd
    assert (abs(off) < 2).all()


def test_simulated_position(record: Record, found: Estimate) -> None:
    """The recorded force alone moves the cart, from the initial state that fits best: better than by the published.

    Two integrators let every error of the force grow.
    """
    ours, published = (
        traces_of(problem(values), [record])[0].fit_simulation
        for values in ({n: found.values[n] for n in FREE}, PUBLISHED)
    )
    print(f"EMPS: position in free run {ours:.2f} %, by the published values {published:.2f} %")
    assert ours > published
