"""``axiswatch commission``: from a table with columns of its own names to a configuration that ``replay`` takes."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from monitor_core.monitoring import axis_status
from service.commands.command_line import output_files
from service.commands.command_line.exit_codes import FAULT, MISTAKE, NOT_TESTED
from service.commands.commissioning.axis import axis_processes
from service.commands.commissioning.signals.signal_proposals import Review, review
from service.commands.main import app
from service.config import Config, load
from service.ingest.records import record_ranges
from service.ingest.records.recorded_units import units_as_recorded
from service.reports.commissioning_report import Outcome
from tests.service.command_line import axiswatch
from tests.service.commands import can_logs
from tests.service.commands.commissioning.two_mass_tables import (
    AXIS,
    RECEIVED,
    VALUES,
    H,
    configured,
    read_rows,
    table,
    write_rows,
)

pytestmark = pytest.mark.usefixtures("without_pictures")


def test_from_a_table_to_a_configuration(folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A torque of the wrong sign and a wrong interval are put right; what is there is not computed again.

    An axis that stands still does not hinder the other.
    """
    record = table(folder / "healthy.csv", seed, 25.0, axes=2, sign=-1)
    text = record.read_text(encoding="utf-8").splitlines()
    still = [text[0], *(",".join([*line.split(",")[:3], "0.1", "0"]) for line in text[1:])]
    record.write_text("\n".join(still) + "\n", encoding="utf-8")
    config = configured(folder / "robot.toml", *(AXIS.format(n=n, interval=x) for n, x in ((1, 0.01), (2, H))))
    words = ("commission", record, "--config", config, "--budget", "2min", "--output", "made", "--yes")
    result = axiswatch(*words)
    assert result.exit_code == NOT_TESTED, result.output
    assert "cell.a2: not identified: column A2_Trq (the torque) is 0.1 throughout" in result.output
    assert "Not complete: cell.a2" in result.output
    assert "the wrong sign" in result.output
    assert "0.005 s apart, not 0.01 s" in result.output
    made = (folder / "made" / "axiswatch.toml").read_text(encoding="utf-8")
    assert "# my robot" in made
    assert "# on the floor" in made
    (axis,) = load(folder / "made" / "axiswatch.toml").axes
    assert axis.id == "cell.a1"
    assert axis.config.torque.factor == -1
    assert axis.config.sample_interval_s == 0.005
    assert axis.config.model.monitor == ("kT", "fm")
    page = (folder / "made" / "report.html").read_text(encoding="utf-8")
    assert "1 of 2 axes ready." in page
    for shown_text in (result.output, page):
        assert "Found within " in shown_text
        assert "Can be watched" not in shown_text
    assert 'href="cell.a1-identification.html"' in page

    before = {path: path.stat().st_mtime_ns for path in (folder / "made").glob("cell.a1*")}
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # without a process for each axis
    assert axiswatch(*words).exit_code == NOT_TESTED
    assert {path: path.stat().st_mtime_ns for path in (folder / "made").glob("cell.a1*")} == before

    faulty = table(folder / "faulty.csv", seed + 1, 25.0, fault=0.8, sign=-1)
    found = axiswatch("replay", faulty, "--config", folder / "made" / "axiswatch.toml")
    assert found.exit_code == 0, found.output
    assert "kT" in found.output.split("Alarms")[1]


def test_some_axes_only(folder: Path, seed: int) -> None:
    """The other axis stays as an earlier call has found it, with its corrections.

    Where nothing is new the axis is not computed again, so it has seen these corrections, too.
    """
    record = table(folder / "healthy.csv", seed, 25.0, axes=2, sign=-1)
    config = configured(folder / "robot.toml", *(AXIS.format(n=n, interval=H) for n in (1, 2)))
    words = ("commission", record, "--config", config, "--budget", "2min", "--output", "made", "--yes")
    made = folder / "made"

    def written() -> dict[str, int]:
        return {path.name: path.stat().st_mtime_ns for path in made.glob("cell.a*")}

    assert axiswatch(*words).exit_code == 0
    before = written()
    again = axiswatch(*words, "--axis", "a1")
    assert again.exit_code == 0, again.output
    assert written() == before
    config.write_text(config.read_text(encoding="utf-8") + "# of both axes, something new\n", encoding="utf-8")
    other = axiswatch(*words, "--axis", "cell.a2")
    assert other.exit_code == 0, other.output
    assert "cell.a1" not in other.stdout
    changed = {name for name, time_ns in written().items() if before[name] != time_ns}
    assert changed
    assert all(name.startswith("cell.a2") for name in changed)
    assert [(axis.id, axis.config.torque.factor) for axis in load(made / "axiswatch.toml").axes] == [
        ("cell.a1", -1),
        ("cell.a2", -1),
    ]
    assert "2 of 2 axes ready." in (made / "report.html").read_text(encoding="utf-8")

    kept = made / "cell.a1.json"
    found = json.loads(kept.read_text(encoding="utf-8"))
    found["outcome"] |= {"motion": "report.html", "excite": ["--as", "speed"], "lost": ["1/Ja"]}
    kept.write_text(json.dumps(found), encoding="utf-8")
    assert "planned motion" not in axiswatch(*words, "--axis", "cell.a2").stdout  # of the other axis

    kept.unlink()
    only = axiswatch(*words, "--axis", "a2", "--axis", "cell.a2")
    assert only.exit_code == 0, only.output
    assert "cell.a1: not commissioned yet, so left out of the new configuration." in only.stdout
    assert [axis.id for axis in load(made / "axiswatch.toml").axes] == ["cell.a2"]
    unknown = axiswatch(*words, "--axis", "a3")
    assert unknown.exit_code == MISTAKE
    assert "a3 is not there" in unknown.output


def test_an_axis_that_its_own_records_do_not_test_is_not_ready(
    folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a range: the whole file would be long enough to count as tested.

    The torque is in percent of a rated torque that nobody has given: N m is none in the reports.
    """
    monkeypatch.setattr(axis_status, "MIN_TESTED_MEMORIES", 45)
    record = table(folder / "healthy.csv", seed, 80.0)
    record.write_text(record.read_text(encoding="utf-8").replace("A1_Trq", "A1_Trq_pct", 1), encoding="utf-8")
    axis = AXIS.format(n=1, interval=H).replace("output_noise", "memory_s = 1.0, output_noise")
    config = configured(folder / "robot.toml", axis.replace("A1_Trq", "A1_Trq_pct"))
    result = axiswatch("commission", "healthy.csv@:40", "--config", config, "--output", "made", "--yes")
    assert result.exit_code == NOT_TESTED, result.output
    page = (folder / "made" / "report.html").read_text(encoding="utf-8")
    assert "0 of 1 axis ready." in page
    assert "nothing is tested in its own records" in page
    assert re.search(r"In its own records kT and fm were tested for [\d.]+ s only, too short to find and name", page)
    unit = "state N m, it is percent of the rated torque. torque.factor = rated torque / 100 [N m]"
    for name in ("report.html", "cell.a1-identification.html", "cell.a1-calibration.html"):
        assert (folder / "made" / name).read_text(encoding="utf-8").count(unit) == 1, name
    replayed = axiswatch("replay", "healthy.csv", "--config", folder / "made" / "axiswatch.toml")
    assert replayed.exit_code == 0, replayed.output


@pytest.mark.parametrize(
    ("torque", "angle", "kept"),
    [
        ('column = "Trq_pct"', 'column = "Pos_mm"', ["N m", "rad"]),
        ('column = "Trq_pct", factor = 0.024', 'column = "Pos_mm", factor = 0.6', []),
        ('column = "Trq_pct", kT_Nm_per_A = 0.2', 'column = "Pos_deg"', []),
    ],
)
def test_units_that_depend_on_the_drive_stay_where_no_factor_converts_them(
    torque: str, angle: str, kept: list[str], tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("Time,Trq_pct,Pos_mm,Pos_deg\n0.0,1,2,3\n0.1,1,2,3\n", encoding="utf-8")
    axis = AXIS.format(n=1, interval=H)
    axis = axis.replace('column = "A1_Trq"', torque).replace('column = "A1_Pos"', angle)
    read = load(configured(tmp_path / "robot.toml", axis))
    found = list(units_as_recorded(read, read.axes[0], tmp_path / "a.csv"))
    assert len(found) == len(kept)
    assert all(f"files state {unit}, it is " in words for unit, words in zip(kept, found, strict=True))


FULL = OSError(28, "No space left on device", "made/cell.a1.json")


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (
            RuntimeError("an odd one"),
            FAULT,
            "a fault of the program (RuntimeError: an odd one), please report it",
        ),
        (FULL, MISTAKE, "made/cell.a1.json: No space left on device"),
    ],
)
def test_a_fault_of_the_program_or_of_the_disk_is_shown_and_reported(
    error: Exception, code: int, words: str, folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> Outcome:
        raise error

    monkeypatch.setattr(axis_processes, "commission_axis", fails)
    record = table(folder / "healthy.csv", seed, 4.0)
    config = configured(folder / "robot.toml", AXIS.format(n=1, interval=H))
    command = ("commission", record, "--config", config, "--output", "made")
    result = CliRunner().invoke(app, [*map(str, command)])
    assert (result.exit_code, "Traceback" in result.stderr) == (code, code == FAULT)
    assert f"cell.a1: not commissioned: {words}" in result.output
    assert "0 of 1 axis ready." in (folder / "made" / "report.html").read_text(encoding="utf-8")
    monkeypatch.setattr(output_files, "replace_text", fails)
    if error is FULL:
        assert "cannot write made/report.html: No space left on device" in axiswatch(*command).stderr


@pytest.mark.parametrize("command", ["commission", "identify", "calibrate"])
def test_records_are_taken_in_the_order_of_their_times(
    command: str, folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first one begins cold, and heat goes on from one to the next."""

    def ordered(texts: Sequence[str], _config: Config) -> list[str]:
        return [texts[1], str(folder / "none.csv")]

    monkeypatch.setattr(record_ranges, "in_order_of_time", ordered)
    records = [table(folder / name, seed, 1.0) for name in ("late.csv", "early.csv")]
    known = "r = 0.0085, Jm = 0.01, Ja = 10, k = 1e4, d = 10, fm = 0.02, fc = 0.1, tau0 = 0"
    text = AXIS.format(n=1, interval=H).replace("r = 0.0085", known)
    result = axiswatch(command, *records, "--config", configured(folder / "robot.toml", text))
    assert result.exit_code == MISTAKE
    assert "none.csv" in result.stderr


def test_a_calibrated_axis_has_one_size_of_each_parameter() -> None:
    """The sizes of the identification are others, as they are found later; what cannot be watched is named anyway."""
    found = Outcome("a", outlook="Can be watched: kT. Cannot: fc.", obstacles="Cannot: fc.", watched=("kT",))
    assert found.answer == "Can be watched: kT. Cannot: fc."
    found = replace(found, within_s=30.0, smallest=(("kT", 0.1, -0.1),))
    assert found.answer == "Found within 30 s, either way: kT from 10 %. Cannot: fc."


def test_records_that_show_no_warm_up_are_not_all_that_a_robot_needs(folder: Path, seed: int) -> None:
    record = table(folder / "healthy.csv", seed, 70.0)
    config = configured(folder / "robot.toml", AXIS.format(n=1, interval=H))
    result = axiswatch("commission", record, "--config", config, "--budget", "2min", "--output", "made")
    assert result.exit_code == 0, result.output
    assert "The records of cell.a1 show no warm-up: if the robot was warm, expect alarms" in result.output


def test_all_wrong_at_once_ends_right(folder: Path, seed: int) -> None:
    """Milliseconds, per mille of 2.4 N m, counts of 2^14; the nominal values are about known."""
    record = table(folder / "healthy.csv", seed, 30.0)
    rows = read_rows(record)
    wrong = [1e3 * (rows[:, 0] - rows[0, 0]), 1000 / 2.4 * rows[:, 1], 2**14 / (2 * np.pi) * rows[:, 2]]
    write_rows(record, np.column_stack([wrong[0], *np.rint(wrong[1:])]))
    nominal = ", ".join(f"{name} = {0.9 * v if name in ('Jm', 'Ja') else v}" for name, v in VALUES.items())
    config = configured(folder / "robot.toml", AXIS.format(n=1, interval=H).replace("kT = 1, r = 0.0085", nominal))
    words = ("commission", record, "--config", config, "--budget", "2min", "--output", "made")
    asked = axiswatch(*words)
    assert asked.exit_code == MISTAKE
    assert "3 proposed changes, to be confirmed in a terminal" in " ".join(asked.stderr.replace("│", " ").split())
    result = axiswatch(*words, "--yes")
    assert result.exit_code == 0, result.output
    assert "per mille of a rated torque of about 2." in result.output
    assert "2^14 = 16384" in result.output
    assert "18 s of the records can be used, 18 memories of 1 s" in (folder / "made" / "report.html").read_text("utf-8")
    (axis,) = load(folder / "made" / "axiswatch.toml").axes
    assert axis.config.estimator.memory_s is not None
    assert 0.5 < axis.config.estimator.memory_s < 1
    assert axis.config.time.factor == 1e-3
    assert axis.config.motion.factor == pytest.approx(2 * np.pi / 2**14)
    assert axis.config.torque.factor == pytest.approx(2.4e-3, rel=0.25)
    found = axis.config.model.nominal_file
    assert found is not None
    scale = axis.config.torque.factor / 2.4e-3  # friction is as right as the rated torque
    assert found.values["fm"] == pytest.approx(scale * VALUES["fm"], rel=0.1)


def review_of_log(folder: Path, rows: Path) -> Review:
    """What is found about the frames of a table."""
    config = can_logs.configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 1, "rad"))
    log = can_logs.log_of(rows, config, folder / "healthy.log")
    return review(config.read_text("utf-8"), "cell.a1", [str(log)], folder)


@pytest.mark.parametrize(("seconds", "every_s", "waited_s"), [(20.0, 0.016, 0.0), (5.0, 0.2, 0.0), (5.0, 0.02, 0.15)])
def test_frames_in_bunches(seconds: float, every_s: float, waited_s: float, folder: Path, seed: int) -> None:
    """An adapter passes on the frames of 16 ms at once: the interval is right, the times are not.

    With whole bunches of 200 ms at both ends a record of 5 s is 2 % too short for its frames; it is 3 % too short
    where the first frames had waited for 150 ms.
    """
    rows = table(folder / "rows.csv", seed, seconds)
    columns = read_rows(rows)
    since = columns[:, 0] - columns[0, 0]
    bunch = np.floor(since / every_s + 1e-9)
    columns[:, 0] += (bunch + 1) * every_s - since + 1e-4 * (np.arange(since.size) - np.searchsorted(bunch, bunch))
    late = since < waited_s
    columns[late, 0] = columns[0, 0] + waited_s + 1e-5 * np.arange(np.count_nonzero(late))
    write_rows(rows, columns, form=RECEIVED)
    found = review_of_log(folder, rows)
    assert [correction.change for correction in found.corrections] == ['time.clock = "cyclic"']
    assert not found.faults


@pytest.mark.parametrize(
    ("scatter_s", "sampled", "changes"),
    [(8e-5, "evenly", ['time.clock = "cyclic"']), (8e-5, "when received", []), (0.0, "evenly", [])],
)
def test_times_of_receipt_that_scatter(
    scatter_s: float, sampled: str, changes: list[str], folder: Path, seed: int
) -> None:
    """By less than 2 % of the interval; the angle resolves that.  A controller may also sample at odd times."""
    rng, h, w = np.random.default_rng(seed), 0.005, 4 * np.pi
    t = h * np.arange(6000)
    late = np.abs(rng.normal(0, scatter_s, t.size)) if scatter_s else np.zeros(t.size)
    at = t + late if sampled == "when received" else t
    angle, speed = 5 * np.sin(w * at), 5 * w * np.cos(w * at)
    torque = 0.01 * -(w**2) * angle + 0.5 * np.tanh(speed) + 0.01 * speed + rng.normal(0, 0.02, t.size)
    rows = folder / "rows.csv"
    np.savetxt(rows, np.column_stack([1e3 + t + late, torque, angle]), "%.10g", ",", header="t,u,y", comments="")
    found = review_of_log(folder, rows)
    assert [correction.change for correction in found.corrections] == changes


@pytest.mark.parametrize(("bits", "every_s"), [(8, 0.004), (16, 0.0051), (8, 0.005)])
def test_a_counter_whose_cycle_is_another_one(bits: int, every_s: float, folder: Path, seed: int) -> None:
    """Times by the counter have the configured interval of 5 ms, whatever the true one is.  Each twentieth is lost."""
    rows = table(folder / "rows.csv", seed, 20.0)
    columns = read_rows(rows)
    columns[:, 0] *= every_s / 0.005
    write_rows(rows, columns, form=RECEIVED)
    messages = can_logs.dbc(folder / "robot.dbc", 1, "rad")
    text = messages.read_text("utf-8").replace("24|40@1- (1E-006,0) [-549755|549755]", "24|24@1- (1E-005,0) [-83|83]")
    text = text.rstrip() + f'\n SG_ Joint1_Count : 48|{bits}@1+ (1,0) [0|{2**bits - 1}] "" Monitor\n'
    messages.write_text(text, "utf-8")
    config = can_logs.configured(folder / "robot.toml", messages)
    counter = 'time = { counter_message = "Joint1", counter_signal = "Joint1_Count" }\n'
    config.write_text(config.read_text("utf-8").replace("estimator =", f"{counter}estimator ="), "utf-8")
    log = can_logs.log_of(rows, config, folder / "all.log")
    lines, lost = log.read_text("utf-8").splitlines(keepends=True), folder / "healthy.log"
    lost.write_text("".join(line for k, line in enumerate(lines) if k % 20))
    found = review(config.read_text("utf-8"), "cell.a1", [str(lost)], folder)
    wanted = [] if every_s == 0.005 else [f"sample_interval_s = {every_s:g}"]
    assert [correction.change for correction in found.corrections][:1] == wanted


def test_frames_with_each_value_four_times(folder: Path, seed: int) -> None:
    """A drive that updates at 50 Hz on a bus of 200 Hz: what is to be changed is at the controller."""
    rows = table(folder / "rows.csv", seed, 20.0)
    columns = read_rows(rows)
    columns[:, 1:] = np.repeat(columns[::4, 1:], 4, axis=0)
    write_rows(rows, columns, form=RECEIVED)
    (fault,) = review_of_log(folder, rows).faults
    assert "torque and motion come 4 times as slowly as the frames" in fault
    assert "let the controller send each value once, every 0.02 s, and set sample_interval_s to that" in fault


def test_nothing_is_changed_without_consent(folder: Path, seed: int) -> None:
    record = table(folder / "healthy.csv", seed, 20.0)
    config = configured(folder / "robot.toml", AXIS.format(n=1, interval=0.01))
    result = axiswatch("commission", record, "--config", config, "--output", "made")
    assert result.exit_code == MISTAKE
    words = " ".join(result.stderr.replace("│", " ").split())
    assert "1 proposed change, to be confirmed in a terminal: cell.a1: sample_interval_s = 0.005" in words
    command = f"axiswatch commission {record} --config {config} --budget 1y --output made --yes"
    assert f"Accept all with: {command}" in result.stdout.splitlines()
    assert not list((folder / "made").iterdir())
