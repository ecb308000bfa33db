"""A signal that comes while the main thread holds the lock of the event that it is to set."""

import subprocess
import sys

from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S

PROGRAM = """
import os, signal
from service.commands.command_line.signal_handling import handling, stopped_by_signals

def handlers():
    return [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]

before = handlers()
with stopped_by_signals() as stop:
    with stop._cond:  # as Event.wait holds it for moments
        os.kill(os.getpid(), signal.SIGTERM)
    assert stop.wait(30)
seen = []
with handling([signal.SIGHUP], lambda: seen.append(1)):
    for count in (1, 2):
        os.kill(os.getpid(), signal.SIGHUP)
        while len(seen) < count:
            pass
assert handlers() == before
print("ended")
"""


def test_a_signal_never_waits_for_what_it_interrupts() -> None:
    command = [sys.executable, "-c", PROGRAM]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.communicate(timeout=PATIENCE_S)[0] == "ended\n"
    finally:
        process.kill()
