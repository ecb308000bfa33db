"""Writes the generated part of docs/: the schema of the API."""

import json
import tempfile
from pathlib import Path

from service.monitoring.snapshot import Histogram, Snapshot
from service.store.journal import Journal
from service.web.app import create_app

TARGET = Path(__file__).with_name("openapi.json")


def main() -> None:
    """Write docs/openapi.json."""
    nothing = Snapshot(0, 0, (), (), Histogram((), (0,), 0.0), None)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "alarms.sqlite")
        schema = create_app(lambda: nothing, journal).openapi()
        journal.close()
    TARGET.write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
    print(f"{TARGET.name}: {len(schema['paths'])} addresses")


if __name__ == "__main__":
    main()
