"""The worker with real monitors, a real journal and real checkpoints; only the frames are there from the start."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from structlog.testing import capture_logs

from monitor_core.monitoring import AlarmEvent, Status
from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame
from service.config.schema import DetectorConfig
from service.pipeline import publishing
from service.pipeline import worker as worker_module
from service.pipeline.persistence.checkpointing import states_of
from service.pipeline.publishing import BOUNDS_S, READ_S, UNREAD_S, ProcessingTime
from service.pipeline.snapshot import Histogram, Snapshot
from service.pipeline.worker import COMPILING, COMPILING_MULTIMODEL, next_block_s
from service.simulation.robot import SimulatedFault
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_filter import AlarmFilter
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from service.store.checkpoints import Checkpoint
from service.store.database import StoreError
from service.store.history_query import Question, ask
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.can.full_disk import fill_the_disk
from tests.service.pipeline.robots import Waiting, blocks, changed, demo
from tests.service.pipeline.running_core import NOW_US, StandingCore

SAID = ("said at the start",)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, seed: int) -> list[Frame]:
    """Twelve seconds of two axes; after six, the friction of the first has doubled."""
    config = demo(tmp_path_factory.mktemp("frames"), 2)
    fault = SimulatedFault("demo.axis1", {"fm": 2.0}, 6.0)
    return [frame for block in blocks(config, 12.0, seed, [fault]) for frame in block.frames()]


@pytest.fixture
def bench(tmp_path: Path, frames: Sequence[Frame], monkeypatch: pytest.MonkeyPatch) -> Iterator[StandingCore]:
    monkeypatch.setattr(worker_module, "MOST_FRAMES", 40)  # many blocks
    bench = StandingCore(tmp_path, demo(tmp_path, 2, history_interval_s=1.0), Waiting(frames), start_messages=SAID)
    yield bench
    bench.close()


@pytest.mark.parametrize(
    ("interval_s", "block_s"), [(0.01, 0.1), (0.005, 0.1), (0.002, 0.06), (0.001, 0.03), (0.0005, 0.03)]
)
def test_a_block_has_some_samples_of_the_fastest_axis(tmp_path: Path, interval_s: float, block_s: float) -> None:
    config = changed(demo(tmp_path, 2), only="axis2", sample_interval_s=interval_s)
    assert config.block_s == pytest.approx(block_s)
    assert demo(tmp_path, 2, block_s=0.5).block_s == 0.5


def test_a_block_that_takes_long_is_followed_by_a_longer_one() -> None:
    assert [next_block_s(0.1, took_s) for took_s in (0.001, 0.06, 3.0)] == pytest.approx([0.1, 0.24, 0.5])


def test_answers_are_prepared_before_their_snapshot_is_shown(
    bench: StandingCore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publishing, "UNREAD_S", 0.0)
    prepared = list[tuple[Snapshot, Snapshot]]()
    bench.worker.publisher.prepare = lambda new: prepared.append((new, bench.worker.snapshot))
    shown = bench.run().snapshot
    assert prepared[-1][0] is shown
    assert all(new is not before for new, before in prepared)


def test_what_is_shown_is_in_the_journal(bench: StandingCore) -> None:
    bench.compile()
    bench.worker.start()
    seen = set()
    while sum(axis.status.samples for axis in bench.worker.snapshot.axes) < 4800:
        assert not bench.failed.is_set()
        shown = bench.worker.snapshot.axes[0]
        for e in shown.open_alarms:
            recorded, _ = bench.journal.query(AlarmFilter("demo.axis1", e.parameter, active=True))
            assert [a.raised_us for a in recorded] == [e.raised_us]
            seen.add(e.parameter)
        alarmed = {p.name for p in shown.status.parameters if p.status is Status.ALARM}
        assert alarmed == {e.parameter for e in shown.open_alarms}
    bench.worker.stop()
    assert "fm" in seen | {e.parameter for e in bench.worker.snapshot.axes[0].open_alarms}
    assert bench.worker.error is None


def test_each_axis_gives_points_of_the_history_while_it_is_tested(bench: StandingCore) -> None:
    bench.run()
    bench.history.write()
    assert bench.history.store is not None
    for axis in bench.worker.snapshot.axes:
        answer = ask(bench.history.store, Question(axis.id, 1.0))
        assert {c.series.parameter for c in answer.courses} == {p.name for p in axis.status.parameters}
        assert axis.status.time_us is not None
        last = axis.status.time_us // 1_000_000
        times = answer.t.tolist()
        assert times == list(range(times[0], last + 1)), "from when P(0) is known on"


def test_an_axis_out_of_service_is_shown_from_the_next_start_on(tmp_path: Path) -> None:
    removed = Note(NOW_US, "anna", "new gearbox")
    before = StandingCore(tmp_path, demo(tmp_path, 2), Waiting([]))
    assert [axis.out_of_service for axis in before.worker.snapshot.axes] == [None, None]
    before.journal.services.change("demo.axis1", AlarmEvent.REMOVE, removed)
    before.close()
    after = StandingCore(tmp_path, demo(tmp_path, 2), Waiting([]))
    assert [axis.out_of_service for axis in after.worker.snapshot.axes] == [removed, None]
    message = "out of service, with alarms that are recorded but not announced: demo.axis1 (anna)"
    assert after.worker.snapshot.messages[:2] == (message, COMPILING)
    after.close()


def test_stopping_processes_all_frames_and_saves(bench: StandingCore, frames: Sequence[Frame]) -> None:
    last = bench.run().snapshot
    assert [axis.status.samples for axis in last.axes] == [2400, 2400]
    assert (last.buses[0].frames, last.buses[0].up, last.checkpoint_us) == (len(frames), True, NOW_US)
    assert sum(last.processing.counts) > 1
    assert last.messages == SAID
    for axis_id, monitor in bench.core.monitors.by_id.items():
        found = bench.checkpoints.load(axis_id, monitor.key, NOW_US)
        assert isinstance(found, Checkpoint)
        assert (found.arrays["floats"] == monitor.to_arrays()["floats"]).all()


@pytest.mark.parametrize("out_of_service", [False, True])
def test_a_snapshot_is_replaced_as_often_as_somebody_looks_and_at_once_where_an_alarm_changes(
    bench: StandingCore, monkeypatch: pytest.MonkeyPatch, out_of_service: bool
) -> None:
    """An axis out of service, which is a message, too, is no news."""
    clock = 0.0
    if out_of_service:
        bench.journal.services.change("demo.axis2", AlarmEvent.REMOVE, Note(NOW_US, "anna"))
    monkeypatch.setattr(publishing, "perf_counter", lambda: clock)
    worker, new = bench.worker, list[float]()
    bench.compile()

    def turn_until(end_s: float, look: bool) -> None:
        """Turns of the worker with samples for each; notes when there is another snapshot."""
        nonlocal clock
        while clock < end_s:
            clock += 0.125
            shown = worker.publisher.newest
            worker.turn()
            if worker.publisher.newest is not shown:
                new.append(clock)
            if look:
                assert worker.snapshot is worker.publisher.newest

    worker.turn()  # the kernel is ready, which is news
    turn_until(2.0, look=False)
    turn_until(3.0, look=True)
    turn_until(5.0, look=False)  # nobody looks any more
    assert new == [1.0, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 4.25]
    while bench.core.monitors.by_id["demo.axis1"].open_alarms == ():
        worker.turn()
    shown = worker.publisher.newest
    assert [a.parameter for a in shown.alarms.standing] == [e.parameter for e in shown.axes[0].open_alarms] == ["fm"]


@pytest.mark.parametrize(("making_s", "pause_s"), [(0.01, READ_S), (0.05, 0.5), (0.3, UNREAD_S)])
def test_a_pause_between_snapshots_is_ten_times_as_long_as_one_takes_but_at_most_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, making_s: float, pause_s: float
) -> None:
    bench = StandingCore(tmp_path, demo(tmp_path, 2), Waiting())
    clock, step_s, made_s = 0.0, 0.01, list[float]()
    monkeypatch.setattr(publishing, "perf_counter", lambda: clock)
    worker, histogram = bench.worker, bench.worker.publisher.processing.histogram

    def slowly() -> Histogram:
        """A part of each snapshot, and so of the time that it takes."""
        nonlocal clock
        clock += making_s
        return histogram()

    monkeypatch.setattr(worker.publisher.processing, "histogram", slowly)
    bench.compile()
    while len(made_s) < 5:
        clock += step_s
        shown = worker.publisher.newest
        worker.turn()
        if worker.publisher.newest is not shown:
            made_s.append(clock)
        assert worker.snapshot is worker.publisher.newest
    # The first one is of what is news: the kernel is ready.
    pauses_s = np.diff(made_s)[1:] - making_s
    assert pauses_s == pytest.approx([pause_s] * 3, abs=1.01 * step_s)
    bench.close()


def test_until_the_kernel_is_ready_frames_wait_and_snapshots_go_on(
    bench: StandingCore, frames: Sequence[Frame]
) -> None:
    first = bench.worker.snapshot
    bench.worker.start()
    while bench.worker.snapshot is first:
        assert not bench.failed.is_set()
    assert COMPILING in bench.worker.snapshot.messages
    assert bench.worker.snapshot.axes[0].status.samples == 0
    bench.compile()
    bench.worker.stop()
    assert bench.worker.snapshot.axes[0].status.samples == 2400


class Seen(NamedTuple):
    """The end of a worker's run: the state of every axis, and its alarms in the journal."""

    states: dict[str, bytes]
    alarms: list[RecordedAlarm]


def seen(bench: StandingCore) -> Seen:
    assert bench.worker.error is None
    states = (state for axis in bench.core.monitors.axes.values() for state in states_of(axis))
    saved = {state.name: (state.arrays() or {}) for state in states}
    content = {name: b"".join(array.tobytes() for array in a.values()) for name, a in saved.items()}
    return Seen(content, bench.journal.query()[0])


def test_what_cannot_be_done_between_blocks_is_raised_to_the_caller(bench: StandingCore) -> None:
    def fails() -> None:
        raise KeyError("no axis")

    bench.compile()
    failed = bench.worker.between_blocks(fails)
    bench.worker.start()
    with pytest.raises(KeyError):
        failed.result(timeout=PATIENCE_S)
    bench.worker.stop()
    assert bench.worker.error is None
    assert bench.worker.between_blocks(lambda: None).cancelled()


@pytest.mark.parametrize("most", [100_000, 300])
def test_estimates_do_not_wait_for_the_multi_model_detector_which_gets_all_samples_later(
    most: int, tmp_path: Path, frames: Sequence[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """States and alarms are the same bits as with a kernel that is ready at once; beyond a number, frames wait."""
    monkeypatch.setattr(worker_module, "MOST_FRAMES", 40)
    monkeypatch.setattr(worker_module, "MOST_DEFERRED", most)
    watched = changed(demo(tmp_path, 2), detector=DetectorConfig(alarm_source="multimodel", budget_s=86400.0))
    folders = [tmp_path / name for name in ("at-once", "late")]
    for folder in folders:
        folder.mkdir()
    at_once, late = (StandingCore(folder, watched, Waiting(frames), start_messages=SAID) for folder in folders)
    at_once.run()

    late.compiled.estimates.set_result(None)
    late.worker.start()
    taken, waits = (4800, ()) if most > 4800 else (most, (COMPILING,))
    wait_for(lambda: sum(axis.status.samples for axis in late.worker.snapshot.axes) >= taken)
    assert taken <= late.core.monitors.deferred_samples < taken + 40
    assert late.worker.snapshot.messages == (*waits, COMPILING_MULTIMODEL, *SAID)
    assert [axis.open_alarms for axis in late.worker.snapshot.axes] == [(), ()]
    late.compiled.multimodel.set_result(None)
    late.worker.stop()

    assert seen(late) == seen(at_once)
    assert [(alarm.axis, alarm.parameter) for alarm in seen(late).alarms] == [("demo.axis1", "fm")]
    at_once.close()
    late.close()


def test_stopping_writes_the_alarms_that_the_disk_has_refused(
    bench: StandingCore, monkeypatch: pytest.MonkeyPatch
) -> None:
    record, refused = bench.journal.record, list[str]()

    def refuse_once(entries: Iterable[AlarmEntry]) -> list[int]:
        found = list(entries)
        if found and not refused:
            refused.append(found[0].axis)
            raise StoreError("database or disk is full")
        return record(found)

    # The next try would come long after the frames are processed.
    monkeypatch.setattr("service.pipeline.persistence.alarm_recording.RETRY_S", 3600.0)
    monkeypatch.setattr(bench.journal, "record", refuse_once)
    last = bench.run().snapshot
    assert refused == ["demo.axis1"]
    assert last.alarms.waiting == 0
    assert [alarm.parameter for alarm in bench.journal.standing()] == [
        alarm.parameter for alarm in last.axes[0].open_alarms
    ]


def test_samples_that_the_multi_model_detector_never_gets_are_reported(bench: StandingCore) -> None:
    bench.compiled.estimates.set_result(None)
    bench.worker.start()
    with capture_logs() as logs:
        bench.worker.stop()
    assert [entry["samples"] for entry in logs if "was not ready" in entry["event"]] == [4800]


def test_a_disk_that_refuses_checkpoints_is_logged_once_and_when_it_takes_them_again(
    bench: StandingCore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise StoreError("database or disk is full")

    saver, save = bench.worker.checkpointer, bench.checkpoints.save
    with capture_logs() as logs:
        for way in (refuse, refuse, save, save, refuse):
            monkeypatch.setattr(bench.checkpoints, "save", way)
            saver.save()
    failed, again = "checkpoint failed; retrying", "checkpoints are saved again"
    assert [entry["event"] for entry in logs] == [failed, again, failed]
    assert "disk is full" in str(saver.problem)


def test_no_checkpoint_is_saved_while_the_detectors_are_behind_the_estimates(
    tmp_path: Path, frames: Sequence[Frame]
) -> None:
    watched = demo(tmp_path, 2, checkpoint_interval_s=1e-6)
    bench = StandingCore(tmp_path, watched, Waiting(frames))
    bench.compiled.estimates.set_result(None)
    bench.worker.start()
    wait_for(lambda: bench.core.monitors.deferred_samples == 4800)
    shown = bench.worker.snapshot
    wait_for(lambda: bench.worker.snapshot is not shown)
    assert bench.worker.snapshot.checkpoint_us is None
    bench.compiled.multimodel.set_result(None)
    wait_for(lambda: bench.worker.snapshot.checkpoint_us is not None)
    bench.worker.stop()
    bench.close()


def test_a_fault_of_the_worker_is_told(bench: StandingCore) -> None:
    bench.compiled.estimates.set_exception(RuntimeError("no compiler"))
    bench.worker.start()
    assert bench.failed.wait(PATIENCE_S)
    bench.worker.stop()
    assert isinstance(bench.worker.error, RuntimeError)


def test_a_full_disk_ends_the_recording_and_not_the_monitoring(tmp_path: Path, frames: Sequence[Frame]) -> None:
    recorder = FrameRecorder(tmp_path / "frames.log")
    fill_the_disk(tmp_path / "frames.log")
    bench = StandingCore(tmp_path, demo(tmp_path, 2), Waiting(frames), recorder)
    bench.run()
    with capture_logs() as logs:
        bench.recording.close()
    bench.close()
    assert logs == []  # it has been said
    assert bench.worker.error is None
    assert "recording has ended: cannot write" in bench.worker.snapshot.messages[0]
    assert bench.worker.snapshot.axes[0].status.samples == 2400


def test_a_state_that_cannot_be_saved_is_said_and_the_old_one_stays(bench: StandingCore) -> None:
    bench.checkpoints.close()
    worker = bench.run()
    assert worker.error is None
    assert worker.snapshot.checkpoint_us is None
    assert "the state of the monitors cannot be saved" in worker.snapshot.messages[0]


def test_processing_times_are_counted_by_their_upper_bounds() -> None:
    time = ProcessingTime()
    for duration_s in (0.0, BOUNDS_S[0], BOUNDS_S[0] * 1.01, 1e9):
        time.observe(duration_s)
    found = time.histogram()
    assert (found.counts[0], found.counts[1], found.counts[-1]) == (2, 1, 1)
    assert len(found.counts) == len(found.bounds) + 1
