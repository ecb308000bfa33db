"""Runs the configured links in one separate thread, with an independent task for each."""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

import structlog

from service.config.schema import AlarmLimits, LinksConfig
from service.links.delivery import FIRST_RETRY_S, LOOK_S, Delivery, MessageReceiver, MessageSource
from service.pipeline.snapshot import LinkSnapshot, Snapshot
from service.store.journal import Journal
from service.store.outbox import OUTBOX_FILE, Outbox

STOP_S = 3.0
"""Longest wait for the links to end [s]; undelivered transitions are delivered after the next start"""

log = structlog.get_logger(__name__)


class RunningLink(Protocol):
    """A link as the thread runs it."""

    delivery: Delivery
    """What it delivers, and its present state"""

    async def run(self) -> None:
        """Run until cancelled."""


class AlarmLink:
    """A link that only delivers alarms."""

    def __init__(self, delivery: Delivery) -> None:
        self.delivery = delivery

    async def run(self) -> None:
        """Deliver until it is cancelled."""
        while True:
            await asyncio.sleep(min(await self.delivery.step(), LOOK_S))


class Links:
    """All configured links; their libraries are imported only if they are configured.

    ``recording_of`` returns the name of the recording of a time; None: there is none (yet).

    Raises:
        LinkSecretError: a secret or a certificate cannot be used.
        StoreError: the outbox cannot be used.
    """

    def __init__(
        self,
        config: LinksConfig,
        state_dir: Path,
        journal: Journal,
        snapshot: Callable[[], Snapshot],
        recording_of: Callable[[int], str | None] = lambda _t_us: None,
    ) -> None:
        self._outbox = Outbox(state_dir / OUTBOX_FILE, journal)
        self._source = MessageSource(journal, self._outbox, recording_of)
        try:
            self._done = self._outbox.begin(config.names)
            self.links: tuple[RunningLink, ...] = tuple(self._make_links(config, state_dir, snapshot))
        except BaseException:
            self._outbox.close()
            raise
        self._stop = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop
        self._started = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._all()), name="links", daemon=True)
        for message in self._outbox.messages:
            log.warning("start", message=message)

    def snapshots(self) -> Sequence[LinkSnapshot]:
        """The present state of each link."""
        return [link.delivery.snapshot for link in self.links]

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread, and close the outbox."""
        if self._thread.ident is not None:
            self._started.wait()
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(STOP_S)
        self._outbox.close()

    async def _all(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._started.set()
        tasks = [asyncio.create_task(_run_on(link)) for link in self.links]
        await self._stop.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _make_links(
        self, config: LinksConfig, state_dir: Path, snapshot: Callable[[], Snapshot]
    ) -> Iterator[RunningLink]:
        """Make the links; the library of each is imported only if it is configured."""
        if config.webhook:
            from service.links.webhook import webhook

            for hook in config.webhook:
                yield AlarmLink(self._delivery(hook.name, "webhook", hook, webhook(hook)))
        if config.mqtt is not None:
            from service.links.mqtt import Broker, MqttLink

            broker = Broker(config.mqtt.prefix)
            delivery = self._delivery("mqtt", "mqtt", config.mqtt, broker)
            yield MqttLink(config.mqtt, broker, delivery, snapshot)
        if config.smtp is not None:
            from service.links.mail import Mail, MailText

            mail = Mail(config.smtp, MailText(snapshot))
            yield AlarmLink(self._delivery("smtp", "smtp", config.smtp, mail))

        if config.opcua is not None:
            from service.links.opcua import OpcUaLink
            from service.links.opcua_alarms import AlarmConditions
            from service.store.tokens import TOKENS_FILE, TokenFile

            conditions = AlarmConditions(self._source.journal, config.opcua.priorities)
            delivery = self._delivery("opcua", "opcua", config.opcua, conditions)
            tokens = TokenFile(state_dir / TOKENS_FILE)
            yield OpcUaLink(config.opcua, tokens, conditions, delivery, snapshot)

    def _delivery(self, name: str, kind: str, limits: AlarmLimits, receiver: MessageReceiver) -> Delivery:
        link = LinkSnapshot(name, kind, connected=True)
        return Delivery(link, limits, receiver, self._source, self._done[name])


async def _run_on(link: RunningLink) -> None:
    """Run a link; after an unexpected exception it is run again, and other links are not affected."""
    while True:
        try:
            await link.run()
        except Exception:
            log.exception("a fault in a link; it is started again", link=link.delivery.snapshot.name)
            await asyncio.sleep(FIRST_RETRY_S)
