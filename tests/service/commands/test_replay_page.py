"""``axiswatch replay --report``: one page that needs nothing else."""

import json
import os
import re
from pathlib import Path

import pytest
from typer.testing import Result

from service.commands.command_line.exit_codes import NOT_TESTED
from service.simulation.robot import SimulatedFault
from tests.conftest import no_pictures
from tests.service.command_line import axiswatch, refused
from tests.service.reports.report_pages import read
from tests.service.robot_tables import START_S, configured, rows

GATE = """
[[robot.axis.signal]]
name = "mode"
message = "Axis2State"
signal = "Torque"
column = "mode"
[[robot.axis.gate]]
signal = "mode"
equals = [1]

"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    """Two axes of which one has a record: friction grows by half after eight seconds; a gap, a pause, a bad row."""
    folder = tmp_path_factory.mktemp("replay_page")
    file = configured(folder, "page", axes=2)
    head, first, second = file.read_text(encoding="utf-8").split("[[robot.axis]]")
    file.write_text("[[robot.axis]]".join([head, f"{first}{GATE}", second]), encoding="utf-8")
    lines = ["t,u,phi,mode"]
    for t, u, phi in rows(file, seed, [SimulatedFault("demo.axis1", {"fm": 1.5}, 8.0)], 20):
        s = t - START_S
        if not 1.0 < s < 1.3:
            lines.append(f"{t + (7200 if s > 18 else 0):.6f},{u!r},{phi!r},{0 if 7 < s < 7.5 else 1}")
    lines[900] = lines[900].replace(",", ",nan,", 1).rsplit(",", 2)[0] + ",1"
    (folder / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def run(folder: Path, *arguments: str | Path) -> Result:
    return axiswatch("replay", "--config", folder / "robot.toml", *arguments)


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    done = run(folder, folder / "a.csv", "--report", folder / "page.html")
    assert done.exit_code == NOT_TESTED, done.output  # there is no record of the second axis
    assert f"written: {folder / 'page.html'}" in done.stderr
    return (folder / "page.html").read_text(encoding="utf-8")


def test_the_page_needs_nothing_else_and_its_picture_shows_what_there_is(page: str) -> None:
    assert [a for a in read(page).addresses if not a.startswith("#")] == []
    assert "url(" not in page.replace("url(#", "")
    assert "<script" not in page
    assert "#0101" not in page
    assert "@media print" in page
    assert "prefers-color-scheme: dark" in page
    assert len(page) < 1_000_000
    for words in (
        *("estimate", "± 2 standard deviations", "nominal", "limits", "test for an increase"),
        *("test for a decrease", "interval of the onset", "alarm raised", "alarm, from onset to end"),
        *("nothing learned", "pause, cut out"),
        *("no samples", "settling", "gated", "tested", "not tested", "axis1 kT", "axis1 fm"),
    ):
        assert f">{words}</text>" in page, words
    assert page.count(">change [%]</text>") == 3
    assert page.count(">CUSUM</text>") == 3
    assert page.count(">multi-model</text>") == 1
    assert ">causes</text>" in page
    assert ">axis2 kT</text>" not in page  # it has no sample
    assert page.index("What was tested when") < page.index("Estimates at the end")
    assert "Long-term trend" not in page
    for absent in ("first uncertainty", "clock set back"):
        assert f">{absent}</text>" not in page


def test_the_page_has_the_alarms_and_counts_of_the_json(folder: Path, page: str) -> None:
    result = run(folder, folder / "a.csv", "--json", "-")
    with no_pictures():
        with_page = run(folder, folder / "a.csv", "--json", "-", "--report", folder / "again.html")
    assert with_page.stdout == result.stdout, "the report changes no number"
    found = json.loads(result.stdout)
    axis, silent = found["axes"]
    text = " ".join(" ".join(read(page).texts).split())
    assert "1 alarm of demo.axis1. No samples of demo.axis2." in text
    (alarm,) = axis["alarms"]
    assert alarm["words"] in text
    for time in (alarm["onset"], alarm["raised"]):
        assert time[:21].replace("T", " ") in text
    assert "with 1 pause cut out" in text
    assert "pause of 2 h" in text
    counts = {**axis["counters"], **axis["dropped"]}
    assert (counts["gap"], counts["not_finite"]) == (2, 1)
    assert counts["gated"] > 50
    for reason, count in counts.items():
        assert reason in text
        assert not count or f" {count} " in text
    for p in axis["parameters"]:
        assert p["name"] in text
    assert silent["samples"] == 0
    assert "No sample of this axis." in text


def test_records_without_dates_and_one_after_the_other(folder: Path, tmp_path: Path) -> None:
    """The second one begins before the first: the clock went back."""
    table = [line.split(",") for line in (folder / "a.csv").read_text(encoding="utf-8").splitlines()]
    early = [[f"{float(t) - START_S:.6f}", *rest] for t, *rest in table[1:2000]]
    text = "\n".join(",".join(row) for row in [table[0], *early])
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
    where = tmp_path / "two.HTML"
    assert run(folder, tmp_path / "a.csv", tmp_path / "b.csv", "--report", where).exit_code == NOT_TESTED
    page = where.read_text(encoding="utf-8")
    assert "Replay of a.csv and 1 more" in page
    assert "clock set back</text>" in page
    assert not re.search(r"1970-01-01 \d\d:", page)


def test_one_sample_can_be_drawn(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("t,u,phi,mode\n1,0,0,1\n", encoding="utf-8")
    assert run(folder, tmp_path / "one.csv", "--report", tmp_path / "one.html").exit_code == NOT_TESTED
    assert (tmp_path / "one.html").is_file()


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("missing/a.html", "missing/a.html cannot be written: missing is no folder"),
        ("taken/a.html", "taken/a.html cannot be written: taken is no folder"),
        ("full", "full is a folder"),
        ("locked/a.html", "locked/a.html cannot be written: Permission denied"),
    ],
)
def test_a_place_that_cannot_be_written_is_reported_at_once(
    where: str, words: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("")
    (tmp_path / "full").mkdir()
    (tmp_path / "locked").mkdir()
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: (str(path), mode) != ("locked", os.W_OK) and may(path, mode))
    assert words in refused("replay", "--config", folder / "robot.toml", folder / "a.csv", "--report", where)


def test_without_samples_there_is_nothing_to_draw(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "none.csv").write_text("t,u,phi,mode\n1,nan,0,1\n", encoding="utf-8")
    done = run(folder, tmp_path / "none.csv", "--report", tmp_path / "a.html")
    assert done.exit_code == 2
    assert done.stderr == (f"axiswatch: no sample of any axis in {tmp_path / 'none.csv'}: there is nothing to draw\n")
    assert not (tmp_path / "a.html").exists()
