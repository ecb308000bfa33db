"""A daemon in a thread of this process: without a start of the program, and open to what a test replaces in it."""

import queue
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from service.commands.daemon.lifecycle import StartEvents, run_daemon
from service.config import Config
from tests.end_to_end.processes import PATIENCE_S

NO_FILE = Path("none.toml")
"""In place of the file of a configuration, which a daemon reads only where somebody asks for it"""


def on_any_port(config: Config) -> Config:
    return config.model_copy(update={"web": config.web.model_copy(update={"port": 0})})


@contextmanager
def daemon_thread(config: Config, file: Path = NO_FILE, **words: Any) -> Iterator[str]:
    """The address of its page; ``words`` are further arguments of ``run_daemon``.  What has ended it is raised."""
    pages, stop = queue.SimpleQueue[str | None](), threading.Event()
    with ThreadPoolExecutor(1, "daemon") as pool:
        events = StartEvents(ready=pages.put)
        ended = pool.submit(run_daemon, on_any_port(config), file, stop=stop, events=events, **words)
        ended.add_done_callback(lambda _: pages.put(None))
        try:
            page = pages.get(timeout=PATIENCE_S)
            if page is not None:
                yield page
        finally:
            stop.set()
        ended.result()
        assert page is not None, "it has ended before it was ready"
