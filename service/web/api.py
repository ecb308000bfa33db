"""REST under /api/v1: axes with their estimates, their history, the alarm journal, the daemon itself."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from pydantic import AwareDatetime

from service.pipeline.snapshot import AxisSnapshot
from service.web import models, views
from service.web.app_state import World
from service.web.errors import NotKnownError
from service.web.times import microseconds

_NOT_FOUND: dict[int | str, dict[str, Any]] = {
    404: {"model": models.Problem, "description": "There is no such one"}
}
_NO_JOURNAL: dict[int | str, dict[str, Any]] = {
    503: {"model": models.Problem, "description": "The alarm journal cannot be read"}
}
_LARGEST_ID = 2**63 - 1

Limit = Annotated[int, Query(ge=1, le=1000, description="at most so many")]
Offset = Annotated[int, Query(ge=0, le=_LARGEST_ID, description="without the first so many")]
Points = Annotated[int, Query(ge=1, le=100_000, description="at most so many points, the last ones")]
Entries = Annotated[int, Query(ge=1, le=10_000, description="at most so many entries, neighbours merged")]
Moment = Annotated[
    AwareDatetime | None, Query(description="ISO 8601 with time zone, e.g. 2026-03-01T12:00:00Z")
]


def router(world: World) -> APIRouter:
    """The routes."""
    api = APIRouter(prefix="/api/v1")
    api.include_router(_axes(world), tags=["axes"])
    api.include_router(_alarms(world), tags=["alarms"])

    @api.get("/service", summary="The daemon itself", tags=["service"])
    def service() -> models.Service:
        """Version, readiness with reasons, buses, messages for the operator."""
        return views.service(world.snapshot(), world.now_us())

    return api


def _axes(world: World) -> APIRouter:
    api = APIRouter()

    @api.get("/axes", summary="All axes")
    def axes() -> models.Axes:
        """All axes with estimates, CUSUMs, counters and model: one request shows everything."""
        return views.axes(world.snapshot(), world.now_us())

    @api.get("/axes/{axis}", summary="One axis", responses=_NOT_FOUND)
    def axis(axis: str) -> models.Axis:
        """One axis, named robot.axis."""
        return views.axis(_axis(world, axis), world.now_us())

    @api.get("/axes/{axis}/history", summary="History of an axis", responses=_NOT_FOUND)
    def history(
        axis: str,
        parameter: Annotated[str | None, Query(description="only this one; default: all")] = None,
        since: Moment = None,
        limit: Points = 3600,
    ) -> models.History:
        """The last points of an axis later than since, oldest first, in columns."""
        found = _axis(world, axis, parameter)
        return views.history(found, parameter, microseconds(since), limit)

    @api.get("/axes/{axis}/trend", summary="Slow course of an axis", responses=_NOT_FOUND)
    def trend(
        axis: str,
        parameter: Annotated[str | None, Query(description="only this one; default: all")] = None,
        points: Entries = 1200,
    ) -> models.Trend:
        """Whether the parameters drift, when they reach their limits, and the means over hours that tell it."""
        return views.trend(_axis(world, axis, parameter), parameter, points)

    return api


def _alarms(world: World) -> APIRouter:
    api = APIRouter()

    @api.get("/alarms", summary="Alarms", responses=_NO_JOURNAL)
    def alarms(
        axis: Annotated[str | None, Query(description="of this axis, named robot.axis")] = None,
        parameter: Annotated[str | None, Query(description="of this parameter")] = None,
        active: Annotated[bool | None, Query(description="true: not ended; false: ended")] = None,
        since: Moment = None,
        until: Moment = None,
        limit: Limit = 100,
        offset: Offset = 0,
    ) -> models.Alarms:
        """Alarms raised from since on and before until, the last raised first."""
        found, total = world.journal.query(
            axis, parameter, active, microseconds(since), microseconds(until), limit, offset
        )
        return models.Alarms(total=total, limit=limit, offset=offset, alarms=[views.alarm(a) for a in found])

    @api.get("/alarms/{id}", summary="One alarm", responses=_NOT_FOUND | _NO_JOURNAL)
    def alarm(alarm_id: Annotated[int, Path(alias="id", ge=1, le=_LARGEST_ID)]) -> models.Alarm:
        """One alarm of the journal."""
        found = world.journal.get(alarm_id)
        if found is None:
            latest, total = world.journal.query(limit=10)
            raise NotKnownError(
                f"no alarm {alarm_id}; the journal holds {total}", [str(a.id) for a in latest]
            )
        return views.alarm(found)

    return api


def _axis(world: World, axis_id: str, parameter: str | None = None) -> AxisSnapshot:
    """The axis, which monitors that parameter."""
    snapshot = world.snapshot()
    found = snapshot.axis(axis_id)
    if found is None:
        raise NotKnownError(f"there is no axis {axis_id!r}", [axis.id for axis in snapshot.axes])
    names = [p.name for p in found.facts.parameters]
    if parameter is not None and parameter not in names:
        raise NotKnownError(f"{axis_id} has no monitored parameter {parameter!r}", names)
    return found
