"""The EMPS benchmark (Janot, Gautier, Brunot 2019): a cart on a ball screw, position measured, closed loop, friction.

The cart moves along a line.  To the program it is a shaft whose "angle" in rad is the position in m: a rack on a
pinion of 1 m radius, gear ratio 1.  So N m stand for N, J in kg m^2 for M in kg, N m s/rad for N/(m/s).

First the values against the published ones.  Then identified and calibrated on one half of the record and watched on
the other, exactly as the commands do it: quiet, faults named.  Watched are the force
constant kT and the friction: in twelve seconds of this motion dry and viscous friction cannot be distinguished, so one
of the two stands for both, and an alarm of fc means that "friction has changed".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import scipy.io

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.injection import equivalent_load, faulty_torque
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.detection import Alarm
from monitor_core.identification import Record
from monitor_core.identification.greybox import Estimate, fit, traces_of
from monitor_core.identification.problem import Problem
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from service.commands.calibrate import calibrate_axis
from service.commands.identification_task import Request, prepare
from service.config import Config, load
from service.ingest.loaded_records import load_samples
from service.reports.calibration_report import Calibration
from service.reports.formats import Provenance
from service.reports.identification_files import as_toml
from tests.core.naming import alarm_versions
from tests.real.drives import ONE_MASS, loaded, one_mass

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


GUESS = "nominal = { kT = 1.0, J = 100.0, fv = 200.0, fc = 20.0, tau0 = 0.0 }\nfriction_speed_scale = 0.001\n"
AXIS = f"""[[robot]]
name = "emps"
[[robot.axis]]
name = "cart"
sample_interval_s = 0.001
time = {{ column = "t" }}
torque = {{ column = "vir", factor = 35.15065188248547 }}
angle = {{ column = "qm" }}
[robot.axis.model]
drive = "cart.mo"
monitor = ["kT", "fc"]
{GUESS}
[robot.axis.estimator]
memory_s = 0.25
"""
HALF_S = 12.42
"""Of 24.84 s: the motion in the second half is that of the first, there and back twice."""
BUDGET_S = 600.0
"""Twelve seconds cannot promise much more."""


def identified(folder: Path, half: str) -> Path:
    """A folder with nominal.toml found in that half, as ``axiswatch identify`` does."""
    (folder / "cart.mo").write_text(ONE_MASS, encoding="utf-8")
    config = configured(folder, AXIS)
    task = prepare(config, config.axes[0], [half], [], Request(start="values"))
    found = task.run(Provenance("", "", ""))
    assert not found.rejection
    (folder / "nominal.toml").write_text(as_toml(found), encoding="utf-8")
    return folder


def watched(folder: Path, monitor: Sequence[str]) -> Config:
    """The configuration of the daemon, with the nominal values of that folder."""
    names = ", ".join(f'"{name}"' for name in monitor)
    text = AXIS.replace(GUESS, 'nominal_file = "nominal.toml"\n')
    return configured(folder, re.sub(r"monitor = .*", f"monitor = [{names}]", text))


def configured(folder: Path, text: str) -> Config:
    path = folder / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, {})


def calibrated(config: Config, half: str, budget_s: float) -> Calibration:
    """Thresholds from that half, a text that selects it, as ``axiswatch calibrate`` finds them."""
    request = CalibrationOptions(budget_s, None, (0.15,), 2, copies=200_000, bank_copies=20_000)
    return calibrate_axis(config, config.axes[0], [half], request, Provenance("", "", ""))


def samples(config: Config, found: Calibration, text: str) -> SampleBlock:
    """The record, or a part of it, through the pipeline of the daemon."""
    (block,), _ = load_samples([text], config, config.axes[0], found.result.model)
    return block


def faulty(found: Calibration, block: SampleBlock, change: Mapping[str, float], start: int) -> SampleBlock:
    """The record if these parameters change by such parts at sample ``start``: the force that the same motion needs."""
    nominal = found.result.model.nominal
    values = {**nominal, **{name: nominal[name] * (1 + part) for name, part in change.items()}}
    load = equivalent_load(found.result.model, values)
    assert load is not None  # exact
    axis = MonitoredAxis(found.result.model, found.result.settings)
    u = block.u.copy()
    u[start:] = faulty_torque(axis, block, load)[start:]
    return block._replace(u=u)


def alarms_and_peak(found: Calibration, block: SampleBlock) -> tuple[list[Alarm], float]:
    """All alarms that the monitor reports, and the largest g over its threshold, of any test."""
    monitor = AxisMonitor(found.result.model, found.result.settings)
    alarms, trace = alarm_versions(monitor, block)
    return alarms, float(np.max(trace.g.max(axis=(0, 1)) / monitor.batch.thresholds[:, 0]))


BEGINS_S = (4.0, 6.0, 8.0)
"""After the beginning of the other half; until 2.6 s P(0) is looked for."""
WATCHED = ("kT", "fc")


class Learned(NamedTuple):
    """Where the nominal values from one half are; that half, and the other, as texts."""

    folder: Path
    own: str
    other: str


class Halves(NamedTuple):
    """The thresholds from one half, and the other as the daemon sees it."""

    found: Calibration
    other: SampleBlock


@pytest.fixture(scope="module")
def learned(records_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Learned:
    """The first half; tests/soak/test_real_records.py takes either for the other."""
    path = records_dir / "emps" / "DATA_EMPS.mat"
    own, other = f"{path}@0:{HALF_S}", f"{path}@{HALF_S}:"
    return Learned(identified(tmp_path_factory.mktemp("emps"), own), own, other)


@pytest.fixture(scope="module")
def half(learned: Learned) -> Halves:
    config = watched(learned.folder, WATCHED)
    found = calibrated(config, learned.own, BUDGET_S)
    print(f"EMPS: {found.result.tests.promise}; {found.result.settings.thresholds}")
    return Halves(found, samples(config, found, learned.other))


def test_the_other_half_is_quiet(half: Halves) -> None:
    episodes, peak = alarms_and_peak(half.found, half.other)
    print(f"EMPS: largest g {peak:.2f} of its threshold")
    assert episodes == []
    assert peak < 0.5


def watch(half: Halves, change: Mapping[str, float], begins_s: float) -> tuple[float, Alarm]:
    """Delay and last state of the only alarm."""
    start = round(begins_s / half.found.result.settings.interval_s)
    episodes, _ = alarms_and_peak(half.found, faulty(half.found, half.other, change, start))
    assert len({(e.raised_us, e.first) for e in episodes}) == 1
    delay_s = (episodes[0].raised_us - int(half.other.t_us[start])) * 1e-6
    e = episodes[-1]
    print(
        f"EMPS {change} at {begins_s:g} s: {e.parameter} {e.direction} ({e.stage}, first {e.first[0]}) after"
        f" {delay_s:.2f} s, {100 * (e.size or 0.0) / half.found.result.model.nominal[e.parameter]:+.0f} %"
    )
    assert e.doubt == ""
    return delay_s, e


@pytest.mark.parametrize("begins_s", BEGINS_S)
@pytest.mark.parametrize("part", [0.15, -0.15])
def test_a_changed_motor_force_is_named(half: Halves, part: float, begins_s: float) -> None:
    """Also where friction crossed first."""
    delay_s, e = watch(half, {"kT": part}, begins_s)
    assert 0 < delay_s < 2
    assert (e.stage, e.parameter, e.direction) == ("named", "kT", "up" if part > 0 else "down")
    assert e.size == pytest.approx(part, abs=0.07)


@pytest.mark.parametrize("begins_s", BEGINS_S)
@pytest.mark.parametrize("part", [0.15, -0.15])
def test_a_changed_friction_is_named(half: Halves, part: float, begins_s: float) -> None:
    """Of both kinds: at 0.1 m/s viscous friction is as large as dry, so the size of fc is twice the part."""
    delay_s, e = watch(half, {"fc": part, "fv": part}, begins_s)
    assert 0 < delay_s < 2
    assert (e.stage, e.parameter, e.direction) == ("named", "fc", "up" if part > 0 else "down")


@pytest.mark.soak
def test_both_kinds_of_friction_are_more_than_this_record_can_tell(learned: Learned) -> None:
    """Watched at once they take each other's place, and scatter so much that nothing can be promised."""
    config = watched(learned.folder, ("kT", "fv", "fc"))
    with pytest.raises(CalibrationError, match=r"too short to promise one false alarm in 10 min"):
        calibrated(config, learned.own, BUDGET_S)
