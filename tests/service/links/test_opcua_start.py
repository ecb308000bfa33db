"""The OPC UA server begins and ends: its port, and the alarms that are active by then."""

from tests.service.links.opcua_plant import Plant, Seen, linked, ua, until

# isort: split

import asyncio
import socket
import threading
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from monitor_core.monitoring import AlarmEvent, AlarmRules
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from service.texts.instants import now_us
from tests.end_to_end.processes import wait_for
from tests.ports import own_port
from tests.service.links.journals import just_raised, record


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
            return {e.NodeId.Identifier: (getattr(e, "ActiveState/Id"), getattr(e, "AckedState/Id")) for e in events}

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
