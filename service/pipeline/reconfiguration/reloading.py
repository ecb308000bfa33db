"""Applies a new configuration to the running daemon, all or nothing.  Unchanged axes keep their monitors.

All slow steps and all checks come first; then the worker replaces the changed axes between two blocks.  A changed axis
continues as after a restart: from its checkpoint if that fits, with its open alarms from the journal.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import NamedTuple

import structlog

from monitor_core.modeling import ModelError
from monitor_core.wording import listed, sentence
from service.can.messages import DescriptionError
from service.can.user_errors import BusError, IngestError
from service.config import Config, NamedAxis
from service.config.axis_settings import AxisError
from service.config.bus_messages import FileVersions, files_of
from service.config.drive_sources import Modelled, model_of_axis
from service.ingest.samples.bus_samples import Ingest
from service.pipeline.axes.axis_alarms import alarm_groups
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.bus_readers import BusIntake, BusReaders
from service.pipeline.reconfiguration.baselines import Baselines
from service.pipeline.reconfiguration.epochs_at_start import epochs_in_force, resume_monitors
from service.pipeline.worker import Worker
from service.store.journal import Journal
from service.texts.instants import iso

log = structlog.get_logger(__name__)

ReloadedPart = Callable[[Config], AbstractContextManager[None]]
"""Another part of the daemon that a configuration changes, as a context manager.  The part changes on entry, or on exit
if the ``with`` block has not raised; otherwise it returns to the former state.  Raises ReloadError."""


class ReloadError(Exception):
    """The new configuration cannot be used without a restart, or not at all; nothing was changed."""


class Reloaded(NamedTuple):
    """What a new configuration has changed: ids of axes, tables."""

    changed: tuple[str, ...]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    kept: int
    """Number of unchanged axes"""
    tables: tuple[str, ...]
    """Other changed tables of the configuration, among them those of reopened buses"""


class Reloading:
    """Applies new configurations.

    Args:
        config: the configuration with which the daemon has started.
        worker: replaces monitors.
        baselines: knows which nominal values are in force.
        buses: the bus readers.
        journal: the journal of alarms and epochs.
        now_us: wall clock.
        parts: other parts of the daemon that a configuration changes.
    """

    def __init__(
        self,
        config: Config,
        worker: Worker,
        baselines: Baselines,
        buses: BusReaders,
        journal: Journal,
        now_us: Callable[[], int],
        parts: Sequence[ReloadedPart] = (),
    ) -> None:
        self._config, self._worker, self._baselines, self._buses = config, worker, baselines, buses
        self._journal, self._now_us, self._parts = journal, now_us, parts
        self._filters = {name: frozenset(ingest.filter) for name, ingest in worker.pipeline.ingests.items()}
        self._files = {bus.name: files_of(config, bus.name) for bus in config.bus}
        self._drives = _drives(config)

    @property
    def config(self) -> Config:
        """The configuration in force."""
        return self._config

    def reload(self, new: Config) -> Reloaded:
        """Apply a configuration that has passed its own checks; from any thread but the worker's.

        Raises:
            ReloadError: the change needs a restart or is not possible; nothing was changed.
            StoreError: the state directory cannot be read or written; nothing was changed.
        """
        with self._baselines.held():
            if fixed := list(_need_restart(self._config, new)):
                raise ReloadError(f"a change of {listed(fixed)} needs a restart")
            before, drives = {axis.id: axis for axis in self._config.axes}, _drives(new)
            changed = [
                axis
                for axis in new.axes
                # A drawing is read once and kept; if its text has changed, the drive is another object.
                if before.get(axis.id) != axis or drives[axis.id] is not self._drives[axis.id]
            ]
            removed = tuple(axis_id for axis_id in before if axis_id not in drives)
            files, ingests = self._check(new, changed)
            self._replace(new, changed, removed, ingests)
            tables = self._changed_tables(new, ingests)
            self._filters = {bus.name: self._filters[bus.name] for bus in new.bus if bus.name not in ingests}
            self._filters |= {name: frozenset(ingest.filter) for name, ingest in ingests.items()}
            self._files, self._drives, self._config = files, drives, new
            self._worker.publisher.refused = None
            return Reloaded(
                tuple(axis.id for axis in changed if axis.id in before),
                tuple(axis.id for axis in changed if axis.id not in before),
                removed,
                len(new.axes) - len(changed),
                tables,
            )

    def _replace(
        self, new: Config, changed: Sequence[NamedAxis], removed: Sequence[str], ingests: Mapping[str, Ingest]
    ) -> None:
        """Let all parts of the daemon change to a configuration, or none of them.

        Raises:
            ReloadError, StoreError: as of ``reload``.
        """
        with ExitStack() as undone:
            for part in self._parts:
                undone.enter_context(part(new))
            try:
                intakes = undone.enter_context(self._buses.replaced(new, ingests))
            except BusError as error:
                raise ReloadError(str(error)) from None
            if changed or removed or ingests or len(new.bus) < len(self._config.bus):
                self._exchange(new, changed, removed, ingests, intakes)

    def _changed_tables(self, new: Config, ingests: Mapping[str, Ingest]) -> tuple[str, ...]:
        """The tables of a configuration, other than axes, that differ from the one in force."""
        gone = {bus.name for bus in self._config.bus} - {bus.name for bus in new.bus}
        sections = (name for name in ("links", "web") if getattr(new, name) != getattr(self._config, name))
        return *(f"[[bus]] {name}" for name in (*ingests, *sorted(gone))), *(f"[{name}]" for name in sections)

    def refuse(self, file: Path, problems: Sequence[str]) -> None:
        """Show the operator, until a configuration is applied, that this file was refused."""
        first, *more = problems
        further = sentence("more mistakes", "; mistakes in it: {count}", count=len(problems)) if more else ""
        self._worker.publisher.refused = sentence(
            "configuration refused",
            "{file} was refused at {at}: {problem}{further}. The former configuration stays in force",
            file=file.name,
            at=iso(self._now_us()),
            problem=first,
            further=further,
        )

    def _check(self, new: Config, changed: Sequence[NamedAxis]) -> tuple[dict[str, FileVersions], dict[str, Ingest]]:
        """Check a configuration; returns the description files of each bus, and new ingests of the buses to reopen.

        Raises:
            ReloadError: an axis or a bus cannot be used as configured.
        """
        before, found = {bus.name: bus for bus in self._config.bus}, dict[str, Ingest]()
        try:
            if changed:
                AxisMonitors(changed)
            files = {bus.name: files_of(new, bus.name) for bus in new.bus}
            for bus in new.bus:
                ingest = Ingest(new, bus.name)
                same = bus == before.get(bus.name) and files[bus.name] == self._files[bus.name]
                # The filter of an open bus lets only those messages through that some axis needed before.
                if not same or not set(ingest.filter) <= self._filters[bus.name]:
                    found[bus.name] = ingest
        except (AxisError, DescriptionError, IngestError, ModelError, OSError) as error:
            raise ReloadError(str(error)) from None
        if found and self._worker.compiles:
            raise ReloadError("the numeric kernel is being compiled; try again when it is ready")
        return files, found

    def _exchange(
        self,
        new: Config,
        changed: Sequence[NamedAxis],
        removed: Sequence[str],
        ingests: Mapping[str, Ingest],
        intakes: Mapping[str, BusIntake],
    ) -> None:
        found = epochs_in_force(changed, self._journal.epochs, self._now_us())
        changed_axes = {axis.id: axis for axis in found.axes}
        new_monitors = AxisMonitors(found.axes)
        new_monitors.compile()
        new_monitors.compile_multimodel()
        for detector in new_monitors.multimodel:
            _ = detector.bank  # make it in this thread, not in the worker's
        axes = [changed_axes.get(axis.id) or self._baselines.in_force(axis.id) for axis in new.axes]
        ids = [axis.id for axis in axes]

        def exchange() -> tuple[str, ...]:
            now_us, worker = self._now_us(), self._worker
            worker.take_all()
            if late := [a for a in (*changed_axes, *removed) if worker.alarms.waits_for_journal(a)]:
                raise ReloadError(f"alarms of {', '.join(late)} are not recorded yet; try again when they are")
            worker.checkpointer.save()
            restored = resume_monitors(new_monitors, found, worker.checkpointer.checkpoints, self._journal, now_us, ids)
            self._journal.group(alarm_groups(new.axes))
            worker.change_buses([bus.name for bus in new.bus], intakes, ingests)
            for name, ingest in worker.pipeline.ingests.items():
                ingest.change([axis for axis in axes if axis.config.bus == name], changed_axes.keys())
            worker.change(axes, new_monitors)
            worker.alarms.adopt(restored.open)
            worker.alarms.record(restored.changes)
            return restored.messages

        messages = self._baselines.between_blocks(exchange)
        self._baselines.configure(new.axes, axes)
        for message in (*found.messages, *messages, *new_monitors.restarted_windows):
            log.warning("reload", message=message)
        log.info("reloaded", axes=len(axes), changed=[*changed_axes], removed=[*removed], opened=[*ingests])


def _drives(config: Config) -> dict[str, Modelled]:
    """The drives of all axes from the present text of their drawings.

    Raises:
        ReloadError: a drive cannot be modelled.
    """
    try:
        return {axis.id: model_of_axis(axis.config) for axis in config.axes}
    except ModelError as error:
        raise ReloadError(str(error)) from None


_RUNNING = ("hosts", "open_metrics", "certificate", "key")
"""Keys of [web] that can be changed while the server runs"""


def _need_restart(before: Config, new: Config) -> Iterator[str]:
    """Keys, with their tables, that are changed but cannot be changed while the daemon runs."""
    for name in ("service", "web"):
        old, other = getattr(before, name), getattr(new, name)
        for key in type(old).model_fields:
            changed = getattr(old, key) != getattr(other, key)
            if name == "web" and key in _RUNNING:  # except for turning TLS on or off
                changed = changed and key == "certificate" and None in (old.certificate, other.certificate)
            if changed:
                yield f"[{name}] {key}"
