"""The daemon: readers, worker, store and web are connected, started and stopped."""

import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import structlog

from service.can.bus import blf_channels
from service.commands.commissioning.signal_look import SignalLook
from service.commands.daemon_parts import DaemonParts
from service.commands.exit_codes import DaemonFailedError
from service.commands.protection import access_of, certificate_of
from service.commands.service_manager import ServiceManager, status_line
from service.config import Config
from service.pipeline.recording import Extracts
from service.pipeline.reloading import Reloaded, ReloadError, Reloading
from service.pipeline.replay_reports import ReplayReports
from service.texts.instants import now_us
from service.web.access import Access
from service.web.app import create_app
from service.web.app_state import AppState
from service.web.report_pages import ReportPages
from service.web.robot_setup import RobotSetup
from service.web.server import Certificate, CertificateError, serve

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
    # Each of the many parts of a large answer waits so long for the interpreter while the worker computes.
    sys.setswitchinterval(0.001)
    with ExitStack() as stack:
        parts = DaemonParts(config, record, stop, stack)
        parts.compiled.multimodel.add_done_callback(
            lambda done: None if done.exception() else _settled(complete)
        )
        worker = parts.worker
        further = (
            partial(_web, access, certificate),
            partial(_numbered, parts.extracts),
            parts.links.exchanged,
        )
        reloading = parts.reloading(further)
        systemd = ServiceManager(
            os.environ,
            lambda: {"worker": worker.turns} | parts.buses.turns(),
            lambda: status_line(worker.snapshot),
        )
        stack.callback(systemd.close)

        def begin(port: int) -> None:
            parts.start()
            reloadable(reloading.reload)
            url = f"{'https' if certificate else 'http'}://{_shown(config.web.host)}:{port}/"
            log.info("running", axes=len(config.axes), buses=len(config.bus), page=url)
            systemd.ready()
            ready(url)

        state = _with_pages(parts.app_state(access, stop), parts, reloading, file, stack)
        worker.prepare = state.prepare
        serve(create_app(state), config.web.host, config.web.port, begin, stop, certificate)
        log.info("stopping")
        systemd.stopping()
    if worker.error is not None:
        raise DaemonFailedError(
            "a fault in the worker has stopped the daemon; the log says what"
        ) from worker.error
    log.info("stopped", checkpoint_us=worker.snapshot.checkpoint_us)


def _with_pages(
    state: AppState, parts: DaemonParts, reloading: Reloading, file: Path | None, stack: ExitStack
) -> AppState:
    """With the pages that need recorded frames, or the file of the configuration."""
    if parts.extracts is not None:
        named = "" if file is None else str(file)
        replays = ReplayReports(
            parts.extracts.folder, lambda: reloading.config, named, parts.state.journal.epochs
        )
        stack.callback(replays.stop)
        state = replace(state, replays=replays)
    if file is None:
        return state
    look = SignalLook(lambda: reloading.config, parts.extracts, now_us)
    return replace(
        state,
        reports=ReportPages(file.parent, [axis.id for axis in parts.config.axes]),
        setup=RobotSetup(lambda: reloading.config, file, look, parts.problems),
    )


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


def _shown(host: str) -> str:
    """A host that a browser on this machine can use."""
    if host in ("0.0.0.0", "::", ""):
        return "localhost"
    return f"[{host}]" if ":" in host else host
