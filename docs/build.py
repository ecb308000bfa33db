"""Writes the generated part of docs/: the schema of the API, the list of the metrics, the figures of the documents."""

import json
import tempfile
from pathlib import Path
from typing import NoReturn

from docs.commissioning_figures import motion_figure, replay_figure, replayed
from docs.reference_figures import figure_5, figure_6, numbers, reference
from service.pipeline.snapshot import Histogram, Snapshot
from service.store.journal import Journal
from service.web.app import create_app
from service.web.app_state import AppState
from service.web.metric_families import FAMILIES
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup

SCHEMA = Path(__file__).with_name("openapi.json")
METRICS = Path(__file__).with_name("metrics.md")
FIGURES = Path(__file__).with_name("figures")


def main() -> None:
    """Write all of it."""
    write_schema()
    write_metrics()
    write_figures()


def write_schema() -> None:
    """Write docs/openapi.json."""
    nothing = Snapshot(0, 0, (), (), Histogram((), (0,), 0.0), None)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "alarms.sqlite")
        setup = RobotSetup(_not_asked, Path(folder) / "axiswatch.toml", _not_asked)
        schema = create_app(AppState(lambda: nothing, journal, setup, ReportPages(Path(folder), ()))).openapi()
        journal.close()
    SCHEMA.write_text(json.dumps(schema, indent=1) + "\n", encoding="utf-8")
    print(f"{SCHEMA.name}: {len(schema['paths'])} addresses")


def _not_asked(*_: object) -> NoReturn:
    raise AssertionError("the schema of the API depends on no answer")


METRICS_TOP = """# Metrics

What `/metrics` has, beside the version (`axiswatch_build_info`), the time to process a block of samples
(`axiswatch_processing_seconds`, a histogram) and the `process_` metrics of every Prometheus client. `make docs` writes
this file.

| metric | type | labels | meaning |
|---|---|---|---|
"""


def write_metrics() -> None:
    """Write docs/metrics.md."""
    rows = [
        f"| `axiswatch_{name}{'_total' * (family.kind == 'counter')}` | {family.kind} "
        f"| {', '.join(f'`{label}`' for label in family.labels)} | {family.words} |\n"
        for name, family in FAMILIES.items()
    ]
    METRICS.write_text(METRICS_TOP + "".join(rows), encoding="utf-8")
    print(f"{METRICS.name}: {len(rows)} metrics")


def write_figures() -> None:
    """Write docs/figures/: the pictures, and the numbers of the first two, which a test compares with the program's."""
    found = reference()
    for name, text in (
        ("figure5.svg", figure_5(found)),
        ("figure6.svg", figure_6(found)),
        ("numbers.json", json.dumps(numbers(found), indent=1) + "\n"),
        ("motion.svg", motion_figure()),
        ("replay.svg", replay_figure(replayed())),
    ):
        (FIGURES / name).write_text(text, encoding="utf-8")
        print(f"figures/{name}: {len(text) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
