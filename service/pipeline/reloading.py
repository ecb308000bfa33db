"""A new configuration for the running daemon, all or nothing: axes that it does not change keep their monitors.

What takes time, and all that can be wrong, is done before the worker exchanges the changed axes between two blocks.  A
changed axis goes on as after a restart: from its checkpoint if that fits, with its open alarms from the journal.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import structlog

from monitor_core.modeling import ModelError
from service.can.messages import DescriptionError
from service.can.user_errors import IngestError
from service.config import Config, NamedAxis
from service.config.axis_settings import AxisError
from service.ingest.bus_samples import Ingest
from service.pipeline.alarm_recording import alarm_rules, quantities
from service.pipeline.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.baselines import Baselines, at_start, begun_again, resume
from service.pipeline.checkpointing import Checkpointer, restore
from service.pipeline.worker import Worker
from service.store.checkpoints import Checkpoints
from service.store.journal import Journal

log = structlog.get_logger(__name__)


class ReloadError(Exception):
    """The new configuration cannot be used without a restart, or not at all; nothing was changed."""


class Reloaded(NamedTuple):
    """What a new configuration has changed."""

    changed: tuple[str, ...]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    kept: int
    """Number of axes that go on as they are"""
    needs_restart: tuple[str, ...]
    """Tables whose changes count only after a restart"""


class Reloading:
    """Exchanges what a new configuration changes.

    Args:
        config: the configuration that the daemon has started with.
        pipeline: of the worker; used by its thread only.
        worker: exchanges monitors.
        baselines: know which values are in force.
        journal: of the alarms and epochs.
        checkpoints: where the states of the monitors are.
        checkpointer: saves them.
        now_us: wall clock.
    """

    def __init__(
        self,
        config: Config,
        pipeline: FramePipeline,
        worker: Worker,
        baselines: Baselines,
        journal: Journal,
        checkpoints: Checkpoints,
        checkpointer: Checkpointer,
        now_us: Callable[[], int],
    ) -> None:
        self._config, self._pipeline, self._worker, self._baselines = config, pipeline, worker, baselines
        self._journal, self._checkpoints, self._checkpointer = journal, checkpoints, checkpointer
        self._now_us = now_us
        self._filters = {name: frozenset(ingest.filter) for name, ingest in pipeline.ingests.items()}

    @property
    def config(self) -> Config:
        """The configuration that is in force."""
        return self._config

    def reload(self, new: Config) -> Reloaded:
        """Take over a configuration that is right in itself; from any thread but the worker's.

        Raises:
            ReloadError: that needs a restart, or is not possible; nothing was changed.
            StoreError: the state directory cannot be read or written; nothing was changed.
        """
        with self._baselines.held():
            before = {axis.id: axis for axis in self._config.axes}
            after = {axis.id: axis for axis in new.axes}
            changed = [axis for axis_id, axis in after.items() if before.get(axis_id) != axis]
            found = Reloaded(
                tuple(axis.id for axis in changed if axis.id in before),
                tuple(axis.id for axis in changed if axis.id not in before),
                tuple(axis_id for axis_id in before if axis_id not in after),
                len(after) - len(changed),
                tuple(
                    f"[{name}]"
                    for name in ("service", "web", "links")
                    if getattr(new, name) != getattr(self._config, name)
                ),
            )
            self._check(new, changed)
            if changed or found.removed:
                self._exchange(new, changed, found.removed)
            # Of the tables that need a restart the old ones are still in force.
            self._config = self._config.model_copy(update={"robot": new.robot})
            return found

    def _check(self, new: Config, changed: Sequence[NamedAxis]) -> None:
        """All that can be wrong with the changed axes."""
        if new.bus != self._config.bus:
            raise ReloadError("[[bus]] was changed, which needs a restart")
        try:
            if changed:
                AxisMonitors(changed)
            for name, known in self._filters.items():
                if not set(Ingest(new, name).filter) <= known:
                    raise ReloadError(
                        f"an axis needs messages of bus {name} that no axis needed at the start, which needs a restart"
                    )
        except (AxisError, DescriptionError, IngestError, ModelError) as error:
            raise ReloadError(str(error)) from None

    def _exchange(self, new: Config, changed: Sequence[NamedAxis], removed: Sequence[str]) -> None:
        begun = at_start(changed, self._journal.epochs, self._now_us())
        in_force = {axis.id: axis for axis in begun.axes}
        made = AxisMonitors(begun.axes)
        made.compile()
        made.compile_multimodel()
        for detector in made.multimodel:
            _ = detector.bank  # made here, not by the worker
        axes = [in_force.get(axis.id) or self._baselines.in_force(axis.id) for axis in new.axes]
        ids = [axis.id for axis in axes]

        def exchange() -> tuple[str, ...]:
            now_us = self._now_us()
            if late := [a for a in (*in_force, *removed) if self._worker.waits_for_journal(a)]:
                raise ReloadError(
                    f"alarms of {', '.join(late)} are not recorded yet; try again when they are"
                )
            self._checkpointer.save()
            resume(made, self._journal.epochs, begun.epochs)
            restored = restore(made, self._checkpoints, self._journal, now_us, ids)
            rules = alarm_rules(begun.axes, quantities(made.by_id))
            self._journal.obey(rules, now_us)
            for name, ingest in self._pipeline.ingests.items():
                ingest.change([axis for axis in axes if axis.config.bus == name], in_force.keys())
            self._worker.change(axes, made)
            self._worker.adopt(restored.open, restored.changes)
            return restored.messages

        messages = self._baselines.between_blocks(exchange)
        self._baselines.configure(new.axes, axes)
        for message in (*begun.messages, *messages, *begun_again(made)):
            log.warning("reload", message=message)
        log.info("reloaded", axes=len(axes), changed=list(in_force), removed=list(removed))
