"""REST under /api/v1/alarms: the alarm journal, and actions of persons on alarms."""

import re
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Depends, Path, Query
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException

from monitor_core.monitoring import AlarmEvent
from service.pipeline.persistence.replay_reports import NoReplayError
from service.store.alarm_filter import AlarmFilter, StateFilter
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import Note
from service.store.database import StoreError
from service.store.journal import UnknownAlarmError
from service.texts.instants import microseconds
from service.web import models, views
from service.web.access import Operator
from service.web.app_state import AppState
from service.web.problem_details import NOT_FOUND, UnknownResourceError, described
from service.web.report_pages import PAGE_HEADERS
from service.web.routes.recording_routes import NO_FRAMES_KEPT

_NO_JOURNAL = described(503, "The alarm journal cannot be read or written")
_CONFLICT = described(409, "Not possible in the present state of the alarm, e.g. acknowledged twice")
_NO_SHELF = described(400, "The end of the shelf is not in the future, or more than seven days in it")
_NO_PAGE = described(400, "No page has given this cursor, or since is not before until")
_NO_RANGE = described(400, "since is not before until")
_ACTIVE_STATES = ("active", "unacknowledged", "acknowledged", "latched", "stale")
"""Filters by state that only active alarms match"""
_LARGEST_ID = 2**63 - 1
_CURSOR = re.compile(r"(?:(-?[0-9]{1,18})\.)?([0-9]{1,18})")
_WEEK_US = 7 * 86_400_000_000
_EARLIEST_US, _LATEST_US = -62_135_596_800_000_000, 253_402_300_799_999_999
"""Range of times in the API: years 1 to 9999, UTC"""

_ENDLESS_S = 1e9
"""A longer duration is cut to this, which is far too long in any case."""

Moment = Annotated[
    models.GivenTime | None,
    Query(description="ISO 8601 with time zone, e.g. 2026-03-01T12:00:00Z; in an address + is %2B"),
]
Cursor = Annotated[str | None, Query(description="the page after the one that has given this as next")]
NOT_A_CURSOR = "this is no cursor: it must be the `next` of a page"
AlarmId = Annotated[int, Path(alias="id", ge=1, le=_LARGEST_ID)]


def in_order(since: Moment, until: Moment) -> tuple[int | None, int | None]:
    """Start and end of a time range [us since 1970].

    Raises:
        HTTPException: the range does not end after its start.
    """
    since_us, until_us = (
        None if t_us is None else max(_EARLIEST_US, min(t_us, _LATEST_US))
        for t_us in (microseconds(since), microseconds(until))
    )
    if since_us is not None and until_us is not None and since_us >= until_us:
        raise HTTPException(400, "since must be before until")
    return since_us, until_us


def _wanted(
    axis: Annotated[str | None, Query(description="only of this axis (robot.axis)")] = None,
    parameter: Annotated[str | None, Query(description="only of this parameter")] = None,
    active: Annotated[bool | None, Query(description="true: not ended, or latched; false: ended")] = None,
    state: Annotated[
        StateFilter | None,
        Query(
            description="only in this state; active: not ended, or latched; stale: shown and active for more than"
            " 24 hours; chattering: with it, alarms of its name were raised three times within ten minutes"
        ),
    ] = None,
    since: Moment = None,
    until: Moment = None,
) -> AlarmFilter:
    """The conditions of a request for the list of alarms."""
    return AlarmFilter(axis, parameter, active, state, *in_order(since, until))


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1/alarms."""
    api = APIRouter(prefix="/alarms")

    @api.get("", summary="Alarms", responses=_NO_JOURNAL | _NO_PAGE)
    def alarms(
        wanted: Annotated[AlarmFilter, Depends(_wanted)],
        limit: Annotated[int, Query(ge=1, le=1000, description="maximum number")] = 100,
        cursor: Cursor = None,
    ) -> models.Alarms:
        """Alarms raised at or after since and before until: those not yet recorded, then the others, latest first.

        While the journal cannot be read, active alarms are those that were last read.
        """
        now_us = state.now_us()
        skipped, after = (0, None) if cursor is None else _place(cursor)
        waiting = [a for a in reversed(state.snapshot().alarms.unrecorded) if wanted.matches(a, now_us)]
        first = waiting[skipped : skipped + limit] if after is None else []
        most = limit - len(first) + 1  # one more, to see whether there is another page
        try:
            recorded, total = state.journal.query(wanted, limit=most, after=after, now_us=now_us)
        except StoreError:
            if after is not None or not (wanted.active or wanted.state in _ACTIVE_STATES):
                raise
            recorded = [a for a in reversed(state.snapshot().alarms.standing) if wanted.matches(a, now_us)]
            total, recorded = len(recorded), recorded[:most]
        files = [] if state.extracts is None else state.extracts.folder.files()  # list the folder only once
        found = [views.alarm(a, now_us, state.recording_of(a.since_us, files)) for a in (*first, *recorded)[:limit]]
        following, left = None, after is None and skipped + len(first) < len(waiting)
        if left or len(first) + len(recorded) > limit:
            last = recorded[-2:-1]
            following = f"{last[0].raised_us}.{last[0].id}" if last else f"{skipped + len(first)}"
        return models.Alarms(total=total + len(waiting), limit=limit, next=following, alarms=found)

    @api.get("/statistics", summary="Alarm statistics", responses=_NO_JOURNAL | _NO_RANGE)
    def statistics(since: Moment = None, until: Moment = None) -> models.AlarmStatistics:
        """Alarms per ten minutes and the most frequent ones, from since (seven days before until) to until (now)."""
        begin_us, end_us = in_order(since, until)
        end_us = state.now_us() if end_us is None else end_us
        begin_us = max(_EARLIEST_US, end_us - _WEEK_US) if begin_us is None else begin_us
        return views.body(models.AlarmStatistics, state.journal.statistics(begin_us, end_us))

    @api.get("/{id}", summary="One alarm", responses=NOT_FOUND | _NO_JOURNAL)
    def alarm(alarm_id: AlarmId) -> models.AlarmRecord:
        """One alarm of the journal, with its transitions."""
        return _record(state, _known(state, alarm_id))

    api.include_router(_actions(state))
    return api


def _place(cursor: str) -> tuple[int, tuple[int, int] | None]:
    """The start of a page: the number of unrecorded alarms to skip, or the recorded alarm before the page."""
    found = _CURSOR.fullmatch(cursor)
    if found is None:
        raise HTTPException(400, NOT_A_CURSOR)
    return (0, (int(found[1]), int(found[2]))) if found[1] else (int(found[2]), None)


def _actions(state: AppState) -> APIRouter:
    """The routes of actions on an alarm; each answers with the alarm after the action."""
    api = APIRouter(prefix="/{id}", responses=NOT_FOUND | _NO_JOURNAL)
    act = partial(_act, state)

    @api.post("/acknowledge", summary="Acknowledge an alarm", responses=_CONFLICT)
    def acknowledge(alarm_id: AlarmId, body: models.AlarmNote, who: Operator) -> models.AlarmRecord:
        """A person knows of the alarm; a latched one ends."""
        return act(alarm_id, AlarmEvent.ACKNOWLEDGE, who, body)

    @api.post("/shelve", summary="Shelve an alarm", responses=_CONFLICT | _NO_SHELF)
    def shelve(alarm_id: AlarmId, body: models.AlarmShelf, who: Operator) -> models.AlarmRecord:
        """Hide an alarm, and the next ones of its axis, parameter and direction, until a time."""
        until_us = microseconds(body.until)
        if body.duration_s is not None:
            until_us = state.now_us() + round(min(max(body.duration_s, -_ENDLESS_S), _ENDLESS_S) * 1e6)
        return act(alarm_id, AlarmEvent.SHELVE, who, body, until_us)

    @api.post("/unshelve", summary="Unshelve an alarm", responses=_CONFLICT)
    def unshelve(alarm_id: AlarmId, body: models.AlarmNote, who: Operator) -> models.AlarmRecord:
        """Show an alarm again, and all others of its axis, parameter and direction."""
        return act(alarm_id, AlarmEvent.UNSHELVE, who, body)

    @api.post(
        "/report", summary="Make the replay report of an alarm", status_code=202,
        responses=described(409, "It has no recording, or another report is being made"),
    )  # fmt: skip
    def make_report(alarm_id: AlarmId, _who: Operator) -> models.AlarmRecord:
        """Replay the recording of an alarm with the nominal values of that time, in a process of lowest priority."""
        found = _known(state, alarm_id)
        if state.replays is None:
            raise HTTPException(409, NO_FRAMES_KEPT)
        try:
            state.replays.begin(found)
        except NoReplayError as error:
            raise HTTPException(409, error.args[0]) from None
        return _record(state, found)

    @api.get(
        "/report", summary="The replay report of an alarm", response_class=FileResponse, responses=NOT_FOUND,
    )  # fmt: skip
    def report(alarm_id: AlarmId) -> FileResponse:
        """The finished report: one page without scripts that contains its pictures, for the maintenance file."""
        page = None if state.replays is None else state.replays.page(_known(state, alarm_id))
        if page is None or not page.is_file():
            raise HTTPException(404, f"there is no report of alarm {alarm_id}; POST makes it")
        return FileResponse(page, media_type="text/html", filename=page.name, headers=PAGE_HEADERS)

    @api.post("/comment", summary="Comment on an alarm")
    def comment(alarm_id: AlarmId, body: models.AlarmComment, who: Operator) -> models.AlarmRecord:
        """Add a comment, the number of a work order, or both, to any alarm."""
        return act(alarm_id, AlarmEvent.COMMENT, who, body)

    return api


def _act(
    state: AppState, alarm_id: int, event: AlarmEvent, who: str, body: models.AlarmNote, until_us: int | None = None
) -> models.AlarmRecord:
    """Take an action on an alarm; returns the alarm after it."""
    note = Note(state.now_us(), who, body.comment, body.work_order)
    if _unrecorded(state, alarm_id):
        if event is not AlarmEvent.ACKNOWLEDGE:
            raise HTTPException(503, f"alarm {alarm_id} is not yet recorded; until then it can only be acknowledged")
        if found := state.acknowledge(alarm_id, note):  # otherwise it has just been recorded
            return _record(state, found)
    try:
        return _record(state, state.journal.act(alarm_id, event, note, until_us))
    except UnknownAlarmError:
        raise _unknown(state, alarm_id) from None


def _record(state: AppState, found: RecordedAlarm) -> models.AlarmRecord:
    recording = state.recording_of(found.since_us)
    transitions = state.journal.transitions(found.id) if found.recorded else ()
    report = None if state.replays is None else state.replays.state(found)
    return views.alarm_record(found, transitions, state.now_us(), recording, report)


def _known(state: AppState, alarm_id: int) -> RecordedAlarm:
    found = _unrecorded(state, alarm_id) or state.journal.get(alarm_id)
    if found is None:
        raise _unknown(state, alarm_id)
    return found


def _unrecorded(state: AppState, alarm_id: int) -> RecordedAlarm | None:
    return next((a for a in state.snapshot().alarms.unrecorded if a.id == alarm_id), None)


def _unknown(state: AppState, alarm_id: int) -> UnknownResourceError:
    latest, total = state.journal.query(limit=10)
    others = f"; these are the latest of {total}" if total > len(latest) else ""
    return UnknownResourceError(f"no alarm {alarm_id}{others}", [str(a.id) for a in latest])
