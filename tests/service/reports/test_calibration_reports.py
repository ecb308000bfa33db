"""What the reports of a calibration say, of one made by hand: each detector its own, and first the one that alarms."""

import io
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from monitor_core.detection import DetectorName
from monitor_core.detection.multimodel.multimodel_detector import HypothesisThreshold
from service.reports.calibration_files import as_html, as_json, as_toml
from service.reports.calibration_report import Calibration, answer, faults, hypotheses, print_text, promises
from service.reports.formats import TextTable
from tests.golden import check, page_text
from tests.service.reports.made import OWN, by_hand

GOLDEN = Path(__file__).parent / "golden"
BOTH: list[DetectorName] = ["multimodel", "cusum"]


def alarming(kind: DetectorName) -> Calibration:
    return replace(by_hand(), alarms=kind)


def causes(calibration: Calibration) -> TextTable:
    table = hypotheses(calibration)
    assert table is not None
    return table


def printed(calibration: Calibration, width: int = 160) -> str:
    console = Console(file=io.StringIO(), width=width, highlight=False)
    print_text(calibration, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("kind", BOTH)
def test_no_word_is_cut_in_a_narrow_terminal(kind: DetectorName) -> None:
    assert sorted(words(printed(alarming(kind), 80))) == sorted(words(printed(alarming(kind))))


def words(text: str) -> list[str]:
    """Whole, with the lines of the tables left out."""
    return [word for word in text.split() if word.strip("─")]


@pytest.mark.parametrize("kind", BOTH)
def test_the_report_on_the_terminal(kind: DetectorName) -> None:
    """Each detector with its promise, what it finds and how it names it; first the one that alarms."""
    lines = [line.rstrip() for line in printed(alarming(kind)).splitlines()]
    check("\n".join([*lines, ""]), GOLDEN / f"calibration_{kind}.txt")


def test_a_table_has_each_fact_once() -> None:
    alone = replace(by_hand(), result=replace(by_hand().result, bank=None), alarms="cusum")
    table = faults(alone, alone.result.tests)
    assert "models: median" not in table.titles
    assert table.rows[0] == ("kT +10 %", "exact", "13 %", "15 s", "27 s", "kT 67 %, 1/Ja 33 %")
    calibration = by_hand()
    assert calibration.result.bank is not None
    own = (*OWN, HypothesisThreshold("fm", 0.1, 5.71, 0.0), HypothesisThreshold("fm", -0.1, 5.74, 0.0))
    bank = replace(calibration.result.bank, thresholds=replace(calibration.result.bank.thresholds, own=own))
    alike = replace(calibration, result=replace(calibration.result, bank=bank))
    assert causes(alike).rows[-1] == ("fm", "2", "5.7", "0")


@pytest.mark.parametrize("kind", BOTH)
def test_the_report_as_a_page(kind: DetectorName) -> None:
    """The same; its first sentence is what the detector that alarms finds in time.

    That is the larger of the smallest changes up and down; where one way none is found, the other way is named.
    """
    check(page_text(as_html(alarming(kind))), GOLDEN / f"calibration_{kind}_page.txt")


def test_what_was_not_tried_is_not_promised() -> None:
    untried = replace(alarming("cusum"), result=replace(by_hand().result, bank=None, caught=[]))
    assert answer(untried) == "What would be found was not tried."


def test_the_files_for_programs_have_both() -> None:
    calibration = by_hand()
    as_read: dict[str, Any] = json.loads(as_json(calibration))
    rest: dict[str, Any] = tomllib.loads(as_toml(calibration))
    assert as_read["alarms"] == "multimodel"
    for kind in BOTH:
        assert f"# {next(promises(alarming(kind)))}\n" in as_toml(alarming(kind))
    assert as_read["provenance"]["version"] == "1.2.3"
    assert [len(found["faults"]) for found in (as_read, as_read["multimodel"])] == [8, 8]
    assert len(as_read["multimodel"]["hypotheses"]) == len(OWN)
    assert as_read["multimodel"]["evidence_share"] == rest["naming"]["evidence_share"] == 0.375
    for one_in, interval, found in (
        (7200, [3600, 36000], [as_read["false_alarms"], rest["false_alarms"]]),
        (10800, [5400, 72000], [as_read["multimodel"]["false_alarms"], rest["bank_false_alarms"]]),
    ):
        for false_alarms in found:
            assert false_alarms["one_in_s"] == pytest.approx(one_in)
            assert false_alarms["interval_s"] == pytest.approx(interval)
    assert as_read["first_named"] == {
        "kT": {"kT": 137, "1/Ja": 10, "none": 3},
        "1/Ja": {"kT": 0, "1/Ja": 60, "none": 30},
    }
    assert as_read["multimodel"]["named"]["1/Ja"] == {
        "kT": 0,
        "1/Ja": 75,
        "delay": 0,
        "fm": 15,
        "noise": 0,
        "none": 0,
    }
    assert as_read["parameters"][1]["smallest_found"] == {"increase": 0.5, "decrease": None}
    assert as_read["multimodel"]["smallest_found"]["1/Ja"] == {"increase": 0.2, "decrease": -0.5}
    assert as_read["faults"][7]["delay_median_s"] is None
    assert as_read["multimodel"]["faults"][7]["delay_median_s"] == 0.7
    assert [hypothesis["h"] for hypothesis in rest["hypothesis"]] == [11.0, 12.0, 13.0]
    assert "size" not in rest["hypothesis"][2]


def test_an_axis_without_a_multimodel_detector() -> None:
    calibration = replace(by_hand(), result=replace(by_hand().result, bank=None), alarms="cusum")
    for words in (as_html(calibration), printed(calibration)):
        assert "No multi-model detector" in words
        assert "models: up" not in words
        assert "Thresholds of the multi-model detector" not in words
    assert json.loads(as_json(calibration))["multimodel"] is None
    assert "hypothesis" not in tomllib.loads(as_toml(calibration))
