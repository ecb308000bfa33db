"""Another configuration for running monitors: what it does not change goes on, bit for bit; no mistake changes it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from monitor_core.monitoring import AlarmEvent
from service.can.bus import open_buses, send
from service.can.frames import Frame
from service.config import Config
from service.config.drive_sources import shipped
from service.pipeline.bus_readers import BusReaders
from service.pipeline.reconfiguration.reloading import Reloaded, ReloadError, Reloading
from service.store.alarm_filter import AlarmFilter
from service.store.alarm_transitions import Note
from service.texts.instants import iso
from tests.end_to_end.processes import wait_for
from tests.service.pipeline.robots import START_US, changed, on_bus, with_axes
from tests.service.pipeline.running_core import AXIS, OTHER, RunningCore, cell, changed_axis, seconds, states


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> list[Frame]:
    return changed_axis(tmp_path_factory.mktemp("frames"), 24.0, seed)


@pytest.fixture
def core(tmp_path: Path, frames: list[Frame]) -> Iterator[RunningCore]:
    """Twelve seconds after its start; the first axis has an alarm."""
    (tmp_path / "core").mkdir()
    core = RunningCore(tmp_path / "core", cell(tmp_path, 2))
    core.feed(seconds(frames, 0, 12))
    assert [a.parameter for a in core.axis().open_alarms] == ["fm"]
    yield core
    core.close()


@pytest.fixture
def reloading(core: RunningCore) -> Iterator[Reloading]:
    """With readers of real buses, beside the one that the test feeds, until one is opened again."""
    with closing(BusReaders(core.config, core.core.ingests)) as buses:
        buses.start(lambda: None)
        yield Reloading(core.config, core.worker, core.baselines, buses, core.journal, lambda: core.now_us)


def with_fm(config: Config, value: float) -> Config:
    nominal = {**config.axes[0].config.model.nominal, "fm": value}
    return changed(config, "axis1", model={"nominal": nominal})


def test_an_axis_that_is_not_changed_is_the_same_bits(
    core: RunningCore, reloading: Reloading, tmp_path: Path, frames: list[Frame]
) -> None:
    (tmp_path / "plain").mkdir()
    plain = RunningCore(tmp_path / "plain", cell(tmp_path, 2))
    plain.feed(seconds(frames, 0, 12))
    found = reloading.reload(with_fm(core.config, 0.078))
    assert found == Reloaded((AXIS,), (), (), 1, ())
    # The time tested is counted for the present nominal values.
    wait_for(lambda: core.axis().status.parameters[0].tested_s == 0.0)
    assert core.axis(OTHER).status.parameters[0].tested_s > 0.0
    for running in (plain, core):
        running.feed(seconds(frames, 12, 24))
        running.worker.stop()
    assert states(core, OTHER) == states(plain, OTHER)
    shown = core.axis()
    assert (shown.epoch.number, shown.status.parameters[2].nominal) == (2, 0.078)
    plain.close()


def test_what_leaves_the_model_as_it_is_keeps_estimates_alarm_and_epoch(
    core: RunningCore, reloading: Reloading, frames: list[Frame]
) -> None:
    """Another trend, other thresholds, and nothing, with a window that is learned meanwhile."""
    before, state = core.axis(), states(core, AXIS)
    trend = changed(core.config, "axis1", trend={"lead_time": 86400.0})
    assert reloading.reload(trend).changed == (AXIS,)
    assert states(core, AXIS) == state
    thresholds = changed(trend, "axis1", detector={"alpha_2": 25.0})
    found = reloading.reload(thresholds)
    assert (found.changed, found.kept) == ((AXIS,), 1)
    wait_for(lambda: core.axis().status.parameters[2].h != before.status.parameters[2].h)
    after = core.axis()
    assert after.status.parameters[2].h == pytest.approx(25 / 20 * before.status.parameters[2].h)
    assert [a.raised_us for a in after.open_alarms] == [a.raised_us for a in before.open_alarms]
    core.feed(seconds(frames, 12, 13))
    assert (core.axis().epoch.number, core.axis().status.samples) == (1, 2600)
    core.baselines.learn(AXIS, 36.0, 0.0, Note(START_US, "anna"))
    assert reloading.reload(thresholds) == Reloaded((), (), (), 2, ())
    assert reloading.reload(changed(thresholds, "axis2", trend={"lead_time": 86400.0})).changed == (OTHER,)
    assert core.epochs()[0].state == "learning"


def test_axes_are_added_and_removed(
    core: RunningCore, reloading: Reloading, tmp_path: Path, frames: list[Frame]
) -> None:
    reload = reloading.reload
    last = {axis.id: axis.status.time_us for axis in core.worker.snapshot.axes}
    wait_for(lambda: not any(core.history.is_due(axis_id, time_us) for axis_id, time_us in last.items()))
    assert reload(cell(tmp_path, 1)) == Reloaded((), (), (OTHER,), 1, ())
    wait_for(lambda: len(core.worker.snapshot.axes) == 1)
    # The history has forgotten the axis that is gone, and only that.
    assert [axis_id for axis_id, time_us in last.items() if core.history.is_due(axis_id, time_us)] == [OTHER]
    core.feed([f for f in seconds(frames, 12, 13) if f.can_id == frames[0].can_id])
    assert [axis.id for axis in core.worker.snapshot.axes] == [AXIS]
    assert reload(cell(tmp_path, 2)) == Reloaded((), (OTHER,), (), 1, ())
    wait_for(lambda: len(core.worker.snapshot.axes) == 2)
    core.feed(seconds(frames, 13, 14))
    assert [(axis.id, axis.status.samples) for axis in core.worker.snapshot.axes] == [
        (AXIS, 2800),
        (OTHER, 2600),
    ]


def test_the_alarms_of_an_axis_end_with_it_and_its_fault_is_found_again_where_it_comes_back(
    core: RunningCore, reloading: Reloading, tmp_path: Path, frames: list[Frame]
) -> None:
    (alarm,), _ = core.journal.query(AlarmFilter(AXIS))
    note = Note(core.now_us, "anna")
    core.journal.act(alarm.id, AlarmEvent.SHELVE, note, core.now_us + 3_600_000_000)
    assert reloading.reload(with_axes(core.config, core.config.robot[0].axis[1:])).removed == (AXIS,)
    assert core.journal.query(AlarmFilter(AXIS, active=True))[1] == 0
    assert reloading.reload(core.config).added == (AXIS,)
    wait_for(lambda: len(core.worker.snapshot.axes) == 2)
    core.feed(seconds(frames, 12, 24))
    assert [a.parameter for a in core.axis().open_alarms] == ["fm"]


def test_what_is_not_possible_changes_nothing(
    core: RunningCore, reloading: Reloading, tmp_path: Path, frames: list[Frame]
) -> None:
    before, epochs = core.axis().status, core.epochs()
    other = with_fm(core.config, 0.07)
    wrong = changed(core.config, "axis1", estimator={"torque_noise": None})
    kept = core.config.service.model_copy(update={"history_interval_s": 7.0})
    web = core.config.web.model_copy(update={"port": 9, "certificate": tmp_path / "a.crt"})
    cases = {
        r"^a change of \[service\] history_interval_s needs a restart$": other.model_copy(update={"service": kept}),
        r"^a change of \[web\] port and \[web\] certificate needs": other.model_copy(update={"web": web}),
        "^demo.axis1: torque_noise not known": wrong,
        "^bus can0: cannot open udp_multicast 10.0.0.1": on_bus(other, interface="udp_multicast", channel="10.0.0.1"),
    }
    for words, config in cases.items():
        with pytest.raises(ReloadError, match=words):
            reloading.reload(config)
        assert reloading.config == core.config
    assert core.axis().status.parameters == before.parameters
    assert core.epochs() == epochs
    core.feed(seconds(frames, 12, 13))
    assert core.axis().status.samples == 2600
    assert reloading.reload(other).changed == (AXIS,)


def test_a_refused_file_is_a_message_until_one_is_applied(core: RunningCore, reloading: Reloading) -> None:
    def shown() -> list[str]:
        return [words for words in core.worker.snapshot.messages if "robot.toml" in words]

    reloading.refuse(Path("plant/robot.toml"), ["robot.toml:3: memry_s: unknown key", "robot.toml:9: kT: no"])
    wait_for(shown)
    (words,) = shown()
    assert words == (
        f"robot.toml was refused at {iso(core.now_us)}: robot.toml:3: memry_s: unknown key; mistakes in it: 2."
        " The former configuration stays in force"
    )
    with pytest.raises(ReloadError):
        reloading.reload(changed(core.config, "axis1", estimator={"torque_noise": None}))
    assert shown() == [words]
    assert core.worker.snapshot.configuration_refused
    reloading.reload(core.config)
    wait_for(lambda: not shown())
    assert not core.worker.snapshot.configuration_refused


def test_another_drawing_in_the_same_file_is_another_drive(
    core: RunningCore, reloading: Reloading, tmp_path: Path
) -> None:
    drawing = shipped("drives/three_mass.mo").read_text(encoding="utf-8")
    file = tmp_path / "cell.mo"
    file.write_text(drawing, encoding="utf-8")
    drawn = changed(core.config, "axis1", model={"drive": str(file)})
    assert reloading.reload(drawn).changed == (AXIS,)
    assert reloading.reload(drawn) == Reloaded((), (), (), 2, ())
    assert "ratio = 1/r" in drawing
    file.write_text(drawing.replace("ratio = 1/r", "ratio = 0.9/r"), encoding="utf-8")
    before = core.axis().watched
    assert reloading.reload(drawn) == Reloaded((AXIS,), (), (), 1, ())
    wait_for(lambda: core.axis().watched != before)
    file.write_text(drawing.replace("ratio = 1/r", "ratio = 1/q"), encoding="utf-8")
    with pytest.raises(ReloadError, match=r"cell\.mo:\d+: .*\bq\b"):
        reloading.reload(drawn)
    assert reloading.config == drawn


def test_a_bus_is_opened_again_and_its_axes_go_on(
    core: RunningCore, reloading: Reloading, tmp_path: Path, frames: list[Frame]
) -> None:
    """On another channel; with messages that no axis has needed before; with another description of the same name."""
    core.reader.add(seconds(frames, 12, 12.5))  # which wait still
    options = {"preserve_timestamps": True}
    new = on_bus(core.config, channel="another", options=options)
    assert reloading.reload(new) == Reloaded((), (), (), 2, ("[[bus]] can0",))
    arrive(core, new, seconds(frames, 12.5, 13), 2600)

    third = on_bus(cell(tmp_path, 3), channel="another", options=options)
    found = reloading.reload(third)
    assert (found.added, found.kept, found.tables) == (("demo.axis3",), 2, ("[[bus]] can0",))
    arrive(core, third, seconds(frames, 13, 13.5), 2700)

    assert third.bus[0].messages is not None
    file = tmp_path / "demo.dbc"
    file.write_bytes(third.bus[0].messages.read_bytes())
    described = on_bus(third, messages=file)
    assert reloading.reload(described).tables == ("[[bus]] can0",)
    assert reloading.reload(described).tables == ()
    text = file.read_text(encoding="utf-8")
    assert "Axis1State" in text
    file.write_text(text.replace("Axis1State", "FirstState"), encoding="utf-8")
    with pytest.raises(ReloadError, match='no message "Axis1State"'):
        reloading.reload(described)
    file.write_text(text + "\n", encoding="utf-8")
    assert reloading.reload(described).tables == ("[[bus]] can0",)
    arrive(core, described, seconds(frames, 13.5, 14), 2800)
    assert [a.parameter for a in core.axis().open_alarms] == ["fm"]
    assert core.axis().status.counters["started"] == 1


def arrive(core: RunningCore, config: Config, frames: list[Frame], samples: int) -> None:
    """These frames come over the bus, and make that many samples of each of the first axes, with those before."""
    with open_buses(config.bus) as buses:
        for frame in frames:
            send(buses["can0"], frame.key, frame.data, frame.t_us * 1e-6)
    wait_for(lambda: [axis.status.samples for axis in core.worker.snapshot.axes[:2]] == [samples] * 2)
