"""The program as its users run it: processes, their logs, their answers."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from tests.demo_text import demo_text
from tests.ports import own_port

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = (sys.executable, "-m", "service.commands.main")
PATIENCE_S = 150.0

T = TypeVar("T")

_BUS = 'interface = "virtual"\nchannel = "axiswatch-demo"'


def demo_config(folder: Path, bus: str | None = None, axes: int = 2, service: str = "") -> Path:
    """The demo's configuration for its first axes, on a bus between processes of its own."""
    (folder / "demo.dbc").write_bytes((ROOT / "config" / "demo.dbc").read_bytes())
    if bus is None:
        # A port of its own, too: Linux hands a socket the datagrams of every group that anyone here has joined.
        port = own_port()
        group = f"239.74.{port // 256}.{port % 256}"
        bus = f'interface = "udp_multicast"\nchannel = "{group}"\noptions = {{ port = {port} }}'
    text = demo_text(axes)
    assert _BUS in text
    text = text.replace(_BUS, bus).replace('state_dir = "demo-state"', f'state_dir = "state"\n{service}')
    file = folder / "robot.toml"
    file.write_text(text, encoding="utf-8")
    return file


def edit(file: Path, *changes: tuple[str, str]) -> Path:
    """The file, in which each text that is there has become another."""
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    return file


def run_program(
    *arguments: str | Path, patience_s: float = PATIENCE_S, under: Sequence[str] = ()
) -> subprocess.CompletedProcess[str]:
    """A command that ends by itself, run ``under`` another one, as nice is."""
    command = [*under, *PROGRAM, *map(str, arguments)]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=patience_s, check=False, env=_environment()
    )


@contextmanager
def running(*arguments: str | Path, log: Path, program: Sequence[str] = PROGRAM) -> Iterator[subprocess.Popen[bytes]]:
    """A command that goes on; killed at the end if it is still there."""
    with log.open("ab") as file:
        process = subprocess.Popen(
            [*program, *map(str, arguments)],
            cwd=ROOT,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=_environment(),
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def robot(config: Path, *words: str) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """The simulated robot of that configuration."""
    return running("simulate", "--config", config, *words, log=config.parent / "robot.log")


@contextmanager
def demo(log: Path, *words: str | Path) -> Iterator[str]:
    """The address of a running demo's page; interrupted at the end, it ends in order."""
    with running(*words, "--port", "0", log=log) as process:
        yield wait_for(lambda: re.search(r"dashboard: (http://\S+)", log.read_text(encoding="utf-8")))[1]
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0


def alarms_shown(page: str) -> list[dict[str, Any]]:
    with urllib.request.urlopen(page + "api/v1/alarms", timeout=PATIENCE_S) as answer:
        found: list[dict[str, Any]] = json.loads(answer.read())["alarms"]
        return found


class Daemon:
    """``axiswatch run`` on a free port."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path, skip: int) -> None:
        self.process, self._log, self._skip = process, log, skip
        self.page = str(self._event("running")["page"])

    def answer(self, path: str) -> tuple[int, str]:
        """Status and body."""
        try:
            with urllib.request.urlopen(self.page + path, timeout=PATIENCE_S) as answer:
                return int(answer.status), str(answer.read(), "utf-8")
        except urllib.error.HTTPError as error:
            return error.code, str(error.read(), "utf-8")

    def get(self, path: str) -> Any:
        """The body of an answer, whatever its status."""
        return json.loads(self.answer(path)[1])

    def status(self, path: str) -> int:
        return self.answer(path)[0]

    def axis(self, number: int = 1) -> dict[str, Any]:
        found: dict[str, Any] = self.get(f"api/v1/axes/demo.axis{number}")
        return found

    def text(self, path: str) -> str:
        status, body = self.answer(path)
        assert status == 200
        return body

    def events(self) -> list[dict[str, Any]]:
        """The log of this run."""
        lines = self._log.read_text(encoding="utf-8").splitlines()[self._skip :]
        return [json.loads(line) for line in lines if line.startswith("{")]

    def stop(self) -> int:
        """SIGTERM; the exit code."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(PATIENCE_S)

    def _event(self, name: str) -> dict[str, Any]:
        def look() -> dict[str, Any] | None:
            found = next((event for event in self.events() if event["event"] == name), None)
            if found is None and self.process.poll() is not None:
                last = "\n".join(self._log.read_text(encoding="utf-8").splitlines()[self._skip :][-20:])
                raise AssertionError(f"it has ended with {self.process.returncode}; its last lines:\n{last}")
            return found

        return wait_for(look)


@contextmanager
def daemon(config: Path, *arguments: str | Path, program: Sequence[str] = PROGRAM) -> Iterator[Daemon]:
    """A running daemon; its log is ``daemon.log`` beside the configuration.

    Where the test fails, what the daemon shows then is printed.
    """
    log = config.parent / "daemon.log"
    log.touch()
    skip = len(log.read_text(encoding="utf-8").splitlines())
    words = ("run", "--config", config, "--port", "0", *arguments)
    with running(*words, log=log, program=program) as process:
        d = Daemon(process, log, skip)
        try:
            yield d
        except BaseException:
            with suppress(OSError):
                for path in ("readyz", "api/v1/service", "api/v1/axes", "api/v1/alarms"):
                    print(f"{path}: {d.answer(path)[1]}")
            print(*log.read_text(encoding="utf-8").splitlines()[-30:], sep="\n")
            raise


def wait_for(
    look: Callable[[], T | None], state: Callable[[], object] | None = None, *, patience_s: float = PATIENCE_S
) -> T:
    """What ``look`` finds, as soon as it finds something; ``state``: what to report if it finds nothing."""
    end = time.monotonic() + patience_s
    while True:
        found = look()
        if found:
            return found
        assert time.monotonic() < end, (
            f"waited {patience_s:.0f} s in vain for {look.__qualname__}{f': {state()}' if state else ''}"
        )
        time.sleep(0.05)


def mistakes(result: subprocess.CompletedProcess[str]) -> tuple[int, Sequence[str]]:
    """Exit code and lines of the error stream, which never hold a traceback."""
    assert "Traceback" not in result.stderr, result.stderr
    return result.returncode, result.stderr.splitlines()


def _environment() -> dict[str, str]:
    return {name: v for name, v in os.environ.items() if not name.startswith("AXISWATCH_")}
