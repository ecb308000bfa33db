"""Server-sent events: changed axes, and transitions of alarms, which a client can resume after an interruption."""

import asyncio
import threading
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import RecordedTransition
from service.store.database import StoreError
from service.web import models, views
from service.web.app_state import AppState
from service.web.problem_details import described

EVERY_S = 0.5
"""Time between two checks for changes"""
MOST_AXES = 50
"""Most axes in an event after the first.  If more have changed, they follow in later events, to spread the work of a
page."""
KEEP_ALIVE_S = 10.0
MOST_STREAMS = 32
MOST_TRANSITIONS = 100
"""Most transitions in one read; a stream with more continues at once with the next ones."""
_LARGEST_ID = 2**63 - 1

_NOT_FOUND = described(404, "There is no such axis")
_FULL = described(503, "Too many streams are open")

LastId = Annotated[
    int | None,
    Header(
        alias="Last-Event-ID",
        ge=0,
        le=_LARGEST_ID,
        description="number of the last alarm event that was received: those after it come first",
    ),
]


class AxisTexts:
    """The JSON of each axis of the newest snapshot, made once for all streams."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._snapshot: Snapshot | None = None
        self._texts: dict[str, bytes] = {}

    def event(self, snapshot: Snapshot, axes: list[AxisSnapshot], now_us: int) -> str:
        """The body of models.Axes with these axes of a snapshot."""
        with self._lock:
            if self._snapshot is not snapshot:
                self._snapshot, self._texts = snapshot, {}
            for axis in axes:
                if axis.id not in self._texts:
                    self._texts[axis.id] = views.axis_json(axis, now_us)
            return views.axes_json(snapshot, [self._texts[axis.id] for axis in axes]).decode()


class EventStream:
    """The stream to one client."""

    def __init__(self, state: AppState, texts: AxisTexts, axis: str | None, last_id: int | None) -> None:
        self._state, self._texts, self._axis, self._last_id = state, texts, axis, last_id
        self._sent: dict[str, AxisSnapshot] = {}
        """Axes as last sent, in the order in which they were sent"""
        self._waiting = False
        self._snapshot: Snapshot | None = None
        self._revision = -1
        self.behind = True
        """Whether there may be more transitions at once"""

    def axes(self) -> str | None:
        """The changed axes as the data of an event; None: no axis has changed."""
        state, snapshot = self._state, self._state.snapshot()
        if snapshot is self._snapshot and not self._waiting:
            return None
        self._snapshot = snapshot
        wanted = [a for a in snapshot.axes if self._axis in (None, a.id)]
        changed = [a for a in wanted if self._sent.get(a.id) != a]
        if not changed:
            return None
        turn = {axis_id: number for number, axis_id in enumerate(self._sent)}
        most = MOST_AXES if turn else len(changed)
        self._waiting = len(changed) > most
        changed = sorted(changed, key=lambda a: turn.get(a.id, -1))[:most]
        for axis in changed:
            self._sent.pop(axis.id, None)
            self._sent[axis.id] = axis
        return self._texts.event(snapshot, changed, state.now_us())

    def alarms(self) -> list[ServerSentEvent]:
        """Events for the transitions since the last call, at most ``MOST_TRANSITIONS``."""
        journal = self._state.journal
        revision = journal.revision
        if revision == self._revision and not self.behind:
            return []
        try:
            if self._last_id is None or self._revision < 0:
                latest = journal.last_transition()  # may be smaller than last_id, if the journal was replaced
                self._last_id = latest if self._last_id is None else min(self._last_id, latest)
            found = journal.transitions_after(self._last_id, MOST_TRANSITIONS)
            alarms = {n.alarm_id: journal.get(n.alarm_id) for n in found}
        except StoreError:
            return []  # the next call tries again
        self._revision, self.behind = revision, len(found) == MOST_TRANSITIONS
        self._last_id = found[-1].number if found else self._last_id
        return [
            self._event(n.number, n.transition, alarm)
            for n in found
            if (alarm := alarms[n.alarm_id]) is not None and self._axis in (None, alarm.axis)
        ]

    def _event(self, number: int, transition: RecordedTransition, alarm: RecordedAlarm) -> ServerSentEvent:
        recording = self._state.recording_of(alarm.since_us)
        body = models.AlarmChange(
            alarm=views.alarm(alarm, self._state.now_us(), recording),
            transition=views.body(models.AlarmTransition, transition),
        )
        return ServerSentEvent(event="alarm", id=str(number), raw_data=body.model_dump_json())


def router(state: AppState) -> APIRouter:
    """The route of the events below /api/v1."""
    api = APIRouter()
    slots, texts = asyncio.Semaphore(MOST_STREAMS), AxisTexts()

    async def slot() -> AsyncIterator[None]:
        if slots.locked():
            raise HTTPException(503, f"{MOST_STREAMS} streams are open", headers={"Retry-After": "10"})
        async with slots:
            yield

    async def known_axis(
        axis: Annotated[str | None, Query(description="only of this axis (robot.axis)")] = None,
    ) -> str | None:
        return None if axis is None else state.axis(axis).id

    @api.get(
        "/events", summary="Live events", response_class=EventSourceResponse, responses=_FULL | _NOT_FOUND,
        dependencies=[Depends(slot)],
    )  # fmt: skip
    async def events(
        request: Request, axis: Annotated[str | None, Depends(known_axis)], last_id: LastId = None
    ) -> AsyncIterator[ServerSentEvent]:
        """Events `axes`: the changed axes, at most twice a second; `alarm`: each transition of an alarm.

        The first `axes` has all axes, later ones at most fifty each; if more have changed, they follow in the next
        events.

        The data of `axes` is as in GET /api/v1/axes; that of `alarm` is {"alarm": Alarm, in its state at the time of
        sending, "transition": AlarmTransition}; its id is the number of the transition. Without Last-Event-ID, only new
        transitions are sent. A comment is sent if there is nothing else for ten seconds.
        """
        stream = EventStream(state, texts, axis, last_id)
        loop = asyncio.get_running_loop()
        axes_at, alive_at = loop.time(), loop.time() + KEEP_ALIVE_S
        while not state.stopping() and request.state.is_known():  # the token has not been revoked
            found = await run_in_threadpool(stream.alarms)
            if loop.time() >= axes_at and (axes := await run_in_threadpool(stream.axes)) is not None:
                found.append(ServerSentEvent(event="axes", raw_data=axes))
                axes_at = loop.time() + EVERY_S
            if not found and loop.time() >= alive_at:
                found.append(ServerSentEvent(comment="still there"))
            for event in found:
                yield event
                alive_at = loop.time() + KEEP_ALIVE_S
            if not stream.behind:
                await asyncio.sleep(EVERY_S)

    return api
