"""``axiswatch identify`` as its users call it: files, exit codes, words."""

import json
import re
import shutil
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from service.config import ConfigErrors, load
from tests import golden
from tests.conftest import ROOT
from tests.end_to_end.processes import edit
from tests.service.command_line import axiswatch, session
from tests.service.commands.identify.conftest import FREE, write_record, write_robot

pytestmark = pytest.mark.usefixtures("without_pictures")

NAMES = ",".join(FREE)


@pytest.fixture
def directory(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files, in which the command runs."""
    for name in ("demo.dbc", "robot.toml", "healthy.csv", "second.csv"):
        shutil.copy(folder / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def identify(words: str) -> Result:
    """From the configured values alone, which is fast."""
    return axiswatch("identify", "--start", "values", "--config", "robot.toml", *words.split())


def found(words: str) -> Any:
    """What is found, as JSON."""
    result = identify(f"{words} --json -")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def refused(words: str) -> str:
    """The one message, of exit code 2; nothing was written."""
    result = identify(words)
    assert result.exit_code == 2, result.output
    assert not Path("nominal.toml").exists()
    return " ".join(result.stderr.replace("│", " ").split())


def test_files_are_written_and_the_next_search_starts_from_there(directory: Path) -> None:
    result = identify(f"healthy.csv@0:8 --axis axis1 --free {NAMES} --json j.json")
    assert result.exit_code == 0, result.output
    assert "written: nominal.toml, report.html, j.json" in result.stderr
    assert "demo.axis1: three-mass" in result.stdout
    assert (directory / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    mode = stat.S_IMODE((directory / "nominal.toml").stat().st_mode)
    assert mode == stat.S_IMODE((directory / "second.csv").stat().st_mode)
    assert sorted(p.name for p in directory.iterdir() if p.name.startswith(".")) == []
    before = (directory / "nominal.toml").read_bytes()
    again = identify("healthy.csv")
    assert (again.exit_code, "--force" in again.output) == (2, True)
    assert (directory / "nominal.toml").read_bytes() == before
    # The values found before are where the next search starts.
    with_nominal_file(directory, "nominal.toml")
    load(directory / "robot.toml", {})
    rows = {p["name"]: p for p in found(f"healthy.csv@8:20 --free {NAMES} -o next.toml")["parameters"]}
    assert abs(rows["Jm"]["change"]) < 0.01


def test_files_where_they_are_wanted_and_json_alone_on_standard_output(directory: Path) -> None:
    (directory / "out").mkdir()
    assert found(f"second.csv --free {NAMES} -o out/nominal.toml")["axis"] == "demo.axis1"
    assert sorted(p.name for p in (directory / "out").iterdir()) == ["nominal.toml", "report.html"]


def test_a_mistake_is_named(directory: Path) -> None:
    own = "--start values --config robot.toml"
    mistakes = (
        *("none.csv", "robot.toml", "healthy.csv@5:2", "healthy.csv@100:200", "healthy.csv@3:3.1"),
        *("healthy.csv@2:2.2 second.csv@1:1.1", "healthy.csv --validate none.csv"),
        *("healthy.csv --validate healthy.csv@3:3.1", "healthy.csv --axis axis9", "healthy.csv --free jm"),
        *("healthy.csv --free Jm --fix Jm", f"healthy.csv --free kT,{NAMES}", "healthy.csv --predictor arx"),
        *("healthy.csv --predictor output-error --disturbance 1", "healthy.csv --disturbance 0"),
        *("healthy.csv -o none/nominal.toml", "healthy.csv -o x --report x", ""),
    )
    text = session("identify", *(f"{own} {words}".rstrip() for words in mistakes))
    golden.check(text, Path(__file__).parent / "golden" / "identify_mistakes.txt")
    assert not (directory / "nominal.toml").exists()


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1e3, "its samples are 5 s apart, but sample_interval_s = 0.005: times must be in seconds, these look like"),
        (1e6, "these look like microseconds"),
        (0.2, "its samples are 0.001 s apart, but sample_interval_s = 0.005: correct it, or the times"),
    ],
)  # fmt: skip
def test_times_in_other_units_are_refused(directory: Path, factor: float, words: str) -> None:
    assert words in refused(times(directory, "second.csv", t=factor))


def times(directory: Path, record: str, t: float = 1.0, torque: float = 1.0) -> str:
    """Name of a copy of the record whose columns are multiplied by these factors."""
    table = np.loadtxt(directory / record, delimiter=",", skiprows=1) * [t, torque, 1.0]
    np.savetxt(directory / "other.csv", table, delimiter=",", header="t,torque,angle", comments="")
    return "other.csv"


def test_a_small_error_of_the_interval_is_not_reported(directory: Path) -> None:
    """Not half a per cent; of two per cent, see the advice below."""
    warnings = found(f"{times(directory, 'second.csv', t=1.005)} --free Jm --force")["warnings"]
    assert not [word for word in warnings if "belongs to the interval of this record" in word]


def test_a_torque_with_the_wrong_sign_is_named(directory: Path) -> None:
    assert "wrong sign" in refused(times(directory, "healthy.csv", torque=-1))


def test_a_poor_fit_is_written_with_force_only(directory: Path) -> None:
    """Only Jm is free, and the configured springs are wrong: no value of Jm explains the motion."""
    message = refused("second.csv --free Jm")
    assert "no nominal values: the drive does not explain the motion" in message
    assert "--force writes them" in message
    assert "No nominal values:" in (directory / "report.html").read_text(encoding="utf-8")
    forced = identify("second.csv --free Jm --force")
    assert forced.exit_code == 0, forced.output
    outlook, verdict = forced.stdout.splitlines()[:2]
    assert "Alarms would come from what the drive lacks. Cannot: fm, since" in outlook
    assert verdict.startswith("demo.axis1: poor fit: the simulation explains ")
    assert (directory / "nominal.toml").exists()
    content = found(f"healthy.csv --free {NAMES} --force")
    assert content["verdict"]["quality"] == "good"
    assert content["verdict"]["validation"] == "halves"
    assert content["verdict"]["missing"] == []


def test_a_fit_that_does_not_converge_makes_no_nominal_values(directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor_core.identification.identification_procedure.MOST_ITERATIONS", 2)
    message = refused(f"second.csv --free {NAMES}")
    assert "no nominal values: the fit has not converged after 2 evaluations, and " in message
    # What moves, of what is free, and what to do.
    moving = message.split("evaluations, and ")[1].split(" would still move")[0].split(", ")
    assert set(moving) <= set(NAMES.split(","))
    assert "--fix" in message
    assert "No nominal values:" in (directory / "report.html").read_text(encoding="utf-8")


def test_a_folder_that_cannot_be_written_to_is_named(directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, _: str) -> None:
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("service.commands.command_line.output_files.replace_text", full)
    assert "cannot write nominal.toml: No space left on device" in refused(f"second.csv --free {NAMES}")


def test_a_drive_from_a_file_is_named_with_its_hash(directory: Path, seed: int) -> None:
    drawn = (ROOT / "config/drives/three_mass.mo").read_bytes()
    (directory / "mine.mo").write_bytes(drawn)
    robot = edit(write_robot(directory), ('"three-mass"', '"mine.mo"'))
    write_record(directory / "mine.csv", load(robot, {}), 6, seed)
    name, digest = found("mine.csv --free Jm,fm")["provenance"]["drawing"]
    assert (name, len(digest)) == ("mine.mo", 64)
    assert f'sha256 = "{digest}"' in (directory / "nominal.toml").read_text(encoding="utf-8")


def test_the_advice_on_the_interval_works(directory: Path) -> None:
    """An interval that is 2 % off: what the note says makes a configuration that the daemon accepts."""
    words = " ".join(found(f"{times(directory, 'healthy.csv', t=1.02)} --free {NAMES} -o next.toml")["warnings"])
    advice = re.search(r"set (sample_interval_s = [\d.]+)\.", words)
    assert advice, words
    assert words.count("belongs to the interval of this record") == 1
    with_nominal_file(directory, "next.toml")
    with pytest.raises(ConfigErrors, match="found with samples every"):
        load(directory / "robot.toml", {})
    edit(directory / "robot.toml", ("sample_interval_s = 0.005", advice[1]))
    load(directory / "robot.toml", {})


def with_nominal_file(directory: Path, name: str) -> None:
    """The configuration with that file in place of its own values."""
    text = (directory / "robot.toml").read_text(encoding="utf-8")
    start, rest = text.split("[robot.axis.model.nominal]")
    rest = "[robot.axis.estimator]" + rest.split("[robot.axis.estimator]")[1]
    rest = re.sub(r"(torque_noise|output_noise|initial_p) = .*\n", "", rest)
    start = start.replace('drive = "three-mass"', f'drive = "three-mass"\nnominal_file = "{name}"')
    (directory / "robot.toml").write_text(start + rest, encoding="utf-8")
