"""The web application: REST API, health and metrics, pages."""

from collections.abc import Callable

from fastapi import FastAPI

from service.pipeline.snapshot import Snapshot
from service.store.journal import Journal
from service.texts.timestamps import now_us
from service.web import api, error_responses, health, pages
from service.web.app_state import VERSION, AppState

DESCRIPTION = """\
Condition monitoring of robot axes: estimated physical parameters, their deviation from the commissioned
values, and alarms that name the parameter that has changed. Times are ISO 8601 in UTC; values are in SI units
on the motor side of the gear unless a description says otherwise; a number that is not finite is null."""


def create_app(
    snapshot: Callable[[], Snapshot], journal: Journal, now_us: Callable[[], int] = now_us
) -> FastAPI:
    """Build the application on the newest snapshot and the journal; ``now_us`` is the clock for ages."""
    state = AppState(snapshot, journal, now_us)
    # FastAPI's own documentation pages load scripts from another host; pages.py serves one that does not.
    app = FastAPI(title="axiswatch", version=VERSION, description=DESCRIPTION, docs_url=None, redoc_url=None)
    app.include_router(api.router(state))
    app.include_router(health.router(state))
    app.include_router(pages.router())
    app.mount("/static", pages.files())
    app.add_middleware(pages.SecurityHeaders)
    error_responses.add_handlers(app)
    return app
