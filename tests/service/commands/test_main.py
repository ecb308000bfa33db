"""The program: its version, its help, its end, and what warm compiles."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.commands.command_line.exit_codes import EXIT_CODES, MISTAKE
from service.commands.main import COMMANDS, app
from service.config import load
from tests.end_to_end.processes import PATIENCE_S
from tests.service.commands.identify.conftest import write_record, write_robot


def test_version_and_warm() -> None:
    for words in ("version", "--version"):
        result = CliRunner().invoke(app, [words])
        assert (result.exit_code, result.stdout) == (0, f"axiswatch {version('axiswatch')}\n")
    result = CliRunner().invoke(app, ["warm"])
    assert result.exit_code == 0
    assert result.stdout.startswith("the kernel is ready (")


_AT_THE_END = """
import atexit, os, sys
from service.commands.main import main
class Last:
    def __del__(self, write=os.write):
        write(1, b"taken apart\\n")
sys.last = Last()
atexit.register(lambda: print("cleaned up", flush=True))
main()
"""


def test_the_daemon_ends_without_taking_the_interpreter_apart(tmp_path: Path) -> None:
    """That would take seconds of a stop."""
    for command, printed in (("run", "cleaned up\n"), ("check", "cleaned up\ntaken apart\n")):
        words = [sys.executable, "-c", _AT_THE_END, command, "--config", str(tmp_path / "none.toml")]
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        assert (done.returncode, done.stdout) == (2, printed)
        assert "none.toml" in done.stderr


@pytest.mark.parametrize("command", [[], *([c] for c in COMMANDS)], ids=lambda c: " ".join(c) or "axiswatch")
def test_help_has_the_exit_codes(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    result = CliRunner().invoke(app, [*command, "--help"])
    assert result.exit_code == 0
    assert " ".join(EXIT_CODES.split()) in " ".join(result.stdout.split())


@pytest.mark.parametrize("command", ["run", "check", "commission"])
def test_without_a_configuration_it_says_what_writes_one(command: str) -> None:
    done = CliRunner().invoke(app, [command])
    assert done.exit_code == MISTAKE
    assert "axiswatch init writes a first one" in " ".join(done.stderr.replace("│", " ").split())


# --- warm leaves nothing for identify and excite to compile -------------------------------------------------


_PROGRAM = """
import gc, sys
from service.commands.warm import compile_offline
from service.commands.main import app

def compiled():
    from numba.core.dispatcher import Dispatcher
    all_ = [x for x in gc.get_objects() if isinstance(x, Dispatcher)]
    return {f"{x.py_func.__module__}.{x.py_func.__name__}{s}" for x in all_ for s in x.signatures}

compile_offline()
before = {x for x in compiled() if x.startswith("monitor_core")}
config, record, out = sys.argv[1:]
for command in (
    ["excite", "--config", config, "--as", "angle", "--torque-limit", "3", "--seconds", "2", "-o", out + ".csv"],
    ["identify", record, "--config", config, "--start", "search", "-o", out + "/nominal.toml"],
):
    app(command, standalone_mode=False)
after = {x for x in compiled() if x.startswith("monitor_core")}
print("BEFORE", len(before))
for name in sorted(after - before):
    print("NEW", name)
"""


def test_nothing_is_left_to_compile(tmp_path: Path, seed: int) -> None:
    """Other kinds of arguments are compiled anew: none of identify's and excite's are."""
    config = write_robot(tmp_path)
    record = write_record(tmp_path / "a.csv", load(config), 10.0, seed)
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-c", _PROGRAM, str(config), str(record), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [line.split(" ", 1) for line in done.stdout.splitlines() if line.startswith(("BEFORE", "NEW"))]
    assert [name for what, name in lines if what == "NEW"] == []
    assert int(lines[0][1]) >= 4
