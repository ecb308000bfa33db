"""Long work pauses in between, so that other threads get the interpreter."""

import time

import pytest

from service.pipeline.pauses import with_pauses


def test_it_pauses_after_each_five_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, paused_s = 0.0, list[float]()

    def sleep(_: float) -> None:
        nonlocal now_s
        paused_s.append(now_s)
        now_s += 1.0

    monkeypatch.setattr(time, "perf_counter", lambda: now_s)
    monkeypatch.setattr(time, "sleep", sleep)
    parts = []
    for part in with_pauses(range(7)):
        parts.append(part)
        now_s += 0.002
    assert parts == [*range(7)]
    assert paused_s == pytest.approx([0.006, 1.012])
