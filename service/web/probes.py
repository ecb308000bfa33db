"""What other machines ask: /healthz, /readyz and /metrics."""

from typing import Annotated

from fastapi import APIRouter, Header, Response

from service.web import metrics, models
from service.web.app_state import World, age_s
from service.web.health import is_alive, reasons_not_ready


def router(world: World) -> APIRouter:
    """The routes."""
    probes = APIRouter(tags=["probes"])
    registry = metrics.registry(world.snapshot, world.now_us)

    # These two answer from the event loop: they must not wait for a thread.
    @probes.get("/healthz", summary="Alive?", responses={503: {"model": models.Health}})
    async def healthz(response: Response) -> models.Health:
        """200 while the worker reports, 503 when it has not for ten seconds."""
        snapshot, now_us = world.snapshot(), world.now_us()
        alive = is_alive(snapshot, now_us)
        response.status_code = 200 if alive else 503
        return models.Health(alive=alive, snapshot_age_s=age_s(snapshot.taken_us, now_us))

    @probes.get("/readyz", summary="Monitoring?", responses={503: {"model": models.Readiness}})
    async def readyz(response: Response) -> models.Readiness:
        """200 while all buses are up and all axes get samples, else 503 with the reasons."""
        reasons = reasons_not_ready(world.snapshot(), world.now_us())
        response.status_code = 503 if reasons else 200
        return models.Readiness(ready=not reasons, reasons=reasons)

    @probes.get("/metrics", summary="Prometheus metrics", response_class=Response)
    def scrape(accept: Annotated[str, Header()] = "") -> Response:
        """Prometheus' text format, or OpenMetrics where that is asked for."""
        body, content_type = metrics.render(registry, accept)
        return Response(body, headers={"Content-Type": content_type})

    return probes
