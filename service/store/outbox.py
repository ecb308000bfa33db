"""What has been promised to plant links: the alarm journal itself, and of each link how far it is with it.

A transition of an alarm is in the journal in one transaction with what it changes, so the promise can neither be lost
nor be one of something that has not happened.  A link needs only the number of the last transition that it is done
with.  That number has a file of its own: the writer of the journal never waits for a link.  After a crash the last
transitions may come again; none is left out.
"""

from collections.abc import Iterable
from pathlib import Path

from service.store.database import Database
from service.store.journal import Journal

OUTBOX_FILE = "links.sqlite"
"""In the state directory."""

MIGRATIONS = (
    """
    CREATE TABLE link (
        name TEXT PRIMARY KEY,
        journal TEXT NOT NULL,
        done INTEGER NOT NULL
    ) STRICT;
    """,
)


class Outbox:
    """How far each link is.

    Every method raises StoreError where the file cannot be read or written.

    Raises:
        StoreInUseError: another daemon writes to this file.
        StoreError: the file cannot be opened.
    """

    def __init__(self, path: Path, journal: Journal) -> None:
        self._journal = journal
        self._db = Database(path, MIGRATIONS, "NORMAL")
        self.messages = self._db.messages

    def begin(self, names: Iterable[str]) -> dict[str, int]:
        """Numbers of the last transitions with which these links are done.

        A link that is new has missed nothing: its first transition is the next one.  One that knows another journal
        begins with the first of this one, which took the place of that.
        """
        last = self._journal.last_transition()
        with self._db.write() as connection:
            known = {
                name: (journal, done)
                for name, journal, done in connection.execute("SELECT name, journal, done FROM link")
            }
            found = dict[str, int]()
            for name in names:
                journal, done = known.get(name, (self._journal.identity, last))
                # A journal from a backup may end before what was done.
                found[name] = min(done, last) if journal == self._journal.identity else 0
            connection.executemany(_SAVE, [(name, self._journal.identity, n) for name, n in found.items()])
        return found

    def done(self, name: str, number: int) -> None:
        """A link is done with all transitions up to that number."""
        with self._db.write() as connection:
            connection.execute(_SAVE, (name, self._journal.identity, number))

    def close(self) -> None:
        """Close the file."""
        self._db.close()


_SAVE = "INSERT OR REPLACE INTO link (name, journal, done) VALUES (?, ?, ?)"
