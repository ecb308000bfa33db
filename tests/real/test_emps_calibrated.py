"""The EMPS benchmark (Janot, Gautier, Brunot 2019): a cart on a ball screw, position measured, closed loop, friction.

The cart moves along a line.  To the program it is a shaft whose "angle" in rad is the position in m: a rack on a
pinion of 1 m radius, gear ratio 1.  So N m stand for N, J in kg m^2 for M in kg, N m s/rad for N/(m/s).

First the values against the published ones.  Then identified and calibrated on one half of the record and watched on
the other, exactly as the commands do it: quiet, faults named.  Watched are the force
constant kT and the friction: in twelve seconds of this motion dry and viscous friction cannot be distinguished, so one
of the two stands for both, and an alarm of fc means that "friction has changed".
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import scipy.io

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.detection import Alarm
from monitor_core.identification import Record
from monitor_core.identification.greybox import Estimate, fit, traces_of
from monitor_core.identification.problem import Problem
from monitor_core.monitoring import AxisMonitor
from service.commands.commissioning.axis.identification_task import Request
from tests.core.naming import alarm_versions
from tests.real.drives import ONE_MASS, loaded, one_mass
from tests.real.halves import EMPS, RealAxis, Watched, identified, watched

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


HALF_S = 12.42
"""Of 24.84 s: the motion in the second half is that of the first, there and back twice."""
OPTIONS = CalibrationOptions(600.0, None, (0.15,), 2, copies=200_000, bank_copies=20_000)
"""A budget of ten minutes: twelve seconds cannot promise much more."""
CART = RealAxis(
    EMPS, ONE_MASS, ("kT", "fc"), 0.25,
    "nominal = { kT = 1.0, J = 100.0, fv = 200.0, fc = 20.0, tau0 = 0.0 }\nfriction_speed_scale = 0.001\n",
)  # fmt: skip
BEGINS_S = (4.0, 6.0, 8.0)
"""After the beginning of the other half; until 2.6 s P(0) is looked for."""


class Learned(NamedTuple):
    """Where the nominal values from one half are; that half, and the other, as texts."""

    folder: Path
    own: str
    other: str


@pytest.fixture(scope="module")
def learned(records_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Learned:
    """The first half; tests/soak/test_real_records.py takes either for the other."""
    path, folder = records_dir / "emps" / "DATA_EMPS.mat", tmp_path_factory.mktemp("emps")
    own, other = f"{path}@0:{HALF_S}", f"{path}@{HALF_S}:"
    assert not identified(CART, own, folder, Request(start="values")).rejection
    return Learned(folder, own, other)


@pytest.fixture(scope="module")
def half(learned: Learned) -> Watched:
    return watched(CART, learned.own, learned.other, learned.folder, OPTIONS)


def test_the_other_half_is_quiet(half: Watched) -> None:
    monitor = AxisMonitor(half.model, half.settings)
    alarms, trace = alarm_versions(monitor, half.block)
    peak = np.max(trace.g.max(axis=(0, 1)) / monitor.batch.thresholds[:, 0])
    print(f"EMPS: largest g {peak:.2f} of its threshold")
    assert alarms == []
    assert peak < 0.5


def after_fault(half: Watched, change: Mapping[str, float], begins_s: float) -> tuple[float, Alarm]:
    """Delay and last state of the only alarm."""
    start = round(begins_s / half.settings.interval_s)
    alarms = half.alarms(half.with_fault(change, start))
    assert len({alarm.key for alarm in alarms}) == 1
    delay_s, last = (alarms[0].raised_us - int(half.block.t_us[start])) * 1e-6, alarms[-1]
    print(f"EMPS {change} at {begins_s:g} s: {last.parameter} {last.direction}, {last.size} after {delay_s:.2f} s")
    assert last.doubt == ""
    return delay_s, last


@pytest.mark.parametrize("begins_s", BEGINS_S)
@pytest.mark.parametrize("part", [0.15, -0.15])
def test_a_changed_motor_force_is_named(half: Watched, part: float, begins_s: float) -> None:
    """Also where friction crossed first."""
    delay_s, e = after_fault(half, {"kT": part}, begins_s)
    assert 0 < delay_s < 2
    assert (e.stage, e.parameter, e.direction) == ("named", "kT", "up" if part > 0 else "down")
    assert e.size == pytest.approx(part, abs=0.07)


@pytest.mark.parametrize("begins_s", BEGINS_S)
@pytest.mark.parametrize("part", [0.15, -0.15])
def test_a_changed_friction_is_named(half: Watched, part: float, begins_s: float) -> None:
    """Of both kinds: at 0.1 m/s viscous friction is as large as dry, so the size of fc is twice the part."""
    delay_s, e = after_fault(half, {"fc": part, "fv": part}, begins_s)
    assert 0 < delay_s < 2
    assert (e.stage, e.parameter, e.direction) == ("named", "fc", "up" if part > 0 else "down")


@pytest.mark.soak
def test_both_kinds_of_friction_are_more_than_this_record_can_tell(learned: Learned) -> None:
    """Watched at once they take each other's place, and scatter so much that nothing can be promised."""
    cart = CART._replace(monitor=("kT", "fv", "fc"))
    with pytest.raises(CalibrationError, match=r"too short to promise one false alarm in 10 min"):
        watched(cart, learned.own, learned.other, learned.folder, OPTIONS)
