"""Where the pictures of a replay draw an alarm: from onset to end, on a line of which pauses are cut out."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor_core.detection import Alarm
from service.pipeline.alarm_recording import as_recorded
from service.reports.replay_course import Timeline, TimeUnit
from service.reports.replay_result import ReplayedAxis
from service.store.alarm_entries import Entry

S = 1_000_000
FOUND = Alarm(
    "fm", "up", 130 * S, 132 * S, 140 * S, None, 0.1, 0.01, 3, onset_low_us=129 * S, onset_high_us=131 * S
)


def axis(*alarms: Alarm) -> ReplayedAxis:
    """Samples from 100 s to 200 s and, after a pause of an hour, for another 50 s."""
    line = Timeline()
    line.take(np.arange(100, 201, dtype=np.int64) * S)
    line.take(np.arange(3800, 3851, dtype=np.int64) * S)
    course: Any = SimpleNamespace(timeline=line, h={"kT": 1.0, "fm": 1.0})
    snapshot: Any = None
    recorded = [as_recorded(Entry("cell.a1", "", 1.0, alarm), n) for n, alarm in enumerate(alarms)]
    return ReplayedAxis(snapshot, recorded, (), course)


@pytest.mark.parametrize(
    ("changes", "start", "end"),
    [
        ({}, 30, 150),
        ({"ended_us": 3810 * S}, 30, 110),
        ({"onset_us": 90 * S}, 32, 150),  # before the first sample: from where it was raised
    ],
)
def test_from_onset_to_end(changes: dict[str, int], start: float, end: float) -> None:
    (span,) = axis(replace(FOUND, **changes)).alarm_spans(["fm"], TimeUnit("s", 1.0))  # type: ignore[arg-type]
    assert (span.start, span.raised, span.end) == pytest.approx((start, 32, end))
    assert span.onset is not None
    assert span.onset.tolist() == pytest.approx([29, 31])
    (in_minutes,) = axis(replace(FOUND, **changes)).alarm_spans(["fm"], TimeUnit("min", 60.0))  # type: ignore[arg-type]
    assert in_minutes.end == pytest.approx(end / 60)
    assert in_minutes.onset is not None
    assert in_minutes.onset.tolist() == pytest.approx([29 / 60, 31 / 60])


def test_alarms_of_a_parameter_and_those_of_none() -> None:
    """A fault of a sensor concerns all parameters; an alarm that was raised outside of the line is nowhere."""
    down = replace(FOUND, parameter="torque sign", direction="down", onset_low_us=None)
    lost = replace(FOUND, raised_us=50 * S)
    spans = list(axis(FOUND, down, lost).alarm_spans(["kT"], TimeUnit("s", 1.0)))
    assert [span.onset for span in spans] == [None]
    own = list(axis(FOUND, down, lost).alarm_spans(["fm"], TimeUnit("s", 1.0)))
    assert [span.arrow for span in own] == [
        "\N{BLACK UP-POINTING TRIANGLE}",
        "\N{BLACK DOWN-POINTING TRIANGLE}",
    ]
