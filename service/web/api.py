"""REST under /api/v1: axes with their estimates, the daemon itself; what has files of its own."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from service.web import models, views
from service.web.alarm_routes import router as alarm_router
from service.web.app_state import AppState, Latest
from service.web.axis_service_routes import router as service_router
from service.web.commissioning_routes import router as commissioning_router
from service.web.drive_routes import router as drive_router
from service.web.epoch_routes import router as epoch_router
from service.web.event_stream import router as event_router
from service.web.history_routes import router as history_router
from service.web.problem_details import described
from service.web.recording_routes import router as recording_router
from service.web.signal_routes import router as signal_router
from service.web.system_routes import router as system_router

_NOT_FOUND = described(404, "It does not exist")
_LONGEST_S = 1.0
"""All pages that are open ask for all axes once a second: one answer is made for them."""

Entries = Annotated[
    int, Query(ge=1, le=10_000, description="maximum number of entries; neighbours are merged")
]
Only = Annotated[str | None, Query(description="only this one; default: all")]


def router(state: AppState) -> APIRouter:
    """The routes below /api/v1."""
    api = APIRouter(prefix="/api/v1")
    api.include_router(_axes(state), tags=["axes"])
    api.include_router(history_router(state), tags=["axes"])
    api.include_router(signal_router(state), tags=["axes"])
    api.include_router(drive_router(state), tags=["axes"])
    api.include_router(epoch_router(state), tags=["epochs"])
    api.include_router(alarm_router(state), tags=["alarms"])
    api.include_router(service_router(state), tags=["alarms"])
    api.include_router(event_router(state), tags=["events"])
    api.include_router(recording_router(state.extracts), tags=["recordings"])
    api.include_router(commissioning_router(state), tags=["commissioning"])
    api.include_router(system_router(state), tags=["service"])

    @api.get("/service", summary="The daemon itself", tags=["service"])
    def service() -> models.Service:
        """Version, readiness with reasons, buses, links, messages for the operator."""
        report = None if state.reports is None else state.reports.address
        return views.service(state.snapshot(), state.now_us(), report, state.access.danger, state.links())

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
        return views.axis(state.axis(axis), state.now_us())

    @api.get("/axes/{axis}/trend", summary="Long-term trend of an axis", responses=_NOT_FOUND)
    def trend(
        axis: str,
        parameter: Only = None,
        points: Entries = 1200,
    ) -> models.Trend:
        """Drift of the parameters, when they reach their limits, and the hourly means behind it."""
        return views.trend(state.axis(axis, parameter), parameter, points)

    return api
