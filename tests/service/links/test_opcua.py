"""The OPC UA server, asked by a real client: values, events, methods; who may do what; encryption; a new start."""

import asyncio
import re
import shlex
import socket
import subprocess
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager
from copy import copy
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import pytest

from tests.conftest import CI, ROOT

try:
    from asyncua import Client, ua
except ImportError:
    if CI:
        raise
    pytest.skip("asyncua is missing: pip install axiswatch[opcua]", allow_module_level=True)

from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.crypto.uacrypto import CertProperties

from monitor_core.monitoring import AlarmEvent, AlarmRules, NotTested, Observation, Status
from service.config.schema_links import LinksConfig
from service.links.link_secrets import LinkSecretError
from service.links.opcua_access import identity
from service.links.opcua_tree import quality, unit_of_measure
from service.links.running import Links
from service.pipeline.epoch_progress import AxisEpoch
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from service.store.tokens import TOKENS_FILE, Scope, TokenFile
from service.texts.instants import now_us
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.ports import own_port
from tests.service.links.journals import just_raised, record
from tests.service.web.conftest import NOON_US, monitored_axis, waiting_axis, whole_snapshot

T = TypeVar("T")
ACKNOWLEDGE = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
ADD_COMMENT = ua.NodeId(ua.ObjectIds.ConditionType_AddComment)
SHELVE, SHELVE_WHY, UNSHELVE = (
    ua.NodeId(number)
    for number in (
        ua.ObjectIds.ShelvedStateMachineType_TimedShelve,
        ua.ObjectIds.ShelvedStateMachineType_TimedShelve2,
        ua.ObjectIds.ShelvedStateMachineType_Unshelve,
    )
)


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
    journal = Journal(folder / "alarms.sqlite")
    stack.callback(journal.close)
    tokens = TokenFile(folder / TOKENS_FILE)
    config = LinksConfig.model_validate({"opcua": {"port": port, "interval_s": 0.2} | keys})
    snapshots = [fresh_snapshot()]
    links = Links(config, folder, journal, lambda: snapshots[0])
    stack.callback(links.stop)
    links.start()
    plant = Plant(folder, journal, port, tokens, snapshots, links)
    wait_for(lambda: plant.links.snapshots()[0].problem != "not connected yet")
    return plant


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    """One for all tests that leave it as it is: a server takes a second of the processor to begin."""
    folder = tmp_path_factory.mktemp("plant")
    tokens = TokenFile(folder / TOKENS_FILE)
    secrets = {"rita": tokens.new("rita", Scope.READ), "otto": tokens.new("otto", Scope.OPERATE)}
    with ExitStack() as stack:
        made = linked(stack, folder, own_port(), anonymous=True)
        made.secrets = secrets
        yield made


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


# --- Values ---------------------------------------------------------------------------------------------------------


def test_the_tree_is_browsed_by_its_names_and_read(plant: Plant) -> None:
    async def look() -> None:
        async with plant.client() as client:
            index = await client.get_namespace_index("urn:axiswatch")
            path = "MotionDeviceSystem/MotionDevices/demo/Axes/axis1/ParameterSet/fm"
            node = await client.nodes.objects.get_child([f"{index}:{name}" for name in path.split("/")])
            assert node.nodeid == ua.NodeId("demo.axis1/fm", index)
            assert (await node.read_description()).Text == "viscous friction of the motor"
            found = await node.read_data_value(raise_on_bad_status=False)
            assert (found.Value.Value, found.StatusCode.name) == (0.07832, "Good")
            at_us = plant.snapshot[0].axes[0].status.time_us or 0
            assert found.SourceTimestamp == datetime.fromtimestamp(at_us / 1e6, UTC)
            unit = await (await node.get_child("0:EngineeringUnits")).read_value()
            assert (unit.DisplayName.Text, unit.UnitId) == ("N m s/rad", -1)
            below = {
                (await child.read_browse_name()).Name: (
                    await child.read_data_value(raise_on_bad_status=False)
                ).Value.Value
                for child in await node.get_children(refs=ua.ObjectIds.HasComponent)
            }
            assert below == {
                "Nominal": 0.06,
                "StandardDeviation": 0.00256,
                "Status": "alarm",
                "NotTestedReason": "",
            }
            texts = {
                name: await client.get_node(ua.NodeId(name, index)).read_value()
                for name in ("demo.axis1/OpenAlarms", "demo.axis1/Epoch", "Controllers/can1/State")
            }
            assert texts == {
                "demo.axis1/OpenAlarms": "fm",
                "demo.axis1/Epoch": "current",
                "Controllers/can1/State": "down: Network is down",
            }
            silent = client.get_node(ua.NodeId("demo.axis2/fm", index))
            found = await silent.read_data_value(raise_on_bad_status=False)
            assert (found.Value.Value, found.StatusCode.name) == (None, "BadWaitingForInitialData")
            assert await client.get_node(ua.NodeId("demo.axis2/fm/Status", index)).read_value() == "waiting"

    asyncio.run(look())


def test_what_has_changed_is_sent_and_nothing_else(plant: Plant) -> None:
    def changed(**changes: Any) -> None:
        """The friction of the first axis has other values; all that is else is as new."""
        now = fresh_snapshot()
        status = now.axes[0].status
        *others, fm = status.parameters
        status = replace(status, parameters=(*others, replace(fm, **changes)))
        plant.snapshot[0] = replace(now, axes=(replace(now.axes[0], status=status), now.axes[1]))

    async def look() -> None:
        seen = Seen()
        async with plant.client() as client:
            index = await client.get_namespace_index("urn:axiswatch")
            names = ("demo.axis1/fm", "demo.axis1/kT", "demo.axis1/fm/Nominal")
            nodes = [client.get_node(ua.NodeId(name, index)) for name in names]
            subscription = await client.create_subscription(50, seen)
            await subscription.subscribe_data_change(nodes)
            await until(lambda: len(seen.values) == 3)
            written = [(await node.read_data_value()).ServerTimestamp for node in nodes]
            changed(estimate=0.08)
            await until(lambda: len(seen.values) == 4)
            changed(estimate=0.09)
            await until(lambda: len(seen.values) == 5)
            assert seen.values[3:] == [("demo.axis1/fm", 0.08), ("demo.axis1/fm", 0.09)]
            again = [(await node.read_data_value()).ServerTimestamp for node in nodes]
            assert [old == new for old, new in zip(written, again, strict=True)] == [
                False,
                True,
                True,
            ]

    try:
        asyncio.run(look())
    finally:
        plant.snapshot[0] = fresh_snapshot()


def axis_with(**status: Any) -> AxisSnapshot:
    """An axis whose friction has these values."""
    axis = monitored_axis()
    *others, fm = axis.status.parameters
    return replace(axis, status=replace(axis.status, parameters=(*others, replace(fm, **status))))


def test_nodes_come_and_go_with_the_axes(plant: Plant) -> None:
    """As after a reload of the configuration: nobody has to connect again."""

    async def look() -> None:
        seen = Seen()
        async with plant.client() as client:
            index = await client.get_namespace_index("urn:axiswatch")
            axes = client.get_node(ua.NodeId("MotionDevices/demo/Axes", index))
            subscription = await client.create_subscription(50, seen)
            await subscription.subscribe_data_change(client.get_node(ua.NodeId("demo.axis1/fm", index)))
            first, second = fresh_snapshot().axes
            fewer = replace(first.status, parameters=first.status.parameters[:1])
            third = replace(second, id="demo.axis3", name="axis3")
            plant.snapshot[0] = replace(fresh_snapshot(), axes=(replace(first, status=fewer), third))

            async def names() -> list[str]:
                return [d.BrowseName.Name for d in await axes.get_children_descriptions()]

            async with asyncio.timeout(PATIENCE_S):
                while await names() != ["axis1", "axis3"]:
                    await asyncio.sleep(0.05)
            await until(lambda: ("demo.axis1/fm", None) in seen.values)
            fm = client.get_node(ua.NodeId("demo.axis1/fm", index))
            assert await refused(fm.read_value()) == "BadNodeIdUnknown"
            kT = client.get_node(ua.NodeId("demo.axis1/kT", index))
            assert await kT.read_value() == 0.99317
            await subscription.delete()

    try:
        asyncio.run(look())
    finally:
        plant.snapshot[0] = fresh_snapshot()


@pytest.mark.parametrize(
    ("axis", "later_s", "name"),
    [
        (monitored_axis(), 0, "Good"),
        (waiting_axis(), 0, "BadWaitingForInitialData"),
        (axis_with(status=Status.INVALID), 0, "BadDataUnavailable"),
        (axis_with(estimate=float("nan")), 0, "BadDataUnavailable"),
        (monitored_axis(), 4, "Good"),
        (monitored_axis(), 6, "UncertainLastUsableValue"),
        (replace(monitored_axis(), gated_by="mode = 2"), 0, "UncertainLastUsableValue"),
        (axis_with(observation=Observation.UNSEEN), 0, "UncertainLastUsableValue"),
        (axis_with(not_tested=NotTested.SEEDING), 0, "UncertainSubNormal"),
        (replace(monitored_axis(), epoch=AxisEpoch(2, "learning", 1.0, 2.0)), 0, "UncertainSubNormal"),
    ],
)
def test_the_status_code_says_whether_an_estimate_can_be_relied_on(
    axis: AxisSnapshot, later_s: int, name: str
) -> None:
    code = quality(axis, axis.status.parameters[-1], NOON_US + later_s * 1_000_000)
    assert ua.StatusCode(code).name == name


def test_units_have_their_number_where_there_is_one() -> None:
    newton_metre, ratio, other = (unit_of_measure(unit) for unit in ("N m", "1", "N m s/rad"))
    assert (newton_metre.UnitId, ratio.UnitId) == (20053, 4404786)  # "NU" and "C62" as numbers
    assert (other.UnitId, other.NamespaceUri) == (-1, "urn:axiswatch")


# --- Alarms ---------------------------------------------------------------------------------------------------------


async def events_of(client: Any, seen: Seen) -> Any:
    """A subscription to all conditions."""
    subscription = await client.create_subscription(50, seen)
    await subscription.subscribe_alarms_and_conditions(evtypes=ua.ObjectIds.AlarmConditionType)
    return subscription


async def act(client: Any, event: Any, method: ua.NodeId, text: str, event_id: bytes | None = None) -> str:
    """The name of the status with which a method of the condition of an event answers."""
    name = ua.Variant(event_id or event.EventId, ua.VariantType.ByteString)
    return await called(client, event, method, name, ua.Variant(ua.LocalizedText(text)))


async def called(client: Any, event: Any, method: ua.NodeId, *arguments: ua.Variant) -> str:
    """The name of the status with which a method answers."""
    request = ua.CallMethodRequest()
    request.ObjectId, request.MethodId = event.NodeId, method
    request.InputArguments = list(arguments)
    (result,) = await client.uaclient.call([request])
    return str(result.StatusCode.name)


def test_an_alarm_is_seen_acknowledged_and_over(plant: Plant) -> None:
    async def follow() -> None:
        seen = Seen()
        async with plant.client("otto") as client, plant.client("rita") as reader:
            await events_of(client, seen)
            alarm = replace(just_raised(), parameter="fm")
            number = record(plant.journal, alarm, "demo.axis1")
            await until(lambda: seen.events)
            (event,) = seen.events
            assert event.NodeId.Identifier == f"alarm/{number}"
            assert (event.SourceName, event.ConditionName, event.Severity) == ("demo.axis1", "fm", 500)
            assert event.SourceNode.Identifier == "demo.axis1"
            assert event.Message.Text.startswith("something has changed, at first sight fm")
            states = [getattr(event, f"{name}/Id") for name in ("ActiveState", "AckedState", "EnabledState")]
            assert (states, event.Retain) == ([True, False, True], True)
            assert event.Time == datetime.fromtimestamp(alarm.raised_us / 1e6, UTC)
            assert await act(reader, event, ACKNOWLEDGE, "") == "BadUserAccessDenied"
            assert await act(client, event, ACKNOWLEDGE, "", b"another") == "BadEventIdUnknown"
            assert await act(client, event, ACKNOWLEDGE, "x" * 2001) == "BadInvalidArgument"
            nothing = replace_id(event, "alarm/" + "9" * 5000)
            assert await act(client, nothing, ACKNOWLEDGE, "") == "BadNodeIdInvalid"
            assert await act(client, event, ADD_COMMENT, "") == "BadInvalidArgument"
            assert await act(client, event, ACKNOWLEDGE, "heard it, too") == "Good"
            await until(lambda: len(seen.events) == 2)
            event = seen.events[1]
            states = [getattr(event, f"{name}/Id") for name in ("ActiveState", "AckedState")]
            assert (states, event.Retain, event.ClientUserId) == ([True, True], True, "otto")
            assert event.Comment.Text == "heard it, too"
            assert await act(client, event, ACKNOWLEDGE, "") == "BadConditionBranchAlreadyAcked"
            assert await act(client, event, ADD_COMMENT, "gearbox ordered") == "Good"
            await until(lambda: len(seen.events) == 3)
            assert shelf(seen.events[2]) == ("Unshelved", False, True)
            hour = ua.Variant(3.6e6, ua.VariantType.Double)
            wait = ua.Variant(ua.LocalizedText("gearbox comes"))
            forever = ua.Variant(8 * 86400e3, ua.VariantType.Double)
            assert await called(reader, event, SHELVE, hour) == "BadUserAccessDenied"
            assert await called(client, event, SHELVE) == "BadArgumentsMissing"
            assert await called(client, event, SHELVE, forever) == "BadShelvingTimeOutOfRange"
            assert await called(client, event, SHELVE, ua.Variant("1 h")) == "BadShelvingTimeOutOfRange"
            assert await called(client, event, UNSHELVE) == "BadConditionNotShelved"
            assert (
                await called(client, event, SHELVE_WHY, hour, ua.Variant(ua.LocalizedText("\x1b")))
                == "BadInvalidArgument"
            )
            assert await called(client, event, SHELVE_WHY, hour, wait) == "Good"
            await until(lambda: len(seen.events) == 4)
            assert shelf(seen.events[3]) == ("Timed Shelved", True, True)
            assert await called(client, event, SHELVE, hour) == "BadConditionAlreadyShelved"
            assert await called(client, event, UNSHELVE) == "Good"
            record(plant.journal, replace(alarm, ended_us=alarm.updated_us), "demo.axis1")
            await until(lambda: len(seen.events) == 6)
            event = seen.events[5]
            assert (getattr(event, "ActiveState/Id"), event.Retain) == (False, False)
            assert await act(client, event, ADD_COMMENT, "late") == "BadNodeIdUnknown"
        steps = [(t.event, t.who, t.comment) for t in plant.journal.transitions(number)]
        assert steps[1:3] == [
            (AlarmEvent.ACKNOWLEDGE, "otto", "heard it, too"),
            (AlarmEvent.COMMENT, "otto", "gearbox ordered"),
        ]
        assert steps[3:5] == [(AlarmEvent.SHELVE, "otto", "gearbox comes"), (AlarmEvent.UNSHELVE, "otto", "")]

    asyncio.run(follow())


def replace_id(event: Any, name: str) -> Any:
    """An event of another condition."""
    other = copy(event)
    other.NodeId = ua.NodeId(name, event.NodeId.NamespaceIndex)
    return other


def shelf(event: Any) -> tuple[str, bool, bool]:
    """The state of the shelf of an alarm, whether it is hidden, and acknowledged."""
    name = getattr(event, "ShelvingState/CurrentState").Text
    return name, event.SuppressedOrShelved, getattr(event, "AckedState/Id")


async def retained(client: Any, seen: Seen) -> list[Any]:
    """The conditions that a refresh brings, up to its end."""
    ends = ua.ObjectIds.RefreshEndEventType
    subscription = await client.create_subscription(50, seen)
    await subscription.subscribe_alarms_and_conditions(evtypes=[ua.ObjectIds.AlarmConditionType, ends])
    condition_type = client.get_node(ua.ObjectIds.ConditionType)
    refresh = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh)
    number = ua.Variant(subscription.subscription_id, ua.VariantType.UInt32)
    await condition_type.call_method(refresh, number)
    await until(lambda: [e for e in seen.events if e.EventType == ua.NodeId(ends)])
    return [e for e in seen.events if e.EventType != ua.NodeId(ends)]


# --- Who may do what ------------------------------------------------------------------------------------------------


def test_who_is_let_in(plant: Plant) -> None:
    async def connect(user: str, secret: str) -> str:
        client = Client(plant.url, timeout=PATIENCE_S)
        client.set_user(user)
        client.set_password(secret)
        return await refused(client.connect())

    async def knock() -> None:
        assert await connect("rita", "axw_wrong") == "BadUserAccessDenied"
        assert await connect("otto", plant.secrets["rita"]) == "BadUserAccessDenied"
        brief = plant.tokens.new("brief", Scope.READ)
        async with plant.client("brief", brief) as client:
            time = client.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
            assert await time.read_value()
            plant.tokens.revoke("brief")
            assert await refused(time.read_value()) == "BadUserAccessDenied"

    asyncio.run(knock())


def test_nobody_writes_a_value_or_a_node(plant: Plant) -> None:
    async def attack() -> None:
        for user in (None, "otto"):
            async with plant.client(user) as client:
                index = await client.get_namespace_index("urn:axiswatch")
                node = client.get_node(ua.NodeId("demo.axis1/fm", index))
                assert await refused(node.write_value(1.0)) == "BadUserAccessDenied"
                assert await refused(node.delete()) == "BadUserAccessDenied"
                assert await refused(node.add_object(index, "mine")) == "BadUserAccessDenied"

    asyncio.run(attack())


def test_a_session_and_its_subscriptions_belong_to_their_connection(plant: Plant) -> None:
    async def attack() -> None:
        async with plant.client("otto") as victim, plant.client() as thief:
            subscription = await victim.create_subscription(100, Seen())
            number = subscription.subscription_id
            assert await refused(thief.uaclient.delete_subscriptions([number])) == "BadSubscriptionIdInvalid"
            stolen = ua.TransferSubscriptionsParameters(SubscriptionIds=[number])
            assert await refused(thief.uaclient.transfer_subscriptions(stolen)) == "BadUserAccessDenied"
            stranger = Client(plant.url, timeout=PATIENCE_S)
            await stranger.connect_sessionless()
            try:
                stranger.uaclient.protocol.authentication_token = (
                    victim.uaclient.protocol.authentication_token
                )
                activation = ua.ActivateSessionParameters(UserIdentityToken=ua.AnonymousIdentityToken())
                assert await refused(stranger.uaclient.activate_session(activation)) == "BadSessionIdInvalid"
                node = stranger.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
                assert await refused(node.read_value()) == "BadUserAccessDenied"
            finally:
                await stranger.disconnect_sessionless()

    asyncio.run(attack())


# --- Encryption -----------------------------------------------------------------------------------------------------

TEXT = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
OPENSSL = re.findall(r"^(openssl req .*?[^\\])$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory, need: Callable[[str], str]) -> Path:
    """A folder with what the command of docs/operation.md makes."""
    folder = tmp_path_factory.mktemp("certificates")
    (command,) = OPENSSL
    words = [need("openssl"), *shlex.split(command.replace("\\\n", " "))[1:]]
    subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=PATIENCE_S)
    return folder


def test_with_a_certificate_everything_is_encrypted(certificates: Path, tmp_path: Path) -> None:
    files = {"certificate": str(certificates / "opcua.crt"), "key": str(certificates / "opcua.key")}
    with ExitStack() as stack:
        plant = linked(stack, tmp_path, own_port(), **files)
        assert plant.links.snapshots()[0].problem.startswith("nobody is let in: there is no token")
        plant.secrets["otto"] = plant.tokens.new("otto", Scope.OPERATE)
        wait_for(lambda: not plant.links.snapshots()[0].problem)
        asyncio.run(encrypted(plant, files))


async def encrypted(plant: Plant, files: dict[str, str]) -> None:
    plain = Client(plant.url, timeout=PATIENCE_S)
    endpoints = await plain.connect_and_get_server_endpoints()
    assert {e.SecurityMode for e in endpoints} == {ua.MessageSecurityMode.SignAndEncrypt}
    assert {e.Server.ApplicationUri for e in endpoints} == {"urn:axiswatch.plant.example"}
    tokens = {t.TokenType for e in endpoints for t in e.UserIdentityTokens}
    assert tokens == {ua.UserTokenType.UserName}
    # A client that does not care about the end points gets a session that is good for nothing.
    await plain.connect_sessionless()
    try:
        with pytest.raises(ua.UaError, match="No matching endpoints"):
            await plain.create_session()
        login = ua.UserNameIdentityToken(
            PolicyId="username", UserName="otto", Password=plant.secrets["otto"].encode()
        )
        await plain.uaclient.activate_session(ua.ActivateSessionParameters(UserIdentityToken=login))
        node = plain.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
        assert await refused(node.read_value()) == "BadUserAccessDenied"
    finally:
        await plain.disconnect_sessionless()
    client = Client(plant.url, timeout=PATIENCE_S)
    client.application_uri = "urn:axiswatch.plant.example"
    await client.set_security(SecurityPolicyBasic256Sha256, *(_pem(files[n]) for n in ("certificate", "key")))
    client.set_user("otto")
    client.set_password(plant.secrets["otto"])
    async with client:
        index = await client.get_namespace_index("urn:axiswatch")
        assert await client.get_node(ua.NodeId("demo.axis1/fm", index)).read_value() == 0.07832


def _pem(path: str) -> CertProperties:
    return CertProperties(Path(path), "pem")


def test_a_certificate_that_cannot_be_used_is_named(certificates: Path) -> None:
    tls = ROOT / "tests" / "tls"

    def problem(certificate: Path, key: Path) -> str:
        config = LinksConfig.model_validate({"opcua": {"certificate": str(certificate), "key": str(key)}})
        assert config.opcua is not None
        with pytest.raises(LinkSecretError) as caught:
            identity(config.opcua)
        return str(caught.value)

    right = certificates / "opcua.crt"
    assert "OPC UA needs an RSA key" in problem(tls / "localhost.crt", tls / "localhost.key")
    assert "the key is that of another certificate" in problem(
        tls / "localhost.crt", certificates / "opcua.key"
    )
    assert "no PEM certificate" in problem(right, tls / "encrypted.key")
    assert (
        problem(right, certificates / "none.key") == f"{certificates / 'none.key'}: No such file or directory"
    )


# --- Its beginning and end ------------------------------------------------------------------------------------------


def test_a_port_that_is_taken_is_reported_and_what_is_active_is_there_after_a_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.links.delivery.FIRST_RETRY_S", 0.1)
    before, rules = Journal(tmp_path / "alarms.sqlite"), AlarmRules("low")
    alarm, gone = just_raised(), replace(just_raised(), parameter="fm")
    acknowledged, returned = record(before, alarm, "demo.axis1"), record(before, gone, "demo.axis1")
    before.act(acknowledged, AlarmEvent.ACKNOWLEDGE, Note(now_us(), "anna"))
    record(before, replace(gone, ended_us=gone.updated_us), "demo.axis1")
    record(before, alarm, "demo.axis7", rules)  # of a priority that is left out
    before.close()

    async def active(plant: Plant) -> dict[str, tuple[bool, bool]]:
        async with plant.client() as client:
            events = await retained(client, Seen())
            return {
                e.NodeId.Identifier: (getattr(e, "ActiveState/Id"), getattr(e, "AckedState/Id"))
                for e in events
            }

    port, threads = own_port(), [thread.name for thread in threading.enumerate()].count("opcua")
    with ExitStack() as stack, socket.create_server(("127.0.0.1", port)) as other:
        plant = linked(stack, tmp_path, port, anonymous=True, priorities=["medium", "high"])
        link = plant.links.snapshots()[0]
        assert (link.connected, link.problem.split(":")[0]) == (
            False,
            f"cannot listen on 127.0.0.1 port {port}",
        )
        new = record(plant.journal, just_raised(), "demo.axis2")
        wait_for(lambda: plant.links.snapshots()[0].pending == 1)
        other.close()
        wait_for(lambda: plant.links.snapshots()[0].connected)
        wait_for(lambda: plant.links.snapshots()[0].delivered == 1)
        assert asyncio.run(active(plant)) == {
            f"alarm/{acknowledged}": (True, True),
            f"alarm/{returned}": (False, False),
            f"alarm/{new}": (True, False),
        }
    assert [thread.name for thread in threading.enumerate()].count("opcua") == threads
    socket.create_server(("127.0.0.1", port)).close()
