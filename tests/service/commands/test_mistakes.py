"""Every mistake of a user: one message that names the thing, the documented exit code, no traceback."""

import shutil
import socket
from pathlib import Path

import pytest

from service.store.journal import Journal
from tests import golden
from tests.end_to_end.processes import edit
from tests.service.command_line import refused, session
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


@pytest.mark.parametrize("command", ["run", "listen", "simulate", "play"])
def test_a_bus_that_cannot_be_opened(command: str, config: Path, record: Path) -> None:
    bus = ('interface = "virtual"\nchannel = "mistakes"', 'interface = "socketcan"\nchannel = "can9"')
    given: list[Path | str] = [record] if command == "play" else []
    given += ["--yes"] if command in ("play", "simulate") else []
    message = refused(command, "--config", edit(config, bus), *given, code=3)
    assert "bus can0: there is no network interface can9" in message


def test_what_a_daemon_needs_is_taken(config: Path, tmp_path: Path) -> None:
    """Its port; its state directory by another daemon, or by a file."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        message = refused("run", "--config", config, "--port", port, code=4)
        assert f"port {port}" in message
        assert "taken" in message
    state = tmp_path / "state"
    journal = Journal(state / "alarms.sqlite")
    assert "is in use by process" in refused("run", "--config", config, "--port", "0", code=4)
    journal.close()
    shutil.rmtree(state)
    state.write_text("", encoding="utf-8")
    assert str(state) in refused("run", "--config", config, "--port", "0", code=4)


@pytest.mark.parametrize(("name", "word"), [("there.log", "exists already"), ("new.csv", ".log")])
def test_a_recording_that_cannot_be(name: str, word: str, config: Path, tmp_path: Path) -> None:
    (tmp_path / "there.log").write_text("kept", encoding="utf-8")
    message = refused("run", "--config", config, "--port", "0", "--record", tmp_path / name)
    assert name in message
    assert word in message
    assert (tmp_path / "there.log").read_text(encoding="utf-8") == "kept"


def test_records_and_options_that_make_no_sense(folder: Path, config: Path, record: Path) -> None:
    """A file that cannot be written is found before the record is run."""
    (folder / "table.xlsx").write_bytes(b"x")
    (folder / "b.csv").write_text("t,u\n0,1\n", encoding="utf-8")
    (folder / "a.log").write_text("(0.0) can0 181#00\nthis is no frame at all ###\n", encoding="utf-8")
    (folder / "large.csv").write_text(HEAD + "0.0,0.1,0.2\n0.005,99.0,0.2\n", encoding="utf-8")
    own = f"--config {config.name}"
    records = ("none.csv", "table.xlsx", "b.csv", "a.log", f"{record.name} --json no/a.json")
    text = session("replay", *(f"{own} {words}" for words in records))
    text += session("play", *(f"{own} {words}" for words in ("none.log", "--speed 0 large.csv", "--speed -1 a.log")))
    faults = ("fm", "fn=1.3", "fm=1.3 --fault-axis axis9")
    text += session("simulate", *(f"{own} --fault {words}" for words in faults))
    text += session("run", f"{own} --port 99999") + session("demo", "--axes 7") + session("ruin", "")
    golden.check(text, Path(__file__).parent / "golden" / "mistakes.txt")
