"""Health for machines: /healthz (alive), /readyz (monitoring, else the reasons), /metrics."""

from collections.abc import Iterator
from typing import Annotated

from fastapi import APIRouter, Header, Response

from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.web import metrics, models
from service.web.app_state import AppState, age_s, sample_age_s

OLDEST_SNAPSHOT_S = 10.0
"""The worker publishes a snapshot about every second, with or without samples; an older one means that it hangs."""

OLDEST_SAMPLE_S = 5.0
OLDEST_SAMPLE_INTERVALS = 10
"""An axis whose last sample is older than both is not being monitored."""


def is_alive(snapshot: Snapshot, now_us: int) -> bool:
    """Whether the worker still publishes snapshots."""
    return age_s(snapshot.taken_us, now_us) <= OLDEST_SNAPSHOT_S


def reasons_not_ready(snapshot: Snapshot, now_us: int) -> list[str]:
    """Reasons why not every axis is monitored now; empty when all are."""
    return list(_reasons(snapshot, now_us))


def _reasons(snapshot: Snapshot, now_us: int) -> Iterator[str]:
    if not is_alive(snapshot, now_us):
        yield f"the worker has not reported for {age_s(snapshot.taken_us, now_us):.0f} s"
    yield from (f"bus {bus.name}: {bus.state}" for bus in snapshot.buses if not bus.up)
    for axis in snapshot.axes:
        reason = _silence(axis, now_us)
        if reason:
            yield reason


def _silence(axis: AxisSnapshot, now_us: int) -> str | None:
    age = sample_age_s(axis, now_us)
    if age is None:
        return f"{axis.id}: no sample yet"
    oldest_s = max(OLDEST_SAMPLE_S, OLDEST_SAMPLE_INTERVALS * axis.interval_s)
    return f"{axis.id}: no sample for {age:.0f} s" if age > oldest_s else None


def router(state: AppState) -> APIRouter:
    """The routes of /healthz, /readyz and /metrics."""
    probes = APIRouter(tags=["probes"])
    registry = metrics.registry(state.snapshot, state.now_us)

    # These two answer on the event loop: they must not wait for a thread.
    @probes.get("/healthz", summary="Alive?", responses={503: {"model": models.Health}})
    async def healthz(response: Response) -> models.Health:
        """200 while the worker reports, 503 when it has not reported for ten seconds."""
        snapshot, now_us = state.snapshot(), state.now_us()
        alive = is_alive(snapshot, now_us)
        response.status_code = 200 if alive else 503
        return models.Health(alive=alive, snapshot_age_s=age_s(snapshot.taken_us, now_us))

    @probes.get("/readyz", summary="Monitoring?", responses={503: {"model": models.Readiness}})
    async def readyz(response: Response) -> models.Readiness:
        """200 while all buses are up and all axes receive samples, else 503 with the reasons."""
        reasons = reasons_not_ready(state.snapshot(), state.now_us())
        response.status_code = 503 if reasons else 200
        return models.Readiness(ready=not reasons, reasons=reasons)

    @probes.get("/metrics", summary="Prometheus metrics", response_class=Response)
    def scrape(accept: Annotated[str, Header()] = "") -> Response:
        """The Prometheus text format, or OpenMetrics if the client accepts it."""
        body, content_type = metrics.render(registry, accept)
        return Response(body, headers={"Content-Type": content_type})

    return probes
