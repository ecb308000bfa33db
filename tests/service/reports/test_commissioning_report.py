"""What the report of a commissioning states of the axes, and which step it names next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from service.reports.commissioning_report import Outcome, as_html, next_step, overview
from service.reports.formats import Provenance


def test_what_the_thresholds_find_comes_first() -> None:
    """The records alone promise more than the tests may say that allow for the scatter of friction."""
    half = Outcome("cell.a1", within_s=50.0, smallest=(("kT", 0.05, -0.05), ("fc", None, -0.5), ("fm", None, None)))
    assert half.finding == "Found within 50 s, either way: kT from 5 %; as far as was tried, not fc, fm."
    assert replace(half, smallest=half.smallest[:1]).finding == "Found within 50 s, either way: kT from 5 %."
    assert Outcome("cell.a1").finding == ""


def test_an_axis_on_which_nothing_is_found_in_time_is_not_ready() -> None:
    blind = Outcome("cell.a1", watched=("kT",), within_s=50.0, smallest=(("kT", None, None),))
    some = Outcome("cell.a2", watched=("kT", "fm"), smallest=(("kT", 0.1, -0.2), ("fm", 0.5, None)))
    assert blind.state == "no change that was tried is found within 50 s"
    assert (some.state, some.finds) == ("ready", {"kT": 0.2})
    rows = overview([blind, some]).rows
    assert [row[2] for row in rows] == ["", "kT 20 %"]
    page = as_html([blind, some], "", Path("made/axiswatch.toml"), Provenance.now())
    assert "1 of 2 axes ready." in page


def test_what_all_axes_share_stands_once_and_commands_are_marked() -> None:
    axes = [Outcome(f"cell.a{n}", watched=("kT",), notes=("One <day>.", f"Axis {n}.")) for n in (1, 2)]
    refused = Outcome("cell.a3", refusal="not identified: it stands")
    step = "Next: `axiswatch run --config <file>`."
    page = as_html([*axes, refused], step, Path("made/axiswatch.toml"), Provenance.now())
    assert [page.count(f"<li>{words}</li>") for words in ("One &lt;day&gt;.", "Axis 1.", "Axis 2.")] == [
        1,
        1,
        1,
    ]
    assert page.index("One &lt;day&gt;.") < page.index("<h2>cell.a1</h2>") < page.index("Axis 1.")
    assert "Next: <code>axiswatch run --config &lt;file&gt;</code>." in page


def test_a_planned_motion_is_for_the_axes_that_have_one() -> None:
    moved = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",), motion="m.csv")
    others = [(), (Outcome("a2", refusal="not identified"),)]
    first, second = (next_step([moved, *more], Path("a.toml"), False, "again") for more in others)
    assert "What is missing takes a record of the planned motion: `again`." in first
    assert "What the records do not show of a1 takes a record of the planned motion: `again`." in second


def test_the_next_step_names_the_axes_whose_records_show_no_warm_up() -> None:
    ready = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",))
    cold = replace(ready, axis_id="a2", no_warm_up=True)
    refused = Outcome("a3", refusal="not identified", no_warm_up=True)
    words = "The records of {} show no warm-up"
    steps = [next_step(axes, Path("a.toml"), False, "again") for axes in ([ready], [ready, cold, refused])]
    assert words.format("a2") in steps[1]
    assert [step.count("show no warm-up") for step in steps] == [0, 1]


def test_the_next_step_warns_of_axes_that_are_tested_without_a_calibration() -> None:
    ready = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",))
    identified = Outcome("a2", refusal="not calibrated", nominal_file="n", watched=("kT",))
    refused = Outcome("a3", refusal="not identified")
    steps = [next_step(axes, Path("a.toml"), False, "again") for axes in ([ready, refused], [ready, identified])]
    assert ["thresholds" in step for step in steps] == [False, True]
    assert "That file tests a2 with thresholds that are not from the records" in steps[1]
