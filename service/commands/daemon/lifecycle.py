"""The daemon: connects, starts and stops readers, worker, store and web server."""

import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import structlog

from service.can.bus import blf_channels
from service.commands.command_line.exit_codes import DaemonFailedError
from service.commands.commissioning.live.signal_look import SignalLook
from service.commands.daemon.daemon_parts import DaemonParts
from service.commands.daemon.protection import access_of, certificate_of
from service.commands.daemon.service_manager import ServiceManager, status_line
from service.config import Config
from service.pipeline.certificate_watch import CertificateWatch
from service.pipeline.persistence.recording import Extracts
from service.pipeline.persistence.replay_reports import ReplayReports
from service.pipeline.reconfiguration.reloading import ReloadError, Reloading
from service.texts.instants import iso, now_us
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup
from service.web.server import Certificate, CertificateError, serve

REPORT_WRITER = "service.commands.daemon.alarm_replay"
"""By its name: it loads what only its own process needs."""

log = structlog.get_logger(__name__)


class StartEvents(NamedTuple):
    """What is called while the daemon starts."""

    ready: Callable[[str], None] = lambda _url: None
    """With the address of the page, once it is served and the buses are read"""
    complete: Callable[[], None] = lambda: None
    """Once everything is compiled and all detectors run, from another thread"""
    reloadable: Callable[[Reloading], None] = lambda _reloading: None
    """With the object that applies another configuration"""


_NO_EVENTS = StartEvents()


def run_daemon(
    config: Config,
    file: Path,
    record: Path | None = None,
    stop: threading.Event | None = None,
    insecure: bool = False,
    events: StartEvents = _NO_EVENTS,
) -> None:
    """Run until ``stop`` is set, which SIGTERM and SIGINT do, too.

    Args:
        config: the whole configuration.
        file: its path; a report of ``commission`` lies beside it.
        record: frames are also written here, as received.
        stop: ends the daemon from another thread.
        insecure: allow access from other machines without tokens or TLS.
        events: what is called while it starts.

    Raises:
        UnprotectedError: other machines could reach the daemon unprotected, and ``insecure`` is not set.
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
    # The parts of a large answer each wait this long for the interpreter while the worker computes.
    sys.setswitchinterval(0.001)
    with ExitStack() as stack:
        parts = DaemonParts(config, record, stop, stack)
        parts.compiled.multimodel.add_done_callback(
            lambda done: None if done.exception() else _settled(events.complete)
        )
        watch = CertificateWatch(config)
        parts.worker.publisher.certificates = watch
        web = partial(_web, access, certificate, watch)
        reloading = parts.reloading((web, partial(_numbered, parts.extracts), parts.links.replaced))
        systemd = _service_manager(parts)
        stack.callback(systemd.close)
        state = _app_state(parts, access, stop, reloading, file)
        if state.replays is not None:
            stack.callback(state.replays.stop)
        parts.worker.publisher.prepare = state.prepare

        def begin(port: int) -> None:
            parts.start()
            events.reloadable(reloading)
            url = f"{'https' if certificate else 'http'}://{_shown(config.web.host)}:{port}/"
            log.info("running", axes=len(config.axes), buses=len(config.bus), page=url)
            systemd.ready()
            events.ready(url)

        serve(create_app(state), config.web.host, config.web.port, begin, stop, certificate)
        log.info("stopping")
        systemd.stopping()
    if (fault := parts.worker.error) is not None:
        raise DaemonFailedError("a fault in the worker has stopped the daemon; the log says what") from fault
    saved_us = parts.worker.snapshot.checkpoint_us
    log.info("stopped", checkpoint=None if saved_us is None else iso(saved_us))


def _service_manager(parts: DaemonParts) -> ServiceManager:
    return ServiceManager(
        os.environ,
        lambda: {"worker": parts.worker.turns} | parts.buses.turns(),
        lambda: status_line(parts.worker.snapshot),
    )


def _app_state(parts: DaemonParts, access: Access, stop: threading.Event, reloading: Reloading, file: Path) -> AppState:
    """Data for the web server: the parts, recorded frames, and the configuration file."""
    worker, baselines, extracts, journal = parts.worker, parts.baselines, parts.extracts, parts.state.journal
    replays = None
    if extracts is not None:
        replays = ReplayReports(extracts.folder, lambda: reloading.config, str(file), journal.epochs, REPORT_WRITER)
    look = SignalLook(lambda: reloading.config, extracts, now_us)
    return AppState(
        lambda: worker.snapshot,
        journal,
        RobotSetup(lambda: reloading.config, file, look, parts.problems),
        ReportPages(file.parent, [axis.id for axis in parts.config.axes]),
        access,
        extracts=extracts,
        history=parts.state.history,
        links=parts.links.snapshots,
        acknowledge=lambda number, note: baselines.between_blocks(lambda: worker.alarms.acknowledge(number, note)),
        baselines=baselines,
        stopping=stop.is_set,
        live=parts.pipeline.live,
        replays=replays,
    )


def _settled(complete: Callable[[], None]) -> None:
    """Exclude all loaded objects from garbage collection, as a full collection stops all threads.

    Later objects are freed without a collection, except cycles. Full collections then are rare; with a thousand axes
    each of them took a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 50)
    complete()


@contextmanager
def _web(access: Access, certificate: Certificate | None, watch: CertificateWatch, new: Config) -> Iterator[None]:
    """Apply changes of [web] that need no restart, and a renewed certificate, after everything else has succeeded."""
    try:
        renewed = certificate_of(new.web)
    except CertificateError as error:
        raise ReloadError(str(error)) from None
    yield
    access.change([new.web.host, *new.web.hosts], new.web.open_metrics)
    if certificate is not None and renewed is not None:
        certificate.renew(renewed)
    watch.reloaded(new)


@contextmanager
def _numbered(extracts: Extracts | None, new: Config) -> Iterator[None]:
    """Bus numbers of recorded frames, whose files hold no bus names."""
    if extracts is not None:
        extracts.folder.add_channels(blf_channels(new.bus) or {})
    yield


def _shown(host: str) -> str:
    """A host name under which a browser on this machine reaches the page."""
    if host in ("0.0.0.0", "::"):
        return "localhost"
    return f"[{host}]" if ":" in host else host
