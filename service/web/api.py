"""REST under /api/v1: axes with their estimates, their history, the alarm journal, the daemon itself."""

import re
from collections.abc import Iterable
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from pydantic import AwareDatetime, BeforeValidator

from service.pipeline.snapshot import AxisSnapshot
from service.texts import microseconds
from service.web import models, views
from service.web.app_state import AppState, Latest


def refusals(words: dict[int, str]) -> dict[int | str, dict[str, Any]]:
    """Problem details that a route answers, by status, with when it does."""
    schema = {"schema": {"$ref": "#/components/schemas/Problem"}}
    return {
        status: {
            "description": when,
            "content": {"application/problem+json": schema},
        }
        for status, when in words.items()
    }


PROTECTED = refusals(
    {401: "There are tokens, and none was given, or an unknown one", 403: "Its scope is too small"}
)
_NOT_FOUND = refusals({404: "It does not exist"})
_NO_JOURNAL = refusals({503: "The alarm journal cannot be read"})
_LONGEST_S = 1.0
"""All pages that are open ask for all axes once a second: one answer is made for them."""
_LARGEST_ID = 2**63 - 1

Limit = Annotated[int, Query(ge=1, le=1000, description="maximum number")]
Offset = Annotated[int, Query(ge=0, le=_LARGEST_ID, description="number to skip")]
Points = Annotated[
    int, Query(ge=1, le=100_000, description="maximum number of points; the last ones are returned")
]
Entries = Annotated[
    int, Query(ge=1, le=10_000, description="maximum number of entries; neighbours are merged")
]
Only = Annotated[str | None, Query(description="only this one; default: all")]
_DATE_AND_TIME = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _date_and_time(text: str) -> str:
    """A text that begins as a time does; pydantic takes a number for seconds or milliseconds since 1970.

    Raises:
        ValueError: it does not.
    """
    if not _DATE_AND_TIME.match(text):
        raise ValueError("must be ISO 8601 with time zone: 2026-03-01T12:00:00Z, or +01:00 as %2B01:00")
    return text


Moment = Annotated[
    Annotated[AwareDatetime, BeforeValidator(_date_and_time)] | None,
    Query(description="ISO 8601 with time zone, e.g. 2026-03-01T12:00:00Z; in an address + is %2B"),
]


class UnknownResourceError(Exception):
    """The resource does not exist; ``known`` lists those that do."""

    def __init__(self, detail: str, known: Iterable[str]) -> None:
        self.problem = models.Problem(detail=detail, known=list(known))
        super().__init__(detail)


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1."""
    api = APIRouter(prefix="/api/v1")
    api.include_router(_axes(state), tags=["axes"])
    api.include_router(_alarms(state), tags=["alarms"])

    @api.get("/service", summary="The daemon itself", tags=["service"])
    def service() -> models.Service:
        """Version, readiness with reasons, buses, messages for the operator."""
        report = None if state.reports is None else state.reports.address
        return views.service(state.snapshot(), state.now_us(), report, state.access.danger)

    return api


def _axes(state: AppState) -> APIRouter:
    api = APIRouter()

    every = Latest(lambda taken, now_us: views.axes(taken, now_us).model_dump_json().encode(), _LONGEST_S)

    @api.get("/axes", summary="All axes", response_model=models.Axes)
    def axes() -> Response:
        """All axes with estimates, CUSUMs, counters and model in one answer; its ages may be a second old."""
        return Response(every(state.snapshot(), state.now_us()), media_type="application/json")

    @api.get("/axes/{axis}", summary="One axis", responses=_NOT_FOUND)
    def axis(axis: str) -> models.Axis:
        """One axis, by its id robot.axis."""
        return views.axis(_axis(state, axis), state.now_us())

    @api.get("/axes/{axis}/history", summary="History of an axis", responses=_NOT_FOUND)
    def history(
        axis: str,
        parameter: Only = None,
        since: Moment = None,
        limit: Points = 3600,
    ) -> models.History:
        """The last points of an axis after since, oldest first, in columns."""
        found = _axis(state, axis, parameter)
        return views.history(found, parameter, microseconds(since), limit)

    @api.get("/axes/{axis}/trend", summary="Long-term trend of an axis", responses=_NOT_FOUND)
    def trend(
        axis: str,
        parameter: Only = None,
        points: Entries = 1200,
    ) -> models.Trend:
        """Drift of the parameters, when they reach their limits, and the hourly means behind it."""
        return views.trend(_axis(state, axis, parameter), parameter, points)

    return api


def _alarms(state: AppState) -> APIRouter:
    api = APIRouter()

    @api.get("/alarms", summary="Alarms", responses=_NO_JOURNAL)
    def alarms(
        axis: Annotated[str | None, Query(description="only of this axis (robot.axis)")] = None,
        parameter: Annotated[str | None, Query(description="only of this parameter")] = None,
        active: Annotated[bool | None, Query(description="true: not ended; false: ended")] = None,
        since: Moment = None,
        until: Moment = None,
        limit: Limit = 100,
        offset: Offset = 0,
    ) -> models.Alarms:
        """Alarms raised at or after since and before until, latest first."""
        found, total = state.journal.query(
            axis, parameter, active, microseconds(since), microseconds(until), limit, offset
        )
        return models.Alarms(total=total, limit=limit, offset=offset, alarms=[views.alarm(a) for a in found])

    @api.get("/alarms/{id}", summary="One alarm", responses=_NOT_FOUND | _NO_JOURNAL)
    def alarm(alarm_id: Annotated[int, Path(alias="id", ge=1, le=_LARGEST_ID)]) -> models.Alarm:
        """One alarm of the journal."""
        found = state.journal.get(alarm_id)
        if found is None:
            latest, total = state.journal.query(limit=10)
            raise UnknownResourceError(
                f"no alarm {alarm_id}; the journal holds {total}", [str(a.id) for a in latest]
            )
        return views.alarm(found)

    return api


def _axis(state: AppState, axis_id: str, parameter: str | None = None) -> AxisSnapshot:
    """The axis of that id, checked to monitor ``parameter`` if one is given."""
    snapshot = state.snapshot()
    found = snapshot.axis(axis_id)
    if found is None:
        raise UnknownResourceError(f"there is no axis {axis_id!r}", [axis.id for axis in snapshot.axes])
    names = [p.name for p in found.status.parameters]
    if parameter is not None and parameter not in names:
        raise UnknownResourceError(f"{axis_id} has no monitored parameter {parameter!r}", names)
    return found
