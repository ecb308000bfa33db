"""Every mistake of a user: one message that names the thing, the documented exit code, no traceback."""

import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from service.commands.main import app
from service.store.journal import Journal
from tests.end_to_end.processes import demo_config
from tests.service.robot_tables import HEAD, configured


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """One axis with columns for tables, on a bus inside the process."""
    return configured(tmp_path, "mistakes")


def edited(config: Path, old: str, new: str) -> Path:
    text = config.read_text(encoding="utf-8")
    assert old in text
    config.write_text(text.replace(old, new), encoding="utf-8")
    return config


def axiswatch(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def refused(result: Result, code: int, *words: str) -> None:
    assert (result.exit_code, "Traceback" in result.output) == (code, False), result.output
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("command", ["run", "check", "simulate", "listen"])
def test_a_configuration_that_is_not_there(command: str, tmp_path: Path) -> None:
    refused(axiswatch(command, "--config", tmp_path / "none.toml"), 2, "none.toml", "No such file")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'signal = "Torque"',
            'signal = "Torgue"',
            ("robot.toml:", 'no signal "Torgue"', 'did you mean "Torque"?'),
        ),
        (
            "torque_noise = 0.05",
            "gain = [0.0, 0.0, -9.0, 0.0, 0.0, 0.1]\ntorque_noise = 0.05",
            ("demo.axis1: the predictor is not stable",),
        ),
        ('"virtual"', '"virtuel"', ("virtuel", 'did you mean "virtual"?')),
    ],
)
def test_a_wrong_configuration(old: str, new: str, words: tuple[str, ...], config: Path) -> None:
    edited(config, old, new)
    refused(axiswatch("run", "--config", config), 2, *words)


def test_two_axes_on_one_signal(tmp_path: Path) -> None:
    file = edited(demo_config(tmp_path, axes=2), '"Axis2State"', '"Axis1State"')
    refused(axiswatch("run", "--config", file), 2, "Axis1State.Torque is already used by")


@pytest.mark.parametrize("command", [["run"], ["listen"], ["simulate"], ["play"]])
def test_a_bus_that_cannot_be_opened(command: list[str], config: Path, tmp_path: Path) -> None:
    edited(config, 'interface = "virtual"\nchannel = "mistakes"', 'interface = "socketcan"\nchannel = "can9"')
    record = tmp_path / "a.csv"
    record.write_text(HEAD + "0.0,0.1,0.2\n0.005,0.1,0.2\n", encoding="utf-8")
    given = [record] if command == ["play"] else []
    refused(axiswatch(*command, "--config", config, *given), 3, "bus can0:", "can9")


def test_a_port_that_is_taken(config: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = axiswatch("run", "--config", config, "--port", str(port))
    refused(result, 4, f"port {port}", "taken")


def test_a_state_directory_that_is_a_file(config: Path, tmp_path: Path) -> None:
    (tmp_path / "state").write_text("", encoding="utf-8")
    refused(axiswatch("run", "--config", config, "--port", "0"), 4, str(tmp_path / "state"))


def test_a_state_directory_that_another_daemon_uses(config: Path, tmp_path: Path) -> None:
    journal = Journal(tmp_path / "state" / "alarms.sqlite")
    refused(axiswatch("run", "--config", config, "--port", "0"), 4, "is in use by process")
    journal.close()


@pytest.mark.parametrize(("name", "word"), [("there.log", "exists already"), ("new.csv", ".log")])
def test_a_recording_that_cannot_be(name: str, word: str, config: Path, tmp_path: Path) -> None:
    (tmp_path / "there.log").write_text("kept", encoding="utf-8")
    refused(axiswatch("run", "--config", config, "--port", "0", "--record", tmp_path / name), 2, name, word)
    assert (tmp_path / "there.log").read_text(encoding="utf-8") == "kept"


RECORDS = [
    ("none.csv", None, ("none.csv", "No such file")),
    ("table.xlsx", b"x", ("table.xlsx", ".csv .parquet .mat .log .asc .blf .trc")),
    ("a.csv", b"t,u\n0,1\n", ("a.csv", "phi", "the angle of axis demo.axis1")),
    ("a.parquet", b"PAR1 this is none", ("a.parquet",)),
    ("a.mat", b"\0" * 300, ("a.mat",)),
    ("a.log", b"(0.0) can0 181#00\nthis is no frame at all ###\n", ("a.log", "line 2")),
    ("empty.log", b"", ("empty.log", "no CAN frames")),
    ("a.blf", b"LOGG and then nothing", ("a.blf",)),
]


@pytest.mark.parametrize(("name", "content", "words"), RECORDS, ids=[name for name, _, _ in RECORDS])
def test_a_record_that_cannot_be_replayed(
    name: str, content: bytes | None, words: tuple[str, ...], config: Path, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    refused(axiswatch("replay", "--config", config, tmp_path / name), 2, *words)


def test_a_record_that_cannot_be_played(config: Path, tmp_path: Path) -> None:
    refused(axiswatch("play", "--config", config, tmp_path / "none.log"), 2, "none.log", "No such file")
    record = tmp_path / "far.csv"
    record.write_text(HEAD + "0.0,0.1,0.2\n0.005,99.0,0.2\n", encoding="utf-8")
    refused(
        axiswatch("play", "--config", config, "--speed", "0", record),
        2,
        "far.csv",
        "does not fit into signal",
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "--fault", "fm"], ("--fault", "PARAMETER=FACTOR")),
        (["simulate", "--fault", "fn=1.3"], ("no parameter 'fn'", "Jm, Jg")),
        (["simulate", "--fault", "fm=1.3", "--fault-axis", "axis9"], ("axis9", "demo.axis1")),
        (["run", "--port", "99999"], ("--port",)),
        (["demo", "--axes", "7"], ("--axes",)),
        (["play", "--speed", "-1", "a.log"], ("--speed",)),
        (["ruin"], ("ruin", "run")),
    ],
    ids=lambda value: " ".join(value),
)
def test_options_that_make_no_sense(
    arguments: list[str], words: tuple[str, ...], config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    given = ["--config", str(config)] if arguments[0] in ("simulate", "run", "play") else []
    refused(axiswatch(arguments[0], *given, *arguments[1:]), 2, *words)


def test_json_that_cannot_be_written(config: Path, tmp_path: Path) -> None:
    record = tmp_path / "a.csv"
    record.write_text(HEAD + "0.0,0.1,0.2\n0.005,0.1,0.2\n", encoding="utf-8")
    result = axiswatch("replay", "--config", config, record, "--json", tmp_path / "no" / "a.json")
    refused(result, 2, "cannot write", "a.json", "No such file or directory")
