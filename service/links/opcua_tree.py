"""The axes as OPC UA nodes with their values, in the structure and with the names of OPC 40010-1 (robotics).

``MotionDeviceSystem/MotionDevices/ROBOT/Axes/AXIS/ParameterSet/PARAMETER`` is the estimate of a parameter; its status
code says whether it is reliable.  Below it are nominal value, standard deviation, and the status in words.
"""

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from functools import partial
from typing import NamedTuple

from asyncua import ua
from asyncua.server.internal_server import InternalServer

from monitor_core.monitoring import Observation, ParameterStatus, Status
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.web.app_state import is_alive, is_silent

NAMESPACE = "urn:axiswatch"
SYSTEM = "MotionDeviceSystem"
_UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
_CODES = {"1": "C62", "N m": "NU", "kg m^2": "B32", "s": "SEC", "rad": "C81", "rad/s": "2A", "W": "WTT"}
"""Codes of UNECE recommendation 20; other units have only a text"""

_GOOD = ua.StatusCodes.Good
_NO_VALUE = ua.StatusCodes.BadWaitingForInitialData
_INVALID = ua.StatusCodes.BadDataUnavailable
_OLD = ua.StatusCodes.UncertainLastUsableValue
_NOT_JUDGED = ua.StatusCodes.UncertainSubNormal
_GONE = ua.StatusCodes.BadNodeIdUnknown

_DOUBLE, _STRING = ua.VariantType.Double, ua.VariantType.String
_BOOLEAN = ua.VariantType.Boolean
_FIELDS = {
    "Nominal": (_DOUBLE, "commissioned value"),
    "StandardDeviation": (_DOUBLE, "of the estimate"),
    "Status": (_STRING, "state of the parameter, as in the API"),
    "NotTestedReason": (_STRING, "why a change of it cannot be detected now; empty: it can"),
}
"""Variables below each parameter"""
_OF_AXIS = {
    "GatedBy": (_STRING, "operating condition that excludes the samples now; empty: none"),
    "Epoch": (_STRING, "state of the nominal values: learning, verifying or current"),
    "OpenAlarms": (_STRING, "causes of the open alarms, with commas; empty: none"),
}
_OF_BUS = {"Connected": (_BOOLEAN, "whether frames can be received"), "State": (_STRING, "up, or why not")}

VariableValue = float | str | bool | None
_Branch = tuple[object, ...]


class _Content(ua.DataValue):
    """An immutable value, which need not be copied: asyncua copies values for each subscription, which takes long."""

    def __deepcopy__(self, _memo: object) -> "_Content":
        return self


class NodeReading(NamedTuple):
    """The present value of a node."""

    node: str
    kind: ua.VariantType
    value: VariableValue
    code: int
    """Status code"""


def quality(axis: AxisSnapshot, p: ParameterStatus, now_us: int) -> int:
    """The status code of an estimate: good while the parameter is tested with present samples."""
    if axis.status.time_us is None:
        return _NO_VALUE
    if p.status is Status.INVALID or not math.isfinite(p.estimate):
        return _INVALID
    if is_silent(axis, now_us) or axis.gated_by or p.observation is Observation.UNSEEN:
        return _OLD
    if not p.tested or axis.epoch.state == "learning":
        return _NOT_JUDGED
    return _GOOD


def unit_of_measure(unit: str) -> ua.EUInformation:
    """A unit in the form of OPC UA."""
    code = _CODES.get(unit)
    return ua.EUInformation(
        NamespaceUri=NAMESPACE if code is None else _UNECE,
        UnitId=(-1 if code is None else int.from_bytes(code.encode("ascii"), "big")),
        DisplayName=ua.LocalizedText(unit),
        Description=ua.LocalizedText("ratio" if unit == "1" else unit),
    )


class Tree:
    """The nodes of axes and buses in a server; ``namespace``: index of ``NAMESPACE``."""

    def __init__(self, server: InternalServer, namespace: int) -> None:
        self._server, self._namespace = server, namespace
        self._written = dict[str, tuple[VariableValue, int]]()
        self._ids = dict[str, ua.NodeId]()
        self._branches = dict[_Branch, list[str]]()
        self._add(self._object(SYSTEM, None, SYSTEM))
        for folder in ("Controllers", "MotionDevices"):
            self._add(self._object(folder, SYSTEM, folder, folder=True))

    def node_id(self, name: str) -> ua.NodeId:
        """The id of a node, such as ``cell1.axis1/fm``; it is the same after every start of the server."""
        return ua.NodeId(name, self._namespace)

    def known(self, name: str) -> ua.NodeId:
        """The id of an existing node; the null id if there is none."""
        return self._ids.get(name, ua.NodeId())

    async def update(self, snapshot: Snapshot, now_us: int) -> int:
        """Add and remove nodes as axes change, and write changed values; returns the number of written values."""
        await self._follow(snapshot)
        count, now = 0, _time(now_us)
        code = _GOOD if is_alive(snapshot, now_us) else _OLD
        for axis in snapshot.axes:
            sampled = now if axis.status.time_us is None else _time(axis.status.time_us)
            count += await self._write(_axis_readings(axis, now_us, code), sampled, now)
            await asyncio.sleep(0)  # so that clients need not wait for all axes
        for bus in snapshot.buses:
            place = f"Controllers/{bus.name}"
            readings = (
                NodeReading(f"{place}/Connected", _BOOLEAN, bus.up, code),
                NodeReading(f"{place}/State", _STRING, bus.state, code),
            )
            count += await self._write(readings, _time(snapshot.taken_us), now)
        return count

    async def _write(self, readings: Iterable[NodeReading], source: datetime, now: datetime) -> int:
        count = 0
        for node, kind, value, code in readings:
            if self._written.get(node) == (value, code):
                continue
            variant = ua.Variant() if value is None else ua.Variant(value, kind)
            content = _Content(variant, ua.StatusCode(code), source, now)
            await self._server.write_attribute_value(self._ids[node], content)
            self._written[node] = value, code
            count += 1
        return count

    # --- Adding and removing nodes -----------------------------------------------------------------------------------

    async def _follow(self, snapshot: Snapshot) -> None:
        """Add nodes of new axes and buses; remove those of axes and buses that are gone or have other parameters."""
        wanted = _branches(snapshot)
        for branch in self._branches.keys() - wanted.keys():
            await self._remove(self._branches.pop(branch))
        for branch, items in wanted.items():
            if branch not in self._branches:
                self._branches[branch] = [self._add(item) for item in items(self)]

    def _add(self, item: ua.AddNodesItem) -> str:
        """Add a node; returns its name."""
        (result,) = self._server.node_mgt_service.add_nodes([item])
        result.StatusCode.check()
        return str(item.RequestedNewNodeId.Identifier)

    async def _remove(self, names: Iterable[str]) -> None:
        """Remove nodes and notify their subscribers, which asyncua's own function does not do."""
        space, gone = self._server.aspace, ua.DataValue(StatusCode=ua.StatusCode(_GONE))
        for name in [*names][::-1]:
            node = self._ids.pop(name)
            self._written.pop(name, None)
            await self._server.write_attribute_value(node, gone)
            for attribute in space[node].attributes.values():
                for handle in [*attribute.datachange_callbacks]:
                    space.delete_datachange_callback(handle)
            for reference in space[node].references:
                above = space.get(reference.NodeId) if not reference.IsForward else None
                if above is not None:
                    above.references[:] = [r for r in above.references if r.NodeId != node]
            del space[node]

    def bus(self, name: str) -> Iterator[ua.AddNodesItem]:
        """Nodes of a bus, as a controller."""
        place = f"Controllers/{name}"
        yield self._object(place, "Controllers", name)
        yield from self._set(place, _OF_BUS)

    def robot(self, name: str) -> Iterator[ua.AddNodesItem]:
        """Nodes of a robot, without those of its axes."""
        place = f"MotionDevices/{name}"
        yield self._object(place, "MotionDevices", name)
        yield self._object(f"{place}/Axes", place, "Axes", folder=True)

    def axis(self, axis: AxisSnapshot) -> Iterator[ua.AddNodesItem]:
        """Nodes of an axis."""
        yield self._object(axis.id, f"MotionDevices/{axis.robot}/Axes", axis.name)
        yield from self._set(axis.id, _OF_AXIS)
        for p in axis.status.parameters:
            yield from self._parameter(axis.id, p)

    def _set(self, place: str, fields: dict[str, tuple[ua.VariantType, str]]) -> Iterator[ua.AddNodesItem]:
        """The ParameterSet of an object with its variables."""
        name = f"{place}/ParameterSet"
        yield self._object(name, place, "ParameterSet")
        for key, (kind, meaning) in fields.items():
            yield self._variable(f"{place}/{key}", name, key, kind, meaning)

    def _parameter(self, axis: str, p: ParameterStatus) -> Iterator[ua.AddNodesItem]:
        place = f"{axis}/{p.name}"
        analog = ua.ObjectIds.AnalogUnitType
        yield self._variable(place, f"{axis}/ParameterSet", p.name, _DOUBLE, p.meaning, analog)
        unit = ua.Variant(unit_of_measure(p.unit), ua.VariantType.ExtensionObject)
        yield self._property(f"{place}/EngineeringUnits", place, "EngineeringUnits", unit)
        for key, (kind, meaning) in _FIELDS.items():
            yield self._variable(f"{place}/{key}", place, key, kind, meaning)

    def _object(self, name: str, parent: str | None, title: str, folder: bool = False) -> ua.AddNodesItem:
        attributes = ua.ObjectAttributes()
        attributes.DisplayName = ua.LocalizedText(title)
        attributes.SpecifiedAttributes = ua.NodeAttributesMask.DisplayName | ua.NodeAttributesMask.EventNotifier
        item = self._item(name, parent, title, ua.NodeClass.Object, attributes)
        kind = ua.ObjectIds.FolderType if folder else ua.ObjectIds.BaseObjectType
        item.TypeDefinition = ua.NodeId(kind)
        item.ReferenceTypeId = ua.NodeId(ua.ObjectIds.Organizes if parent is None else ua.ObjectIds.HasComponent)
        return item

    def _variable(
        self,
        name: str,
        parent: str,
        title: str,
        kind: ua.VariantType,
        meaning: str,
        type_definition: int = ua.ObjectIds.BaseDataVariableType,
    ) -> ua.AddNodesItem:
        attributes = _attributes(title, ua.NodeId(int(kind)), meaning)
        item = self._item(name, parent, title, ua.NodeClass.Variable, attributes)
        item.TypeDefinition, item.ReferenceTypeId = (
            ua.NodeId(type_definition),
            ua.NodeId(ua.ObjectIds.HasComponent),
        )
        return item

    def _property(self, name: str, parent: str, title: str, value: ua.Variant) -> ua.AddNodesItem:
        attributes = _attributes(title, ua.NodeId(ua.ObjectIds.EUInformation), "")
        attributes.Value = value
        item = self._item(name, parent, title, ua.NodeClass.Variable, attributes)
        item.BrowseName = ua.QualifiedName(title, 0)  # the name belongs to the standard
        item.TypeDefinition, item.ReferenceTypeId = (
            ua.NodeId(ua.ObjectIds.PropertyType),
            ua.NodeId(ua.ObjectIds.HasProperty),
        )
        return item

    def _item(
        self, name: str, parent: str | None, title: str, node_class: ua.NodeClass, attributes: object
    ) -> ua.AddNodesItem:
        item = ua.AddNodesItem()
        item.RequestedNewNodeId = self._ids[name] = self.node_id(name)
        item.ParentNodeId = ua.NodeId(ua.ObjectIds.ObjectsFolder) if parent is None else self._ids[parent]
        item.BrowseName = ua.QualifiedName(title, self._namespace)
        item.NodeClass, item.NodeAttributes = node_class, attributes
        return item


def _branches(snapshot: Snapshot) -> dict[_Branch, Callable[[Tree], Iterator[ua.AddNodesItem]]]:
    """Groups of nodes by all that they depend on, with the function that makes them; robots before their axes."""
    found = dict[_Branch, Callable[[Tree], Iterator[ua.AddNodesItem]]]()
    for bus in snapshot.buses:
        found["bus", bus.name] = partial(Tree.bus, name=bus.name)
    for axis in snapshot.axes:
        found["robot", axis.robot] = partial(Tree.robot, name=axis.robot)
        parameters = tuple((p.name, p.unit, p.meaning) for p in axis.status.parameters)
        found["axis", axis.id, parameters] = partial(Tree.axis, axis=axis)
    return found


def _attributes(title: str, data_type: ua.NodeId, meaning: str) -> ua.VariableAttributes:
    """Attributes of a read-only variable without a value."""
    mask = ua.NodeAttributesMask
    attributes = ua.VariableAttributes()
    attributes.SpecifiedAttributes = (
        mask.DisplayName
        | mask.Description
        | mask.Value
        | mask.DataType
        | mask.ValueRank
        | mask.AccessLevel
        | mask.UserAccessLevel
        | mask.Historizing
    )
    attributes.DisplayName, attributes.Description = ua.LocalizedText(title), ua.LocalizedText(meaning)
    attributes.DataType, attributes.ValueRank = data_type, ua.ValueRank.Scalar
    attributes.AccessLevel = attributes.UserAccessLevel = ua.AccessLevel.CurrentRead.mask
    attributes.Historizing = False
    return attributes


def _axis_readings(axis: AxisSnapshot, now_us: int, alive: int) -> Iterator[NodeReading]:
    """The values of the nodes of an axis.  ``alive``: status code of values that do not depend on samples."""
    waits = axis.status.time_us is None
    code = _OLD if is_silent(axis, now_us) and not waits else alive
    alarms = ", ".join(dict.fromkeys(e.parameter for e in axis.open_alarms if e.kind != "forecast"))
    for key, text in (("GatedBy", axis.gated_by), ("Epoch", axis.epoch.state), ("OpenAlarms", alarms)):
        yield NodeReading(f"{axis.id}/{key}", _STRING, text, alive)
    for p in axis.status.parameters:
        place, known = f"{axis.id}/{p.name}", quality(axis, p, now_us)
        yield _number(place, p.estimate, known)
        yield _number(f"{place}/StandardDeviation", p.standard_deviation, known)
        nominal = _NOT_JUDGED if axis.epoch.state == "learning" else _GOOD
        yield _number(f"{place}/Nominal", p.nominal, nominal)
        yield NodeReading(f"{place}/Status", _STRING, p.status, code)
        yield NodeReading(f"{place}/NotTestedReason", _STRING, p.not_tested or "", code)


def _number(node: str, value: float, code: int) -> NodeReading:
    """The reading of a number; one with a bad status code has no value."""
    if not math.isfinite(value):
        code = _INVALID if code in (_GOOD, _OLD, _NOT_JUDGED) else code
    return NodeReading(node, _DOUBLE, None if code in (_NO_VALUE, _INVALID) else value, code)


def _time(t_us: int) -> datetime:
    return datetime.fromtimestamp(t_us / 1e6, UTC)
