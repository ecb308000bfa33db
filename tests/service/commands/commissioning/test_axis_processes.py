"""The processes in which axes are commissioned."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from service.commands.commissioning.axis import axis_processes
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.axis_processes import needed_memory
from service.commands.commissioning.signals.signal_proposals import Review
from service.reports.commissioning_report import Outcome
from tests.end_to_end.processes import PATIENCE_S

PROGRAM = """
import multiprocessing, os, sys, time

def work(found):
    from service.commands.commissioning.axis.axis_processes import end_with_parent
    end_with_parent()
    with open(found, "w") as file:
        file.write(f"{os.getpid()}\\n")
    time.sleep(600)

if __name__ == "__main__":
    multiprocessing.get_context("spawn").Process(target=work, args=(sys.argv[1],)).start()
"""


def is_running(pid: int) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc, as Linux has it")
def test_they_end_with_the_command_that_is_killed(tmp_path: Path) -> None:
    """Left behind they would compute for an hour, of which nobody takes the result."""
    script, found = tmp_path / "program.py", tmp_path / "pid"
    script.write_text(PROGRAM, encoding="utf-8")
    command = subprocess.Popen([sys.executable, script, found], env=os.environ | {"PYTHONPATH": os.getcwd()})
    while not (found.exists() and found.read_text(encoding="utf-8").endswith("\n")):
        assert command.poll() is None
        time.sleep(0.02)
    worker = int(found.read_text(encoding="utf-8"))
    assert is_running(worker)
    command.kill()
    command.wait()
    end = time.monotonic() + 60
    while is_running(worker):
        assert time.monotonic() < end, "the process goes on after its parent was killed"
        time.sleep(0.02)


INTERRUPTED = """
import signal, sys, time
from types import SimpleNamespace
from service.commands.commissioning.axis import axis_processes

def endless(order, review, step):
    step("identify", "", 0.0)
    time.sleep(600)

axis_processes.commission_axis = endless
axis_processes.os.cpu_count = lambda: 2

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # tests that run in the background ignore it
    orders = [SimpleNamespace(axis_id=name) for name in ("one", "two")]
    shown = lambda step: print(step.axis_id, flush=True)
    try:
        reviews = dict.fromkeys(("one", "two"), SimpleNamespace(samples=1000))
        list(axis_processes.outcomes(orders, reviews, shown))
    except KeyboardInterrupt:
        sys.exit(7)
"""


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["alone", "all"])
def test_an_interrupt_ends_them_without_a_word(send: Callable[[int, int], None], tmp_path: Path) -> None:
    """As `kill -INT` or a supervisor sends it to the command alone; a terminal sends it to all of them."""
    script = tmp_path / "program.py"
    script.write_text(INTERRUPTED, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.getcwd()}
    errors = tmp_path / "errors"
    with errors.open("wb") as file:
        command = subprocess.Popen(
            [sys.executable, script], env=environment, stdout=subprocess.PIPE, stderr=file, start_new_session=True
        )
    try:
        assert command.stdout is not None
        assert {command.stdout.readline().strip() for _ in range(2)} == {b"one", b"two"}
        send(command.pid, signal.SIGINT)
        assert command.wait(PATIENCE_S) == 7
    finally:
        command.kill()
        command.communicate()
    assert errors.read_text() == ""


KILLED = """
import os, signal
from types import SimpleNamespace
from service.commands.commissioning.axis import axis_processes
from service.reports.commissioning_report import Outcome

def works(job, review, step):
    if job.axis_id == "two":
        os.kill(os.getpid(), signal.SIGKILL)
    return Outcome(job.axis_id, notes=("found",))

axis_processes.commission_axis = works
axis_processes.os.cpu_count = lambda: 2

if __name__ == "__main__":
    jobs = [SimpleNamespace(axis_id=name) for name in ("one", "two", "three")]
    reviews = dict.fromkeys(("one", "two", "three"), SimpleNamespace(samples=1000))
    for outcome in axis_processes.outcomes(jobs, reviews, lambda step: None):
        print(outcome.axis_id, outcome.refusal or outcome.notes[0])
"""


def test_an_axis_whose_process_is_killed_does_not_end_the_others(tmp_path: Path) -> None:
    """As by a system without memory."""
    found = dict(line.split(maxsplit=1) for line in lines_of(KILLED, tmp_path))
    assert found.pop("two").startswith(
        "not commissioned: its process was ended by SIGKILL, as the system does when memory"
    )
    assert found == {"one": "found", "three": "found"}


def lines_of(program: str, folder: Path) -> list[str]:
    """What a program prints."""
    script = folder / "program.py"
    script.write_text(program, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.getcwd()}
    run = subprocess.run([sys.executable, script], env=environment, capture_output=True, timeout=PATIENCE_S, check=True)
    return run.stdout.decode().splitlines()


AT_ONCE = """
import sys, time
from pathlib import Path
from types import SimpleNamespace
from service.commands.commissioning.axis import axis_processes
from service.reports.commissioning_report import Outcome

def works(job, review, step):
    begun, folder = time.time(), Path(__file__).parent
    (folder / f"{job.axis_id}.begun").touch()
    while len(list(folder.glob("*.begun"))) < 2:  # a process may take seconds to begin
        time.sleep(0.01)
    time.sleep(0.5)
    return Outcome(job.axis_id, notes=(f"{begun} {time.time()}",))

needs = axis_processes.needed_memory(1000)
axis_processes.commission_axis = works
axis_processes.free_memory = lambda: int(2.5 * needs)
axis_processes.os.cpu_count = lambda: 4

if __name__ == "__main__":
    jobs = [SimpleNamespace(axis_id=name) for name in "abc"]
    reviews = dict.fromkeys("abc", SimpleNamespace(samples=1000))
    for outcome in axis_processes.outcomes(jobs, reviews, lambda step: None):
        print(outcome.notes[0])
"""


def test_no_more_axes_at_once_than_fit_into_the_memory(tmp_path: Path) -> None:
    """Memory for two and a half, on four processors."""
    spans = [tuple(map(float, line.split())) for line in lines_of(AT_ONCE, tmp_path)]
    at_once = [sum(begun <= now < ended for begun, ended in spans) for now, _ in spans]
    assert len(spans) == 3
    assert max(at_once) == 2


def test_an_axis_for_which_there_is_no_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are commissioned; where the free memory is not known, all are."""
    monkeypatch.setattr(axis_processes, "commission_axis", lambda job, *_: Outcome(job.axis_id, notes=("found",)))
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    jobs = [cast("AxisJob", SimpleNamespace(axis_id=name)) for name in ("long", "short")]
    reviews = {
        name: Review((), (), (), "", samples=samples) for name, samples in (("long", 7_200_000), ("short", 1000))
    }

    def refused_with(free: int | None) -> list[str]:
        monkeypatch.setattr(axis_processes, "free_memory", lambda: free)
        found = list(axis_processes.outcomes(jobs, reviews, lambda _: None))
        assert len(found) == 2
        assert all(outcome.refusal or outcome.notes == ("found",) for outcome in found)
        return [outcome.refusal for outcome in found if outcome.refusal]

    (words,) = refused_with(needed_memory(3_600_000))
    assert words.startswith(
        "not commissioned: its 7200000 samples take about 3.1 GB of memory, of which 1.9 GB are free"
    )
    assert "enough for 58 % of them: end other programs, leave records out" in words
    assert refused_with(needed_memory(7_200_000)) == []
    assert refused_with(None) == []
    assert len(refused_with(300_000_000)) == 1  # this process has the program already
    assert len(refused_with(200_000_000)) == 2
