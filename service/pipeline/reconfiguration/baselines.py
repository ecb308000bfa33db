"""New nominal values (a new epoch) for single axes while the daemon runs.

The thread that makes the request does what takes time: reading files, cross-checks, making the monitor.  Between two
blocks of samples, the worker's thread writes the epoch and then replaces the monitor.  One transaction writes the new
epoch and ends the former epoch and its alarms.  If the process is killed between the two steps, the next start finds
the new epoch.
"""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from typing import TypeVar

import structlog

from monitor_core.trend import PARTS, KeptReason, Learned, LearningWindow, WindowDoubt, WindowError
from monitor_core.wording import duration, sentence
from service.config import NamedAxis
from service.config.axis_settings import axis_settings, monitored_model
from service.config.epoch_values import (
    EpochValuesError,
    content_of,
    fingerprint_of,
    from_files,
    recentred,
    with_epoch,
)
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.epoch_progress import Learning
from service.pipeline.reconfiguration.epochs_at_start import nominal_values
from service.pipeline.snapshot import AxisSnapshot
from service.pipeline.worker import Worker
from service.store.alarm_transitions import SERVICE, Note
from service.store.database import StoreError
from service.store.epochs import CANCELLED, RECONFIGURED, Epoch, EpochPlan, Epochs, EpochValue

LOOK_S = 1.0
"""Time between two checks of the running learning and verification windows."""
ANSWER_S = 20.0
"""Longest wait for the worker, which acts between two blocks (about every 0.1 s)."""

log = structlog.get_logger(__name__)
T = TypeVar("T")


class BaselineError(Exception):
    """The request cannot be fulfilled; the text says why."""


class BaselineConflictError(BaselineError):
    """The request cannot be fulfilled at present; the text says what to do first."""


class BaselineUnavailableError(BaselineError):
    """The worker does not answer: the daemon starts or stops, or hangs."""


class UnknownEpochError(LookupError):
    """The axis has no epoch of that number; ``known`` are those that it has."""

    def __init__(self, axis: str, number: int, known: Sequence[int]) -> None:
        super().__init__(f"{axis} has no epoch {number}")
        self.known = known


_REASONS = {
    str(words): words
    for words in (
        CANCELLED,
        RECONFIGURED,
        sentence("window unobserved", WindowDoubt.NOT_OBSERVED),
        sentence("window unexplained", WindowDoubt.MODEL),
        sentence("window unsteady", WindowDoubt.UNSTEADY),
        sentence("window moved", WindowDoubt.MOVED),
        sentence("kept unobserved", KeptReason.NOT_OBSERVED),
        sentence("kept uncertain", KeptReason.UNCERTAIN),
        sentence("kept by definition", KeptReason.BY_DEFINITION),
    )
}


def reason_of(stored: str) -> str:
    """Turn a stored reason back into its translatable sentence; any other text is returned as it is."""
    why, colon, names = stored.partition(": ")
    if why not in _REASONS:
        return stored
    return sentence("of parameters", "{why}: {names}", why=_REASONS[why], names=names) if colon else _REASONS[why]


class Baselines:
    """Starts new epochs of axes: at a person's request and when a learning window is over.  For use by any thread.

    Args:
        configured: axes as configured.
        in_force: axes with the nominal values that are in force.
        worker: owns the monitors and replaces them.
        epochs: the store of the epochs.
        now_us: wall clock.
    """

    def __init__(
        self,
        configured: Sequence[NamedAxis],
        in_force: Sequence[NamedAxis],
        worker: Worker,
        epochs: Epochs,
        now_us: Callable[[], int],
    ) -> None:
        self._configured = {axis.id: axis for axis in configured}
        self._in_force = {axis.id: axis for axis in in_force}
        self._worker, self.epochs, self._now_us = worker, epochs, now_us
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="baselines", daemon=True)

    @property
    def _monitors(self) -> AxisMonitors:
        return self._worker.pipeline.monitors

    def start(self) -> None:
        """Start the thread that checks the windows."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def held(self) -> AbstractContextManager[bool]:
        """The lock of the epochs: none begins or ends inside a ``with`` block of it."""
        return self._lock

    def in_force(self, axis_id: str) -> NamedAxis:
        """An axis with the nominal values that are in force."""
        return self._in_force[axis_id]

    def configure(self, configured: Sequence[NamedAxis], in_force: Sequence[NamedAxis]) -> None:
        """Replace the axes; to be called inside ``held``."""
        self._configured = {axis.id: axis for axis in configured}
        self._in_force = {axis.id: axis for axis in in_force}

    def learn(self, axis_id: str, length_s: float, verify_s: float, note: Note) -> Epoch:
        """Begin a learning window.

        Args:
            axis_id: a configured axis.
            length_s: operating time of the window [s].
            verify_s: operating time of the verification that follows [s]; 0: none.
            note: who makes the request, when and why.

        Raises:
            BaselineError: the window is too short.
            BaselineConflictError: a learning window runs already.
            StoreError: the epoch cannot be written.
        """
        with self._lock:
            axis = self._without_window(axis_id)
            model = monitored_model(axis)
            settings = axis_settings(axis, model)
            least_s = PARTS * settings.naming_samples * settings.interval_s
            if length_s < least_s:
                raise BaselineError(
                    sentence(
                        "window too short",
                        "{axis}: a learning window of {length} is too short: the memory of its estimates needs at least"
                        " {least} of operation",
                        axis=axis_id,
                        length=duration(length_s),
                        least=duration(least_s),
                        length_s=length_s,
                        least_s=least_s,
                    )
                )
            plan = EpochPlan(axis_id, "window", content_of(axis), self._fingerprint(axis_id), (), length_s, verify_s)

            def begin() -> Epoch:
                epoch = self.epochs.learn(plan, note)
                window = LearningWindow(self._monitors.axes[axis_id].monitor.model, length_s)
                self._monitors.axes[axis_id].epoch.learning = Learning(epoch.number, window)
                return epoch

            epoch = self.between_blocks(begin)
            log.info("learning", axis=axis_id, epoch=epoch.number, operation_s=length_s, who=note.who)
            return epoch

    def use_files(self, axis_id: str, nominal: str, thresholds: str | None, verify_s: float, note: Note) -> Epoch:
        """Start an epoch with the contents of nominal.toml and thresholds.toml; other arguments as in ``learn``.

        Raises:
            BaselineError: the files do not fit the axis.
            BaselineConflictError: a learning window runs.
            StoreError: the epoch cannot be written.
        """
        with self._lock:
            self._without_window(axis_id)
            try:
                content = from_files(self._configured[axis_id], nominal, thresholds)
            except EpochValuesError as error:
                raise BaselineError(error.args[0]) from None
            plan = EpochPlan(axis_id, "files", content, self._fingerprint(axis_id), (), None, verify_s)
            return self._begin_epoch(plan, self.epochs.next_number(axis_id), note)

    def restore(self, axis_id: str, number: int, verify_s: float, note: Note) -> Epoch:
        """Start a new epoch with the values of a former one; other arguments as in ``learn``.

        Raises:
            UnknownEpochError: the axis has no epoch of this number.
            BaselineError: the former epoch does not fit the axis any more.
            BaselineConflictError: the former epoch is in force, or never was; or a learning window runs.
            StoreError: the epoch cannot be written.
        """
        with self._lock:
            known = {epoch.number: epoch for epoch in self.epochs.of_axis(axis_id)}
            if number not in known:
                raise UnknownEpochError(axis_id, number, sorted(known))
            self._without_window(axis_id)
            former = known[number]
            if former.in_force:
                words = "epoch {number} of {axis} is in force"
                raise BaselineConflictError(sentence("in force already", words, number=number, axis=axis_id))
            if former.in_force_us is None:
                words = "epoch {number} of {axis} never was in force: {why}"
                raise BaselineConflictError(
                    sentence(
                        "never in force",
                        words,
                        number=number,
                        axis=axis_id,
                        why=reason_of(former.reason),
                    )
                )
            fingerprint = self._fingerprint(axis_id)
            plan = EpochPlan(axis_id, "restored", former.content, fingerprint, (), None, verify_s, number)
            return self._begin_epoch(plan, max(known) + 1, note)

    def cancel(self, axis_id: str, note: Note) -> Epoch:
        """End a learning window without new values.

        Raises:
            BaselineConflictError: no learning window runs.
            StoreError: the epoch cannot be written.
        """
        with self._lock:
            return self._cancel(axis_id, note)

    def _cancel(self, axis_id: str, note: Note, refused: str = "") -> Epoch:
        def end() -> Epoch | None:
            event, reason = ("refused", refused) if refused else ("cancelled", CANCELLED)
            epoch = self.epochs.cancel(axis_id, note, event, reason)  # type: ignore[arg-type]
            self._monitors.axes[axis_id].epoch.learning = None
            return epoch

        epoch = self.between_blocks(end)
        if epoch is None:
            raise BaselineConflictError(sentence("no window", "no learning window of {axis} runs", axis=axis_id))
        return epoch

    def finish_windows(self) -> None:
        """Put learned values in force and end verifications, for all windows that are complete.

        Raises:
            StoreError: an epoch cannot be written; the next call tries again.
        """
        for axis in self._worker.snapshot.axes:
            if axis.epoch.complete:
                with self._lock:
                    if axis.epoch.state == "learning":
                        self._finish_learning(axis.id)
                    elif not any(alarm.kind != "forecast" for alarm in axis.open_alarms):
                        self._finish_verification(axis)

    def _finish_learning(self, axis_id: str) -> None:
        learning = self._monitors.axes[axis_id].epoch.learning
        if learning is None or not learning.window.complete:
            return  # it was cancelled meanwhile
        # A complete window does not change any more, so this thread may read it.
        planned = next(e for e in self.epochs.of_axis(axis_id) if e.number == learning.number)
        note = Note(self._now_us(), SERVICE, planned.comment, planned.work_order)
        axis = self._in_force[axis_id]
        model = monitored_model(axis)
        try:
            learned = learning.window.learned(axis_settings(axis, model).tests(len(model.scale))[2] * model.scale)
            names = [name for name in model.monitored if name not in learned.kept]
            theta = dict(zip(model.monitored, learned.theta, strict=True))
            content = recentred(axis, {name: float(theta[name]) for name in names})
            plan = EpochPlan(axis_id, "window", content, planned.fingerprint, (), planned.learn_s, planned.verify_s)
            self._begin_epoch(plan, learning.number, note, learned)
        except (WindowError, EpochValuesError) as error:
            log.warning("learning refused", axis=axis_id, epoch=learning.number, reason=str(error))
            self._cancel(axis_id, note, str(error))

    def _finish_verification(self, axis: AxisSnapshot) -> None:
        def end() -> None:
            self.epochs.verified(axis.id, axis.epoch.number, Note(self._now_us(), SERVICE))
            epoch = self._monitors.axes[axis.id].epoch
            if epoch.number == axis.epoch.number:
                epoch.verify_s = None

        self.between_blocks(end)
        log.info("verified", axis=axis.id, epoch=axis.epoch.number)

    def _begin_epoch(self, plan: EpochPlan, number: int, note: Note, learned: Learned | None = None) -> Epoch:
        axis_id = plan.axis
        try:
            axis = with_epoch(self._configured[axis_id], plan.content, number)
        except EpochValuesError as error:
            raise BaselineError(str(error)) from None
        before = self._in_force[axis_id]
        plan = plan._replace(nominal=_with_learned(nominal_values(axis, before), learned))
        new = AxisMonitors([axis])
        new.compile()
        new.compile_multimodel()
        if plan.verify_s:
            new.axes[axis_id].epoch.verify_s = plan.verify_s
        axes = [axis if other.id == axis_id else other for other in self._in_force.values()]

        def begin_epoch() -> Epoch:
            if self._worker.alarms.waits_for_journal(axis_id):
                words = "{axis}: alarms are not recorded yet; try again when they are"
                raise BaselineConflictError(sentence("alarms first", words, axis=axis_id))
            epoch = self.epochs.take_over(plan, note, self._worker.alarms.rules_of(axis_id))
            self._worker.change(axes, new)
            return epoch

        epoch = self.between_blocks(begin_epoch)
        self._in_force[axis_id] = axis
        log.info("epoch", axis=axis_id, epoch=number, source=plan.source, who=note.who)
        return epoch

    def _without_window(self, axis_id: str) -> NamedAxis:
        if any(epoch.state == "learning" for epoch in self.epochs.of_axis(axis_id)):
            words = "a learning window of {axis} runs: wait for its end, or cancel it first"
            raise BaselineConflictError(sentence("window runs", words, axis=axis_id))
        return self._in_force[axis_id]

    def _fingerprint(self, axis_id: str) -> str:
        return fingerprint_of(self._configured[axis_id])

    def between_blocks(self, action: Callable[[], T]) -> T:
        """Let the worker run an action between two blocks, and wait for its result.

        Raises:
            BaselineUnavailableError: the worker does not answer.
        """
        done = self._worker.between_blocks(action)
        try:
            return done.result(timeout=ANSWER_S)
        except CancelledError:
            pass
        except TimeoutError:
            if not done.cancel():  # the action has just started
                return done.result()
        words = "the worker does not answer: the daemon starts or stops; try again"
        raise BaselineUnavailableError(sentence("worker silent", words))

    def _run(self) -> None:
        while not self._stop.wait(LOOK_S):
            try:
                self.finish_windows()
            except (StoreError, BaselineError) as error:
                log.warning("epochs are not up to date; retrying", reason=str(error))


def _with_learned(nominal: tuple[EpochValue, ...], learned: Learned | None) -> tuple[EpochValue, ...]:
    """The nominal values with their standard deviations from a learning window, or why a value was kept."""
    if learned is None:
        return nominal
    return tuple(
        v._replace(standard_deviation=None, kept=str(learned.kept[v.name]))
        if v.name in learned.kept
        else v._replace(standard_deviation=float(sd))
        for v, sd in zip(nominal, learned.standard_deviation, strict=True)
    )
