"""Signals of the operating system, obeyed by a thread: the end of a command, a changed configuration."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

_SIGNAL, _END = b"s", b"e"


@contextmanager
def stopped_by_signals(stop: threading.Event | None = None) -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set, which is a regular end: exit code 0; the second one ends the process.

    Handlers are as before afterwards.  In another thread than the main one signals are left alone.
    """
    stop = stop or threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    with obeyed((signal.SIGINT, signal.SIGTERM), stop.set, once=True):
        yield stop


@contextmanager
def obeyed(numbers: Sequence[int], action: Callable[[], object], *, once: bool = False) -> Iterator[None]:
    """In this block, which the main thread runs, each of these signals lets a thread call ``action``.

    The main thread runs a handler between any two of its instructions, also while it holds the lock of an event that it
    waits for: to set the event in the handler would then wait for ever.  So the handler only writes to a pipe.

    Args:
        numbers: of the signals.
        action: one call after the other, none at the same time.
        once: the next signal does what it does by default.
    """
    reading, writing = os.pipe()

    def obey() -> None:
        while os.read(reading, 1) == _SIGNAL:
            action()
        os.close(reading)

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        os.write(writing, _SIGNAL)
        for number in numbers if once else ():
            signal.signal(number, signal.SIG_DFL)

    threading.Thread(target=obey, name="signals", daemon=True).start()
    before = {number: signal.signal(number, on_signal) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.write(writing, _END)  # nobody waits for an action that takes long
        os.close(writing)
