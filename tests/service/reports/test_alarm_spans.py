"""Where the pictures of a replay draw an alarm: from onset to end, on a line of which pauses are cut out."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor_core.detection import Alarm, Cause
from service.config import load
from service.ingest.records.record_files import RecordQuality, RecordStep
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.persistence.alarm_recording import as_recorded
from service.reports.replay_report import alarm_table
from service.reports.replay_result import Replay, ReplayedAxis
from service.reports.timeline import Timeline, TimeUnit
from service.store.alarm_entries import AlarmEntry

ROOT = Path(__file__).resolve().parents[3]
S = 1_000_000
FOUND = Alarm("fm", "up", 130 * S, 132 * S, 140 * S, None, 0.1, 0.01, 3, onset_low_us=129 * S, onset_high_us=131 * S)


def axis(*alarms: Alarm) -> ReplayedAxis:
    """Samples from 100 s to 200 s and, after a pause of an hour, for another 50 s."""
    line = Timeline()
    line.take(np.arange(100, 201, dtype=np.int64) * S)
    line.take(np.arange(3800, 3851, dtype=np.int64) * S)
    course: Any = SimpleNamespace(timeline=line, h={"kT": 1.0, "fm": 1.0})
    snapshot: Any = None
    recorded = [as_recorded(AlarmEntry("cell.a1", "", 1.0, alarm), n) for n, alarm in enumerate(alarms)]
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


def test_an_onset_without_an_earlier_end_is_a_latest_one() -> None:
    """A change that was there when the tests began."""
    unknown = replace(FOUND, onset_low_us=None)
    neither = replace(unknown, onset_high_us=None)
    snapshot: Any = SimpleNamespace(id="cell.a1")
    found = axis(FOUND, unknown, neither)._replace(snapshot=snapshot)
    rows = alarm_table([found]).rows
    assert [row[3] for row in rows] == ["30.00 s (-1.0 +1.0 s)", "before 31.00 s", "30.00 s"]


def test_axes_of_a_robot_whose_alarms_the_same_payload_explains_name_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As the journal has them (test_alarm_transitions.py), from the alarms of a replay."""
    config = load(ROOT / "config" / "demo.toml")
    payload = replace(FOUND, parameter="kT", direction="down", stage="named", causes=(Cause("kT", 1.0, ("load",)),))
    found = {
        "demo.axis1": payload,
        "demo.axis3": payload,
        "demo.axis4": replace(payload, causes=(Cause("kT", 1.0),)),
    }
    monitors = AxisMonitors(config.axes)
    monkeypatch.setattr(monitors, "update", lambda _samples, _see: list(found.items()))
    record: Any = SimpleNamespace(steps=lambda: [RecordStep({}, 1.0)], quality=RecordQuality({}))
    replay = Replay(monitors, config, drawn=False)
    replay.add(record, lambda _done: None)
    axes = replay.result(["record"], "demo.toml").axes
    named = {axis.id: alarm.same_payload for axis in axes for alarm in axis.alarms}
    assert named == {"demo.axis1": ("demo.axis3",), "demo.axis3": ("demo.axis1",), "demo.axis4": ()}
