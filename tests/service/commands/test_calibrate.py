"""From a healthy record to thresholds that the daemon's own pipeline uses, and reports about them."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.samples import SampleBlock
from service.commands.calibrate import seconds_of
from service.commands.commissioning.axis.calibration_task import calibrate_axis
from service.config import Config, load
from service.config.axis_detectors import detectors_of
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.records.record_files import read_record
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.reports.calibration_files import as_html, as_toml
from service.reports.calibration_report import Calibration, one_sided
from service.reports.formats import Provenance
from service.texts.not_tested_words import not_tested_sentences
from tests.service.commands.identify.conftest import robot_text, write_record, write_robot
from tests.service.found_files import named

PROVENANCE = Provenance("1.2.3", "2002-02-02T02:02:02+00:00", "axiswatch calibrate <healthy.csv> & more")
OPTIONS = CalibrationOptions(600.0, 4.0, (0.02, 0.2), 8, copies=150_000, bank_copies=40_000)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """robot.toml, healthy.csv of 60 s, and faulty.csv in which the torque constant falls after 40 of 60 s."""
    folder = tmp_path_factory.mktemp("calibrate")
    path = write_robot(folder)
    config = load(path, {})
    write_record(folder / "healthy.csv", config, 60, seed)
    write_record(folder / "faulty.csv", config, 60, seed + 1, {"kT": 0.8}, 40.0)
    return path


@pytest.fixture(scope="module")
def found(robot: Path) -> Calibration:
    config = load(robot, {})
    return calibrate_axis(config, config.axes[0], [str(robot.parent / "healthy.csv")], OPTIONS, PROVENANCE)


def test_the_promise_and_faults_that_are_found(found: Calibration) -> None:
    assert [detector.detector for detector in found.detectors] == ["multimodel", "cusum"]
    for detector in found.detectors:
        most, low, high = detector.between_s
        assert low < most < high
        assert low > 0.8 * 600
        assert "one false alarm in" in detector.promise
    assert found.result.onsets == 8
    for detector in found.detectors:
        for name in found.result.model.monitored:
            up, down = detector.smallest(name)
            assert up in (0.02, 0.2)
            assert down in (-0.02, -0.2)
        rows = detector.confusion()
        assert all(sum(row.values()) == 4 * 8 for row in rows.values())
        assert max(rows["kT"], key=lambda name: rows["kT"][name]) == "kT"
    assert {caught.fault.parameter for caught in found.result.caught if caught.exact} == {"kT", "fm"}
    assert found.result.tests.confusion()["kT"]["kT"] > 24


def test_records_of_an_hour_say_what_to_expect_of_another_temperature(robot: Path, found: Calibration) -> None:
    """An axis whose friction follows a temperature raises no alarm outside its range: it is not tested there."""
    (caution,) = (words for words in found.warnings if "of one day" in words)
    assert "Expect alarms when it is warmer or colder" in caution
    header, *rows = (robot.parent / "healthy.csv").read_text(encoding="utf-8").splitlines()
    measured = [f"{header},temp", *(f"{row},30" for row in rows)]
    (robot.parent / "measured.csv").write_text("\n".join(measured) + "\n", encoding="utf-8")
    signal = (
        '[[robot.axis.signal]]\nname = "temperature"\ncolumn = "temp"\nmessage = "Axis1State"\nsignal = "Counter"\n'
    )
    schedule = 'parameter = "fm"\nsignal = "temperature"\nslope = -0.001\nreference = 30.0\n'
    text = f"{robot.read_text(encoding='utf-8')}{signal}[[robot.axis.model.schedule]]\n{schedule}"
    (robot.parent / "follows.toml").write_text(text, encoding="utf-8")
    config, few = load(robot.parent / "follows.toml", {}), replace(OPTIONS, onsets=1, copies=50_000)
    follows = calibrate_axis(config, config.axes[0], [str(robot.parent / "measured.csv")], few, PROVENANCE)
    (caution,) = (words for words in follows.warnings if "of one day" in words)
    assert "Friction follows temperature. Where that is more than a tenth" in caution
    assert "the axis is not tested; add records" in caution
    short = SampleBlock(np.array([0, 5000], np.int64), np.zeros(2), np.zeros(2))
    (heated,) = one_sided([short], [], {"heat"})
    assert "outside the range of the records, only larger changes are found; add records" in heated


@pytest.mark.parametrize(
    ("starts_s", "words"), [((0,), "are of one day and"), ((0, 0), ""), ((0, 40), "are of one day and")]
)
def test_records_that_each_begin_at_zero_may_be_of_several_days(starts_s: tuple[int, ...], words: str) -> None:
    minute = np.array([0, 30_000_000], np.int64)
    records = [SampleBlock(minute + 1_000_000 * start, np.zeros(2), np.zeros(2)) for start in starts_s]
    (caution,) = one_sided(records, [])
    assert caution.startswith(f"The records {words} last 30 s at most.".replace("  ", " "))


def test_the_same_again_is_the_same(robot: Path) -> None:
    """Also of the bank, whose copies run beside the others: neither takes the other's draws."""
    config = load(robot, {})
    few = CalibrationOptions(300.0, 4.0, (0.2,), 1, copies=20_000, bank_copies=10_000)
    records = [str(robot.parent / "healthy.csv@0:30")]
    first, again = (calibrate_axis(config, config.axes[0], records, few, PROVENANCE) for _ in range(2))
    assert first.result.bank is not None
    assert as_toml(again) == as_toml(first)


def test_the_daemon_uses_the_file_and_then_the_multimodel_detector_alarms(
    robot: Path, found: Calibration, tmp_path: Path
) -> None:
    (tmp_path / "demo.dbc").symlink_to(robot.parent / "demo.dbc")
    (tmp_path / "thresholds.toml").write_text(as_toml(found), encoding="utf-8")
    (tmp_path / "robot.toml").write_text(named(robot_text()), encoding="utf-8")
    axis = load(tmp_path / "robot.toml", {}).axes[0]
    model = axis_model(axis.config)
    settings = axis_settings(axis, model)
    for loaded, calibrated in zip(settings.thresholds, found.result.settings.thresholds, strict=True):
        assert loaded == pytest.approx(calibrated, rel=1e-9)
    content = tomllib.loads(as_toml(found))
    assert content["false_alarms"]["budget_s"] == 600.0
    assert content["record"][0]["samples"] == 12000
    assert found.result.bank is not None
    own = found.result.bank.thresholds.own
    assert {"kT", "1/Ja", "fm", "torque sign", "output stuck"} <= {limit.cause for limit in own}
    assert all(5 < limit.h < 60 for limit in own)
    chosen = detectors_of(axis, model, settings)
    assert chosen.alarm_source == found.alarms == "multimodel"
    assert chosen.multimodel is not None
    bank = chosen.multimodel.bank
    assert [(hypothesis.cause, hypothesis.alike) for hypothesis in bank.hypotheses] == [
        (limit.cause, limit.alike) for limit in own
    ]
    np.testing.assert_allclose(bank.allowance, [limit.allowance for limit in own])
    assert bank.evidence_share == pytest.approx(found.result.bank.evidence_share, rel=1e-9)


@pytest.mark.parametrize("configured", ["report", "wait"])
def test_outside_the_speed_of_the_records_the_axis_is_marked_or_waits(
    robot: Path, found: Calibration, tmp_path: Path, configured: str
) -> None:
    """The record itself, beside thresholds whose records were slower."""
    text = as_toml(found)
    condition, top = tomllib.loads(text)["range"]
    assert (condition["condition"], top["condition"]) == ("rms speed", "top speed")
    assert 0 == top["low"] < condition["low"] < condition["high"] < top["high"]
    slower = re.sub(r'(condition = "rms speed"\nlow = ).*\nhigh = .*', r"\g<1>0.01\nhigh = 0.02", text)
    (tmp_path / "demo.dbc").symlink_to(robot.parent / "demo.dbc")
    for thresholds, outside in ((text, False), (slower, True)):
        (tmp_path / "thresholds.toml").write_text(thresholds, encoding="utf-8")
        own = f'[robot.axis.detector]\noutside_calibration = "{configured}"'
        (tmp_path / "robot.toml").write_text(
            named(robot_text()).replace("[robot.axis.detector]", own), encoding="utf-8"
        )
        config = load(tmp_path / "robot.toml", {})
        monitors = AxisMonitors(config.axes)
        for step in read_record(robot.parent / "healthy.csv", config).steps():
            monitors.update(step.samples)
        (axis_id,) = monitors.by_id
        words = "; ".join(monitors.axes[axis_id].outside_calibration)
        assert words.startswith("rms speed = ") == outside
        assert monitors.axes[axis_id].gated_by == (words if configured == "wait" else "")
        status = monitors.by_id[axis_id].status()
        assert (status.counters["gated"] > 1000) == (outside and configured == "wait")
        waits = "and its records show no warm-up. Needed: an hour more of samples"
        untested = " ".join(not_tested_sentences(status.untested(), status))
        assert (waits in untested) == (configured == "wait" and not outside)


def test_page(found: Calibration) -> None:
    page = as_html(found)
    assert page.count("<svg") == 3
    assert "<healthy.csv>" not in page
    assert not re.search(r"#01010\d|nan|inf\b", page)
    for words in ("Thresholds", "What will be found", "The smallest change", "exact", "simulated"):
        assert words in page


def refused(robot: Path, options: CalibrationOptions = OPTIONS, record: str = "healthy.csv", text: str = "") -> str:
    if text:
        (robot.parent / "changed.toml").write_text(text, encoding="utf-8")
        robot = robot.parent / "changed.toml"
    config: Config = load(robot, {})
    with pytest.raises(CalibrationError) as caught:
        calibrate_axis(config, config.axes[0], [str(robot.parent / record)], options, PROVENANCE)
    return str(caught.value)


def test_a_record_with_a_fault_in_it(robot: Path) -> None:
    words = refused(robot, record="faulty.csv")
    match = re.search(r"faulty\.csv: kT changes by -0\.[12]\d?.* about ([\d.]+) s after", words)
    assert match, words
    assert abs(float(match[1]) - 40) < 3


def test_a_record_that_is_too_short(robot: Path) -> None:
    words = refused(robot, record="healthy.csv@0:10")
    assert re.search(r"5\.\d* s of the records can be used, 6 memories of 1 s: at least 20 are needed, 20 s", words)
    from_first_samples = re.sub(r"^initial_p = .*\n", "", robot_text(), flags=re.MULTILINE)
    assert "too short for the tests to begin" in refused(robot, record="healthy.csv@0:10", text=from_first_samples)


def test_a_year_cannot_be_promised_from_25_seconds(robot: Path) -> None:
    words = refused(robot, replace(OPTIONS, budget_s=31557600.0, sizes=(0.2,)), "healthy.csv@0:26")
    assert "too short to promise one false alarm in a year" in words
    assert "or a budget of one in" in words


def test_less_time_than_a_memory_takes(robot: Path) -> None:
    words = refused(robot, CalibrationOptions(600.0, 1.0, (0.2,), 8))
    assert "--within 1: the memory is 1 s" in words


def test_budgets() -> None:
    texts = {"10min": 600.0, "1h": 3600.0, "2 hours": 7200.0, "30d": 2592000.0, "1y": 31557600.0, "90": 90.0}
    assert {text: seconds_of(text) for text in texts} == texts


@pytest.mark.parametrize("text", ["", "often", "0s", "-1h", "1.2.3h", "1 fortnight", "0.5s"])
def test_what_is_no_budget(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="write a time"):
        seconds_of(text)
