"""The daemon: readers, worker, store and web are connected, started and stopped."""

import gc
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import structlog

from monitor_core.wording import sentence
from service.can.bus import blf_channels
from service.can.frame_recorder import FrameRecorder
from service.commands.commissioning.signal_look import SignalLook
from service.commands.exit_codes import DaemonFailedError
from service.commands.plant_links import PlantLinks
from service.commands.protection import access_of, certificate_of
from service.commands.service_manager import ServiceManager, status_line
from service.commands.signal_handling import stopped_by_signals
from service.config import Config
from service.config.schema_links import LinksConfig
from service.pipeline.alarm_recording import Alarms, alarm_groups, alarm_rules, quantities
from service.pipeline.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.baselines import AtStart, Baselines, at_start, begun_again, resume
from service.pipeline.bus_readers import BusReaders
from service.pipeline.checkpointing import Checkpointer, restore
from service.pipeline.history_recording import HistoryRecording
from service.pipeline.recording import Extracts, Recording, RecordingFolder
from service.pipeline.reloading import Reloaded, ReloadError, Reloading
from service.pipeline.replay_reports import ReplayReports
from service.pipeline.snapshot import Snapshot
from service.pipeline.wall_clock import WallClock
from service.pipeline.warming import EARLY, CacheFiller, Shape, batch_shape
from service.pipeline.worker import Compiled, Worker
from service.store.checkpoints import Checkpoints
from service.store.history_store import Bounds, HistoryStore, Resolution
from service.store.journal import Journal
from service.texts import now_us
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup
from service.web.server import Certificate, CertificateError, serve

if TYPE_CHECKING:
    from service.links.running import Links

ALARMS_FILE, CHECKPOINTS_FILE, HISTORY_FILE = "alarms.sqlite", "checkpoints.sqlite", "history.sqlite"
"""In the state directory."""

log = structlog.get_logger(__name__)


def run_daemon(
    config: Config,
    record: Path | None = None,
    ready: Callable[[str], None] = lambda _url: None,
    stop: threading.Event | None = None,
    file: Path | None = None,
    complete: Callable[[], None] = lambda: None,
    insecure: bool = False,
    reloadable: Callable[[Callable[[Config], Reloaded]], None] = lambda _reload: None,
) -> None:
    """Run until ``stop`` is set, which SIGTERM and SIGINT do, too.

    Args:
        config: the whole configuration.
        record: frames are also written here, as received.
        ready: called with the address of the page once it is served and the buses are read.
        stop: ends the daemon from another thread.
        file: of the configuration; beside it ``commission`` has left its report, if it has.
        complete: called once everything is compiled and all detectors run, from another thread.
        insecure: other machines may reach it without tokens or TLS.
        reloadable: called with what takes over another configuration.

    Raises:
        UnprotectedError: they would, and may not.
        CertificateError: the certificate or its key cannot be used.
        AxisError, DescriptionError, IngestError: the configuration cannot be used.
        BusError: a bus cannot be opened.
        StoreError: the state directory cannot be used.
        RecordError: the record cannot be written.
        CannotListenError: the address of the page is not available.
        LinkSecretError: a secret or a certificate of a link cannot be used.
        DaemonFailedError: an internal fault.
    """
    stop = stop or threading.Event()
    certificate = certificate_of(config.web)
    access = access_of(config, insecure)
    if access.danger is not None:
        log.warning("access", message=access.danger)
    with ExitStack() as stack:
        journal = Journal(config.service.state_dir / ALARMS_FILE)
        stack.callback(journal.close)
        begun = at_start(config.axes, journal.epochs, now_us())
        core = FramePipeline(config, begun.axes)
        compiled = _in_background(config, stack)
        compiled.multimodel.add_done_callback(lambda done: None if done.exception() else _settled(complete))
        buses = BusReaders(config, core.ingests)
        stack.callback(buses.close)
        extracts = _extracts(config)
        recording = Recording(FrameRecorder(record) if record else None, extracts)
        stack.callback(recording.close)
        history = _history(config)
        stack.callback(history.stop)
        checkpoints = Checkpoints(config.service.state_dir / CHECKPOINTS_FILE)
        stack.callback(checkpoints.close)
        saver = Checkpointer(checkpoints, core.monitors, config.service.checkpoint_interval_s, None, now_us)
        state = _State(journal, checkpoints, saver, begun, history)
        worker = _worker(config, core, compiled, buses, recording, state, stop)
        baselines = Baselines(config.axes, begun.axes, core.monitors, worker, journal.epochs, now_us)
        stack.enter_context(stopped_by_signals(stop))
        stack.callback(worker.stop)
        stack.callback(baselines.stop)
        stack.callback(buses.close)

        links = _links(config, journal, lambda: worker.snapshot, extracts)
        stack.callback(links.stop)
        parts = (partial(_web, access, certificate), partial(_numbered, extracts), links.exchanged)
        reloading = Reloading(
            config, core, worker, baselines, buses, journal, checkpoints, saver, now_us, parts
        )
        systemd = ServiceManager(
            os.environ, lambda: {"worker": worker.turns} | buses.turns(), lambda: status_line(worker.snapshot)
        )
        stack.callback(systemd.close)

        def begin(port: int) -> None:
            buses.start(worker.frames_arrived)
            worker.start()
            history.start()
            links.start()
            baselines.start()
            reloadable(reloading.reload)
            url = f"{'https' if certificate else 'http'}://{_shown(config.web.host)}:{port}/"
            log.info("running", axes=len(config.axes), buses=len(config.bus), page=url)
            systemd.ready()
            ready(url)

        pages = setup = replays = None
        if extracts is not None:
            named = "" if file is None else str(file)
            replays = ReplayReports(extracts.folder, lambda: reloading.config, named, journal.epochs)
            stack.callback(replays.stop)
        if file is not None:
            pages = ReportPages(file.parent, [axis.id for axis in config.axes])
            look = SignalLook(lambda: reloading.config, extracts, now_us)
            setup = RobotSetup(lambda: reloading.config, file, look, lambda: state.problems(worker.snapshot))
        shown = AppState(
            lambda: worker.snapshot,
            journal,
            access,
            reports=pages,
            extracts=extracts,
            history=history,
            links=links.snapshots,
            acknowledge=lambda number, note: baselines.between_blocks(
                lambda: worker.acknowledge(number, note)
            ),
            baselines=baselines,
            stopping=stop.is_set,
            live=core.live,
            setup=setup,
            replays=replays,
        )
        serve(create_app(shown), config.web.host, config.web.port, begin, stop, certificate)
        log.info("stopping")
        systemd.stopping()
    if worker.error is not None:
        raise DaemonFailedError(
            "a fault in the worker has stopped the daemon; the log says what"
        ) from worker.error
    log.info("stopped", checkpoint_us=worker.snapshot.checkpoint_us)


def _settled(complete: Callable[[], None]) -> None:
    """Everything is loaded: a full garbage collection, which stops all threads, need not look at it again and again.

    What comes later is freed without one, but for cycles.  Full collections are rare then: with a thousand axes each
    took a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 50)
    complete()


@contextmanager
def _web(access: Access, certificate: Certificate | None, new: Config) -> Iterator[None]:
    """What of [web] can be changed, and a certificate that was renewed; once all else is in force."""
    try:
        renewed = certificate_of(new.web)
    except CertificateError as error:
        raise ReloadError(str(error)) from None
    yield
    access.change([new.web.host, *new.web.hosts], new.web.open_metrics)
    if certificate is not None and renewed is not None:
        certificate.renew(renewed)


@contextmanager
def _numbered(extracts: Extracts | None, new: Config) -> Iterator[None]:
    """The numbers of the buses in files without their names."""
    if extracts is not None:
        extracts.folder.add_channels(blf_channels(new.bus) or {})
    yield


def needs_cyclic_clock(config: Config) -> bool:
    """Whether the clock of an axis is fitted to its cycles, as it has no sample counter."""
    return any(axis.config.time.clock == "cyclic" for axis in config.axes)


_LONGEST_LOAD_S = 5.0
"""For which a stop waits for a kernel that is being loaded."""


def _in_background(config: Config, stack: ExitStack) -> Compiled:
    """Compile the kernel, or load it from its cache, during the start: that of the estimates first.

    In parallel both would be slower where there are two processors.  This uses separate monitors: those of the worker
    are used by one thread only.
    """
    compiled = Compiled(Future(), Future())
    filler = EARLY if EARLY.begun else CacheFiller()

    def compile_kernel() -> None:
        try:
            monitors = AxisMonitors(config.axes)
            shapes = {batch_shape(lanes) for lanes in monitors.batch_sizes}
            if needs_cyclic_clock(config):
                shapes.add(Shape.CYCLIC_CLOCK)
            if filler.fill(shapes):
                monitors.compile()
                compiled.estimates.set_result(None)
            if filler.fill({Shape.MULTIMODEL} if monitors.multimodel else ()):
                monitors.compile_multimodel()
                compiled.multimodel.set_result(None)
        except BaseException as error:
            for done in compiled:
                if not done.done():
                    done.set_exception(error)

    thread = threading.Thread(target=compile_kernel, name="compiler", daemon=True)
    thread.start()
    # What it loads has finalizers: at the end of the program Python goes through their list, which must not grow then.
    stack.callback(thread.join, _LONGEST_LOAD_S)
    stack.callback(filler.stop)
    return compiled


class _State(NamedTuple):
    """What is in the state directory, and the epochs that are in force."""

    journal: Journal
    checkpoints: Checkpoints
    saver: Checkpointer
    begun: AtStart
    history: HistoryRecording

    def problems(self, snapshot: Snapshot) -> dict[str, str | None]:
        """Why its files cannot be written now, by their names."""
        waiting = snapshot.alarms.waiting
        words = sentence("alarms wait", "{alarms} alarms are not recorded yet", alarms=waiting)
        return {
            ALARMS_FILE: words if waiting else None,
            CHECKPOINTS_FILE: self.saver.problem,
            HISTORY_FILE: snapshot.history.problem,
        }


def _worker(
    config: Config,
    core: FramePipeline,
    compiled: Compiled,
    buses: BusReaders,
    recording: Recording,
    state: _State,
    stop: threading.Event,
) -> Worker:
    """The worker, whose monitors are restored."""
    journal, checkpoints, saver, begun, history = state
    resume(core.monitors, journal.epochs, begun.epochs)
    restored = restore(core.monitors, checkpoints, journal, now_us())
    saver.saved_us = restored.checkpoint_us
    messages = (*begun.messages, *restored.messages, *begun_again(core.monitors))
    known = quantities(core.monitors.by_id)
    rules = alarm_rules(config.axes, known)
    journal.obey(rules, now_us())
    journal.group(alarm_groups(config.axes))
    clock = WallClock()
    alarms = Alarms(journal, known, rules=rules, wall=clock)
    alarms.adopt(restored.open)
    alarms.record(restored.changes)
    for message in messages:
        log.warning("start", message=message)
    intakes = buses.intakes(core.ingests, recording)
    return Worker(
        config, core, intakes, recording, alarms, history, saver, compiled, clock, messages, stop.set
    )


def _history(config: Config) -> HistoryRecording:
    kept = config.service
    ages_s: dict[Resolution, float] = {
        "raw": kept.history_raw_days * 86400,
        "minute": kept.history_minute_days * 86400,
        "hour": kept.history_hour_days * 86400,
        "day": kept.history_day_days * 86400,
    }
    bounds = Bounds(ages_s, kept.history_mb * 1e6)
    return HistoryRecording(
        lambda: HistoryStore(kept.state_dir / HISTORY_FILE, bounds), kept.history_interval_s
    )


def _links(
    config: Config,
    journal: Journal,
    snapshot: Callable[[], Snapshot],
    extracts: Extracts | None,
) -> PlantLinks:
    def recording_of(t_us: int) -> str | None:
        return None if extracts is None else extracts.folder.holding(t_us)

    def make(links: LinksConfig) -> "Links":
        from service.links.running import Links

        return Links(links, config.service.state_dir, journal, snapshot, recording_of)

    return PlantLinks(config.links, make)


def _extracts(config: Config) -> Extracts | None:
    """What writes the frames around alarms, unless the configuration leaves no room for them."""
    kept = config.service
    if not kept.recordings_mb:
        return None
    folder = RecordingFolder(
        kept.state_dir / "recordings",
        round(kept.recordings_mb * 1e6),
        blf_channels(config.bus) if kept.recording_format == "blf" else None,
    )
    return Extracts(folder, kept.recording_before_s, kept.recording_after_s, now_us)


def _shown(host: str) -> str:
    """A host that a browser on this machine can use."""
    if host in ("0.0.0.0", "::", ""):
        return "localhost"
    return f"[{host}]" if ":" in host else host
