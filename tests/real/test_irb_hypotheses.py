"""The bank of hypotheses on the record of a real robot axis, with thresholds from it: quiet, and faults found."""

from pathlib import Path

import numpy as np
import pytest

from monitor_core.detection.bank import HypothesisBank
from monitor_core.detection.events import Changed, Event, Named
from monitor_core.detection.threshold import allowances, thresholds
from tests.real.irb import Record, model_and_settings, read, with_torque_constant, with_viscous_friction

pytestmark = pytest.mark.records

BETWEEN_S = 600.0
"""Mean time between false alarms that is asked for; the record has ten seconds."""


@pytest.fixture(scope="module")
def record(records_dir: Path) -> Record:
    return read(records_dir / "irb" / "robot_arm.mat")


@pytest.fixture(scope="module")
def bank(record: Record) -> HypothesisBank:
    model, settings = model_and_settings()
    first = HypothesisBank(model, settings)
    _, trace = first.run_traced(*record)
    taken = allowances(trace.llr)
    second = HypothesisBank(model, settings, first.hypotheses, allowance=taken)
    _, trace = second.run_traced(*record)
    h = thresholds(trace.g, settings.interval_s, BETWEEN_S)
    return HypothesisBank(model, settings, first.hypotheses, h=h, allowance=taken)


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
    named = [e for e in events if isinstance(e, Named)]
    assert isinstance(events[0], Changed)
    assert 0 < events[0].time_us - record.t_us[start] < 1.5e6
    assert {share.cause for share in named[0].shares[:2]} == {"kT", "output scale"}
    assert named[-1].shares[0].cause == "kT"
    assert named[-1].shares[0].size == pytest.approx(np.log(1.2), abs=0.05)


def test_friction_is_found_and_named(bank: HypothesisBank, record: Record) -> None:
    start = len(record.u) // 2
    events = run(bank, with_viscous_friction(record, 0.0074, start))
    assert isinstance(events[0], Changed)
    assert 0 < events[0].time_us - record.t_us[start] < 1.5e6
    assert {e.shares[0].cause for e in events if isinstance(e, Named)} == {"fm"}
