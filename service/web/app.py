"""The web application: REST API, health, metrics, pages without external content, error answers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, FastAPI, Header, Query, Request, Response
from fastapi import Path as PathParameter
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse
from starlette.exceptions import HTTPException
from starlette.staticfiles import StaticFiles

from monitor_core.monitoring import AlarmTransitionError, ShelfEndError
from service.config.public_text import public_words
from service.pipeline.pauses import with_pauses
from service.pipeline.reconfiguration.baselines import BaselineConflictError, BaselineError, BaselineUnavailableError
from service.pipeline.snapshot import Snapshot
from service.store.database import StoreError
from service.web import metrics, models, views
from service.web.access import ForbiddenError, Scope, needs
from service.web.app_state import VERSION, AppState, CachedAnswer, age_s, is_alive, reasons_not_ready
from service.web.entity_tags import EntityTags
from service.web.event_stream import router as event_router
from service.web.gate import RequestGate
from service.web.problem_details import (
    NOT_FOUND,
    PROTECTED,
    UnknownResourceError,
    add_to_schema,
    answer,
    mistakes,
)
from service.web.report_pages import router as report_router
from service.web.robot_setup import NoLookError
from service.web.routes.alarm_routes import router as alarm_router
from service.web.routes.axis_service_routes import router as service_router
from service.web.routes.commissioning_routes import router as commissioning_router
from service.web.routes.drive_routes import router as drive_router
from service.web.routes.epoch_routes import router as epoch_router
from service.web.routes.history_routes import router as history_router
from service.web.routes.recording_routes import router as recording_router
from service.web.routes.signal_routes import router as signal_router
from service.web.routes.system_routes import router as system_router

STATIC = Path(__file__).parent / "static"
DESCRIPTION = """\
Condition monitoring of robot axes: estimated physical parameters, their deviation from the commissioned
values, and alarms that name the parameter that has changed. Times are ISO 8601 in UTC; values are in SI units
on the motor side of the gear unless a description says otherwise; a number that is not finite is null."""

_LONGEST_S = 2.0
"""Longest use of one answer with all axes [s]: all open pages request it once a second, so it is made once."""

Entries = Annotated[int, Query(ge=1, le=10_000, description="maximum number of entries; neighbours are merged")]
Only = Annotated[str | None, Query(description="only this one; default: all")]


def create_app(state: AppState) -> FastAPI:
    """Make the application from the state of the daemon."""
    # FastAPI's own documentation pages load scripts from another host; the page at /docs does not.
    app = FastAPI(title="axiswatch", version=VERSION, description=DESCRIPTION, docs_url=None, redoc_url=None)
    app.include_router(_api(state), dependencies=[Depends(needs(Scope.READ))], responses=PROTECTED)
    app.include_router(_probes(state))
    app.include_router(_pages())
    app.include_router(report_router(state.reports))
    app.mount("/static", StaticFiles(directory=STATIC, check_dir=False))  # after the route of the icons
    app.add_middleware(EntityTags)
    app.add_middleware(RequestGate, access=state.access)
    _describe_webhook(app)
    _answer_errors(app, state)
    add_to_schema(app)
    return app


def _api(state: AppState) -> APIRouter:
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
        report, danger, folder = state.reports.address, state.access.danger, state.setup.folder
        return views.service(state.snapshot(), state.now_us(), report, danger, folder, state.links())

    return api


def _axes(state: AppState) -> APIRouter:
    api = APIRouter()

    def written(taken: Snapshot, now_us: int) -> bytes:
        return views.axes_json(taken, [views.axis_json(a, now_us) for a in with_pauses(taken.axes)])

    every = CachedAnswer(written, _LONGEST_S)
    state.prepared.append(every)

    @api.get("/axes", summary="All axes", response_model=models.Axes)
    def axes() -> Response:
        """All axes with estimates, CUSUMs, counters and model in one answer; its ages may be two seconds old."""
        return Response(every(state.snapshot(), state.now_us()), media_type="application/json")

    @api.get("/axes/{axis}", summary="One axis", responses=NOT_FOUND)
    def axis(axis: str) -> models.Axis:
        """One axis, by its id robot.axis."""
        return views.axis(state.axis(axis), state.now_us())

    @api.get("/axes/{axis}/trend", summary="Long-term trend of an axis", responses=NOT_FOUND)
    def trend(axis: str, parameter: Only = None, points: Entries = 1200) -> models.Trend:
        """Drift of the parameters, when they reach their limits, and the hourly means behind it."""
        return views.trend(state.axis(axis, parameter), parameter, points)

    return api


def _probes(state: AppState) -> APIRouter:
    """Health for machines: /healthz (alive), /readyz (monitoring, or the reasons why not), /metrics."""
    probes = APIRouter(tags=["probes"])
    written = metrics.Metrics(state.snapshot, state.now_us, state.links)
    state.prepared.extend(written.of_axes.values())
    protected = Depends(needs(Scope.READ))

    # The next two routes answer on the event loop, so that they need not wait for a thread.
    @probes.get("/healthz", summary="Alive?", responses={503: {"model": models.Health}})
    async def healthz(response: Response) -> models.Health:
        """200 while the worker reports, 503 when it has not reported for ten seconds."""
        snapshot, now_us = state.snapshot(), state.now_us()
        alive = is_alive(snapshot, now_us)
        response.status_code = 200 if alive else 503
        return models.Health(
            alive=alive,
            snapshot_age_s=age_s(snapshot.taken_us, now_us),
            insecure=state.access.danger is not None,
        )

    @probes.get(
        "/readyz",
        summary="Monitoring?",
        responses={503: {"model": models.Readiness}, **PROTECTED},
        dependencies=[protected],
    )
    async def readyz(response: Response) -> models.Readiness:
        """200 while all buses are up and all axes receive samples, else 503 with the reasons."""
        reasons = [reason.words for reason in reasons_not_ready(state.snapshot(), state.now_us())]
        response.status_code = 503 if reasons else 200
        return models.Readiness(ready=not reasons, reasons=reasons)

    open_metrics = state.access.open_metrics  # for the schema only; the gate uses the present setting

    @probes.get(
        "/metrics",
        summary="Prometheus metrics",
        response_class=Response,
        responses={} if open_metrics else PROTECTED,
        dependencies=[] if open_metrics else [protected],
    )
    def scrape(accept: Annotated[str, Header()] = "") -> Response:
        """The Prometheus text format, or OpenMetrics if the client accepts it."""
        body, content_type = written.scrape(accept)
        return Response(body, headers={"Content-Type": content_type})

    return probes


def _pages() -> APIRouter:
    pages = APIRouter(include_in_schema=False)

    @pages.get("/")
    @pages.get("/docs")
    def index() -> Response:
        return _page("index.html")

    @pages.get("/static/icon-{number}.svg")
    def numbered_icon(number: Annotated[str, PathParameter(pattern=r"^([1-9]|9\+)$")]) -> Response:
        """The icon with a number of alarms; the content policy does not allow the page to draw it."""
        icon = STATIC / "icon.svg"
        if not icon.is_file():
            return _page(icon.name)
        drawn = icon.read_text(encoding="utf-8").replace("</svg>", _NUMBER.format(number=number) + "</svg>")
        return Response(drawn, media_type="image/svg+xml")

    return pages


_NUMBER = (
    '<circle cx="22" cy="10" r="10" fill="#c8102e"/><text x="22" y="15" font-family="sans-serif" font-size="14"'
    ' font-weight="700" fill="#fff" text-anchor="middle">{number}</text>'
)


def _page(name: str) -> Response:
    """A page of the dashboard; an error answer if the dashboard has not been built."""
    path = STATIC / name
    if path.is_file():
        return FileResponse(path)
    return answer(503, "the dashboard is not built; in the top folder of the sources: python hatch_build.py")


def _describe_webhook(app: FastAPI) -> None:
    """Add the requests that ``[[links.webhook]]`` sends to the schema."""

    @app.webhooks.post("alarm", tags=["links"])
    def alarm(
        body: models.AlarmMessage,
        x_axiswatch_timestamp: Annotated[int, Header(description="time of this try, seconds since 1970")],
        x_axiswatch_signature: Annotated[
            str,
            Header(description="sha256=HMAC-SHA-256 in hexadecimal digits of the text TIMESTAMP.BODY, by the secret"),
        ],
    ) -> None:
        """A transition of an alarm, again and again until the answer is 2xx, or 4xx other than 408, 425 and 429."""


_STATUS: Mapping[type[Exception], int] = {
    ShelfEndError: 400,
    ForbiddenError: 403,
    AlarmTransitionError: 409,
    BaselineConflictError: 409,
    BaselineError: 422,
    BaselineUnavailableError: 503,
    NoLookError: 503,
}
"""Status of the answer to a request that raises such an error; the error's first argument is the text"""


def _answer_errors(app: FastAPI, state: AppState) -> None:
    """Answer failed requests with the reason, which names no folder of the machine, and with the existing resources."""

    async def refused(_: Request, error: Exception) -> JSONResponse:
        return answer(_STATUS[type(error)], error.args[0])

    for kind in _STATUS:
        app.add_exception_handler(kind, refused)

    @app.exception_handler(UnknownResourceError)
    async def not_known(_: Request, error: UnknownResourceError) -> JSONResponse:
        return answer(404, error.detail, error.known)

    @app.exception_handler(RequestValidationError)
    async def not_as_described(_: Request, error: RequestValidationError) -> JSONResponse:
        return answer(422, mistakes(error.errors()))

    @app.exception_handler(StoreError)
    async def store_failed(_: Request, error: StoreError) -> JSONResponse:
        return answer(
            503, f"a file of the daemon cannot be read or written: {public_words(str(error), state.setup.folder)}"
        )

    @app.exception_handler(HTTPException)
    async def no_such_path(request: Request, error: HTTPException) -> JSONResponse:
        if error.status_code != 404:
            return answer(error.status_code, public_words(error.detail, state.setup.folder), headers=error.headers)
        paths = [*app.openapi()["paths"], "/", "/docs", "/openapi.json"]
        return answer(404, f"there is nothing at {request.url.path}", sorted(paths))
