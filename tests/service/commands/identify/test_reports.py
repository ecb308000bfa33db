"""nominal.toml, the page, the JSON and the terminal say what was found."""

import hashlib
import io
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from monitor_core.drive import ThermalModel
from monitor_core.identification import Effect, FoundWarmUp, IdentificationResult, Obstacle, Watched
from service.commands.commissioning.axis.identification_task import Request, prepare
from service.config.schema.found_file import read_found
from service.config.schema.nominal_file import NominalFile, structure_of
from service.reports.identification_files import as_json, as_toml
from service.reports.identification_html import as_html
from service.reports.identification_report import IdentificationReport
from service.reports.identification_tables import print_text, residual_words, verdict_line
from service.reports.outlook_words import missing_words, watched_table
from tests.service.commands.identify.conftest import PROVENANCE, with_estimate
from tests.service.reports.report_pages import read


@pytest.fixture(scope="session")
def page(found: IdentificationReport) -> str:
    return as_html(found)


# --- nominal.toml ------------------------------------------------------------------------------------


def test_the_file_has_what_was_found(found: IdentificationReport, tmp_path: Path) -> None:
    path = tmp_path / "nominal.toml"
    path.write_text(as_toml(found), encoding="utf-8")
    read, e = read_found(NominalFile, path), found.result.estimate
    assert read.values == pytest.approx(dict(e.values), rel=1e-9)
    assert read.predictor.gain == pytest.approx(e.K.tolist(), rel=1e-9)
    assert read.predictor.innovation_variance == pytest.approx(e.lam0, rel=1e-9)
    coloured = replace(found, result=replace(found.result, colour=7.25))
    path.write_text(as_toml(coloured) + "\n", encoding="utf-8")
    assert read_found(NominalFile, path).predictor.lam0 == pytest.approx(7.25 * e.lam0)
    assert (read.predictor.kind, read.predictor.interval_s) == ("innovations", 0.005)
    assert read.drive.structure == structure_of(found.result.start.drive)
    assert (read.axis, read.date) == ("demo.axis1", PROVENANCE.date)
    assert read.noise.torque == pytest.approx(e.noise["torque"], rel=1e-9)


def test_the_file_has_the_covariance_its_origin_and_notes(found: IdentificationReport, folder: Path) -> None:
    content, e = tomllib.loads(as_toml(found)), found.result.estimate
    sd = np.array([content["standard_deviations"][name] for name in e.names])
    assert content["correlation"]["names"] == list(e.names)
    covariance = np.array(content["correlation"]["matrix"]) * np.outer(sd, sd)
    assert np.allclose(covariance, e.covariance, rtol=1e-3, atol=1e-3 * np.outer(sd, sd).min())
    content = tomllib.loads(as_toml(found))
    digest = hashlib.sha256((folder / "healthy.csv").read_bytes()).hexdigest()
    first, second = content["record"]
    assert (first["purpose"], first["sha256"], first["used"]) == ("estimation", digest, 4000)
    assert second["purpose"] == "validation"
    assert first["fit_simulation"] == pytest.approx(found.result.estimation[0].fit_simulation, rel=1e-3)
    assert content["provenance"]["axiswatch"] == "1.2.3"
    text = as_toml(found)
    assert re.search(r"^Jm = 0\.00\d+  # kg m\^2, \+- [\d.]+ %; inertia of the motor$", text, re.MULTILINE)
    assert "kT = 1.0  # 1, held: not in --free" in text


def test_notes_cannot_break_the_file(found: IdentificationReport) -> None:
    nasty = "two\nlines\x7f\x00 # and = [more]"
    command = nasty.replace("\x00", "")
    provenance = PROVENANCE._replace(command=command, drawing=('a"b\\.mo', "00"))
    doubtful = replace(with_estimate(found, words=(nasty,)), provenance=provenance)
    content = tomllib.loads(as_toml(doubtful))
    assert content["provenance"]["command"] == command
    assert content["drive"]["file"] == 'a"b\\.mo'


def test_a_disturbance_and_a_delay_are_found_and_reach_the_file(folder: Path, robot: Any, tmp_path: Path) -> None:
    request = Request(start="values", free=("Jm", "fm", "Ja", "kg", "ka"), delay=True, disturbance_s=0.3)
    other = prepare(robot, robot.axes[0], [f"{folder / 'healthy.csv'}@0:6"], [], request).run(PROVENANCE)
    (tmp_path / "n.toml").write_text(as_toml(other), encoding="utf-8")
    read = read_found(NominalFile, tmp_path / "n.toml")
    (delay,) = (row for row in other.result.rows() if row.name == "delay")
    assert abs(delay.value) < 1e-4
    assert delay.unit == "s"
    assert read.drive.torque_disturbance
    assert read.values["Td"] == pytest.approx(0.3)
    assert len(read.predictor.gain) == 7
    assert read.predictor.torque_delay_s == pytest.approx(other.result.estimate.delay_s, abs=1e-12)


# --- report.html -------------------------------------------------------------------------------------


def test_the_page_stands_alone(page: str) -> None:
    """It asks for nothing, uses its own colours, and parts of its pictures have names of their own."""
    addresses = read(page).addresses
    assert addresses
    assert [a for a in addresses if not a.startswith(("#", "data:image/svg+xml;base64,"))] == []
    assert "url(" not in page.replace("url(#", "")
    assert "<script" not in page
    assert "@import" not in page
    assert "#0101" not in page
    for name in ("text", "quiet", "line", "band", "alarm"):
        assert f"stroke: var(--{name})" in page or f"fill: var(--{name})" in page, name
    defined = re.findall(r'<clipPath id="([^"]+)"', page)
    assert len(defined) > 5
    assert len(defined) == len(set(defined))


def test_the_page_has_all_parameters_and_warnings(page: str, found: IdentificationReport) -> None:
    text = " ".join(" ".join(read(page).texts).split())
    for row in found.result.rows():
        assert row.name in text
        assert row.meaning in text
    for words in (*found.warnings, *(test.words for test in residual_words(found))):
        assert words in text
    for words in (
        "healthy.csv",
        "second.csv",
        "three-mass",
        PROVENANCE.command,
        "ARX",
        found.estimation[0].sha256,
    ):
        assert words in text  # fmt: skip


def test_the_verdict_is_that_of_the_fit_and_what_users_write_is_escaped(found: IdentificationReport, page: str) -> None:
    assert "Nominal values found" in page
    stuck = as_html(with_estimate(found, converged=False, words=("<b onload=x>&",)))
    assert "No nominal values:" in stuck
    assert "Nominal values found" not in stuck
    assert "<b onload" not in stuck
    assert "&lt;b onload=x&gt;&amp;" in stuck
    read(stuck)


# --- JSON, terminal ----------------------------------------------------------------------------------


def test_the_json_has_everything_and_null_for_what_is_not_finite(found: IdentificationReport) -> None:
    content = json.loads(as_json(found))
    assert content["trustworthy"] is True
    assert {p["name"] for p in content["parameters"]} == {row.name for row in found.result.rows()}
    assert np.allclose(content["covariance"], found.result.estimate.covariance)
    assert content["predictor"]["gain"] == found.result.estimate.K.tolist()
    assert len(content["bode"]["drive"]["db"]) == len(content["bode"]["before"]["frequency_hz"])
    assert [r["purpose"] for r in content["records"]] == ["estimation", "validation"]
    covariance = found.result.estimate.covariance.copy()
    covariance[0, 0] = np.inf
    content = json.loads(as_json(with_estimate(found, covariance=covariance)))
    assert content["covariance"][0][0] is None
    assert (content["trustworthy"], "Jm" in content["why_not"]) == (False, True)


def test_the_terminal_has_the_table(found: IdentificationReport) -> None:
    console = Console(width=80, record=True, file=io.StringIO())
    print_text(found, console)
    text = console.export_text()
    assert "…" not in text
    for row in found.result.rows():
        assert row.name in text
    for trace in (*found.result.estimation, *found.result.validation):
        assert f"{trace.fit_simulation:.2f} %" in text


# --- What can be watched is first, then the verdict -------------------------------------------------------------------


def test_a_repeated_motion_is_no_test_of_the_values(found: IdentificationReport, tmp_path: Path) -> None:
    assert "one motion" not in verdict_line(found)
    again = replace(found, result=replace(found.result, verdict=found.result.verdict._replace(repeats_s=10.02)))
    line = verdict_line(again)
    assert line.startswith("demo.axis1: good fit of one motion: the simulation explains ")
    assert "; all records repeat one motion of 10 s, so this does not show that inertia and friction are right" in line
    assert tomllib.loads(as_toml(again))["verdict"]["repeats_s"] == 10.02
    assert "repeats_s" not in tomllib.loads(as_toml(found))["verdict"]
    (tmp_path / "nominal.toml").write_text(as_toml(again), encoding="utf-8")
    assert read_found(NominalFile, tmp_path / "nominal.toml").values.keys() == found.result.estimate.values.keys()


def test_what_can_be_watched_is_first_and_the_verdict_second(found: IdentificationReport, page: str) -> None:
    console = Console(width=80, record=True, file=io.StringIO())
    print_text(found, console)
    lines = console.export_text().strip().splitlines()
    assert lines[0].startswith("demo.axis1: Can be watched: kT (changes from ")
    assert all(f"{name} (changes from" in lines[0] for name in ("kT", "1/Ja", "fm"))
    assert f"within a memory of {found.result.memory_s:g} s" in lines[0]
    assert lines[1].startswith("demo.axis1: good fit: the simulation explains ")
    text = " ".join(read(page).texts)
    outlook = lines[0].removeprefix("demo.axis1: ")
    assert text.index(outlook) < text.index(lines[1]) < text.index("Parameters")
    content = json.loads(as_json(found))
    assert content["verdict"]["validation"] == "records"
    assert (content["verdict"]["quality"], content["outlook"]) == ("good", outlook)
    assert tomllib.loads(as_toml(found))["verdict"]["explained"] > 90


@pytest.mark.parametrize(
    ("name", "obstacle", "words"),
    [
        ("fm", Obstacle.NO_SIZE, "in [robot.axis.model.scales]"),
        ("fc", Obstacle.NO_SIZE, "in [robot.axis.model.scales]. A torque sensor behind the gearbox"),
        ("fm", Obstacle.TOGETHER, "motion at several speeds"),
        ("kT", Obstacle.NOT_SHOWN, "faster motion"),
        ("1/Ja", Obstacle.NOT_SHOWN, "`axiswatch excite --find 1/Ja` plans"),
        ("tau0", Obstacle.NOT_SHOWN, "more of the angle range"),
    ],
)
def test_what_would_help_to_watch_a_parameter(
    found: IdentificationReport, name: str, obstacle: Obstacle, words: str
) -> None:
    lost = replace(found, result=replace(found.result, watched=(Watched(name, 2.0, obstacle),)))
    assert lost.outlook.startswith(f"Nothing can be watched with this. Cannot: {name}, since")
    assert words in lost.outlook


def test_friction_that_is_taken_as_constant_is_reported(found: IdentificationReport) -> None:
    """With a heat that something else follows, and without any."""
    heat = FoundWarmUp(ThermalModel(300.0, 1e-3, 0.1, 10.0), {"fm": (-1e-5, 1e-6)}, ((0.0,),), (0.0,))
    none = replace(found.result, not_following=("fm", "fc"))
    assert any("friction falls as the axis warms up: fm and fc taken" in w for w in notes(found, none))
    some = replace(found.result, not_following=("fc",), warm_up=heat)
    assert any("fm changes as the axis warms up, but not that fc would, too" in w for w in notes(found, some))
    assert not any("warms up" in w for w in found.warnings)


def test_what_a_temperature_or_the_heat_leaves_is_reported(found: IdentificationReport) -> None:
    """A hall of another temperature is observed, which has its price; a thermometer knows it."""
    fm, hall = found.result.estimate.values["fm"], "A hall that is colder or warmer"
    measured = notes(found, replace(found.result, temperature_errors={"fm": 0.1 * fm}))
    assert any("Beside the temperature fm is off by 10 %" in w and "2 times that" in w for w in measured)
    assert not any(hall in w for w in measured)
    model = ThermalModel(300.0, 1e-3, 0.1, 10.0, ambient=2.5)
    heat = FoundWarmUp(model, {"fm": (-0.02 * fm, 0.001 * fm)}, ((0.0,), (0.0,)), (0.0, -3.0), {"fm": 0.1 * fm})
    remarks = notes(found, replace(found.result, warm_up=heat))
    assert any(hall in w and "changes fm by up to 10 %." in w for w in remarks)
    assert any("differ from that of the first, by -3 W of heat, beside up to 10 W by friction" in w for w in remarks)
    alike = replace(heat, ambients=(0.0, 0.0))
    assert not any("halls of the records differ" in w for w in notes(found, replace(found.result, warm_up=alike)))


def notes(found: IdentificationReport, result: IdentificationResult) -> tuple[str, ...]:
    return replace(found, result=result).warnings


def test_a_load_is_explained_though_no_drive_has_it(found: IdentificationReport) -> None:
    shown = Watched("load", 0.06, None)
    table = watched_table(replace(found.result, watched=(shown,)))
    assert table.rows == [("load", "weight of arm and payload, relative to that of the records", "6 %")]
    hidden = replace(found.result, watched=(shown._replace(obstacle=Obstacle.NOT_SHOWN),))
    assert "record motion of the whole arm" in replace(found, result=hidden).outlook


def test_too_few_samples_are_nothing_that_the_drive_lacks(found: IdentificationReport) -> None:
    words = {e: missing_words(found.result.verdict._replace(missing=(e,))) for e in (Effect.OFFSET, Effect.SAMPLES)}
    assert words[Effect.OFFSET].startswith("The records show what the drive lacks: a constant torque acts")
    assert words[Effect.SAMPLES].startswith("The records do not show the motion: their samples are too far apart")
