"""OPC UA link: a server for axes and alarms in a separate thread, with data from the snapshot and the journal."""

import asyncio
import gc
import logging
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from time import monotonic

from asyncua import Server, ua
from asyncua.common.connection import TransportLimits
from asyncua.crypto.security_policies import SecurityPolicyFactory, SecurityPolicyNone

from service.config.schema import OpcUaConfig
from service.links.delivery import FIRST_RETRY_S, LOOK_S, Delivery
from service.links.opcua_access import GuardedServer, Nobody, Users, identity
from service.links.opcua_alarms import AlarmConditions
from service.links.opcua_tree import NAMESPACE, Tree
from service.pipeline.snapshot import Snapshot
from service.store.database import StoreError
from service.store.tokens import TokenFile
from service.texts.instants import now_us
from service.web.app_state import VERSION
from service.web.server import CannotListenError, listen

MOST_MESSAGE_BYTES = 16 * 2**20
_CHUNK_BYTES = 65535
_ENCRYPTED = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]


class OpcUaLink:
    """The OPC UA server as a link; if its port is taken, it retries.

    Its users are the ``tokens`` of the API; ``conditions`` are the receiver of ``delivery``.

    Raises:
        LinkSecretError: the certificate or its key cannot be used.
    """

    def __init__(
        self,
        config: OpcUaConfig,
        tokens: TokenFile,
        conditions: AlarmConditions,
        delivery: Delivery,
        snapshot: Callable[[], Snapshot],
    ) -> None:
        self._config, self._conditions, self.delivery = config, conditions, delivery
        self._snapshot_of, self._users = snapshot, Users(tokens, config.anonymous)
        self._identity = identity(config)
        delivery.begin()
        # asyncua logs mistakes of clients with tracebacks; the daemon itself logs refused clients and writes.
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)

    async def run(self) -> None:
        """Serve until cancelled, in another thread, so that clients cannot delay the other links."""
        stop, ended, failures = threading.Event(), threading.Event(), list[Exception]()

        def work() -> None:
            try:
                asyncio.run(self._serve(stop))
            except Exception as error:
                failures.append(error)
            finally:
                gc.unfreeze()
                ended.set()

        threading.Thread(target=work, name="opcua", daemon=True).start()
        try:
            while not ended.is_set():
                await asyncio.sleep(LOOK_S)
        finally:
            stop.set()
            while not ended.is_set():
                await asyncio.sleep(LOOK_S / 10)
        for failure in failures:
            await asyncio.sleep(self.delivery.failed(f"a fault of the program: {failure}"))
            raise failure

    async def _make_server(self) -> Server:
        """Make a server that does not listen yet."""
        inner = GuardedServer(self._users, self._conditions.operate)
        inner.bind_condition_methods = 1  # severity of the server's own refresh events
        server = Server(inner)
        server.name, server.manufacturer_name, server.product_uri = "axiswatch", "axiswatch", NAMESPACE
        server.application_type = ua.ApplicationType.Server
        chunks = MOST_MESSAGE_BYTES // _CHUNK_BYTES + 1
        server.limits = TransportLimits(_CHUNK_BYTES, _CHUNK_BYTES, chunks, MOST_MESSAGE_BYTES)
        await server.init()
        await server.set_application_uri(self._identity.uri)
        await server.set_build_info(NAMESPACE, "axiswatch", "axiswatch", VERSION, VERSION, datetime.now(UTC))
        policies = [ua.SecurityPolicyType.NoSecurity]
        if self._identity.certificate:
            policies = _ENCRYPTED
            await server.load_certificate(self._identity.certificate, "pem")
            await server.load_private_key(self._identity.key, format="pem")
            plain = SecurityPolicyFactory(SecurityPolicyNone, ua.MessageSecurityMode.None_, permission_ruleset=Nobody())
            server._policies.append(plain)  # asyncua has no public way to refuse unencrypted connections
        server.set_security_policy(policies, self._users)
        named = [ua.UserNameIdentityToken]
        server.set_identity_tokens([*named, ua.AnonymousIdentityToken] if self._config.anonymous else named)
        host, port = self._config.host, self._config.port
        server.set_endpoint(f"opc.tcp://{f'[{host}]' if ':' in host else host}:{port}/")
        server.socket_address = host, port
        return server

    async def _wait_for_port(self, stop: threading.Event) -> None:
        """Wait until the port is free; meanwhile give up alarm transitions that become too old."""
        while not stop.is_set():
            try:
                listen(self._config.host, self._config.port).close()
            except CannotListenError as error:
                end = monotonic() + self.delivery.failed(str(error))
                while not stop.is_set() and monotonic() < end:
                    self.delivery.read_new()
                    await asyncio.sleep(LOOK_S)
            else:
                return

    async def _serve(self, stop: threading.Event) -> None:
        """Serve until ``stop`` is set."""
        with _without_collections():
            server = await self._make_server()
            tree = Tree(server.iserver, await server.register_namespace(NAMESPACE))
            await tree.update(self._snapshot_of(), now_us())
        await self._begin(server, tree, stop)
        await self._wait_for_port(stop)
        if stop.is_set():
            return
        await server.start()
        self.delivery.works(self._users.problem)
        next_s = -math.inf
        try:
            while not stop.is_set():
                left_s = await self.delivery.step()
                if left_s > 0 and self.delivery.snapshot.problem != self._users.problem:
                    self.delivery.works(self._users.problem)
                if monotonic() >= next_s:
                    next_s = monotonic() + self._config.interval_s
                    await tree.update(self._snapshot_of(), now_us())
                await asyncio.sleep(max(0.0, min(left_s, LOOK_S, next_s - monotonic())))
        finally:
            self._conditions.end()
            await server.stop()

    async def _begin(self, server: Server, tree: Tree, stop: threading.Event) -> None:
        """Load the present state of the alarms, before clients can connect."""
        while not stop.is_set():
            try:
                await self._conditions.begin(server.iserver, tree)
            except StoreError as error:
                self.delivery.failed(str(error))
                await asyncio.sleep(FIRST_RETRY_S)
            else:
                return


@contextmanager
def _without_collections() -> Iterator[None]:
    """Turn off the garbage collector while the server makes its nodes, then exclude these from collections.

    The nodes of the standard are a million permanent objects; scanning them again and again would hold Python's lock.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
