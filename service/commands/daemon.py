"""The daemon: readers, worker, store and web are connected, started and stopped."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import ExitStack
from pathlib import Path

import structlog

from service.can.bus_reader import CanReader
from service.can.frame_recorder import FrameRecorder
from service.commands.exit_codes import DaemonFailedError, stopped_by_signals
from service.config import Config
from service.config.schema import WebConfig
from service.pipeline.alarm_recording import Alarms, alarm_rules, quantities
from service.pipeline.axis_monitors import AxisMonitors, FramePipeline
from service.pipeline.checkpointing import Checkpointer, restore
from service.pipeline.history_recording import HistoryRecording
from service.pipeline.recording import Extracts, Recording, RecordingFolder
from service.pipeline.warming import EARLY, CacheFiller, Shape, batch_shape
from service.pipeline.worker import BusIntake, Compiled, Worker
from service.store.checkpoints import Checkpoints
from service.store.history_store import Bounds, HistoryStore, Resolution
from service.store.journal import Journal
from service.store.tokens import TOKENS_FILE, TokenFile
from service.texts import now_us
from service.web.access import Access
from service.web.app import create_app
from service.web.report_pages import ReportPages
from service.web.server import Certificate, is_remote, serve

log = structlog.get_logger(__name__)


def run_daemon(
    config: Config,
    record: Path | None = None,
    ready: Callable[[str], None] = lambda _url: None,
    stop: threading.Event | None = None,
    reports: Path | None = None,
    complete: Callable[[], None] = lambda: None,
    insecure: bool = False,
) -> None:
    """Run until ``stop`` is set, which SIGTERM and SIGINT do, too.

    Args:
        config: the whole configuration.
        record: frames are also written here, as received.
        ready: called with the address of the page once it is served and the buses are read.
        stop: ends the daemon from another thread.
        reports: folder in which ``commission`` has left its report, if it has.
        complete: called once everything is compiled and all detectors run, from another thread.
        insecure: other machines may reach it without tokens or TLS.

    Raises:
        UnprotectedError: they would, and may not.
        CertificateError: the certificate or its key cannot be used.
        AxisError, DescriptionError, IngestError: the configuration cannot be used.
        BusError: a bus cannot be opened.
        StoreError: the state directory cannot be used.
        RecordError: the record cannot be written.
        CannotListenError: the address of the page is not available.
        DaemonFailedError: an internal fault.
    """
    stop = stop or threading.Event()
    certificate = _certificate(config.web)
    access = _access(config, insecure)
    with ExitStack() as stack:
        core = FramePipeline(config)
        compiled = _in_background(config, stack)
        compiled.multimodel.add_done_callback(lambda done: None if done.exception() else complete())
        readers = _open_buses(config, core, stack)
        recorder = FrameRecorder(record) if record else None
        extracts = _extracts(config)
        recording = Recording(recorder, extracts)
        stack.callback(recording.close)
        history = _history(config)
        stack.callback(history.stop)
        worker, journal = _worker(config, core, compiled, readers, recording, history, stack, stop)
        stack.enter_context(stopped_by_signals(stop))
        stack.callback(worker.stop)
        for reader in readers.values():
            stack.callback(reader.close)

        def begin(port: int) -> None:
            for reader in readers.values():
                reader.start()
            worker.start()
            history.start()
            url = f"{'https' if certificate else 'http'}://{_shown(config.web.host)}:{port}/"
            log.info("running", axes=len(config.axes), buses=len(config.bus), page=url)
            ready(url)

        pages = None if reports is None else ReportPages(reports, [axis.id for axis in config.axes])
        app = create_app(
            lambda: worker.snapshot,
            journal,
            reports=pages,
            access=access,
            extracts=extracts,
            history=history,
            stopping=stop.is_set,
        )
        serve(app, config.web.host, config.web.port, begin, stop, certificate)
        log.info("stopping")
    if worker.error is not None:
        raise DaemonFailedError(
            "a fault in the worker has stopped the daemon; the log says what"
        ) from worker.error
    log.info("stopped", checkpoint_us=worker.snapshot.checkpoint_us)


def _certificate(web: WebConfig) -> Certificate | None:
    if web.certificate is None or web.key is None:
        return None
    certificate = Certificate(web.certificate, web.key)
    certificate.check()
    return certificate


def _access(config: Config, insecure: bool) -> Access:
    web = config.web
    access = Access(
        TokenFile(config.service.state_dir / TOKENS_FILE),
        [web.host, *web.hosts],
        remote=is_remote(web.host),
        tls=web.certificate is not None,
        insecure=insecure,
        open_metrics=web.open_metrics,
    )
    if access.danger is not None:
        log.warning("access", message=access.danger)
    return access


def needs_cyclic_clock(config: Config) -> bool:
    """Whether the clock of an axis is fitted to its cycles, as it has no sample counter."""
    return any(axis.config.time.clock == "cyclic" for axis in config.axes)


def _in_background(config: Config, stack: ExitStack) -> Compiled:
    """Compile the kernel, or load it from its cache, during the start: that of the estimates first.

    In parallel both would be slower where there are two processors.  This uses separate monitors: those of the worker
    are used by one thread only.
    """
    compiled = Compiled(Future(), Future())
    filler = EARLY if EARLY.begun else CacheFiller()
    stack.callback(filler.stop)

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

    threading.Thread(target=compile_kernel, name="compiler", daemon=True).start()
    return compiled


def _open_buses(config: Config, core: FramePipeline, stack: ExitStack) -> dict[str, CanReader]:
    readers = {}
    for bus in config.bus:
        readers[bus.name] = reader = CanReader(bus, core.ingests[bus.name].filter)
        reader.open()
        stack.callback(reader.close)
    return readers


def _worker(
    config: Config,
    core: FramePipeline,
    compiled: Compiled,
    readers: Mapping[str, CanReader],
    recording: Recording,
    history: HistoryRecording,
    stack: ExitStack,
    stop: threading.Event,
) -> tuple[Worker, Journal]:
    """The worker with the files of the state directory, which are closed in the reverse order."""
    journal = Journal(config.service.state_dir / "alarms.sqlite")
    stack.callback(journal.close)
    checkpoints = Checkpoints(config.service.state_dir / "checkpoints.sqlite")
    stack.callback(checkpoints.close)
    restored = restore(core.monitors, checkpoints, journal, now_us())
    known = quantities(core.monitors.by_id)
    rules = alarm_rules(config.axes, known)
    journal.obey(rules, now_us())
    alarms = Alarms(journal, known, rules=rules)
    alarms.adopt(restored.open)
    alarms.record(restored.changes)
    interval_s = config.service.checkpoint_interval_s
    for message in restored.messages:
        log.warning("start", message=message)
    saver = Checkpointer(checkpoints, core.monitors, interval_s, restored.checkpoint_us, now_us)
    buses = [BusIntake(name, r, core.ingests[name], recording) for name, r in readers.items()]
    worker = Worker(
        config,
        core,
        buses,
        recording,
        alarms,
        history,
        saver,
        compiled,
        now_us,
        restored.messages,
        stop.set,
    )
    return worker, journal


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
        lambda: HistoryStore(kept.state_dir / "history.sqlite", bounds), kept.history_interval_s
    )


def _extracts(config: Config) -> Extracts | None:
    """What writes the frames around alarms, unless the configuration leaves no room for them."""
    kept = config.service
    if not kept.recordings_mb:
        return None
    folder = RecordingFolder(kept.state_dir / "recordings", round(kept.recordings_mb * 1e6))
    return Extracts(folder, kept.recording_before_s, kept.recording_after_s, now_us)


def _shown(host: str) -> str:
    """A host that a browser on this machine can use."""
    if host in ("0.0.0.0", "::", ""):
        return "localhost"
    return f"[{host}]" if ":" in host else host
