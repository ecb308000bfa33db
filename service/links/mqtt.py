"""MQTT 5 link: publishes the status of the daemon and the state of each axis (both retained), and alarm transitions.

``PREFIX/status``: "online", or "offline" by the last will.  ``PREFIX/ROBOT/AXIS/state``: JSON, if it has changed, at
most once in each interval.  ``PREFIX/ROBOT/AXIS/alarm``: JSON, QoS 1, from the journal.
"""

import asyncio
import math
from collections import deque
from collections.abc import Callable, Sequence
from time import monotonic

import aiomqtt

from service.config.schema import MqttConfig
from service.links.delivery import LOOK_S, Delivery, Message
from service.links.link_secrets import secret, tls
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.texts.instants import now_us
from service.web import models, views

KEEPALIVE_S = 20
"""The broker publishes the last will after 1.5 times this time without a packet"""
ANSWER_S = 10.0
"""Time in which the broker must answer [s]"""


def state_body(axis: AxisSnapshot, now_us: int) -> models.AxisState:
    """The published state of an axis, with the names of the API."""
    shown = views.axis(axis, now_us)
    parameters = [
        models.ParameterState(
            deviation=None if p.estimate is None or p.nominal is None else p.estimate - p.nominal,
            **p.model_dump(include=models.ParameterState.model_fields.keys() - {"deviation"}),
        )
        for p in shown.parameters
    ]
    own = shown.model_dump(include=models.AxisState.model_fields.keys() - {"parameters"})
    return models.AxisState(parameters=parameters, **own)


class Broker:
    """The connection to a broker, if there is one; the receiver of a Delivery."""

    most = 1

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix
        self.client: aiomqtt.Client | None = None

    async def send(self, messages: Sequence[Message]) -> None:
        """Publish messages, and wait for the broker's confirmation of each.

        Raises:
            MqttError: the connection is lost.
        """
        for m in messages:
            body = views.alarm_message(*m, now_us())
            await self.publish(f"{_place(m.alarm.axis)}/alarm", body.model_dump_json(), qos=1)

    async def publish(self, topic: str, text: str, qos: int = 0, retain: bool = False) -> None:
        """Publish a text below the prefix.

        Raises:
            MqttError: the connection is lost.
        """
        if self.client is None:
            raise aiomqtt.MqttError("there is no connection")
        await self.client.publish(f"{self._prefix}/{topic}", text, qos=qos, retain=retain)


class States:
    """Provides the changed states of axes one by one, so that an alarm need not wait until all are published.

    ``interval_s``: time between two states of an axis; ``clock``: monotonic clock [s].
    """

    def __init__(
        self, snapshot: Callable[[], Snapshot], interval_s: float, clock: Callable[[], float] = monotonic
    ) -> None:
        self._snapshot, self._interval_s, self._clock = snapshot, interval_s, clock
        self._last: dict[str, str] = {}
        self._due = deque[AxisSnapshot]()
        self._next = -math.inf

    def next(self) -> tuple[str, str] | None:
        """Id and JSON of an axis that has changed since its last publication; None: there is none now."""
        if not self._due and self._clock() >= self._next:
            self._next = self._clock() + self._interval_s
            self._due.extend(self._snapshot().axes)
        while self._due:
            axis = self._due.popleft()
            text = state_body(axis, now_us()).model_dump_json()
            if self._last.get(axis.id) != text:
                self._last[axis.id] = text
                return axis.id, text
        return None


class MqttLink:
    """The link to a broker, the receiver of ``delivery``; reconnects after failures.

    Raises:
        LinkSecretError: the password or the certificate of the authority cannot be used.
    """

    def __init__(
        self, config: MqttConfig, broker: Broker, delivery: Delivery, snapshot: Callable[[], Snapshot]
    ) -> None:
        self._config, self._broker, self.delivery, self._states_of = config, broker, delivery, snapshot
        self._password = secret(config.password_file, config.password_env)
        self._context = tls(config.ca_file) if config.tls else None
        delivery.begin()

    async def run(self) -> None:
        """Connect and publish until it is cancelled."""
        while True:
            try:
                async with self._client() as client:
                    self._broker.client = client
                    try:
                        await self._publish(client)
                    except asyncio.CancelledError:
                        await self._broker.publish("status", "offline", qos=1, retain=True)
                        raise
            except aiomqtt.MqttError as error:
                if (task := asyncio.current_task()) is not None and task.cancelling():
                    raise asyncio.CancelledError from None
                wait_s = self.delivery.failed(f"{self._config.host}:{self._config.port}: {error.__cause__ or error}")
            finally:
                self._broker.client = None
            await self._wait(wait_s)

    def _client(self) -> aiomqtt.Client:
        c = self._config
        return aiomqtt.Client(
            c.host,
            c.port,
            username=c.user,
            password=self._password,
            protocol=aiomqtt.ProtocolVersion.V5,
            will=aiomqtt.Will(f"{c.prefix}/status", "offline", qos=1, retain=True),
            timeout=ANSWER_S,
            keepalive=KEEPALIVE_S,
            tls_context=self._context,
        )

    async def _publish(self, client: aiomqtt.Client) -> None:
        """Publish until the connection is lost."""
        # No topic is subscribed: it ends with the connection.
        lost = asyncio.ensure_future(anext(client.messages))
        try:
            await self._broker.publish("status", "online", qos=1, retain=True)
            self.delivery.works()
            states = States(self._states_of, self._config.interval_s)
            while not lost.done():
                left_s = await self.delivery.step()
                state = states.next()
                if state is not None:
                    await self._broker.publish(f"{_place(state[0])}/state", state[1], retain=True)
                elif left_s > 0:
                    await asyncio.wait([lost], timeout=min(left_s, LOOK_S))
            lost.result()
        finally:
            lost.cancel()

    async def _wait(self, wait_s: float) -> None:
        """Wait; meanwhile give up transitions that become too old."""
        end = monotonic() + wait_s
        while (left_s := end - monotonic()) > 0:
            self.delivery.read_new()
            await asyncio.sleep(min(left_s, LOOK_S))


def _place(axis_id: str) -> str:
    """ROBOT/AXIS."""
    return axis_id.replace(".", "/", 1)
