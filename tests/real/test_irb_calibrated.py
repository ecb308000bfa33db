"""Thresholds from the whole record of a real robot axis: it is quiet, and faults put into its second half are named."""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.detection.multimodel.multimodel_detector import Limits, MultiModelDetector
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from service.commands.calibrate import calibrate_axis
from service.reports.calibration_report import Calibration
from service.reports.formats import Provenance
from tests.real.irb import Record, configuration, read, with_torque_constant, with_viscous_friction

pytestmark = pytest.mark.records
VISCOUS = 0.0074
"""N m s/rad: about a quarter of the healthy friction."""
WITHIN_S = 2.5
BUDGET_S = 600.0
"""Ten seconds cannot promise much more."""


def calibrated(path: Path, budget_s: float) -> Calibration:
    config = configuration()
    wishes = CalibrationOptions(budget_s, WITHIN_S, (0.3,), 10, copies=2_000_000, bank_copies=500_000)
    return calibrate_axis(config, config.axes[0], [str(path)], wishes, Provenance("", "", ""))


@pytest.fixture(scope="module")
def path(records_dir: Path) -> Path:
    return records_dir / "irb" / "robot_arm.mat"


@pytest.fixture(scope="module")
def found(path: Path) -> Calibration:
    return calibrated(path, BUDGET_S)


def test_the_healthy_record_is_quiet(found: Calibration, path: Path) -> None:
    monitor = AxisMonitor(found.result.model, found.result.settings)
    episodes, trace = monitor.update_traced(SampleBlock(*read(path)))
    assert episodes == []
    assert (trace.g.max(axis=(0, 1)) < 0.5 * monitor.batch.thresholds[:, 0]).all()


@pytest.mark.parametrize(
    ("torque_constant", "viscous", "alarm"),
    [
        (1.2, 0.0, ("kT", "up")),
        (0.8, 0.0, ("kT", "down")),
        (1, VISCOUS, ("fm", "up")),
        (1, -VISCOUS, ("fm", "down")),
    ],
)
def test_a_fault_in_the_second_half_is_named_in_time(
    found: Calibration, path: Path, torque_constant: float, viscous: float, alarm: tuple[str, str]
) -> None:
    record: Record = read(path)
    start = len(record.u) // 2
    faulty = with_viscous_friction(with_torque_constant(record, torque_constant, start), viscous, start)
    monitor = AxisMonitor(found.result.model, found.result.settings)
    episodes = [change.alarm for change in monitor.update(SampleBlock(*faulty))]
    assert {(e.parameter, e.direction) for e in episodes} == {alarm}
    delay_s = (episodes[0].raised_us - int(record.t_us[start])) * 1e-6
    print(f"irb {alarm}: {delay_s:.2f} s")
    assert 0 < delay_s < WITHIN_S


@pytest.mark.parametrize(
    ("torque_constant", "viscous", "name"),
    [(1.2, 0.0, "kT"), (0.8, 0.0, "kT"), (1, VISCOUS, "fm"), (1, -VISCOUS, "fm")],
)
def test_the_bank_with_its_own_thresholds_is_quiet_and_finds_the_same_faults(
    found: Calibration, path: Path, torque_constant: float, viscous: float, name: str
) -> None:
    """At first sight the name may be another one; after three memories it is right."""
    assert found.result.bank is not None
    record: Record = read(path)
    limits = Limits(1.0, found.result.bank.limits.own)
    model, settings = found.result.model, found.result.settings
    watched = AxisMonitor(
        model,
        settings,
        MultiModelDetector(model, settings, limits),
        "multimodel",
    )
    assert watched.update(SampleBlock(*record)) == []
    start = len(record.u) // 2
    faulty = with_viscous_friction(with_torque_constant(record, torque_constant, start), viscous, start)
    watched = AxisMonitor(
        model,
        settings,
        MultiModelDetector(model, settings, limits),
        "multimodel",
    )
    episodes = [change.alarm for change in watched.update(SampleBlock(*faulty))]
    delay_s = (episodes[0].raised_us - int(record.t_us[start])) * 1e-6
    print(f"irb, bank, {name}: {delay_s:.2f} s")
    assert 0 < delay_s < WITHIN_S
    assert [(e.parameter, e.stage) for e in watched.open_alarms] == [(name, "named")]


def test_a_year_cannot_be_promised_from_ten_seconds(path: Path) -> None:
    with pytest.raises(CalibrationError, match="too short to promise one false alarm in a year"):
        calibrated(path, 31557600.0)
