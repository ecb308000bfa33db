"""REST under /api/v1/axes/{axis}/: taking an axis out of service for maintenance, and returning it to service."""

from fastapi import APIRouter
from pydantic import Field

from monitor_core.monitoring import AlarmEvent
from service.store.alarm_transitions import Note
from service.store.axis_services import ServiceEvent
from service.web import views
from service.web.access import Operator
from service.web.app_state import AppState
from service.web.models import AlarmNote, Body, OutOfService, TextOrNull, Time
from service.web.problem_details import described

_NOT_FOUND = described(404, "The axis does not exist")
_NO_STORE = described(503, "The journal cannot be read or written")
_CONFLICT = described(409, "The axis is already out of service, or already in service")


class AxisServiceStep(Body):
    """A removal of an axis from service by a person, or a return."""

    at: Time = Field(description="UTC")
    event: ServiceEvent
    who: str
    comment: TextOrNull
    work_order: TextOrNull


class AxisService(Body):
    """Whether the alarms of an axis are announced."""

    axis: str
    out_of_service: OutOfService | None = Field(description="null: it is in service")
    steps: list[AxisServiceStep] = Field(description="by persons, oldest first")


def router(state: AppState) -> APIRouter:
    """The routes."""
    api = APIRouter(prefix="/axes/{axis}", responses=_NOT_FOUND | _NO_STORE)

    @api.get("/service", summary="Service of an axis")
    def service(axis: str) -> AxisService:
        """Whether an axis is out of service, and who has taken it out of service or returned it."""
        configured = state.axis(axis).out_of_service
        steps = state.journal.services.steps(axis)
        removed = steps[-1].note if steps and steps[-1].event is AlarmEvent.REMOVE else None
        if removed is None and configured is not None and not configured.at_us:
            removed = configured
        shown = [views.body(AxisServiceStep, step.note, event=step.event) for step in steps]
        return AxisService(axis=axis, out_of_service=views.out_of_service(removed), steps=shown)

    def change(axis: str, event: ServiceEvent, body: AlarmNote, who: str) -> AxisService:
        known = state.axis(axis).id
        note = Note(state.now_us(), who, body.comment, body.work_order)
        state.journal.services.change(known, event, note)
        return service(known)

    @api.post("/out-of-service", summary="Take an axis out of service", responses=_CONFLICT)
    def remove(axis: str, body: AlarmNote, who: Operator) -> AxisService:
        """Its alarms are recorded, but not announced, until it is returned to service."""
        return change(axis, AlarmEvent.REMOVE, body, who)

    @api.post("/return-to-service", summary="Return an axis to service", responses=_CONFLICT)
    def give_back(axis: str, body: AlarmNote, who: Operator) -> AxisService:
        """Its alarms are announced again; those that are active are shown."""
        return change(axis, AlarmEvent.RETURN, body, who)

    return api
