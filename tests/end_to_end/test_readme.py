"""Every command that the README shows, run as it stands there."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.end_to_end.processes import (
    ROOT,
    Daemon,
    daemon,
    demo_config,
    run_program,
    running,
    wait_for,
)

README = (ROOT / "README.md").read_text(encoding="utf-8")
CONSOLE = re.findall(r"^\$ (.+)$", "\n".join(re.findall(r"```console\n(.*?)```", README, re.S)), re.M)


def shown(start: str) -> list[list[str]]:
    """The commands that begin with these words, as arguments."""
    found = [shlex.split(line) for line in CONSOLE if line.startswith(start + " ")]
    assert found, f"the README shows no {start!r} any more"
    return found


def arguments(command: list[str], folder: Path) -> list[str]:
    """Without the program's name, its files in this folder."""
    return [str(folder / word) if word.endswith((".toml", ".log", ".json")) else word for word in command[1:]]


def test_every_command_shown_is_run_here() -> None:
    starts = {
        " ".join(line.split()[:2]) if line.startswith("axiswatch") else line.split()[0] for line in CONSOLE
    }
    commands = ("check", "listen", "run", "simulate", "replay", "play")
    assert starts == {"curl", *(f"axiswatch {name}" for name in commands)}


@pytest.mark.parametrize("target", ["run", "test", "bench", "soak", "lint", "format", "docs", "lock"])
def test_targets_of_make(target: str, need: Callable[[str], str]) -> None:
    done = subprocess.run(
        [need("make"), "-n", target], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout


def test_a_robot_from_check_to_play(tmp_path: Path) -> None:
    config = demo_config(tmp_path, axes=1)
    (check,) = shown("axiswatch check")
    (listen,) = shown("axiswatch listen")
    (run,) = shown("axiswatch run")
    (simulate,) = shown("axiswatch simulate")
    assert run_program(*arguments(check, tmp_path)).returncode == 0
    with (
        running(*arguments(simulate, tmp_path), log=tmp_path / "robot.log"),
        daemon(config, *arguments(run, tmp_path)[3:]) as d,
    ):
        wait_for(lambda: d.get("api/v1/axes/demo.axis1")["counters"]["used"] > 100)
        heard = run_program(*arguments(listen, tmp_path))
        assert (heard.returncode, "axis1" in heard.stdout) == (0, True)
        answers_to_curl(d)
        assert d.stop() == 0
    (replay,) = shown("axiswatch replay")
    (play,) = shown("axiswatch play")
    assert run_program(*arguments(replay, tmp_path)).returncode == 0
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["axes"]
    assert run_program(*arguments(play, tmp_path)).returncode == 0


def answers_to_curl(d: Daemon) -> None:
    """Each address shown answers, on the port of this daemon."""
    curl = shutil.which("curl")
    for command in shown("curl"):
        address = command[1].replace("http://127.0.0.1:8080/", d.page)
        if curl:
            subprocess.run([curl, "--silent", "--show-error", "--fail", address], check=True, timeout=30)
        else:
            assert d.status(address.removeprefix(d.page)) == 200


def test_files_that_are_named_are_there() -> None:
    named = set(re.findall(r"`((?:service|monitor_core)/[\w./]*)`|\]\(([\w./]+)\)", README))
    paths = {path for pair in named for path in pair if path}
    assert len(paths) > 15
    assert [path for path in sorted(paths) if not (ROOT / path).exists()] == []
