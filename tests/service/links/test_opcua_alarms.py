"""Alarms as conditions of OPC UA: events, acknowledged, commented and shelved by methods."""

from tests.service.links.opcua_plant import Plant, Seen, ua, until

# isort: split

import asyncio
from copy import copy
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from monitor_core.monitoring import AlarmEvent
from tests.service.links.journals import just_raised, record

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
