"""Every command and program that README and docs show, run as it stands there."""

import json
import re
import subprocess
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import httpx
import pytest

from monitor_core.calibration import CalibrationOptions
from service.commands import commission
from service.commands.commissioning.axis import axis_processes
from service.commands.commissioning.live import live_recording
from service.config import load
from service.simulation.robot import SimulatedFault
from service.store.journal import Journal
from tests.conftest import no_pictures
from tests.end_to_end.documents import CONSOLE, DOCUMENTS, TEXTS, TOML, code, shown
from tests.end_to_end.played_robot import write_log
from tests.end_to_end.processes import PATIENCE_S, ROOT, demo_config, edit
from tests.service.command_line import axiswatch
from tests.service.commands import can_logs
from tests.service.commands.commissioned_demo import as_shipped
from tests.service.commands.commissioning.two_mass_tables import FEW, table
from tests.service.commands.identify.conftest import write_record, write_robot
from tests.service.commands.live_robots import configured, moving
from tests.service.pipeline.robots import replayed
from tests.service.web.conftest import FM_ALARM, Stage, serving, stored_history


def arguments(command: list[str], folder: Path) -> list[str]:
    """Without the program's name, its files in this folder."""
    files = (".toml", ".log", ".json", ".mo", ".csv", ".html")
    return [str(folder / word) if word.endswith(files) else word for word in command[1:]]


def test_every_command_shown_is_run_here() -> None:
    """`baseline`, and what it needs over REST, in tests/service/commands/test_baseline.py.

    What a daemon is needed for: in test_daemon.py.
    """
    starts = {" ".join(line.split()[:2]) if line.startswith("axiswatch") else line.split()[0] for line in CONSOLE}
    commands = (
        "check listen run status alarms history baseline token backup restore simulate replay play model excite"
        " identify calibrate init"
    )
    assert starts == {"curl", *(f"axiswatch {name}" for name in (*commands.split(), "commission"))}


@pytest.mark.parametrize("target", ["run", "test", "bench", "soak", "lint", "format", "docs", "lock", "image-test"])
def test_targets_of_make(target: str, need: Callable[[str], str]) -> None:
    done = subprocess.run(
        [need("make"), "-n", target], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S, check=True
    )
    assert done.stdout


def test_others_are_let_in(tmp_path: Path) -> None:
    """In the order of the documents: a token is made, listed and revoked, beside this [web]."""
    (web,) = (block for block in TOML if "[web]" in block)
    edit(demo_config(tmp_path, axes=1), ("[[bus]]", f"{web}\n[[bus]]"))
    results = [axiswatch(*arguments(command, tmp_path)) for command in shown("axiswatch token")]
    assert [result.exit_code for result in results] == [0, 0, 0]
    made, listed, revoked = (result.stdout for result in results)
    assert made.startswith("axw_")
    assert "operate" in listed
    assert revoked == "anna is revoked\n"


def test_an_experiment_is_planned(tmp_path: Path) -> None:
    demo_config(tmp_path, axes=1)
    (excite,) = shown("axiswatch excite")
    done = axiswatch(*arguments(excite, tmp_path))
    assert (done.exit_code, done.stderr) == (0, "")
    assert all(words in done.stdout for words in ("binds", "crest factor", "predicted sd", "1/Ja"))
    assert (tmp_path / "motion.csv").read_text(encoding="utf-8").startswith("t_s,torque_Nm,")


def test_a_table_and_ten_lines_are_enough_to_identify_an_axis(tmp_path: Path, seed: int) -> None:
    """What the motor feels of each mass, spring and bearing, within five standard deviations and half a per cent."""
    (tmp_path / "axis.toml").write_text(TOML[0], encoding="utf-8")
    assert len(TOML[0].splitlines()) <= 10
    true = load(write_robot(tmp_path), {})
    write_record(tmp_path / "healthy.csv", true, 20, seed)
    identify, validated, warm = shown("axiswatch identify")
    assert "--validate" in validated
    with no_pictures():
        done = axiswatch(*arguments(identify, tmp_path), "-o", tmp_path / "nominal.toml")
    assert done.exit_code == 0, done.stderr
    found = tomllib.loads((tmp_path / "nominal.toml").read_text(encoding="utf-8"))
    values, sds, nominal = found["values"], found["standard_deviations"], true.axes[0].config.model.nominal
    for name in ("Jm", "Jg", "Ja", "kg", "ka", "fm"):
        scale = 1.0 if name in ("Jm", "fm") else (values["r"] / nominal["r"]) ** 2
        off = abs(values[name] * scale - nominal[name])
        assert off < 5 * sds[name] * scale + 0.005 * nominal[name], name
    (tmp_path / "warm.toml").write_text(
        TOML[0] + next(block for block in TOML if 'column = "temp"' in block), encoding="utf-8"
    )
    rows = (tmp_path / "healthy.csv").read_text(encoding="utf-8").splitlines()
    warmer = [f"{row},{20 + n // 500 % 4}" for n, row in enumerate(rows[1:2001])]
    (tmp_path / "warm.csv").write_text("\n".join((rows[0] + ",temp", *warmer, "")), encoding="utf-8")
    with no_pictures():
        done = axiswatch(*arguments(warm, tmp_path))
    assert done.exit_code == 0, done.stderr
    (slope,) = tomllib.loads((tmp_path / "nominal-warm.toml").read_text(encoding="utf-8"))["schedule"]
    assert abs(slope["slope"]) < 5 * slope["standard_deviation"] + 0.001 * values["fm"]


def test_a_robot_is_commissioned_by_one_command(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "axis.toml").write_text(TOML[0], encoding="utf-8")
    write_record(tmp_path / "healthy.csv", load(write_robot(tmp_path), {}), 34, seed)
    monkeypatch.setattr(commission, "options_for", lambda _budget_s: FEW)
    monkeypatch.chdir(tmp_path)
    (_, init, *_), (_, command) = shown("axiswatch init"), shown("axiswatch commission")
    proposed = axiswatch(*init[1:], "-o", "proposed.toml")
    assert "axis: torque torque, angle angle: sure" in proposed.stdout
    with no_pictures():
        done = axiswatch(*command[1:])
    assert done.exit_code == 0, done.output
    (axis,) = load(tmp_path / "commissioned" / "axiswatch.toml", {}).axes
    assert axis.config.model.thresholds_file is not None
    assert "1 of 1 axis ready." in (tmp_path / "commissioned" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("identified", [False, pytest.param(True, marks=pytest.mark.soak)])
def test_a_robot_is_commissioned_on_its_bus(
    identified: bool, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bus in this process, on which a robot lives faster than the clock; its torque has the wrong sign."""
    if not identified:
        monkeypatch.setattr(axis_processes, "commission_axis", as_shipped)
    robot_config = configured(tmp_path / "true.toml", can_logs.dbc(tmp_path / "robot.dbc", 1, "rad"))
    rows = table(tmp_path / "rows.csv", seed, 40.0, sign=-1)
    monkeypatch.setattr(commission, "options_for", lambda _budget_s: replace(FEW, within_s=20.0))
    monkeypatch.setattr(live_recording, "LEAST_S", 1.0)
    monkeypatch.setattr(live_recording, "LOOK_S", 1.0)
    monkeypatch.chdir(tmp_path)
    (init, *_), (command, _) = shown("axiswatch init"), shown("axiswatch commission")
    bus = load(robot_config, {}).bus[0]
    init[init.index("socketcan:can0")] = f"virtual:{bus.channel},preserve_timestamps=true"
    command[command.index("10")] = "0.06"
    with no_pictures(), moving(rows, robot_config):
        proposed = axiswatch(*init[1:], "--seconds", 1)
        assert "axis1: torque Joint1.Joint1_Torque_Act [Nm]" in proposed.stdout, proposed.output
        done = axiswatch(*command[1:])
    assert done.exit_code == 0, done.output
    (axis,) = load(tmp_path / "commissioned" / "axiswatch.toml", {}).axes
    assert axis.config.torque.factor == -1
    assert axis.config.model.thresholds_file is not None
    assert "`axiswatch run --config commissioned/axiswatch.toml`" in done.stdout
    assert any("commissioned/axiswatch.toml" in run for run in shown("axiswatch run"))
    assert axiswatch("check", "--config", "commissioned/axiswatch.toml").exit_code == 0
    kept = [*tmp_path.glob("commissioned/records/*"), *tmp_path.glob("commissioned/robot1.axis1.json")]
    before = [path.stat().st_mtime_ns for path in kept]
    assert len(before) == 1 + identified
    again = axiswatch(*[word for word in command[1:] if word not in ("--minutes", "0.06")])
    assert again.exit_code == 0, again.output
    assert [path.stat().st_mtime_ns for path in kept] == before, "what was recorded is used again"


def test_an_axis_is_identified_calibrated_and_watched(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a rough guess, with records of half a minute: a third one is quiet, and a fault is named."""
    config = demo_config(tmp_path, axes=1)
    records = {"healthy": (), "second": (), "third": (), "faulty": (FAULT,)}
    for number, (name, faults) in enumerate(records.items()):
        write_log(tmp_path / f"{name}.log", load(config, {}), 30, seed + number, faults)
    text = config.read_text(encoding="utf-8")
    for name, guess in {"Jm": 0.004, "Ja": 150, "kg": 2e5, "ka": 4e5, "fm": 0.03, "fc": 0, "tau0": 0}.items():
        text = re.sub(rf"^{name} = [\d.]+", f"{name} = {guess}", text, flags=re.MULTILINE)
    config.write_text(text, encoding="utf-8")
    (identify,) = (command for command in shown("axiswatch identify") if "--validate" in command)
    done = axiswatch(*arguments(identify, tmp_path))
    assert done.exit_code == 0, done.stderr
    assert "second.log" in done.stdout
    assert (tmp_path / "report.html").stat().st_size > 100_000
    text = pointed_at_nominal(text)
    watches(config, text, "nominal.toml")

    (calibrate,) = shown("axiswatch calibrate")
    output = ("--output", tmp_path / "thresholds.toml", "--onsets", 5, "--sizes", "20", "--force")
    # Some of the copies: all of them take half a minute.
    fewer = partial(CalibrationOptions, copies=60_000, bank_copies=20_000)
    monkeypatch.setattr("monitor_core.calibration.CalibrationOptions", fewer)
    calibrated = axiswatch(*arguments(calibrate, tmp_path), *output)
    assert calibrated.exit_code == 0, calibrated.output
    assert "one false alarm in" in calibrated.stdout
    assert (tmp_path / "report.html").stat().st_size > 20_000
    text = re.sub(r"^alpha_[12] = .*\n", "", text, flags=re.MULTILINE)
    (snippet,) = (block for block in TOML if "thresholds_file" in block)
    watches(config, text.replace("[robot.axis.model]\n", snippet), "thresholds.toml")


def watches(config: Path, text: str, file: str) -> None:
    """With this configuration, which names that file, a healthy record is quiet and the fault is named."""
    config.write_text(text, encoding="utf-8")
    check = axiswatch("check", "--config", config)
    assert (check.exit_code, file in check.stdout) == (0, True)
    assert replayed(config, config.with_name("third.log"))["alarms"] == []
    (alarm,) = replayed(config, config.with_name("faulty.log"))["alarms"]
    assert (alarm["parameter"], alarm["direction"]) == ("fm", "up")
    assert alarm["size"] == pytest.approx(0.3 * 0.06, rel=0.1)


FAULT = SimulatedFault("demo.axis1", {"fm": 1.3}, 15.0)


def pointed_at_nominal(text: str) -> str:
    """The configuration with the lines of the README, without nominal values and noises of its own."""
    (snippet,) = (block for block in TOML if "nominal_file" in block)
    text = re.sub(r"\[robot\.axis\.model\.nominal\]\n.*?\n\n", "", text, flags=re.S)
    text = re.sub(r"^(torque_noise|output_noise|initial_p) = .*\n", "", text, flags=re.MULTILINE)
    return text.replace("[robot.axis.model]\n", snippet)


def test_the_drive_drawn_here_is_modelled_and_simulated(tmp_path: Path) -> None:
    (drawing,) = code("modelica")
    (tmp_path / "two.mo").write_text(drawing, encoding="utf-8")
    (model,) = shown("axiswatch model")
    modelled = axiswatch(*arguments(model, tmp_path))
    assert (modelled.exit_code, modelled.stderr) == (0, "")
    assert all(name in modelled.stdout for name in ("Jm", "Ja", "k", "d", "f", "motor", "arm"))
    config = edit(demo_config(tmp_path, axes=1), ('drive = "three-mass"', 'drive = "two.mo"'))
    text = re.sub(r"^initial_p = .*\n|\[robot.axis.model.nominal\]\n(.* = .*\n)*", "", config.read_text(), flags=re.M)
    config.write_text(text.replace('["kT", "1/Ja", "fm"]', '["1/Ja", "f"]'), encoding="utf-8")
    simulated = axiswatch("simulate", "--config", config, "--fault", "f=1.3", "--fault-after", "0.5", "--seconds", "1")
    assert (simulated.exit_code, simulated.stderr) == (0, "")
    assert "demo.axis1: f x 1.3" in simulated.stdout


def test_the_history_is_fetched_as_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(tmp_path / "alarms.sqlite")
    with stored_history(tmp_path) as history, serving(Stage(journal, history=history)) as url:
        monkeypatch.setenv("AXISWATCH_URL", url)
        for command in shown("axiswatch history"):
            done = axiswatch(*arguments(command, tmp_path))
            assert done.exit_code == 0, done.output
    journal.close()
    assert (tmp_path / "axis1.csv").read_text(encoding="utf-8").startswith("time,parameter,unit,n,estimate_mean")


def test_an_alarm_is_followed_by_command_line_and_by_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every step shown is possible, in the order of the document: of alarm 1 by commands, of alarm 2 by REST.

    Both ways take the axis of alarm 2 out of service and return it.
    """
    journal = Journal(tmp_path / "alarms.sqlite")
    stage = Stage(journal)
    stage.healthy()
    for axis in ("demo.axis1", "demo.axis2"):
        stage.record(axis, "N m s/rad", 0.06, FM_ALARM)
    with serving(stage) as url:
        monkeypatch.setenv("AXISWATCH_URL", url)
        for command in (*shown("axiswatch status"), *shown("axiswatch alarms")):
            done = axiswatch(*command[1:])
            assert done.exit_code == 0, done.output
        for command in shown("curl"):
            if "--json" in command and re.search("/alarms/|-service$", command[3]):
                address = command[3].replace("http://127.0.0.1:8080", url)
                assert httpx.post(address, json=json.loads(command[2]), timeout=PATIENCE_S).status_code == 200
    assert [len(journal.transitions(number)) for number in (1, 2)] == [5, 9]
    assert [a.work_order for a in journal.query()[0]] == ["WO-1718", "WO-1718"]
    journal.close()


def test_the_library_example_names_the_fault(capsys: pytest.CaptureFixture[str]) -> None:
    """With some of its copies, which are all the same to what it prints."""
    (program,) = (block for block in code("python") if "import monitor_core as mc" in block)
    shown = "copies=1_000_000, bank_copies=250_000"
    assert shown in program
    program = program.replace(shown, "copies=60_000, bank_copies=20_000")
    exec(compile(program, "README.md", "exec"), {})
    parameter, direction, _, size, *_ = capsys.readouterr().out.split()
    assert (parameter, direction) == ("kT", "up")
    assert float(size) == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_files_and_headings_that_are_named_are_there(path: Path) -> None:
    text = TEXTS[path.name]
    links = [link.partition("#")[::2] for link in re.findall(r"\]\(([^)\s:]+)\)", text)]
    assert [file for file, _ in links if file and not (path.parent / file).exists()] == []
    named = re.findall(r"`((?:service|monitor_core|tests)/[\w./]*)`", text)
    assert [name for name in named if not (ROOT / name).exists()] == []
    for file, anchor in links:
        headings = re.findall(r"^#+ (.+)$", TEXTS[Path(file).name] if file and anchor else text, re.M)
        anchors = {re.sub(r"[^\w -]", "", h).strip().lower().replace(" ", "-") for h in headings}
        assert not anchor or anchor in anchors, (file, anchor)
