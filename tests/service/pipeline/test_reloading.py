"""Another configuration for running monitors: what it does not change goes on, bit for bit; no mistake changes it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from service.can.frames import Frame
from service.config import Config
from service.pipeline.reloading import Reloaded, ReloadError, Reloading
from service.store.alarm_transitions import Note
from tests.end_to_end.processes import wait_for
from tests.service.pipeline.robots import START_US, changed, demo
from tests.service.pipeline.running_core import AXIS, OTHER, RunningCore, changed_axis
from tests.service.pipeline.test_baselines import seconds, states


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> list[Frame]:
    return changed_axis(tmp_path_factory.mktemp("frames"), 24.0, seed)


def reloading(core: RunningCore) -> Reloading:
    return Reloading(
        core.config,
        core.core,
        core.worker,
        core.baselines,
        core.journal,
        core.checkpoints,
        core.checkpointer,
        lambda: core.now_us,
    )


@pytest.fixture
def core(tmp_path: Path, frames: list[Frame]) -> Iterator[RunningCore]:
    """Twelve seconds after its start; the first axis has an alarm."""
    (tmp_path / "core").mkdir()
    core = RunningCore(tmp_path / "core", demo(tmp_path, 2))
    core.feed(seconds(frames, 0, 12))
    assert [a.parameter for a in core.axis().open_alarms] == ["fm"]
    yield core
    core.close()


def with_fm(config: Config, value: float, only: str = "axis1") -> Config:
    nominal = {**config.axes[0].config.model.nominal, "fm": value}
    return changed(config, only, model={"nominal": nominal})


def test_an_axis_that_is_not_changed_is_the_same_bits(
    core: RunningCore, tmp_path: Path, frames: list[Frame]
) -> None:
    (tmp_path / "plain").mkdir()
    plain = RunningCore(tmp_path / "plain", demo(tmp_path, 2))
    plain.feed(seconds(frames, 0, 12))
    found = reloading(core).reload(with_fm(core.config, 0.078))
    assert found == Reloaded((AXIS,), (), (), 1, ())
    for running in (plain, core):
        running.feed(seconds(frames, 12, 24))
        running.worker.stop()
    assert states(core, OTHER) == states(plain, OTHER)
    shown = core.axis()
    assert (shown.epoch.number, shown.status.parameters[2].nominal) == (2, 0.078)
    plain.close()


def test_an_axis_with_other_thresholds_keeps_its_estimates_and_its_alarm(core: RunningCore) -> None:
    before = core.axis()
    new = changed(
        core.config,
        "axis1",
        detector=core.config.axes[0].config.detector.model_copy(update={"alpha_2": 25.0}),
    )
    found = reloading(core).reload(new)
    assert (found.changed, found.kept) == ((AXIS,), 1)
    wait_for(lambda: core.axis().status.parameters[2].h != before.status.parameters[2].h)
    after = core.axis()
    assert after.epoch.number == 1
    assert after.status.parameters[2].h == pytest.approx(25 / 20 * before.status.parameters[2].h)
    assert [a.raised_us for a in after.open_alarms] == [a.raised_us for a in before.open_alarms]


def test_an_axis_with_another_trend_goes_on_where_it_was(core: RunningCore, frames: list[Frame]) -> None:
    before = states(core, AXIS)
    new = changed(core.config, "axis1", trend={"lead_time": 86400.0})
    assert reloading(core).reload(new).changed == (AXIS,)
    assert states(core, AXIS) == before
    core.feed(seconds(frames, 12, 13))
    assert (core.axis().epoch.number, core.axis().status.samples) == (1, 2600)


def test_axes_are_added_and_removed(core: RunningCore, tmp_path: Path, frames: list[Frame]) -> None:
    reload = reloading(core).reload
    assert reload(demo(tmp_path, 1)) == Reloaded((), (), (OTHER,), 1, ())
    wait_for(lambda: len(core.worker.snapshot.axes) == 1)
    core.feed([f for f in seconds(frames, 12, 13) if f.can_id == frames[0].can_id])
    assert [axis.id for axis in core.worker.snapshot.axes] == [AXIS]
    assert reload(demo(tmp_path, 2)) == Reloaded((), (OTHER,), (), 1, ())
    core.feed(seconds(frames, 13, 14))
    assert [(axis.id, axis.status.samples) for axis in core.worker.snapshot.axes] == [
        (AXIS, 2800),
        (OTHER, 2600),
    ]


def test_what_is_not_possible_changes_nothing(core: RunningCore, tmp_path: Path) -> None:
    reload, before = reloading(core).reload, core.axis().status
    epochs = core.epochs()
    bus = core.config.bus[0].model_copy(update={"channel": "another"})
    wrong = changed(core.config, "axis1", estimator={"torque_noise": None})
    cases = {
        "needs a restart": with_fm(core.config, 0.07).model_copy(update={"bus": (bus,)}),
        "needs messages of bus can0": demo(tmp_path, 3),
        "demo.axis1: torque_noise not known": wrong,
    }
    for words, config in cases.items():
        with pytest.raises(ReloadError, match=words):
            reload(config)
    assert core.axis().status.parameters == before.parameters
    assert core.epochs() == epochs


def test_what_needs_a_restart_is_named(core: RunningCore) -> None:
    kept = core.config.service.model_copy(update={"history_interval_s": 7.0})
    new = with_fm(core.config, 0.07).model_copy(update={"service": kept})
    assert reloading(core).reload(new) == Reloaded((AXIS,), (), (), 1, ("[service]",))


def test_a_reload_without_a_change_keeps_an_epoch(core: RunningCore) -> None:
    reload = reloading(core).reload
    core.baselines.learn(AXIS, 36.0, 0.0, Note(START_US, "anna"))
    assert reload(core.config) == Reloaded((), (), (), 2, ())
    assert reload(
        changed(
            core.config,
            "axis2",
            trend=core.config.axes[1].config.trend.model_copy(update={"lead_time": 86400.0}),
        )
    )
    assert core.epochs()[0].state == "learning"
