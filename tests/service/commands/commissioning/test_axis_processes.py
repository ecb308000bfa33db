"""The processes in which axes are commissioned."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # tests that run in the background ignore it
    orders = [SimpleNamespace(axis_id=name) for name in ("one", "two")]
    shown = lambda step: print(step.axis_id, flush=True)
    try:
        list(axis_processes.outcomes(orders, {"one": None, "two": None}, shown))
    except KeyboardInterrupt:
        sys.exit(7)
"""


def test_an_interrupt_of_the_command_alone_ends_them(tmp_path: Path) -> None:
    """As `kill -INT` or a supervisor sends it; a terminal sends it to all of them."""
    script = tmp_path / "program.py"
    script.write_text(INTERRUPTED, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.getcwd()}
    command = subprocess.Popen([sys.executable, script], env=environment, stdout=subprocess.PIPE)
    try:
        assert command.stdout is not None
        assert command.stdout.readline().strip() in (b"one", b"two")
        command.send_signal(signal.SIGINT)
        assert command.wait(PATIENCE_S) == 7
    finally:
        command.kill()
        command.communicate()
