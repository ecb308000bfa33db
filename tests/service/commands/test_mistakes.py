"""Every mistake of a user: one message that names the thing, the documented exit code, no traceback."""

import shutil
import socket
from collections.abc import Sequence
from pathlib import Path

import pytest

from service.store.journal import Journal
from tests.end_to_end.processes import edit
from tests.service.command_line import axiswatch
from tests.service.robot_tables import HEAD, configured

pytestmark = pytest.mark.usefixtures("without_pictures")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """One axis with columns for tables, on a bus inside the process."""
    return configured(tmp_path, "mistakes")


@pytest.fixture
def record(tmp_path: Path) -> Path:
    file = tmp_path / "a.csv"
    file.write_text(HEAD + "0.0,0.1,0.2\n0.005,0.1,0.2\n", encoding="utf-8")
    return file


def refused(code: int, words: Sequence[str], *command: object) -> None:
    result = axiswatch(*command)
    assert result.exit_code == code, result.output
    lines = " ".join(result.stderr.replace("│", " ").split())  # the box around a message breaks it anywhere
    for word in words:
        assert word in lines


@pytest.mark.parametrize("command", ["run", "listen", "simulate", "play"])
def test_a_bus_that_cannot_be_opened(command: str, config: Path, record: Path) -> None:
    bus = ('interface = "virtual"\nchannel = "mistakes"', 'interface = "socketcan"\nchannel = "can9"')
    given: list[Path | str] = [record] if command == "play" else []
    given += ["--yes"] if command in ("play", "simulate") else []
    refused(3, ["bus can0:", "no network interface can9"], command, "--config", edit(config, bus), *given)


def test_what_a_daemon_needs_is_taken(config: Path, tmp_path: Path) -> None:
    """Its port; its state directory by another daemon, or by a file."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        refused(4, [f"port {port}", "taken"], "run", "--config", config, "--port", port)
    state = tmp_path / "state"
    journal = Journal(state / "alarms.sqlite")
    refused(4, ["is in use by process"], "run", "--config", config, "--port", "0")
    journal.close()
    shutil.rmtree(state)
    state.write_text("", encoding="utf-8")
    refused(4, [str(state)], "run", "--config", config, "--port", "0")


@pytest.mark.parametrize(("name", "word"), [("there.log", "exists already"), ("new.csv", ".log")])
def test_a_recording_that_cannot_be(name: str, word: str, config: Path, tmp_path: Path) -> None:
    (tmp_path / "there.log").write_text("kept", encoding="utf-8")
    refused(2, [name, word], "run", "--config", config, "--port", "0", "--record", tmp_path / name)
    assert (tmp_path / "there.log").read_text(encoding="utf-8") == "kept"


RECORDS = [
    ("none.csv", None, ("none.csv", "No such file")),
    ("table.xlsx", b"x", ("table.xlsx", ".csv .parquet .mat .log .asc .blf .trc .mf4")),
    ("a.csv", b"t,u\n0,1\n", ("a.csv", "phi", "the angle of axis demo.axis1")),
    ("a.log", b"(0.0) can0 181#00\nthis is no frame at all ###\n", ("a.log", "line 2")),
]


@pytest.mark.parametrize(("name", "content", "words"), RECORDS, ids=[name for name, _, _ in RECORDS])
def test_a_record_that_cannot_be_replayed(
    name: str, content: bytes | None, words: tuple[str, ...], config: Path, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    refused(2, words, "replay", "--config", config, tmp_path / name)


def test_a_record_that_cannot_be_played(config: Path, record: Path, tmp_path: Path) -> None:
    refused(2, ["none.log", "No such file"], "play", "--config", config, tmp_path / "none.log")
    record.write_text(HEAD + "0.0,0.1,0.2\n0.005,99.0,0.2\n", encoding="utf-8")
    words = [record.name, "does not fit into signal"]
    refused(2, words, "play", "--config", config, "--speed", "0", record)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("simulate --fault fm", ["--fault", "PARAMETER=FACTOR"]),
        ("simulate --fault fn=1.3", ["no parameter 'fn' in axis demo.axis1; there is Jm, Jg"]),
        ("simulate --fault fm=1.3 --fault-axis axis9", ["axis9", "demo.axis1"]),
        ("run --port 99999", ["--port"]),
        ("demo --axes 7", ["--axes"]),
        ("play --speed -1 a.log", ["--speed"]),
        ("ruin", ["ruin", "run"]),
    ],
)
def test_options_that_make_no_sense(arguments: str, words: list[str], config: Path) -> None:
    command, *rest = arguments.split()
    refused(
        2, words, command, *(["--config", config] if command in ("simulate", "run", "play") else []), *rest
    )


def test_json_that_cannot_be_written(config: Path, record: Path) -> None:
    """Found before the record is run."""
    words = ["a.json cannot be written", "is no folder"]
    refused(2, words, "replay", "--config", config, record, "--json", record.parent / "no" / "a.json")
