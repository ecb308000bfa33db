"""Commands that go on, on a real bus between processes."""

import json
import os
import pty
import select
import signal
import subprocess
import urllib.request
from pathlib import Path

from service.commands.command_line.exit_codes import NOT_TESTED
from tests.end_to_end.processes import PATIENCE_S, PROGRAM, ROOT, alarms_shown, demo, demo_config, wait_for
from tests.service.commands.commissioning.two_mass_tables import AXIS, H, configured, table


def test_demo_shows_a_page_and_its_report_and_names_its_fault(tmp_path: Path) -> None:
    log = tmp_path / "demo.log"
    with demo(log, "demo", "--axes", "2", "--fault-after", "6") as page:
        with urllib.request.urlopen(page, timeout=PATIENCE_S) as answer:
            assert b"<html" in answer.read()
        with urllib.request.urlopen(page + "api/v1/service", timeout=PATIENCE_S) as answer:
            report = json.loads(answer.read())["report"]
        with urllib.request.urlopen(page + report[1:], timeout=PATIENCE_S) as answer:
            assert "6 of 6 axes ready." in answer.read().decode()
        (alarm,) = wait_for(lambda: [a for a in alarms_shown(page) if a["stage"] == "named"])
        assert (alarm["axis"], alarm["parameter"], alarm["direction"]) == ("demo.axis2", "fm", "up")
    assert "fm x 1.3 after 6 s" in log.read_text(encoding="utf-8")


def test_listen_on_a_terminal_is_one_table_and_ends_by_itself(tmp_path: Path) -> None:
    config = demo_config(tmp_path, axes=1)
    ours, theirs = pty.openpty()
    command = [*PROGRAM, "listen", "--config", str(config), "--seconds", "0.5"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=theirs, stderr=theirs, stdin=subprocess.DEVNULL)
    os.close(theirs)
    shown = b"".join(iter(lambda: _read(ours), b""))
    os.close(ours)
    assert process.wait(PATIENCE_S) == 0
    for words in (b"quantity", b"not received", b"can0: up, 0 frames"):
        assert words in shown


def _read(terminal: int) -> bytes:
    """What is there, empty at the end."""
    ready, _, _ = select.select([terminal], [], [], PATIENCE_S)
    assert ready
    try:
        return os.read(terminal, 65536)
    except OSError:  # the other end is closed
        return b""


def test_a_process_of_commission_that_is_killed_is_the_refusal_of_its_axis(tmp_path: Path) -> None:
    record = table(tmp_path / "healthy.csv", 3, 20.0, axes=2)
    config = configured(tmp_path / "robot.toml", *(AXIS.format(n=n, interval=H) for n in (1, 2)))
    log, words = tmp_path / "commission.log", ("commission", record, "--config", config, "-o", tmp_path)
    with log.open("w", encoding="utf-8") as file:
        command = [*PROGRAM, *map(str, words)]
        process = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, cwd=tmp_path)
        try:
            wait_for(lambda: "identify ..." in log.read_text(encoding="utf-8"))
            os.kill(wait_for(lambda: workers_of(process.pid))[0], signal.SIGKILL)
            assert process.wait(PATIENCE_S) == NOT_TESTED
        finally:
            process.kill()
            process.wait()
    text = log.read_text(encoding="utf-8")
    assert "Traceback" not in text
    ended = [
        name for name in ("cell.a1", "cell.a2") if f"{name}: not commissioned: its process was ended by SIGKILL" in text
    ]
    assert len(ended) == 1
    (found,) = tmp_path.glob("*-nominal.toml")  # of the other one
    assert ended[0] not in found.name


def workers_of(pid: int) -> list[int]:
    """The processes that a process has started to share its work."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [n for n in map(int, children) if b"spawn_main" in Path(f"/proc/{n}/cmdline").read_bytes()]
