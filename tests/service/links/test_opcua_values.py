"""The values that the OPC UA server shows: its tree, their status codes and units, what a subscription gets."""

from tests.service.links.opcua_plant import Plant, Seen, fresh_snapshot, refused, ua, until

# isort: split

import asyncio
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from monitor_core.monitoring import NotTested, Observation, Status
from service.links.opcua_tree import quality, unit_of_measure
from service.pipeline.axes.epoch_progress import AxisEpoch
from service.pipeline.snapshot import AxisSnapshot
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import NOON_US, monitored_axis, waiting_axis


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
            assert [old == new for old, new in zip(written, again, strict=True)] == [False, True, True]

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
def test_the_status_code_says_whether_an_estimate_can_be_relied_on(axis: AxisSnapshot, later_s: int, name: str) -> None:
    code = quality(axis, axis.status.parameters[-1], NOON_US + later_s * 1_000_000)
    assert ua.StatusCode(code).name == name


def test_units_have_their_number_where_there_is_one() -> None:
    newton_metre, ratio, other = (unit_of_measure(unit) for unit in ("N m", "1", "N m s/rad"))
    assert (newton_metre.UnitId, ratio.UnitId) == (20053, 4404786)  # "NU" and "C62" as numbers
    assert (other.UnitId, other.NamespaceUri) == (-1, "urn:axiswatch")
