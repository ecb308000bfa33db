"""A repaired axis gets new nominal values while the daemon runs: real monitors, journal and checkpoints."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from monitor_core.monitoring import AlarmEvent, AlarmState, Status
from service.can.frames import Frame
from service.config import Config
from service.pipeline.reconfiguration.baselines import BaselineConflictError, BaselineError, reason_of
from service.store.alarm_filter import AlarmFilter
from service.store.alarm_transitions import SERVICE, Note
from service.web.models import sentences
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.found_files import nominal_text, thresholds_text
from tests.service.pipeline.robots import START_US, changed
from tests.service.pipeline.running_core import (
    AXIS,
    OTHER,
    TRUTH,
    RunningCore,
    cell,
    changed_axis,
    seconds,
)

WINDOW_S = 36.0
REPAIR = Note(START_US, "anna", "gearbox changed", "WO-1718")


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> list[Frame]:
    return changed_axis(tmp_path_factory.mktemp("frames"), 86.0, seed)


Start = Callable[..., RunningCore]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts the daemon in the same folder; the one before has to be closed."""
    started = list[RunningCore]()

    def begin(config: Config | None = None, folder: str = "state") -> RunningCore:
        (tmp_path / folder).mkdir(exist_ok=True)
        started.append(RunningCore(tmp_path / folder, config or cell(tmp_path, 2)))
        return started[-1]

    yield begin
    for daemon in started:
        daemon.close()


def test_an_alarm_a_repair_a_learned_baseline_its_verification_and_the_way_back(
    start: Start, frames: list[Frame]
) -> None:
    d = start()
    d.feed(seconds(frames, 0, 12))
    (alarm,) = (a for a in d.journal.query(AlarmFilter(AXIS))[0] if a.parameter == "fm")
    d.journal.act(alarm.id, AlarmEvent.ACKNOWLEDGE, REPAIR)

    assert d.baselines.learn(AXIS, WINDOW_S, 5.0, REPAIR).state == "learning"
    d.feed(seconds(frames, 12, 40))
    learning = d.axis().epoch
    assert (learning.number, learning.state, learning.length_s) == (1, "learning", WINDOW_S)
    assert 15 < (learning.done_s or 0) < 28
    assert learning.words.startswith("learning: ")
    assert d.axis().status.parameters[2].status is Status.ALARM  # no gap: tested with the former values
    d.baselines.finish_windows()
    assert d.axis().epoch.state == "learning"

    d.feed(seconds(frames, 40, 58))
    d.baselines.finish_windows()
    new, old = d.epochs()
    assert (old.state, new.state, new.source, new.who) == ("closed", "verifying", "window", "anna")
    assert (new.comment, new.work_order) == ("gearbox changed", "WO-1718")
    learned = {value.name: value for value in new.nominal}
    fm = learned["fm"]
    assert fm.standard_deviation is not None
    assert abs(fm.value - TRUTH) < 4 * fm.standard_deviation < 0.2 * 0.06
    assert (fm.former, fm.kept) == (0.06, "")
    wait_for(lambda: d.axis().epoch.number == 2)
    assert d.axis().status.parameters[2].nominal == fm.value
    wait_for(lambda: d.worker.snapshot.checkpoint_us == d.now_us)  # long before one is due
    after = d.journal.get(alarm.id)
    assert after is not None
    assert (after.state, after.ended_us) == (AlarmState.NORMAL, d.now_us)
    last = d.journal.transitions(alarm.id)[-1]
    assert (last.event, last.who, last.work_order) == (AlarmEvent.CLEAR, SERVICE, "WO-1718")
    assert last.comment == "epoch 2 of demo.axis1 has begun: gearbox changed"

    d.feed(seconds(frames, 58, 70))
    assert d.axis().open_alarms == ()
    # That it is the same to the last bit is shown in test_reloading.py.
    assert (d.axis(OTHER).status.samples, d.axis(OTHER).status.counters["started"]) == (14_000, 1)
    d.baselines.finish_windows()
    assert d.epochs()[0].state == "current"
    assert [e.event for e in d.journal.epochs.events(AXIS)[2]] == ["begun", "taken over", "verified"]
    wait_for(lambda: d.axis().epoch.state == "current")

    back = d.baselines.restore(AXIS, 1, 5.0, REPAIR)
    assert (back.number, back.state, back.source, back.restored_from) == (3, "verifying", "restored", 1)
    assert [e.state for e in d.epochs()] == ["verifying", "rolled_back", "closed"]
    wait_for(lambda: d.axis().epoch.number == 3)
    assert d.axis().status.parameters[2].nominal == 0.06

    d.feed(seconds(frames, 70, 86))  # the axis is another one than that epoch says
    assert [a.parameter for a in d.axis().open_alarms] == ["fm"]
    assert d.axis().epoch.complete
    d.baselines.finish_windows()
    assert d.epochs()[0].state == "verifying"


def test_files_that_do_not_fit_change_nothing(start: Start, frames: list[Frame]) -> None:
    d = start()
    d.feed(seconds(frames, 0, 1))
    config = d.config.axes[0].config
    good = nominal_text(config)
    other_drive = good.replace('"structure" = "', '"structure" = "0')
    cases = {
        "is no TOML": "format = ",
        "identify it again": other_drive,
        "sample_interval_s": good.replace('"interval_s" = 0.005', '"interval_s" = 0.004'),
        "thresholds.toml was made with": good,
    }
    for text, nominal in cases.items():
        thresholds = thresholds_text(config, forgetting=0.5) if text.startswith("thresholds") else None
        with pytest.raises(BaselineError, match=text):
            d.baselines.use_files(AXIS, nominal, thresholds, 8.0, REPAIR)
    assert [(e.number, e.state, e.source) for e in d.epochs()] == [(1, "current", "configuration")]


def test_a_window_that_is_refused_or_cancelled_leaves_the_epoch_in_force(start: Start, frames: list[Frame]) -> None:
    d = start()
    d.baselines.learn(OTHER, WINDOW_S, 8.0, REPAIR)
    with pytest.raises(BaselineConflictError, match="runs"):
        d.baselines.learn(OTHER, WINDOW_S, 8.0, REPAIR)
    assert d.baselines.cancel(OTHER, REPAIR).reason == "it was cancelled"

    d.baselines.learn(AXIS, WINDOW_S, 8.0, REPAIR)
    wait_for(lambda: d.axis().epoch.state == "learning")
    learning = d.core.monitors.axes[AXIS].epoch.learning
    assert learning is not None
    learning.window.from_arrays(
        {"sums": np.zeros((3, 12, 3)), "rho": np.zeros(3), "counts": np.array([WINDOW_S, 2, 12, 0])}
    )
    d.feed(seconds(frames, 0, 1))
    d.baselines.finish_windows()
    refused, first = d.epochs()
    assert (refused.state, first.state) == ("cancelled", "current")
    assert refused.reason == "no parameter was observed for long enough: kT, 1/Ja, fm"
    (found,) = sentences([reason_of(refused.reason)])
    assert (found["words"], found["kind"]) == (refused.reason, "of parameters")
    with pytest.raises(BaselineConflictError, match="never was in force: no parameter was observed"):
        d.baselines.restore(AXIS, 2, 0.0, REPAIR)


def test_a_window_goes_on_after_a_restart_and_so_does_the_epoch(start: Start, frames: list[Frame]) -> None:
    first = start()
    first.baselines.learn(AXIS, WINDOW_S, 8.0, REPAIR)
    first.feed(seconds(frames, 0, 25))
    done_s = first.axis().epoch.done_s
    first.close()
    second = start()
    assert second.messages == ()
    assert (second.axis().epoch.state, second.axis().epoch.done_s) == ("learning", done_s)
    second.feed(seconds(frames, 25, 62))
    second.baselines.finish_windows()
    value = second.epochs()[0].nominal[2].value
    assert abs(value - TRUTH) < 0.1 * TRUTH
    second.close()

    third = start()
    assert third.messages == ("demo.axis1: the nominal values of epoch 2 are in force, not those of the configuration",)
    shown = third.axis()
    assert (shown.epoch.number, shown.epoch.state) == (2, "verifying")
    assert shown.status.parameters[2].nominal == value
    third.close()


def test_a_window_of_which_nothing_is_left_begins_again_which_is_shown_while_it_runs(start: Start) -> None:
    first = start()
    first.baselines.learn(AXIS, WINDOW_S, 8.0, REPAIR)
    first.close()
    second = start()
    message = "demo.axis1: the learning window of epoch 2 begins again"
    assert message in second.worker.snapshot.messages
    second.baselines.cancel(AXIS, REPAIR)
    wait_for(lambda: message not in second.worker.snapshot.messages)


def test_a_configuration_that_was_changed_by_hand_counts(start: Start, tmp_path: Path, frames: list[Frame]) -> None:
    first = start()
    first.feed(seconds(frames, 0, 1))
    first.baselines.use_files(AXIS, nominal_text(first.config.axes[0].config), None, 8.0, REPAIR)
    first.close()
    config = cell(tmp_path, 2)
    nominal = {**config.axes[0].config.model.nominal, "fm": 0.07}
    second = start(changed(config, "axis1", model={"nominal": nominal}))
    assert "demo.axis1: the configuration was changed since epoch 2 began" in second.messages[0]
    assert (second.axis().epoch.number, second.axis().status.parameters[2].nominal) == (3, 0.07)
    assert [e.source for e in second.epochs()] == ["configuration", "files", "configuration"]


def test_a_checkpoint_of_another_epoch_is_not_restored_and_that_is_reported(
    start: Start, frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process ends between the transaction and the exchange of the monitor."""
    first = start()
    first.feed(seconds(frames, 0, 5))
    first.worker.between_blocks(first.checkpointer.save).result(PATIENCE_S)

    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(first.worker, "change", ended)
    with pytest.raises(KeyboardInterrupt):
        first.baselines.use_files(AXIS, nominal_text(first.config.axes[0].config), None, 8.0, REPAIR)
    first.worker.stop()  # without a last checkpoint: its thread is gone
    assert first.failed.is_set()
    first.journal.close()
    first.checkpoints.close()
    second = start()
    assert (second.axis().epoch.number, second.axis().epoch.state) == (2, "verifying")
    assert second.messages[-1] == (
        "demo.axis1: its checkpoint is not used and was quarantined: it belongs to the configuration, not to epoch 2"
        " (restarted: the estimates and the long-term history)"
    )
    assert second.axis(OTHER).status.samples > 0
