"""Thresholds from the whole record of a real robot axis: it is quiet, and faults put into its second half are named.

By the CUSUM tests and by the multi-model detector.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.detection.multimodel.multimodel_detector import Limits, MultiModelDetector, bank_of
from monitor_core.detection.multimodel.multimodel_events import CauseIdentified, ChangeDetected
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from service.commands.calibrate import calibrate_axis
from service.reports.calibration_report import Calibration
from service.reports.formats import Provenance
from tests.real.irb import FAULTS, Fault, configuration, with_torque_constant

pytestmark = pytest.mark.records
WITHIN_S = 2.5
BUDGET_S = 600.0
"""Ten seconds cannot promise much more."""


def calibrated(path: Path, budget_s: float) -> Calibration:
    config = configuration()
    wishes = CalibrationOptions(budget_s, WITHIN_S, (0.3,), 10, copies=2_000_000, bank_copies=500_000)
    return calibrate_axis(config, config.axes[0], [str(path)], wishes, Provenance("", "", ""))


@pytest.fixture(scope="module")
def found(irb_path: Path) -> Calibration:
    return calibrated(irb_path, BUDGET_S)


def limits(found: Calibration) -> Limits:
    assert found.result.bank is not None
    return Limits(1.0, found.result.bank.limits.own)


def monitor(found: Calibration, source: str) -> AxisMonitor:
    """Its alarms are those of the CUSUM tests or of the multi-model detector."""
    model, settings = found.result.model, found.result.settings
    if source == "cusum":
        return AxisMonitor(model, settings)
    return AxisMonitor(model, settings, MultiModelDetector(model, settings, limits(found)), "multimodel")


def test_the_healthy_record_is_quiet(found: Calibration, irb_record: SampleBlock) -> None:
    watched = monitor(found, "cusum")
    episodes, trace = watched.update_traced(irb_record)
    assert episodes == []
    assert (trace.g.max(axis=(0, 1)) < 0.5 * watched.batch.thresholds[:, 0]).all()
    assert monitor(found, "multimodel").update(irb_record) == []


@pytest.mark.parametrize("source", ["cusum", "multimodel"])
@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_in_the_second_half_is_named_in_time(
    fault: Fault, source: str, found: Calibration, irb_record: SampleBlock
) -> None:
    """At first sight the bank's name may be another one; after three memories it is right."""
    watched, start = monitor(found, source), len(irb_record.u) // 2
    episodes = [change.alarm for change in watched.update(fault.put_into(irb_record, start))]
    delay_s = (episodes[0].raised_us - int(irb_record.t_us[start])) * 1e-6
    print(f"irb, {source}, {fault}: {delay_s:.2f} s")
    assert 0 < delay_s < WITHIN_S
    if source == "cusum":
        assert {(e.parameter, e.direction) for e in episodes} == {fault.alarm}
    else:
        assert [(e.parameter, e.stage) for e in watched.open_alarms] == [(fault.alarm[0], "named")]


def test_a_torque_constant_is_told_from_a_scaled_output_when_there_is_evidence(
    found: Calibration, irb_record: SampleBlock
) -> None:
    start = len(irb_record.u) // 2
    bank = bank_of(found.result.model, found.result.settings, limits(found))
    events = bank.run(*with_torque_constant(irb_record, 1.2, start)[:3])
    named = [e for e in events if isinstance(e, CauseIdentified)]
    assert isinstance(events[0], ChangeDetected)
    assert {share.cause for share in named[0].shares[:2]} == {"kT", "output scale"}
    assert named[-1].shares[0].cause == "kT"
    assert named[-1].shares[0].size == pytest.approx(np.log(1.2), abs=0.05)


def test_a_year_cannot_be_promised_from_ten_seconds(irb_path: Path) -> None:
    with pytest.raises(CalibrationError, match="too short to promise one false alarm in a year"):
        calibrated(irb_path, 31557600.0)
