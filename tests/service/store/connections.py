"""The connections to SQLite that a store opens, for tests that look into them or hinder them."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest


@contextmanager
def connections(through: Callable[[sqlite3.Connection], Any] = lambda opened: opened) -> Iterator[list[Any]]:
    """All that are opened meanwhile, the writer of a store first; ``through``: what the store gets in their place."""
    found, connect = list[Any](), sqlite3.connect

    def opened(*given: Any, **options: Any) -> Any:
        found.append(through(connect(*given, **options)))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sqlite3, "connect", opened)
        yield found


class Watched:
    """A connection that calls ``before`` before each statement."""

    def __init__(self, connection: sqlite3.Connection, before: Callable[[], None] = lambda: None) -> None:
        self._connection, self.before = connection, before

    def __getattr__(self, name: str) -> Any:
        if name in ("execute", "executemany", "executescript"):
            self.before()
        return getattr(self._connection, name)
