"""A running OPC UA server of a plant, and a client's ways to look at it, for the tests of that link.

Its import skips a test file where asyncua is missing, so each takes its names of asyncua from here, first of all.
"""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import pytest

from tests.conftest import CI

try:
    from asyncua import Client, ua
except ImportError:
    if CI:
        raise
    pytest.skip("asyncua is missing: pip install axiswatch[opcua]", allow_module_level=True)

from service.config.schema import LinksConfig
from service.links.running import Links
from service.pipeline.snapshot import Snapshot
from service.store.journal import Journal
from service.store.tokens import TOKENS_FILE, TokenFile
from service.texts.instants import now_us
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.links import journals
from tests.service.web.conftest import whole_snapshot

__all__ = ["Client", "Plant", "Seen", "fresh_snapshot", "linked", "refused", "ua", "until"]

T = TypeVar("T")


def fresh_snapshot() -> Snapshot:
    """The first axis has samples, the second one has never had any; by a clock that is ahead, so none becomes old."""
    at_us = now_us() + 3_600_000_000
    snapshot = whole_snapshot()
    first, second = snapshot.axes
    first = replace(first, status=replace(first.status, time_us=at_us))
    return replace(snapshot, taken_us=at_us, axes=(first, second))


@dataclass
class Plant:
    """A running link, its journal, the snapshot that it serves, and the secrets of its tokens."""

    folder: Path
    journal: Journal
    port: int
    tokens: TokenFile
    snapshot: list[Snapshot]
    links: Links
    secrets: dict[str, str] = field(default_factory=dict)

    @property
    def url(self) -> str:
        return f"opc.tcp://127.0.0.1:{self.port}/"

    @asynccontextmanager
    async def client(self, user: str | None = None, secret: str | None = None) -> Any:
        client = Client(self.url, timeout=PATIENCE_S)
        if user is not None:
            client.set_user(user)
            client.set_password(secret or self.secrets[user])
        async with client:
            yield client


def linked(stack: ExitStack, folder: Path, port: int, **keys: Any) -> Plant:
    """A link that is up, unless its port is taken."""
    tokens = TokenFile(folder / TOKENS_FILE)
    config = LinksConfig.model_validate({"opcua": {"port": port, "interval_s": 0.2} | keys})
    snapshots = [fresh_snapshot()]
    links, journal = stack.enter_context(journals.linked(config, folder, lambda: snapshots[0]))
    plant = Plant(folder, journal, port, tokens, snapshots, links)
    wait_for(lambda: plant.links.snapshots()[0].problem != "not connected yet")
    return plant


class Seen:
    """What a subscription gets."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.values: list[tuple[str, Any]] = []

    def event_notification(self, event: Any) -> None:
        self.events.append(event)

    def datachange_notification(self, node: Any, value: Any, _data: object) -> None:
        self.values.append((node.nodeid.Identifier, value))


async def until(look: Callable[[], T]) -> T:
    """What it finds, as soon as that is something."""
    async with asyncio.timeout(PATIENCE_S):
        while not (found := look()):
            await asyncio.sleep(0.02)
    return found


async def refused(request: Awaitable[object]) -> str:
    """The name of the status with which it is refused."""
    with pytest.raises(ua.UaStatusCodeError) as caught:
        await request
    return str(ua.StatusCode(caught.value.code).name)
