"""Slow histories in the daemon: fed, saved, put back, and the alarms about limits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from monitor_core.detection import Alarm, Reach
from monitor_core.trend.entries import EstimateReading
from service.config import Config
from service.pipeline.axes.axis_alarms import AxisAlarm, quantities
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.trends import Trends
from service.pipeline.persistence.alarm_recording import AlarmRecorder
from service.pipeline.persistence.checkpointing import Checkpointer
from service.pipeline.persistence.restoring import restore
from service.store.alarm_filter import AlarmFilter
from service.store.checkpoints import Checkpoints, MonitorState
from service.store.journal import Journal
from tests.service.pipeline.robots import START_US, changed, demo
from tests.service.store.quarantine import quarantined

AXIS = "demo.axis1"
HOUR_S = 3600.0
NOW_US = START_US + 10**12


def limited(folder: Path, limits: dict[str, tuple[float, ...]]) -> Config:
    """The demo's configuration with limits of its first axis."""
    config = changed(demo(folder, 2), trend={"interval_s": HOUR_S})
    return changed(config, "axis1", model={"limits": limits})


def readings(hours: int, per_hour: float, seed: int, others: bool = True) -> list[EstimateReading]:
    """Twelve readings an hour; fm begins at its nominal value and drifts by that part of it each hour."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(12 * hours):
        fm = 0.06 * (1 + per_hour * k / 12) + 0.0015 * rng.normal()
        value = (1 + 0.02 * rng.normal(), 0.01 + 1e-4 * rng.normal(), fm)
        t_us = START_US + k * 300_000_000
        found.append(EstimateReading(t_us, value, (4e-4, 1e-8, 2.25e-6), (others, others, True), 300.0, 0.05))
    return found


def feed(trends: Trends, some: Sequence[EstimateReading], most: int | None = None) -> list[AxisAlarm]:
    changes = []
    for reading in some:
        trends.take(AXIS, [reading])
        changes += trends.update(most)
    return changes


def fm(trends: Trends) -> tuple[str, ...]:
    return tuple(r.state for r in trends.for_axis(AXIS)[2].reaches)


def test_a_limit_that_comes_near_raises_one_alarm_that_is_updated(tmp_path: Path, seed: int) -> None:
    """By half in 500 h: it is foretold fourteen days, 336 h, before."""
    trends = AxisMonitors(limited(tmp_path, {"fm": (0.09,)}).axes).trends
    changes = feed(trends, readings(360, 0.001, seed, others=False))
    assert len({c.alarm.raised_us for c in changes}) == 1
    first, last = changes[0].alarm, changes[-1].alarm
    assert (first.kind, first.stage, first.parameter, first.direction) == ("forecast", "named", "fm", "up")
    raised_h = (first.raised_us - START_US) / 3.6e9
    assert 119 < raised_h < 180  # sooner than 164 h, most often: it is the lower end of the interval that counts
    (reach,), day_us = last.reaches, 86_400_000_000
    assert reach.high_us is not None
    assert reach.low_us - day_us < START_US + 500 * 3_600_000_000 < reach.high_us + day_us
    assert last.size == pytest.approx(0.06 * 0.36, rel=0.1)
    assert last.ended_us is None
    assert trends.for_axis("demo.axis2")[2].trend is None


def test_what_is_steady_raises_none_and_shows_a_far_limit(tmp_path: Path, seed: int) -> None:
    trends = AxisMonitors(limited(tmp_path, {"fm": (0.03, 0.09)}).axes).trends
    assert feed(trends, readings(130, 0.0, seed, others=False)) == []
    assert len(fm(trends)) == 2
    assert "beyond" not in fm(trends)


def test_a_limit_of_ja_is_one_of_its_reciprocal(tmp_path: Path) -> None:
    config = limited(tmp_path, {"Ja": (150.0,)})
    trends = AxisMonitors(config.axes).trends
    feed(trends, readings(125, 0.0, 1))
    (reach,) = trends.for_axis(AXIS)[1].reaches
    assert (reach.name, reach.unit, reach.limit, reach.above) == ("Ja", "kg m^2", 150.0, True)


def test_not_observed_is_not_counted(tmp_path: Path) -> None:
    trends = AxisMonitors(limited(tmp_path, {}).axes).trends
    for reading in readings(30, 0.0, 2):
        trends.take(AXIS, [reading._replace(known=(True, False, True))])
    trends.update()
    assert [len(p.entries) for p in trends.for_axis(AXIS)] == [30, 0, 30]


def save(monitors: AxisMonitors, checkpoints: Checkpoints) -> None:
    Checkpointer(checkpoints, monitors, 60.0, lambda: NOW_US).save()


def restarted(config: Config, checkpoints: Checkpoints, journal: Journal, *lost: str, **parts: object) -> Trends:
    """The trends after a restart, maybe with other settings of the axis; ``lost``: what a message ends with."""
    monitors = AxisMonitors((changed(config, "axis1", **parts) if parts else config).axes)
    messages = restore(monitors, checkpoints, journal, NOW_US).messages
    assert [message.partition("(restarted: ")[2] for message in messages] == list(lost)
    return monitors.trends


def test_after_a_restart_it_goes_on_as_if_nothing_had_happened(
    tmp_path: Path, checkpoints: Checkpoints, journal: Journal, seed: int
) -> None:
    config = limited(tmp_path, {"fm": (0.09,)})
    course = readings(140, 0.0005, seed)
    uninterrupted = AxisMonitors(config.axes).trends
    feed(uninterrupted, course, 0)
    uninterrupted.update()
    cut = AxisMonitors(config.axes)
    feed(cut.trends, course[:1000], 0)
    save(cut, checkpoints)
    feed(cut.trends, course[1000:1100], 0)
    save(cut, checkpoints)  # only what has changed
    feed(cut.trends, course[1100:1200], 0)  # lost with the process
    later = restarted(config, checkpoints, journal)
    feed(later, course[1100:], 0)
    later.update()
    for a, b in zip(later.for_axis(AXIS), uninterrupted.for_axis(AXIS), strict=True):
        assert a.entries == b.entries
        assert a.trend is not None
        assert b.trend is not None
        assert (a.trend.level, a.trend.slope, a.reaches) == (b.trend.level, b.trend.slope, b.reaches)


def test_damage_is_told_counted_and_quarantined(tmp_path: Path, checkpoints: Checkpoints, journal: Journal) -> None:
    config = limited(tmp_path, {})
    monitors = AxisMonitors(config.axes)
    feed(monitors.trends, readings(30, 0.0, 1), 0)
    save(monitors, checkpoints)
    part = MonitorState(f"{AXIS} fm (history)", monitors.trends.axes[AXIS].key, {"entries": np.ones((3, 6))})
    checkpoints.save([part], NOW_US)
    later = restarted(config, checkpoints, journal, "the long-term history of fm)")
    assert later.lost == {AXIS: 1, "demo.axis2": 0}
    later.update()
    assert [len(p.entries) for p in later.for_axis(AXIS)] == [30, 30, 0]
    assert [axis for axis, _ in quarantined(tmp_path)] == [part.axis]


def test_other_nominal_values_begin_a_new_history_and_a_memory_does_not(
    tmp_path: Path, checkpoints: Checkpoints, journal: Journal
) -> None:
    config = limited(tmp_path, {})
    monitors = AxisMonitors(config.axes)
    feed(monitors.trends, readings(30, 0.0, 1), 0)
    save(monitors, checkpoints)
    later = restarted(config, checkpoints, journal, "the estimates)", estimator={"memory_s": 3.0})
    assert later.lost[AXIS] == 0
    nominal = {**config.robot[0].axis[0].model.nominal, "fm": 0.07}
    lost = "the long-term history of kT, 1/Ja and fm)"
    assert restarted(config, checkpoints, journal, lost, model={"nominal": nominal}).lost[AXIS] == 4


FORECAST = Alarm(
    "fm", "up", 5, 20, 30, None, 0.02, 0.001, 1, "named", kind="forecast",
    reaches=(Reach("fm", "N m s/rad", 0.09, True, "ahead", 40, 90),),
)  # fmt: skip


def test_a_forecast_is_not_taken_for_a_change_of_the_same_parameter(
    tmp_path: Path, checkpoints: Checkpoints, journal: Journal
) -> None:
    """Neither in the journal, nor by the monitor that finds it there after a restart."""
    monitors = AxisMonitors(limited(tmp_path, {"fm": (0.09,)}).axes)
    alarms = AlarmRecorder(journal, quantities(monitors.by_id))
    change = Alarm("fm", "up", 10, 40, 50, None, 0.03, 0.001, 2)
    alarms.record([AxisAlarm(AXIS, FORECAST), AxisAlarm(AXIS, change)])
    found, total = journal.query(AlarmFilter(AXIS))
    assert total == 2
    assert [a.kind for a in found] == ["", "forecast"]
    assert found[1].reaches == FORECAST.reaches
    assert restore(monitors, checkpoints, journal, NOW_US).changes == ()
    assert monitors.by_id[AXIS].open_alarms == (change,)
    without = AxisMonitors(demo(tmp_path, 2).axes)
    (ended,) = restore(without, checkpoints, journal, NOW_US).changes
    assert (ended.alarm.kind, ended.alarm.ended_us) == ("forecast", NOW_US)


def test_an_alarm_about_a_limit_goes_on_after_a_restart_and_ends_when_it_is_far(tmp_path: Path, seed: int) -> None:
    trends = AxisMonitors(limited(tmp_path, {"fm": (0.09,)}).axes).trends
    assert trends.adopt([AxisAlarm(AXIS, FORECAST)], NOW_US) == []
    changes = feed(trends, readings(125, 0.0, seed, others=False))
    assert changes[0].alarm.raised_us == FORECAST.raised_us
    assert changes[-1].alarm.ended_us is not None
    assert len([c for c in changes if c.alarm.ended_us is not None]) == 1
