"""Alarms as OPC UA conditions: an event for each transition of the journal; methods to acknowledge, comment, shelve.

A condition is an alarm of the journal.  It is no node; clients refer to it by the ConditionId of its events, as OPC
10000-9 allows.  Their actions are recorded in the journal, and return to all clients as transitions.
"""

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import structlog
from asyncua import ua
from asyncua.common.event_objects import AlarmCondition
from asyncua.server.internal_server import InternalServer

from monitor_core.monitoring import (
    HIDDEN_STATES,
    MAX_SHELF_S,
    AlarmEvent,
    AlarmLife,
    AlarmState,
    AlarmTransitionError,
    Priority,
)
from service.links.delivery import PAGE, Message, UnavailableError
from service.links.opcua_tree import Tree
from service.store.alarm_filter import AlarmFilter
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import SERVICE, Note, control_character
from service.store.database import StoreError
from service.store.journal import Journal
from service.texts.alarm_words import episode_words
from service.texts.instants import now_us

SEVERITIES: dict[Priority, int] = {"low": 200, "medium": 500, "high": 800}
"""Severities from 1 to 1000; in OPC 10000-9, low is up to 333, high from 667"""
MOST_COMMENT = 2000
"""Most characters of a comment, as in the API"""
MOST_RETURNED = 1000
"""Most returned, unacknowledged alarms that are loaded at a start"""

_METHODS = {
    ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge): (AlarmEvent.ACKNOWLEDGE, 2),
    ua.NodeId(ua.ObjectIds.ConditionType_AddComment): (AlarmEvent.COMMENT, 2),
    ua.NodeId(ua.ObjectIds.ShelvedStateMachineType_TimedShelve): (AlarmEvent.SHELVE, 1),
    ua.NodeId(ua.ObjectIds.ShelvedStateMachineType_TimedShelve2): (AlarmEvent.SHELVE, 2),
    ua.NodeId(ua.ObjectIds.ShelvedStateMachineType_Unshelve): (AlarmEvent.UNSHELVE, 0),
    ua.NodeId(ua.ObjectIds.ShelvedStateMachineType_Unshelve2): (AlarmEvent.UNSHELVE, 1),
}
"""Event and number of arguments of each method: the id of an event and a comment; of shelving its time [ms], and a
comment in the methods named ...2"""
_NOT_POSSIBLE = {
    AlarmEvent.ACKNOWLEDGE: ua.StatusCodes.BadConditionBranchAlreadyAcked,
    AlarmEvent.SHELVE: ua.StatusCodes.BadConditionAlreadyShelved,
    AlarmEvent.UNSHELVE: ua.StatusCodes.BadConditionNotShelved,
}
_CONDITION = "alarm/"
_CONDITION_ID = re.compile(rf"{_CONDITION}([0-9]{{1,18}})")

log = structlog.get_logger(__name__)


class AlarmConditions:
    """The receiver of a Delivery: shows alarms of these priorities as conditions of the server, while one runs."""

    most = PAGE

    def __init__(self, journal: Journal, priorities: Sequence[Priority]) -> None:
        self._journal, self._priorities = journal, priorities
        self._server: InternalServer | None = None
        self._tree: Tree | None = None
        self._events = dict[int, set[bytes]]()

    async def begin(self, server: InternalServer, tree: Tree) -> None:
        """Attach a new server, and load the alarms that are active or wait for a person, for clients' refresh requests.

        Raises:
            StoreError: the journal cannot be read.
        """
        self._server, self._tree = server, tree
        self._events.clear()
        returned, _ = self._journal.query(AlarmFilter(state=AlarmState.RETURNED), limit=MOST_RETURNED)
        for alarm in (*self._journal.standing(), *returned):
            if alarm.priority in self._priorities:
                note = Note(alarm.updated_us, SERVICE)
                await self._show(f"{self._journal.identity}-alarm-{alarm.id}", alarm, alarm.life, note)

    def end(self) -> None:
        """Detach the server, which has ended."""
        self._server = self._tree = None

    async def send(self, messages: Sequence[Message]) -> None:
        """Trigger an event for each message.

        Raises:
            UnavailableError: no server runs.
        """
        for m in messages:
            t = m.transition
            # The transition of a hidden alarm does not contain the state to which it returns.
            life = m.alarm.life if t.to_state in HIDDEN_STATES else AlarmLife(t.to_state)
            await self._show(m.id, m.alarm, life, Note(t.at_us, t.who, t.comment))

    async def _show(self, event_id: str, alarm: RecordedAlarm, life: AlarmLife, note: Note) -> None:
        if self._server is None or self._tree is None:
            raise UnavailableError("the server does not run")
        event = condition(self._tree, alarm, life, note)
        event.EventId = event_id.encode("ascii")
        if event.Retain:
            self._events.setdefault(alarm.id, set()).add(event.EventId)
        else:
            self._events.pop(alarm.id, None)
        await self._server.subscription_service.trigger_event(event)

    async def operate(self, who: str, method: ua.CallMethodRequest) -> ua.CallMethodResult | None:
        """Handle a method call; returns None if it is no method of a condition."""
        number, arguments = _alarm_id(method.ObjectId), [v.Value for v in method.InputArguments or []]
        event, wanted = _METHODS.get(method.MethodId, (None, 0))
        if event is None or number is None:
            return None
        if len(arguments) < wanted:
            code = ua.StatusCode(ua.StatusCodes.BadArgumentsMissing)
        elif len(arguments) > wanted:
            code = ua.StatusCode(ua.StatusCodes.BadTooManyArguments)
        elif event in (AlarmEvent.SHELVE, AlarmEvent.UNSHELVE):
            code = self._shelve(who, event, number, arguments)
        else:
            code = self._act(who, event, number, arguments)
        log.info("write request", who=who, what=f"OPC UA {event} alarm {number}", result=code.name)
        return ua.CallMethodResult(StatusCode=code)

    def _act(self, who: str, event: AlarmEvent, number: int, arguments: list[object]) -> ua.StatusCode:
        event_id, comment = arguments[0], _comment(arguments[1])
        if comment is None or len(comment) > MOST_COMMENT or (event is AlarmEvent.COMMENT and not comment):
            return ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
        if number not in self._events:
            return ua.StatusCode(ua.StatusCodes.BadNodeIdUnknown)
        if not isinstance(event_id, bytes) or event_id not in self._events[number]:
            return ua.StatusCode(ua.StatusCodes.BadEventIdUnknown)
        return self._done(number, event, Note(now_us(), who, comment))

    def _shelve(self, who: str, event: AlarmEvent, number: int, arguments: list[object]) -> ua.StatusCode:
        if number not in self._events:
            return ua.StatusCode(ua.StatusCodes.BadNodeIdUnknown)
        at_us, until_us = now_us(), None
        if event is AlarmEvent.SHELVE:
            time_ms, *arguments = arguments
            if not isinstance(time_ms, float) or not 0 < time_ms <= MAX_SHELF_S * 1e3:
                return ua.StatusCode(ua.StatusCodes.BadShelvingTimeOutOfRange)
            until_us = at_us + round(time_ms * 1e3)
        comment = _comment(arguments[0]) if arguments else ""
        if comment is None or len(comment) > MOST_COMMENT:
            return ua.StatusCode(ua.StatusCodes.BadInvalidArgument)
        return self._done(number, event, Note(at_us, who, comment), until_us)

    def _done(self, number: int, event: AlarmEvent, note: Note, until_us: int | None = None) -> ua.StatusCode:
        """Record an event in the journal; returns the status code."""
        try:
            self._journal.act(number, event, note, until_us)
        except AlarmTransitionError:
            alarm = self._journal.get(number)
            shelved = alarm is None or alarm.life.state is AlarmState.SHELVED
            if event is AlarmEvent.SHELVE and not shelved:
                return ua.StatusCode(ua.StatusCodes.BadInvalidState)  # the alarm is no longer active
            return ua.StatusCode(_NOT_POSSIBLE.get(event, ua.StatusCodes.BadInvalidState))
        except StoreError as error:
            log.error("an OPC UA client cannot act on an alarm", reason=str(error))
            return ua.StatusCode(ua.StatusCodes.BadResourceUnavailable)
        return ua.StatusCode()


def condition(tree: Tree, alarm: RecordedAlarm, life: AlarmLife, note: Note) -> AlarmCondition:
    """The event for an alarm in a state, with the note of the transition to that state."""
    event = AlarmCondition(
        tree.known(alarm.axis),
        episode_words(alarm, alarm.nominal, alarm.unit, alarm.same_payload),
        SEVERITIES[alarm.priority],
    )
    event.SourceName, event.ConditionName = alarm.axis, alarm.parameter
    event.Time = event.ReceiveTime = datetime.fromtimestamp(note.at_us / 1e6, UTC)
    event.add_property("NodeId", tree.node_id(f"{_CONDITION}{alarm.id}"), ua.VariantType.NodeId)
    event.ConditionClassId = ua.NodeId(ua.ObjectIds.MaintenanceConditionClassType)
    event.ConditionClassName = ua.LocalizedText("Maintenance")
    event.InputNode = tree.known(f"{alarm.axis}/{alarm.parameter}")
    event.BranchId, event.Quality = ua.NodeId(), ua.StatusCode()
    event.Retain = life.below is not AlarmState.NORMAL
    event.LastSeverity = event.Severity
    event.Comment, event.ClientUserId = ua.LocalizedText(note.comment), note.who
    acknowledged = life.below in (AlarmState.NORMAL, AlarmState.ACKNOWLEDGED)
    _put(event, "EnabledState", True, "Enabled")
    _put(event, "AckedState", acknowledged, "Acknowledged" if acknowledged else "Unacknowledged")
    _put(event, "ActiveState", life.active, "Active" if life.active else "Inactive")
    _put(event, "SuppressedState", life.state is AlarmState.SUPPRESSED, "Suppressed", "Unsuppressed")
    _put(event, "OutOfServiceState", life.state is AlarmState.OUT_OF_SERVICE, "Out of service", "In service")
    event.SuppressedOrShelved = life.hidden
    _put_shelf(event, life.state is AlarmState.SHELVED)
    return event


def _put(event: AlarmCondition, name: str, state: bool, word: str, other: str = "") -> None:
    """Set a two-state variable with its text."""
    setattr(event, name, ua.LocalizedText(word if state or not other else other))
    setattr(event, f"{name}/Id", state)


def _put_shelf(event: AlarmCondition, shelved: bool) -> None:
    name, ids = "ShelvingState/CurrentState", ua.ObjectIds
    state = ids.ShelvedStateMachineType_TimedShelved if shelved else ids.ShelvedStateMachineType_Unshelved
    word = ua.LocalizedText("Timed Shelved" if shelved else "Unshelved")
    event.add_property(name, word, ua.VariantType.LocalizedText)
    event.add_property(f"{name}/Id", ua.NodeId(state), ua.VariantType.NodeId)


def _alarm_id(node: ua.NodeId) -> int | None:
    """The number of the alarm in a ConditionId; None: it is no ConditionId of an alarm."""
    found = _CONDITION_ID.fullmatch(str(node.Identifier))
    return None if found is None else int(found[1])


def _comment(argument: object) -> str | None:
    """The text of a comment; None: the argument is no valid text."""
    if argument is None:
        return ""
    text = argument.Text if isinstance(argument, ua.LocalizedText) else argument
    if text is None:
        return ""
    return text if isinstance(text, str) and control_character(text) is None else None
