"""The web application: REST, probes and metrics, pages."""

from collections.abc import Callable

from fastapi import FastAPI

from service.pipeline.snapshot import Snapshot
from service.store.journal import Journal
from service.web import api, errors, pages, probes
from service.web.app_state import VERSION, World
from service.web.times import now_us

DESCRIPTION = """\
Condition monitoring of robot axes: estimated physical parameters, their deviation from the commissioned
values, and alarms that name the parameter that has changed. Times are ISO 8601 in UTC; values are in SI units
on the motor side of the gear unless a description says otherwise; a number that is not finite is null."""


def create_app(
    snapshot: Callable[[], Snapshot], journal: Journal, now_us: Callable[[], int] = now_us
) -> FastAPI:
    """The application over the newest snapshot and the journal; ``now_us`` is the clock for ages."""
    world = World(snapshot, journal, now_us)
    # FastAPI's own documentation pages load their scripts from another host; pages.py has one that does not.
    app = FastAPI(title="axiswatch", version=VERSION, description=DESCRIPTION, docs_url=None, redoc_url=None)
    app.include_router(api.router(world))
    app.include_router(probes.router(world))
    app.include_router(pages.router())
    app.mount("/static", pages.files())
    app.add_middleware(pages.SafeHeaders)
    errors.add_handlers(app)
    return app
