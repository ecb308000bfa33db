"""What the web answers for a thousand axes: of a new snapshot, and of one that has been asked for before."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

import pytest

from service.store.journal import Journal
from tests.bench.measure import Say
from tests.service.web.conftest import Stage, monitored_axis

pytestmark = pytest.mark.bench

AXES, ROUNDS = 1000, 15
TARGETS_S = {"/metrics": 0.05, "/api/v1/axes": 0.1}


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    journal = Journal(tmp_path / "alarms.sqlite")
    held = Stage(journal)
    axes = tuple(monitored_axis(f"axis{number}") for number in range(AXES))
    held.snapshot = replace(held.snapshot, axes=axes)
    yield held
    journal.close()


def test_a_thousand_axes(stage: Stage, say: Say) -> None:
    client = stage.client()
    rows = []
    for path, target in TARGETS_S.items():
        client.get(path)
        found: dict[str, list[float]] = {"new": [], "asked for before": []}
        for _ in range(ROUNDS):
            stage.snapshot = replace(stage.snapshot)
            for seconds in found.values():
                start = time.perf_counter()
                body = client.get(path).content
                seconds.append(time.perf_counter() - start)
        rows += [
            (path, snapshot, len(body) / 1e6, median(seconds), target) for snapshot, seconds in found.items()
        ]
    header = ("", "snapshot", "MB", "s", "target s")
    say(f"answers for {AXES} axes, medians of {ROUNDS}", header, rows)
