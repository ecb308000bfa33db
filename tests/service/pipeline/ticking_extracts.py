"""Extracts of the bus, with the worker's part."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from service.pipeline.persistence.recording import Extracts


@contextmanager
def ticking(extracts: Extracts) -> Iterator[None]:
    """The worker's part, in a thread of its own."""
    end = threading.Event()

    def work() -> None:
        while not end.wait(0.02):
            extracts.tick()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()
