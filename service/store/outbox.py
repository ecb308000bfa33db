"""How far each plant link has delivered the transitions in the alarm journal.

The journal itself is the outbox: a transition is written in one transaction with the change of state, so it is neither
lost nor delivered without having happened.  A link only stores the number of the last transition that it has finished.
These numbers are in a separate file, so that the writer of the journal never waits for a link.  After a crash, the last
transitions may be delivered again; none is left out.
"""

from collections.abc import Iterable
from pathlib import Path

from service.store.database import Store
from service.store.journal import Journal

OUTBOX_FILE = "links.sqlite"
"""Name of the file in the state directory."""

MIGRATIONS = (
    """
    CREATE TABLE link (
        name TEXT PRIMARY KEY,
        journal TEXT NOT NULL,
        done INTEGER NOT NULL
    ) STRICT;
    """,
)


class Outbox(Store):
    """The number of the last finished transition of each link."""

    def __init__(self, path: Path, journal: Journal) -> None:
        super().__init__(path, MIGRATIONS, "NORMAL")
        self._journal = journal

    def begin(self, names: Iterable[str]) -> dict[str, int]:
        """The number of the last finished transition of each of these links.

        A new link starts with the next transition.  A link whose number belongs to another journal starts with the
        first transition of this one, which has replaced the other.
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
                # A journal restored from a backup may end before the last finished transition.
                found[name] = min(done, last) if journal == self._journal.identity else 0
            connection.executemany(_SAVE, [(name, self._journal.identity, n) for name, n in found.items()])
        return found

    def done(self, name: str, number: int) -> None:
        """Store that a link has finished all transitions up to this number."""
        with self._db.write() as connection:
            connection.execute(_SAVE, (name, self._journal.identity, number))


_SAVE = "INSERT OR REPLACE INTO link (name, journal, done) VALUES (?, ?, ?)"
