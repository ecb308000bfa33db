"""Handling of operating system signals in a thread: end of a command, changed configuration."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

_SIGNAL, _END = b"s", b"e"


@contextmanager
def stopped_by_signals(stop: threading.Event | None = None) -> Iterator[threading.Event]:
    """An event set by SIGINT and SIGTERM for a regular end with exit code 0; a second signal ends the process.

    The former handlers are restored at the end.  Outside the main thread signals are not changed.
    """
    stop = stop or threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    with handling((signal.SIGINT, signal.SIGTERM), stop.set, once=True):
        yield stop


@contextmanager
def handling(numbers: Sequence[int], action: Callable[[], object], *, once: bool = False) -> Iterator[None]:
    """In this block, run by the main thread, each of these signals makes a thread call ``action``.

    The main thread can run a handler between any two instructions, even while it holds the lock of an event.  Setting
    the event in the handler would then block for ever; therefore the handler only writes to a pipe.

    Args:
        numbers: numbers of the signals.
        action: called for each signal; calls never overlap.
        once: the second signal has its default effect.
    """
    reading, writing = os.pipe()

    def handle() -> None:
        while os.read(reading, 1) == _SIGNAL:
            action()
        os.close(reading)

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        os.write(writing, _SIGNAL)
        for number in numbers if once else ():
            signal.signal(number, signal.SIG_DFL)

    threading.Thread(target=handle, name="signals", daemon=True).start()
    before = {number: signal.signal(number, on_signal) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.write(writing, _END)  # nobody waits for an action that takes long
        os.close(writing)
