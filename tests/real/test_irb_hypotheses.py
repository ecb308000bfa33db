"""The multi-model detector on the record of a real robot axis, with thresholds from it: quiet, and faults found."""

from pathlib import Path

import numpy as np
import pytest

from monitor_core.calibration.multimodel_thresholds import bank_limits
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import Limits, bank_of
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected, Event
from monitor_core.samples import SampleBlock
from tests.real.irb import Record, model_and_settings, read, with_torque_constant, with_viscous_friction

pytestmark = pytest.mark.records

BETWEEN_S = 600.0
"""Mean time between false alarms that is asked for; the record has ten seconds."""
COPIES = 500_000
"""Samples of it, four minutes."""


@pytest.fixture(scope="module")
def record(records_dir: Path) -> Record:
    return read(records_dir / "irb" / "robot_arm.mat")


@pytest.fixture(scope="module")
def bank(record: Record, seed: int) -> HypothesisBank:
    model, settings = model_and_settings()
    t_us, u, y = record
    samples = BETWEEN_S / settings.interval_s
    own = bank_limits(
        model, settings, [SampleBlock(t_us, u, y, name="irb")], samples, np.random.default_rng(seed), COPIES
    ).own
    return bank_of(model, settings, Limits(BETWEEN_S, own))


def run(bank: HypothesisBank, record: Record) -> list[Event]:
    bank.reset()
    events = bank.run(*record)
    for event in events:
        print(event)
    return events


def test_the_healthy_axis_is_quiet(bank: HypothesisBank, record: Record) -> None:
    assert run(bank, record) == []


def test_a_torque_constant_is_found_and_told_from_a_scaled_output_when_there_is_evidence(
    bank: HypothesisBank, record: Record
) -> None:
    start = len(record.u) // 2
    events = run(bank, with_torque_constant(record, 1.2, start))
    named = [e for e in events if isinstance(e, CauseIdentified)]
    assert isinstance(events[0], ChangeDetected)
    assert 0 < events[0].time_us - record.t_us[start] < 1.5e6
    assert {share.cause for share in named[0].shares[:2]} == {"kT", "output scale"}
    assert named[-1].shares[0].cause == "kT"
    assert named[-1].shares[0].size == pytest.approx(np.log(1.2), abs=0.05)


def test_friction_is_found_and_named(bank: HypothesisBank, record: Record) -> None:
    start = len(record.u) // 2
    events = run(bank, with_viscous_friction(record, 0.0074, start))
    assert isinstance(events[0], ChangeDetected)
    assert 0 < events[0].time_us - record.t_us[start] < 1.5e6
    assert {e.shares[0].cause for e in events if isinstance(e, CauseIdentified)} == {"fm"}
