"""What was quarantined of the checkpoints."""

import sqlite3
from contextlib import closing
from pathlib import Path


def quarantined(folder: Path) -> list[tuple[str, str]]:
    """Axis and reason of each state, oldest first."""
    with closing(sqlite3.connect(folder / "checkpoints.sqlite")) as file:
        return file.execute("SELECT axis, reason FROM quarantine ORDER BY id").fetchall()
